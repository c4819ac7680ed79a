# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tools that draw over a view have in common: where they are open, and work in slices of some milliseconds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy

from ...blender.display import viewport
from ...metric.stepper import Stepper

SLICE = 0.03  # seconds of work of a tick


@dataclass
class Tool:
    """A tool that is open.

    Attributes:
        area: the pointer of the one it is in. scene: the name of the scene it was opened in.
        work: what is being made, or None. longest_step: seconds of it, so far.
    """

    area: int
    scene: str
    work: Stepper[None] | None = None
    longest_step: float = 0.0
    _handle: Any = None

    def open(self, draw: Callable[[], None]) -> None:
        """Has it drawn over views from now on."""
        if not bpy.app.background:
            self._handle = bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", "POST_PIXEL")

    def close(self, *timers: Callable[[], Any]) -> None:
        """Ends its work, its drawing and its timers."""
        self.stop()
        for timer in timers:
            if bpy.app.timers.is_registered(timer):
                bpy.app.timers.unregister(timer)
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
            self._handle = None
        viewport.redraw()

    def stop(self) -> None:
        """Ends its work."""
        if self.work is not None:
            self.work.cancel()
            self.work = None

    def is_here(self) -> bool:
        """Whether it belongs to the view and the scene that are being drawn."""
        area = bpy.context.area
        return area is not None and area.as_pointer() == self.area and bpy.context.scene.name == self.scene

    def work_on(self) -> float | None:
        """A slice of its work, as a timer; then Blender may draw and listen."""
        if self.work is None:
            return None
        began = last = time.perf_counter()
        more = True
        while more and last - began < SLICE:
            more = self.work.step()
            now = time.perf_counter()
            self.longest_step, last = max(self.longest_step, now - last), now
        if more:
            return 0.0
        self.work = None
        return None


def soon(timer: Callable[[], Any]) -> None:
    """Has a timer called outside of the drawing; there is none without a window."""
    if not bpy.app.background and not bpy.app.timers.is_registered(timer):
        bpy.app.timers.register(timer, first_interval=0)
