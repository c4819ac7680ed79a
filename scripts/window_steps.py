# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps in Blender's window, for scripts that run in it, with pictures after some of them.

What opens the window gives shot(name), which takes a picture, and done(), which closes it, in builtins.
"""

from __future__ import annotations

import builtins
import traceback
from collections.abc import Callable, Sequence

import bpy

DRAWN = 6  # seconds until a change is on the screen, drawn by software
DONE = 2  # and until the window has done what nobody takes a picture of


def view() -> tuple[bpy.types.Window, bpy.types.Area]:
    window = bpy.context.window_manager.windows[0]
    return window, next(area for area in window.screen.areas if area.type == "VIEW_3D")


def play(
    steps: Sequence[tuple[Callable[[], object], str]], measuring: Callable[[], bool], failed: Callable[[str], object]
) -> None:
    """Runs the steps one after the other once the window is there.

    Args:
        steps: what to do, and the name of the picture that is taken afterwards; "" takes none.
        measuring: whether a modal operator is at work, whose own timer drives it; steps wait for it.
        failed: is told the traceback of a step.
    """
    waiting = list(steps)

    def step() -> float | None:
        if measuring():
            return 0.5
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
        bpy.app.timers.register(lambda: picture(name), first_interval=DRAWN if name else DONE)
        return None

    def picture(name: str) -> None:
        if name:
            builtins.shot(name)
        bpy.app.timers.register(step, first_interval=0.1)

    bpy.app.timers.register(step, first_interval=3)
