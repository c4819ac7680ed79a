# SPDX-License-Identifier: GPL-3.0-or-later
"""Legends as the view draws them."""

from __future__ import annotations

from typing import Any

import bpy

from ...metric.evaluation import Result
from ...report.visual import layers


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
