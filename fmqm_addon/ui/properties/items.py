# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of what is compared: one object or collection each."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import (
    PointerProperty,
)

from ...blender.display.scene_objects import TAG
from ...blender.scene.members import is_measured


def is_asset(object_: bpy.types.Object) -> bool:
    """Whether an object can be measured: it may show a surface, or it stands for what hangs from it. Cheap."""
    return TAG not in object_ and (object_.type in {"EMPTY", "ARMATURE"} or is_measured(object_))  # nothing of ours


def can_be_picked(_: Any, object_: bpy.types.Object) -> bool:
    return is_asset(object_)


class FMQMItem(bpy.types.PropertyGroup):
    """One asset to compare: an object or a collection."""

    object: PointerProperty(
        name="Object",
        description="Mesh, curve, surface, text, metaball, empty or armature; what hangs from it counts with it",
        type=bpy.types.Object,
        poll=can_be_picked,
    )
    collection: PointerProperty(
        name="Collection", description="Collection whose objects count as one", type=bpy.types.Collection
    )


def kept(object_: bpy.types.Object | None) -> bpy.types.Object | None:
    """None for an object that was deleted: it stays in the file, in no scene, as long as a property points at it.

    Cheap: panels ask at each redraw.
    """
    if object_ is None or bpy.context.view_layer.objects.get(object_.name) == object_:
        return object_
    return object_ if object_.users_scene else None  # which goes through all objects


def item_target(item: FMQMItem) -> bpy.types.Object | bpy.types.Collection | None:
    """What an item stands for; None if that was deleted."""
    return kept(item.object) or item.collection


CLASSES = (FMQMItem,)
