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
from .polls import cannot_compare
from .view_tool import At, ViewTool

_STEPS = {"PAGE_UP": -1, "PAGE_DOWN": 1}


class FMQM_OT_loupe(ViewTool, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.loupe"
    bl_label = "Loupe"
    bl_description = (
        "Show Original, LOD and heat map side by side, enlarged: the chosen worst place, or the place under the mouse. "
        "Press again to close"
    )

    status = (
        "Move: Look under the Mouse    Click: Hold, Follow Again    Page Up, Page Down: Worst Places    "
        "Esc, Right Click: Finish"
    )
    why_not = staticmethod(cannot_compare)

    def begin(self, context: bpy.types.Context) -> bool:
        if loupe.shown is not None and loupe.shown.area == self._area.as_pointer():
            loupe.close()  # the one that is running sees it and ends
            return False
        put_away()
        self._shown = loupe.open_in(self._area, context.scene)
        return True

    def is_on(self, _: bpy.types.Context) -> bool:
        return loupe.shown is self._shown

    def act(
        self, context: bpy.types.Context, event: bpy.types.Event, region: bpy.types.Region, at: At, inside: bool
    ) -> bool:
        if not inside:
            return False
        if event.type == "MOUSEMOVE":
            self._move(context, region, at)
            return False
        if event.value != "PRESS":
            return False
        if event.type == "LEFTMOUSE":
            self._shown.follows = not self._shown.follows
            self._move(context, region, at)
            return True
        if event.type in _STEPS:
            try:
                worst.step_worst(context.scene, self._area, _STEPS[event.type])
            except FMQMError as reason:
                self.report({"WARNING"}, str(reason))
            return True
        return False

    def end(self, context: bpy.types.Context) -> None:
        if self.is_on(context):
            loupe.close()

    def _move(self, context: bpy.types.Context, region: bpy.types.Region, at: At) -> None:
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


CLASSES = (FMQM_OT_loupe,)
