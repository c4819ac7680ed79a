# SPDX-License-Identifier: GPL-3.0-or-later
"""The loupe: Original, LOD and heat map of one place, while the mouse moves or the worst places are stepped through."""

from __future__ import annotations

import bpy

from ...metric.errors import FMQMError
from .. import session
from ..properties.rows import active_row
from ..view import loupe, sight, worst
from ..view.result import why_not
from ..view.shown import put_away
from .pick import holds
from .polls import allowed, cannot_compare

_STATUS = (
    "Move: Look under the Mouse    Click: Hold, Follow Again    Page Up, Page Down: Worst Places    "
    "Esc, Right Click: Finish"
)
_STEPS = {"PAGE_UP": -1, "PAGE_DOWN": 1}


class FMQM_OT_loupe(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.loupe"
    bl_label = "Loupe"
    bl_description = (
        "Show Original, LOD and heat map side by side, enlarged: the chosen worst place, or the place under the mouse. "
        "Press again to close"
    )
    bl_options: set[str] = set()  # it changes nothing that could be undone

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, cannot_compare(context))

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        if loupe.shown is not None and loupe.shown.area == context.area.as_pointer():
            loupe.close()  # the one that is running sees it and ends
            return {"FINISHED"}
        put_away()
        self._area, self._shown = context.area, loupe.open_in(context.area, context.scene)
        context.workspace.status_text_set(_STATUS)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, "The loupe needs the mouse")
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        region = next((each for each in self._area.regions if each.type == "WINDOW"), None)
        if loupe.shown is not self._shown or region is None:
            return self._finish(context)
        inside = holds(self._area, region, event)
        if event.type == "ESC" or (event.type == "RIGHTMOUSE" and inside):
            return self._finish(context)
        at = (event.mouse_x - region.x, event.mouse_y - region.y)
        if event.type == "MOUSEMOVE" and inside:
            self._move(context, region, at)
        elif event.type == "LEFTMOUSE" and event.value == "PRESS" and inside:
            self._shown.follows = not self._shown.follows
            self._move(context, region, at)
            return {"RUNNING_MODAL"}
        elif event.type in _STEPS and event.value == "PRESS" and inside:
            try:
                worst.step_worst(context.scene, self._area, _STEPS[event.type])
            except FMQMError as reason:
                self.report({"WARNING"}, str(reason))
            return {"RUNNING_MODAL"}
        return {"PASS_THROUGH"}

    def _move(self, context: bpy.types.Context, region: bpy.types.Region, at: tuple[float, float]) -> None:
        """Looks at the place under the mouse, and goes out of its way."""
        shown, row = self._shown, active_row(context.scene)
        if loupe.covers(at):
            shown.below, shown.place = not shown.below, None
            self._area.tag_redraw()
        if not shown.follows or row is None or why_not(context.scene):
            return
        measured = session.get(row.uid)
        if measured is not None:
            view = self._area.spaces.active.region_3d
            loupe.aim(context.scene, sight.sight_under(row, measured, region, view, at, shown.side))

    def cancel(self, context: bpy.types.Context) -> None:
        self._finish(context)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        if loupe.shown is self._shown:
            loupe.close()
        context.workspace.status_text_set(None)
        return {"FINISHED"}


CLASSES = (FMQM_OT_loupe,)
