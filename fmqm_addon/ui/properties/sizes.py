# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine that screen sizes are for, and the screen."""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ...screen_size.engines import ENGINES, Screen

_ENGINE_ITEMS = [
    ("unity", "Unity", "LOD Group: screenRelativeTransitionHeight of each level"),
    ("unreal", "Unreal", "Screen Size of each level"),
    ("godot", "Godot", "visibility_range_begin and _end of each level, with margins"),
    ("threejs", "three.js", "LOD.addLevel: distance and hysteresis of each level"),
    ("gltf", "glTF", "MSFT_screencoverage of all levels"),
]
assert tuple(name for name, _, _ in _ENGINE_ITEMS) == ENGINES


class FMQMSizes(bpy.types.PropertyGroup):
    """How sizes on screen become the numbers of an engine."""

    engine: EnumProperty(name="Engine", description="Whose numbers are shown and copied", items=_ENGINE_ITEMS)
    transition: EnumProperty(
        name="Switch",
        description="How LODs replace each other",
        items=[
            ("strict", "Hard", "At once: smaller sizes, so that it is not seen"),
            ("fade", "Faded", "Dithered, which hides more: larger sizes"),
        ],
    )
    height: IntProperty(
        name="Height", description="Pixels that the screen is high", default=Screen.height, min=1, max=100_000
    )
    width: IntProperty(
        name="Width", description="Pixels that the screen is wide", default=Screen.width, min=1, max=100_000
    )
    fov: FloatProperty(
        name="Field of View", description="Vertical, in degrees", default=Screen.fov, min=1.0, max=179.0, precision=1
    )
    lod_bias: FloatProperty(
        name="LOD Bias", description="Of Unity's quality settings", default=Screen.lod_bias, min=0.001, max=100.0
    )
    height_ratio: BoolProperty(
        name="Ratios of Heights",
        description="Coverages as ratios of heights, as some loaders take them",
        default=Screen.height_ratio,
    )


CLASSES = (FMQMSizes,)
