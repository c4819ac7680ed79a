# SPDX-License-Identifier: GPL-3.0-or-later
"""What Decimate to Quality searches for, and how the last search went."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    FloatProperty,
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
    path: StringProperty(name="Path", description="Versions that were scored, one a line")
    path_of: StringProperty(name="Path Of", description="Object whose versions they are")
    found: IntProperty(name="Found", description="Line of the version that was chosen; -1: none", default=-1, min=-1)


CLASSES = (FMQMDecimate,)
