# SPDX-License-Identifier: GPL-3.0-or-later
"""Flip and wipe: the LOD where the Original stands, and back."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty

from ..view import flip, shown
from .pick import holds
from .polls import allowed, cannot_compare

_STATUS = "F: Original, LOD    Drag: Wipe    Esc, Right Click: Finish"


class FMQM_OT_flip(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.flip"
    bl_label = "Flip"
    bl_description = (
        "Show the LOD where the Original stands; press again for the Original, and so on. "
        "Both are drawn over the view, alone, in the colors that are measured; nothing of the file is touched"
    )
    bl_options: set[str] = set()  # it changes nothing that could be undone

    wipe: BoolProperty(
        name="Wipe", description="Show both, with a border between them that can be dragged", default=False
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, cannot_compare(context))

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        if flip.shown is not None and flip.shown.area == context.area.as_pointer():
            if self.wipe:
                flip.wipe_to(0.5 if flip.shown.wipe is None else None)
            else:
                flip.turn()
            return {"FINISHED"}  # the one that is running goes on
        shown.put_away()
        self._area, self._drags = context.area, False
        self._shown = flip.open_in(context.area, context.scene, 0.5 if self.wipe else None)
        context.workspace.status_text_set(_STATUS)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, "Flip needs a window")
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        region = next((each for each in self._area.regions if each.type == "WINDOW"), None)
        if flip.shown is not self._shown or region is None:
            return self._finish(context)
        inside = holds(self._area, region, event)
        if event.type == "ESC" or (event.type == "RIGHTMOUSE" and inside):
            return self._finish(context)
        share = min(max((event.mouse_x - region.x) / region.width, 0.0), 1.0)
        if event.type == "LEFTMOUSE" and event.value == "RELEASE" and self._drags:
            self._drags = False
        elif event.type == "LEFTMOUSE" and event.value == "PRESS" and inside:
            self._drags = True
            flip.wipe_to(share)
        elif event.type == "MOUSEMOVE" and self._drags:
            flip.wipe_to(share)
        elif event.type == "F" and event.value == "PRESS" and inside and not (event.ctrl or event.shift or event.alt):
            flip.turn()
        else:
            return {"PASS_THROUGH"}
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._finish(context)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        if flip.shown is self._shown:
            flip.close()
        context.workspace.status_text_set(None)
        return {"FINISHED"}


CLASSES = (FMQM_OT_flip,)
