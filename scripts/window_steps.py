# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in Blender's window, for scripts that run in it, with pictures after some of them.

What opens the window gives shot(name), which takes a picture, and done(), which closes it, in builtins.
"""

from __future__ import annotations

import builtins
import traceback
from collections.abc import Callable, Sequence

import bpy

DRAWN = 1  # seconds from the drawing of a view until it is on the screen


def view() -> tuple[bpy.types.Window, bpy.types.Area]:
    window = bpy.context.window_manager.windows[0]
    return window, next(area for area in window.screen.areas if area.type == "VIEW_3D")


def play(
    steps: Sequence[tuple[Callable[[], object], str]],
    measuring: Callable[[], bool],
    failed: Callable[[str], object],
    rest: float = DRAWN,
) -> None:
    """Runs the steps one after the other once the window is there.

    Args:
        steps: what to do, and the name of the picture that is taken afterwards; "" takes none.
        measuring: whether there is work with a timer of its own that drives it; steps and pictures wait for its end.
        failed: is told the traceback of a step.
        rest: seconds from when the view was drawn to the next step.
    """
    waiting = list(steps)
    drawn: list[bool] = []  # one for each time since the last step, or since the work that it began
    bpy.types.SpaceView3D.draw_handler_add(lambda: drawn.append(True), (), "WINDOW", "POST_PIXEL")

    def is_drawn() -> bool:
        """Whether the view is on the screen as it is now: it is when the next drawing has begun."""
        if measuring():
            drawn.clear()
        elif len(drawn) < 2:
            view()[1].tag_redraw()
        return len(drawn) >= 2

    def step() -> float | None:
        if not is_drawn():
            return 0.2
        if not waiting:
            builtins.done()
            return None
        act, name = waiting.pop(0)
        window, area = view()
        region = next(region for region in area.regions if region.type == "WINDOW")
        try:
            with bpy.context.temp_override(window=window, area=area, region=region):
                act()
        except Exception:
            failed(traceback.format_exc())
            builtins.done()
            return None
        drawn.clear()
        bpy.app.timers.register(lambda: picture(name), first_interval=0.1)
        return None

    def picture(name: str) -> float | None:
        if not is_drawn():
            return 0.2
        if name:
            bpy.app.timers.register(lambda: shoot(name), first_interval=rest)
        else:
            bpy.app.timers.register(step, first_interval=rest)
        return None

    def shoot(name: str) -> None:
        builtins.shot(name)
        bpy.app.timers.register(step, first_interval=0.1)

    bpy.app.timers.register(step, first_interval=3)
