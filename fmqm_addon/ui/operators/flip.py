# SPDX-License-Identifier: GPL-3.0-or-later
"""Flip and wipe: the LOD where the Original stands, and back."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty

from ..view import flip, shown
from .polls import cannot_compare
from .view_tool import At, ViewTool


class FMQM_OT_flip(ViewTool, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.flip"
    bl_label = "Flip"
    bl_description = (
        "Show the LOD where the Original stands; press again for the Original, and so on. "
        "Both are drawn over the view, alone, in the colors that are measured; nothing of the file is touched"
    )

    status = "F: Original, LOD    Drag: Wipe    Esc, Right Click: Finish"
    why_not = staticmethod(cannot_compare)

    wipe: BoolProperty(
        name="Wipe", description="Show both, with a border between them that can be dragged", default=False
    )

    def begin(self, context: bpy.types.Context) -> bool:
        if flip.shown is not None and flip.shown.area == self._area.as_pointer():
            if self.wipe:
                flip.wipe_to(0.5 if flip.shown.wipe is None else None)
            else:
                flip.turn()
            return False  # the one that is running goes on
        shown.put_away()
        self._drags = False
        self._shown = flip.open_in(self._area, context.scene, 0.5 if self.wipe else None)
        return True

    def is_on(self, _: bpy.types.Context) -> bool:
        return flip.shown is self._shown

    def act(self, _: bpy.types.Context, event: bpy.types.Event, region: bpy.types.Region, at: At, inside: bool) -> bool:
        share = min(max(at[0] / region.width, 0.0), 1.0)
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
            return False
        return True

    def end(self, context: bpy.types.Context) -> None:
        if self.is_on(context):
            flip.close()


CLASSES = (FMQM_OT_flip,)
