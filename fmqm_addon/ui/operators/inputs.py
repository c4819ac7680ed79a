# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons that choose what is compared with what."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import bpy

from ...blender.scene.lods import are_kin, find_lods
from ...blender.scene.members import lineage
from ..properties.items import FMQMItem, is_asset, item_target, kept
from ..properties.scene import FMQMScene
from .polls import allowed


def _selected_assets(context: bpy.types.Context) -> list[bpy.types.Object]:
    return sorted((o for o in context.selected_objects if is_asset(o)), key=lambda o: o.name_full)


def _apart_from(
    reference: bpy.types.Object | bpy.types.Collection | None, assets: Sequence[bpy.types.Object]
) -> list[bpy.types.Object]:
    """Those that are no part of the reference, which is no part of theirs, nor of each other: these are measured with
    what they hang from, and imports leave all of it selected."""
    chosen = set(assets)
    return [
        asset
        for asset in assets
        if asset != reference
        and not are_kin(asset, reference)
        and not any(above in chosen and are_kin(asset, above) for above in lineage(asset.parent))
    ]


def set_compared(fmqm: FMQMScene, assets: Sequence[bpy.types.Object | bpy.types.Collection]) -> None:
    fmqm.compared.clear()
    for asset in assets:
        _add_compared(fmqm, asset)
    fmqm.compared_index = 0


def _add_compared(fmqm: FMQMScene, asset: bpy.types.Object | bpy.types.Collection) -> None:
    item = fmqm.compared.add()
    item.name = asset.name
    if isinstance(asset, bpy.types.Collection):
        item.collection = asset
    else:
        item.object = asset


def set_reference(fmqm: FMQMScene, asset: bpy.types.Object | bpy.types.Collection) -> None:
    fmqm.bare_reference = False
    if isinstance(asset, bpy.types.Collection):
        fmqm.reference_kind, fmqm.reference_collection = "COLLECTION", asset
    else:
        fmqm.reference_kind, fmqm.reference = "OBJECT", asset


def reference_of(fmqm: FMQMScene) -> bpy.types.Object | bpy.types.Collection | None:
    """The asset that stands as the reference in the panel; None if that was deleted."""
    return kept(fmqm.reference) if fmqm.reference_kind == "OBJECT" else fmqm.reference_collection


def _chosen(fmqm: FMQMScene) -> FMQMItem | None:
    """Of the list of LODs."""
    return fmqm.compared[fmqm.compared_index] if 0 <= fmqm.compared_index < len(fmqm.compared) else None


class FMQM_OT_use_selection(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.use_selection"
    bl_label = "Use Selection"
    bl_description = "The active object becomes the original, the other selected objects its LODs"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        active, why = context.active_object, ""
        if active is None or not is_asset(active):
            why = "Make the original the active object: click it last"
        elif not any(o != active and is_asset(o) for o in context.selected_objects):
            why = "Select the objects to compare, and the original last"
        return allowed(cls, why)

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm, active = context.scene.fmqm, context.active_object
        compared = _apart_from(active, _selected_assets(context))
        if not compared:
            self.report(
                {"WARNING"},
                f"What is selected is measured with {active.name}, as one hangs from the other; select another asset",
            )
            return {"CANCELLED"}
        set_reference(fmqm, active)
        set_compared(fmqm, compared)
        return {"FINISHED"}


class FMQM_OT_find_lods(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.find_lods"
    bl_label = "Find LODs"
    bl_description = (
        "Find the levels of detail of the active object by names of objects, empties or collections (Rock_LOD0, "
        "LOD1_Rock, x00_Rock, Rock_L0, Rock_high), an FBX LOD group or its collection. The finest is the original"
    )
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        found = find_lods(context.scene, context.active_object)
        if found is None or len(found.levels) < 2:
            self.report(
                {"WARNING"},
                "No levels of detail found: make one of them active. Names such as Rock_LOD0 and Rock_LOD1 tell",
            )
            return {"CANCELLED"}
        fmqm = context.scene.fmqm
        set_reference(fmqm, found.levels[0])
        set_compared(fmqm, found.levels[1:])
        number = len(found.levels) - 1
        levels = "1 level" if number == 1 else f"{number} levels"
        self.report({"INFO"}, f"{found.levels[0].name} and {levels}, by {found.how}")
        return {"FINISHED"}


class FMQM_OT_own_modifiers(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.own_modifiers"
    bl_label = "Own Modifiers"
    bl_description = "Compare the active object as its modifiers make it with its mesh without them"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        active, why = context.active_object, ""
        if active is None or active.type != "MESH":
            why = "Make a mesh object active"
        elif not active.modifiers:
            why = f"{active.name} has no modifiers"
        return allowed(cls, why)

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm, active = context.scene.fmqm, context.active_object
        set_reference(fmqm, active)
        set_compared(fmqm, [active])
        fmqm.bare_reference = True
        return {"FINISHED"}


class FMQM_OT_add_selected(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.add_selected"
    bl_label = "Add Selected"
    bl_description = "Add the selected objects to the list, but for the original"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        there = any(is_asset(o) for o in context.selected_objects)
        return allowed(cls, "" if there else "Select objects with a surface, or an empty with such objects")

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        there = {item.object for item in fmqm.compared}
        for object_ in _apart_from(reference_of(fmqm), _selected_assets(context)):
            if object_ not in there and not any(are_kin(object_, other) for other in there):
                _add_compared(fmqm, object_)
        fmqm.compared_index = max(0, len(fmqm.compared) - 1)
        return {"FINISHED"}


class FMQM_OT_add_collection(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.add_collection"
    bl_label = "Add Active Collection"
    bl_description = "Add the active collection to the list; its objects count as one"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        chosen = context.collection not in (None, context.scene.collection)
        return allowed(cls, "" if chosen else "Choose a collection in the outliner")

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        if context.collection not in {item.collection for item in fmqm.compared}:
            _add_compared(fmqm, context.collection)
        fmqm.compared_index = len(fmqm.compared) - 1
        return {"FINISHED"}


class FMQM_OT_remove_compared(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.remove_compared"
    bl_label = "Remove"
    bl_description = "Remove the chosen object from the list; the object itself stays"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, "" if _chosen(context.scene.fmqm) else "Choose an LOD in the list")

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        fmqm.compared.remove(fmqm.compared_index)
        fmqm.compared_index = max(0, min(fmqm.compared_index, len(fmqm.compared) - 1))
        return {"FINISHED"}


class FMQM_OT_swap(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.swap"
    bl_label = "Swap with Original"
    bl_description = "The chosen LOD becomes the original, and the original an LOD in its place"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        fmqm, why = context.scene.fmqm, ""
        chosen = _chosen(fmqm)
        if fmqm.bare_reference:
            why = "The original is the same object without its modifiers"
        elif reference_of(fmqm) is None or chosen is None or item_target(chosen) is None:
            why = "Choose an original and an LOD"
        return allowed(cls, why)

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        index = fmqm.compared_index
        chosen, original = item_target(fmqm.compared[index]), reference_of(fmqm)
        if chosen is None or original is None:
            return {"CANCELLED"}
        fmqm.compared.remove(index)
        set_reference(fmqm, chosen)
        _add_compared(fmqm, original)
        fmqm.compared.move(len(fmqm.compared) - 1, index)
        return {"FINISHED"}


class FMQM_OT_clear_compared(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.clear_compared"
    bl_label = "Clear List"
    bl_description = "Empty the list; the objects themselves stay"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, "" if context.scene.fmqm.compared else "The list is empty")

    def execute(self, context: bpy.types.Context) -> set[str]:
        set_compared(context.scene.fmqm, [])
        return {"FINISHED"}


CLASSES = (
    FMQM_OT_use_selection,
    FMQM_OT_find_lods,
    FMQM_OT_own_modifiers,
    FMQM_OT_add_selected,
    FMQM_OT_add_collection,
    FMQM_OT_remove_compared,
    FMQM_OT_swap,
    FMQM_OT_clear_compared,
)
