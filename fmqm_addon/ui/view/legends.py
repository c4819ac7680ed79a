# SPDX-License-Identifier: GPL-3.0-or-later
"""Legends as the view draws them."""

from __future__ import annotations

from typing import Any

import bpy

from ...metric.evaluation import Result
from ...report.visual import layers

LOW, HIGH, BELOW = "low", "high", "below"  # what can be dragged: the ends, and the score below which patches are shown
_LEAST = 0.001  # between the ends


def moved(end: str, before: tuple[float, float, float], share: float) -> tuple[float, float, float]:
    """The ends and the threshold after one of them has been dragged.

    Args:
        before: low, high and below when the drag began. share: how far, upwards, in heights of the bar at that time.
    """
    low, high, below = before
    step = share * (high - low)
    if end == LOW:
        low = max(0.0, min(low + step, high - _LEAST))
    elif end == HIGH:
        high = min(1.0, max(high + step, low + _LEAST))
    else:
        below = min(1.0, max(0.0, below + step))
    return low, high, below


def legend_of(
    scene: bpy.types.Scene, layer: str, ends: tuple[float, float], result: Result, name: str
) -> dict[str, Any]:
    """The legend of a layer between two ends, as report.visual.layers.Legend.as_dict has it."""
    return layers.legend(layer, ends, name, result, lambda length: length_text(scene, length)).as_dict()


def length_text(scene: bpy.types.Scene, length: float) -> str:
    """A length in scene units as the scene's unit settings want it."""
    units = scene.unit_settings
    if units.system == "NONE":
        return f"{length:.3g}"
    text: str = bpy.utils.units.to_string(
        units.system, "LENGTH", length * units.scale_length, precision=3, split_unit=False
    )
    return text
