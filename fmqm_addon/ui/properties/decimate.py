# SPDX-License-Identifier: GPL-3.0-or-later
"""What Decimate to Quality and LOD Chain search for, and how the last search went."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from ...comparison.decimation import LEAST_TRIANGLES


class FMQMDecimate(bpy.types.PropertyGroup):
    """What is searched for, and how the last search went."""

    target: FloatProperty(
        name="Target",
        description="The copy scores at least this much against the original, by the results' judge",
        default=0.9,
        min=0.01,
        max=1.0,
        precision=2,
        step=1,
    )
    limited: BoolProperty(
        name="Limit Triangles", description="Never more triangles than this, even if the target is missed then"
    )
    max_triangles: IntProperty(
        name="Max Triangles", description="The most triangles of the copy", default=10_000, min=LEAST_TRIANGLES
    )
    textures: BoolProperty(
        name="Smaller Textures",
        description="Then halve the color images of the copy, on materials of its own, as long as the target below is "
        "kept. Normals and other data keep their size",
    )
    texture_target: FloatProperty(
        name="Texture Target",
        description="The copy with smaller textures still scores at least this much",
        default=0.85,
        min=0.01,
        max=1.0,
        precision=2,
        step=1,
    )
    path: StringProperty(name="Path", description="Versions that were scored, one a line")
    path_of: StringProperty(name="Path Of", description="Object whose versions they are")
    found: IntProperty(name="Found", description="Line of the version that was chosen; -1: none", default=-1, min=-1)


MOST_LEVELS = 8


class FMQMChain(bpy.types.PropertyGroup):
    """The LODs that are made of an object."""

    levels: IntProperty(name="Levels", description="How many LODs are made", default=4, min=1, max=MOST_LEVELS)
    qualities: FloatVectorProperty(
        name="Qualities",
        description="What each LOD scores at least against the original, by the results' judge",
        size=MOST_LEVELS,
        default=(0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3),
        min=0.01,
        max=1.0,
        precision=2,
        step=1,
    )
    name_original: BoolProperty(
        name="Rename Original to LOD0", description="The original's name gets the ending _LOD0, where it has it not"
    )


CLASSES = (FMQMDecimate, FMQMChain)
