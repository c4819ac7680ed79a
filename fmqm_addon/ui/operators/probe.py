# SPDX-License-Identifier: GPL-3.0-or-later
"""The probe: values under the mouse."""

from __future__ import annotations

import bpy

from ..view import heat, overlay, probe
from ..view.result import look_of
from .view_tool import At, ViewTool


class FMQM_OT_probe(ViewTool, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.probe"
    bl_label = "Probe"
    bl_description = "Show the score and the features of the place under the mouse"

    status = "Move: Values under the Mouse    Esc, Right Click: Finish"

    def begin(self, context: bpy.types.Context) -> bool:
        if look_of(context.scene).show == heat.OFF:
            look_of(context.scene).show = heat.SURFACE
        return True

    def is_on(self, context: bpy.types.Context) -> bool:
        return heat.shown_in(context.scene) is not None

    def act(
        self, context: bpy.types.Context, event: bpy.types.Event, region: bpy.types.Region, at: At, inside: bool
    ) -> bool:
        if event.type == "MOUSEMOVE":
            view = self._area.spaces.active.region_3d
            found = probe.probe(context.scene, region, view, at) if inside else None
            lines = () if found is None else tuple(probe.lines_of(context.scene, found))
            overlay.hint = overlay.Hint(self._area.as_pointer(), at, lines) if lines else None
            self._area.tag_redraw()
        return False

    def end(self, _: bpy.types.Context) -> None:
        overlay.hint = None
        self._area.tag_redraw()


CLASSES = (FMQM_OT_probe,)
