# SPDX-License-Identifier: GPL-3.0-or-later
"""Small squares in the colors of scores, as icons."""

from __future__ import annotations

from typing import Any

import bpy
import bpy.utils.previews
import numpy as np

from ...report.visual.colormap import score_colors

_STEPS, _SIDE = 20, 32
_LOWEST = 0.5  # the score of the hottest square: features hardly ever fall below it
_icons: Any = None


def swatch(score: float) -> int:
    """The number of the icon for a score; 0, which is no icon, where there is no window."""
    if _icons is None:
        return 0
    step = round(min(max((score - _LOWEST) / (1 - _LOWEST), 0.0), 1.0) * _STEPS)
    return int(_icons[str(step)].icon_id)


def register() -> None:
    global _icons
    if bpy.app.background:
        return
    _icons = bpy.utils.previews.new()
    for step, color in enumerate(score_colors(np.linspace(0, 1, _STEPS + 1))):
        pixels = np.ones((_SIDE, _SIDE, 4), np.float32)
        pixels[:, :, :3] = color
        icon = _icons.new(str(step))
        icon.icon_size = (_SIDE, _SIDE)
        icon.icon_pixels_float = pixels.ravel().tolist()


def unregister() -> None:
    global _icons
    if _icons is not None:
        bpy.utils.previews.remove(_icons)
        _icons = None
