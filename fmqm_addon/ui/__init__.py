# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar: properties, operators, panels. Thin; what they do is in metric, blender and report."""

from __future__ import annotations

import bpy

from . import stale
from .operators import decimate, inputs, results
from .operators import measure as measuring
from .operators import view as look
from .panels import results as panels
from .properties import scene
from .properties import settings as properties

_look_groups = tuple(cls for cls in look.CLASSES if issubclass(cls, bpy.types.PropertyGroup))
_look_rest = tuple(cls for cls in look.CLASSES if cls not in _look_groups)

# Groups before the scene's group that holds them, panels before their sub-panels.
CLASSES: tuple[type, ...] = (
    *properties.CLASSES,
    *_look_groups,
    decimate.FMQMDecimate,
    *scene.CLASSES,
    *inputs.CLASSES,
    *measuring.CLASSES,
    *results.CLASSES,
    *panels.CLASSES,
    *_look_rest,
    *decimate.CLASSES,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    scene.register()
    measuring.register()
    stale.register()
    look.register()


def unregister() -> None:
    """The exact mirror of register."""
    look.unregister()
    stale.unregister()
    measuring.unregister()
    scene.unregister()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
