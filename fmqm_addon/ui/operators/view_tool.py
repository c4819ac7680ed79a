# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tools of the mouse in a 3D view share: beginning, going on, ending."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .polls import allowed, no_viewport

At = tuple[float, float]


class ViewTool:
    """A part of operators that go on in one view until Esc, a right click there, or the end of what they show.

    Attributes:
        bl_label: their name. status: what the status bar says meanwhile. why_not: why they cannot begin; "": they can.
    """

    bl_label: str
    bl_options: set[str] = set()  # nothing changes that could be undone
    status = ""
    why_not = staticmethod(no_viewport)
    report: Callable[[set[str], str], None]  # the operator's

    def begin(self, context: bpy.types.Context) -> bool:
        """Shows what there is to show; False: nothing is to go on."""
        raise NotImplementedError

    def is_on(self, context: bpy.types.Context) -> bool:
        """Whether what it shows is there still."""
        raise NotImplementedError

    def act(
        self, context: bpy.types.Context, event: bpy.types.Event, region: bpy.types.Region, at: At, inside: bool
    ) -> bool:
        """Does what an event asks for; whether nobody else shall get it.

        Args:
            at: the mouse, in pixels of the view's main region. inside: it is there and not over the sidebar.
        """
        raise NotImplementedError

    def end(self, context: bpy.types.Context) -> None:
        """Takes away what it shows."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, cls.why_not(context))

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        self._area = context.area
        if not self.begin(context):
            return {"FINISHED"}
        context.workspace.status_text_set(self.status)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, _: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, f"{self.bl_label} needs the mouse")
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        region = next((each for each in self._area.regions if each.type == "WINDOW"), None)
        if region is None or not self.is_on(context):
            return self._finish(context)
        inside = _holds(self._area, region, event)
        if event.type == "ESC" or (event.type == "RIGHTMOUSE" and inside):
            return self._finish(context)
        at = (event.mouse_x - region.x, event.mouse_y - region.y)
        return {"RUNNING_MODAL"} if self.act(context, event, region, at, inside) else {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._finish(context)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        self.end(context)
        context.workspace.status_text_set(None)
        return {"FINISHED"}


def _holds(area: bpy.types.Area, window: bpy.types.Region, event: bpy.types.Event) -> bool:
    """Whether the mouse is in the view and not over a toolbar or the sidebar."""

    def within(region: bpy.types.Region) -> bool:
        return (
            region.x <= event.mouse_x < region.x + region.width and region.y <= event.mouse_y < region.y + region.height
        )

    others = (region for region in area.regions if region != window and region.width > 1 and region.height > 1)
    return within(window) and not any(within(region) for region in others)
