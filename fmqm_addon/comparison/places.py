# SPDX-License-Identifier: GPL-3.0-or-later
"""Where something lies, in words."""

from __future__ import annotations

from ..metric.geometry import Floats

_AXES = (("left", "right"), ("front", "back"), ("lower", "upper"))  # x, y, z; Blender's front view looks along y
_ORDER = (2, 0, 1)  # "upper left front"
_ALONE = {"left": "left side", "right": "right side", "lower": "bottom", "upper": "top"}


def place_name(position: Floats, low: Floats, high: Floats) -> str:
    """A position in a box by thirds, such as "upper left front"; "middle" in the middle of all."""
    words = []
    for axis in _ORDER:
        size = high[axis] - low[axis]
        share = (position[axis] - low[axis]) / size if size > 0 else 0.5
        if not 1 / 3 <= share <= 2 / 3:
            words.append(_AXES[axis][int(share > 0.5)])
    if len(words) == 1:
        return _ALONE.get(words[0], words[0])
    return " ".join(words) or "middle"
