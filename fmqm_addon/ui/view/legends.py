# SPDX-License-Identifier: GPL-3.0-or-later
"""Legends, stored on the objects that they explain."""

from __future__ import annotations

import json
from dataclasses import replace

import bpy

from ...metric.evaluation import Result
from ...report.visual import layers
from . import overlay


def explain(
    scene: bpy.types.Scene,
    object_: bpy.types.Object,
    layer: str,
    ends: tuple[float, float],
    result: Result,
    name: str,
    note: str = "",
) -> None:
    """Stores the legend on the object, where drawing, saving and undo find it."""
    legend = layers.legend(layer, ends, name, result, lambda length: length_text(scene, length))
    object_[overlay.LEGEND] = json.dumps(replace(legend, note=note or legend.note).as_dict())


def length_text(scene: bpy.types.Scene, length: float) -> str:
    """A length in scene units as the scene's unit settings want it."""
    units = scene.unit_settings
    if units.system == "NONE":
        return f"{length:.3g}"
    text: str = bpy.utils.units.to_string(
        units.system, "LENGTH", length * units.scale_length, precision=3, split_unit=False
    )
    return text
