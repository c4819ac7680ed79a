# SPDX-License-Identifier: GPL-3.0-or-later
"""The probe: values under the mouse."""

from __future__ import annotations

import bpy

from ..view import heat, overlay, probe
from ..view.result import look_of
from .pick import holds
from .polls import allowed, no_viewport

_STATUS = "Move: Values under the Mouse    Esc, Right Click: Finish"


class FMQM_OT_probe(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.probe"
    bl_label = "Probe"
    bl_description = "Show the score and the features of the place under the mouse"
    bl_options: set[str] = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, no_viewport(context))

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        self._area = context.area
        if look_of(context.scene).show == heat.OFF:
            look_of(context.scene).show = heat.SURFACE
        context.workspace.status_text_set(_STATUS)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, "The probe needs the mouse")
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in {"ESC", "RIGHTMOUSE", "RET"} or heat.shown_in(context.scene) is None:
            return self._finish(context)
        region = next((r for r in self._area.regions if r.type == "WINDOW"), None)
        if region is None:
            return self._finish(context)
        at = (event.mouse_x - region.x, event.mouse_y - region.y)
        if event.type != "MOUSEMOVE":
            return {"PASS_THROUGH"}
        overlay.hint = None
        if holds(self._area, region, event):
            found = probe.probe(context.scene, region, self._area.spaces.active.region_3d, at)
            lines = () if found is None else tuple(probe.lines_of(context.scene, found))
            overlay.hint = overlay.Hint(self._area.as_pointer(), at, lines) if lines else None
        self._area.tag_redraw()
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._finish(context)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        overlay.hint = None
        context.workspace.status_text_set(None)
        self._area.tag_redraw()
        return {"FINISHED"}


CLASSES = (FMQM_OT_probe,)
