# SPDX-License-Identifier: GPL-3.0-or-later
"""Picking a sample in the 3D view, by the mouse."""

from __future__ import annotations

import bpy

from ..view import heat, units
from ..view.result import look_of
from .polls import no_samples
from .view_tool import At, ViewTool

_REACH = 14  # pixels around the mouse in which a sample is picked


class FMQM_OT_unit_pick(ViewTool, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.unit_pick"
    bl_label = "Pick Sample"
    bl_description = "Click on points in the view to see the normal and the tangent unit of the sample there"

    status = "Click: Choose Sample    Esc, Right Click: Finish"

    def begin(self, context: bpy.types.Context) -> bool:
        look_of(context.scene).show = heat.POINTS
        context.window.cursor_modal_set("CROSSHAIR")
        return True

    def is_on(self, context: bpy.types.Context) -> bool:
        return not no_samples(context)  # the row may have been cleared meanwhile

    def act(
        self, context: bpy.types.Context, event: bpy.types.Event, region: bpy.types.Region, at: At, inside: bool
    ) -> bool:
        if event.type != "LEFTMOUSE" or event.value != "PRESS" or not inside:
            return False
        reach = _REACH * context.preferences.system.ui_scale
        sample = units.nearest_sample(context.scene, region, self._area.spaces.active.region_3d, at, reach)
        if sample is not None:
            units.show_unit(context.scene, sample)
        return True

    def end(self, context: bpy.types.Context) -> None:
        context.window.cursor_modal_restore()


CLASSES = (FMQM_OT_unit_pick,)
