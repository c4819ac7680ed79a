# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar: properties, operators, panels. Thin; what they do is in metric, blender and report."""

from __future__ import annotations

import bpy

from . import gizmos, keys, live, operators, panels, preferences, properties, stale
from .operators import measure
from .panels import swatches
from .properties import scene
from .view import live_corner, updates

CLASSES: tuple[type, ...] = (
    *preferences.CLASSES,
    *properties.CLASSES,
    *operators.CLASSES,
    *panels.CLASSES,
    *gizmos.CLASSES,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    scene.register()
    measure.register()
    swatches.register()
    stale.register()
    updates.register()
    live_corner.register()
    keys.register()


def unregister() -> None:
    """The exact mirror of register."""
    keys.unregister()
    live_corner.unregister()
    live.turn_off()
    updates.unregister()
    stale.unregister()
    swatches.unregister()
    measure.unregister()
    scene.unregister()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
