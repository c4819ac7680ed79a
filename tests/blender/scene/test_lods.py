# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding levels of detail by name, LOD group and collection."""

from __future__ import annotations

import bpy
import pytest

from fmqm_addon.blender.scene.lod_names import lod_of_name
from fmqm_addon.blender.scene.lods import find_lods
from tests.blender import scenes


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Rock_LOD0", ("rock", 0)),
        ("rock_lod1", ("rock", 1)),
        ("LOD1_Rock", ("rock", 1)),
        ("Rock.LOD1", ("rock", 1)),
        ("Rock LOD 2", ("rock", 2)),
        ("Rock-lod_12", ("rock", 12)),
        ("RockLOD3", ("rock", 3)),
        ("Rock_LOD1_mesh", ("rock_mesh", 1)),
        ("Rock_LOD1.001", ("rock", 1)),
        ("LOD0", ("", 0)),
        ("Big Rock_LOD0", ("big rock", 0)),
        ("Rock", None),
        ("Explod1", None),
        ("Melody_3", None),
        ("Rock_LOD", None),
        ("Rock_LOD123", None),
    ],
)
def test_names(name: str, expected: tuple[str, int] | None) -> None:
    found = lod_of_name(name)
    assert (found and found[:2]) == expected


def levels(active: bpy.types.Object | None = None) -> list[str] | None:
    found = find_lods(bpy.context.scene, active)
    return None if found is None else [level.name for level in found.levels]


def empty(name: str) -> bpy.types.Object:
    made = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(made)
    return made


def collection(name: str) -> bpy.types.Collection:
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    return made


def test_the_only_group_in_order_of_levels() -> None:
    for name in ("Rock_LOD2", "Rock_LOD0", "Rock_LOD10", "Rock_LOD1", "Ground"):
        scenes.cube(name)
    wanted = ["Rock_LOD0", "Rock_LOD1", "Rock_LOD2", "Rock_LOD10"]
    assert levels() == wanted
    assert levels(bpy.data.objects["Ground"]) == wanted


def test_the_active_objects_group() -> None:
    for name in ("Rock_LOD0", "Rock_LOD1", "Tree_LOD0", "Tree_LOD1"):
        scenes.cube(name)
    assert levels(bpy.data.objects["Tree_LOD1"]) == ["Tree_LOD0", "Tree_LOD1"]
    assert levels() is None  # which of the two?


def test_an_original_without_a_level() -> None:
    for name in ("Rock", "Rock_LOD1", "Rock_LOD2"):
        scenes.cube(name)
    assert levels(bpy.data.objects["Rock"]) == ["Rock", "Rock_LOD1", "Rock_LOD2"]


def test_copies_and_single_levels_are_no_group() -> None:
    for name in ("Rock_LOD1", "Rock_LOD1.001", "Tree_LOD0"):
        scenes.cube(name)
    assert levels() is None


def test_empties_that_name_levels_stand_for_their_parts() -> None:
    for level in range(2):
        parent = empty(f"House_LOD{level}")
        for part in ("Door", "Roof"):
            scenes.cube(f"{part}_LOD{level}").parent = parent
    assert levels(bpy.data.objects["Door_LOD1"]) == ["House_LOD0", "House_LOD1"]


def test_an_fbx_lod_group() -> None:
    group = empty("Statue")
    group["fbx_type"] = "LodGroup"
    for name in ("Statue_a", "Statue_b"):
        scenes.cube(name).parent = group
    assert levels(bpy.data.objects["Statue_b"]) == ["Statue_a", "Statue_b"]
    assert levels() == ["Statue_a", "Statue_b"]


def test_collections_that_name_levels() -> None:
    for level in range(3):
        scenes.cube(f"Body{level}", collection=collection(f"Car_LOD{level}"))
    found = find_lods(bpy.context.scene, bpy.data.objects["Body1"])
    assert found is not None and found.how == "collections"
    assert levels(bpy.data.objects["Body1"]) == ["Car_LOD0", "Car_LOD1", "Car_LOD2"]


def test_members_of_a_collection_the_most_faces_first() -> None:
    group = collection("Vase")
    scenes.square("Low", collection=group)
    scenes.cube("High", collection=group)
    assert levels(bpy.data.objects["Low"]) == ["High", "Low"]


def test_nothing() -> None:
    assert levels() is None
    assert levels(scenes.cube()) is None
