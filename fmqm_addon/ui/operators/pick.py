# SPDX-License-Identifier: GPL-3.0-or-later
"""Picking a sample in the 3D view, by the mouse."""

from __future__ import annotations

import bpy

from ...metric.errors import FMQMError
from ..view import heat, units
from ..view.result import look_of
from .polls import allowed, no_viewport

_REACH = 14  # pixels around the mouse in which a sample is picked
_STATUS = "Click: Choose Sample    Esc, Right Click: Finish"


class FMQM_OT_unit_pick(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.unit_pick"
    bl_label = "Pick Sample"
    bl_description = "Click on points in the view to see the normal and the tangent unit of the sample there"
    bl_options: set[str] = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, no_viewport(context))

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        self._area = context.area
        look_of(context.scene).show = heat.POINTS
        context.window.cursor_modal_set("CROSSHAIR")
        context.workspace.status_text_set(_STATUS)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, "Picking needs the mouse; use Next Sample")
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in {"ESC", "RIGHTMOUSE", "RET"}:
            return self._finish(context)
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}
        region = next((r for r in self._area.regions if r.type == "WINDOW"), None)
        if region is None or not holds(self._area, region, event):
            return {"PASS_THROUGH"}  # buttons go on working
        at = (event.mouse_x - region.x, event.mouse_y - region.y)
        reach = _REACH * context.preferences.system.ui_scale
        try:
            view = self._area.spaces.active.region_3d
            sample = units.nearest_sample(context.scene, region, view, at, reach)
            if sample is not None:
                units.show_unit(context.scene, sample)
        except FMQMError as reason:  # the row was cleared meanwhile
            self.report({"WARNING"}, str(reason))
            return self._finish(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._finish(context)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        return {"FINISHED"}


def holds(area: bpy.types.Area, window: bpy.types.Region, event: bpy.types.Event) -> bool:
    """Whether the mouse is in the view and not over a toolbar or the sidebar."""

    def within(region: bpy.types.Region) -> bool:
        return (
            region.x <= event.mouse_x < region.x + region.width and region.y <= event.mouse_y < region.y + region.height
        )

    others = (region for region in area.regions if region != window and region.width > 1 and region.height > 1)
    return within(window) and not any(within(region) for region in others)


CLASSES = (FMQM_OT_unit_pick,)
