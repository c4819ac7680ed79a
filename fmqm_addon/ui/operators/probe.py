# SPDX-License-Identifier: GPL-3.0-or-later
"""The probe: values under the mouse, and the ends of the legend, which can be dragged meanwhile."""

from __future__ import annotations

import bpy

from ..view import heat, overlay, probe
from ..view.result import look_of
from .pick import holds
from .polls import allowed, no_viewport

_STATUS = "Move: Values under the Mouse    Drag an End of the Legend: Range    Esc, Right Click: Finish"
_REACH = 12  # pixels around an end of the legend's bar in which it is taken
_LEAST = 0.001  # between the ends


class FMQM_OT_probe(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.probe"
    bl_label = "Probe"
    bl_description = "Show the score and the features of the place under the mouse; drag the ends of the legend"
    bl_options: set[str] = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, no_viewport(context))

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        self._area, self._end = context.area, ""
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
        if event.type == "LEFTMOUSE":
            self._end = self._end_at(context, at) if event.value == "PRESS" else ""
            return {"RUNNING_MODAL"} if self._end else {"PASS_THROUGH"}
        if event.type != "MOUSEMOVE":
            return {"PASS_THROUGH"}
        if self._end:
            self._drag(context, at)
            return {"RUNNING_MODAL"}
        overlay.hint = None
        if holds(self._area, region, event):
            found = probe.probe(context.scene, region, self._area.spaces.active.region_3d, at)
            lines = () if found is None else tuple(probe.lines_of(context.scene, found))
            overlay.hint = overlay.Hint(self._area.as_pointer(), at, lines) if lines else None
        self._area.tag_redraw()
        return {"PASS_THROUGH"}

    def _end_at(self, context: bpy.types.Context, at: tuple[float, float]) -> str:
        """Which end of the legend's bar lies at a place: "low", "high" or ""."""
        bar = overlay.bars.get(self._area.as_pointer())
        shown = heat.shown_in(context.scene)
        if bar is None or shown is None or shown.values is None:
            return ""
        x, y, width, height = bar
        reach = _REACH * context.preferences.system.ui_scale
        if not x - reach <= at[0] <= x + width + 3 * reach:
            return ""
        return "low" if abs(at[1] - y) < reach else "high" if abs(at[1] - y - height) < reach else ""

    def _drag(self, context: bpy.types.Context, at: tuple[float, float]) -> None:
        shown, look = heat.shown_in(context.scene), look_of(context.scene)
        bar = overlay.bars.get(self._area.as_pointer())
        if shown is None or bar is None:
            return
        _, y, _, height = bar
        place = (at[1] - y) / height
        low, high = shown.ends
        value = min(max(low + place * (high - low), 0.0), 1.0)
        if self._end == "low":
            low = min(value, high - _LEAST)
        else:
            high = max(value, low + _LEAST)
        look.low, look.high = low, high
        if look.range != "CUSTOM":
            look.range = "CUSTOM"

    def cancel(self, context: bpy.types.Context) -> None:
        self._finish(context)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        overlay.hint = None
        context.workspace.status_text_set(None)
        self._area.tag_redraw()
        return {"FINISHED"}


CLASSES = (FMQM_OT_probe,)
