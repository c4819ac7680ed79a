# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parts of an asset are measured: families, levels of detail, collision hulls and patterns."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from fmqm_addon.blender.files.load import chains_of_file, load_asset
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.fingerprint import fingerprint
from fmqm_addon.blender.scene.lod_names import is_collider, lod_of_name
from fmqm_addon.blender.scene.lods import are_kin, find_lods
from fmqm_addon.blender.scene.measure import measuring
from fmqm_addon.blender.scene.parts import parts_of
from fmqm_addon.blender.scene.target import take, target_of
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.errors import FileError, MeshError
from fmqm_addon.metric.settings import Settings
from tests.blender import scenes

ALL = Reading()
FEW = PairOptions(settings=Settings(samples=600, patches=10))


def empty(name: str, parent: bpy.types.Object | None = None) -> bpy.types.Object:
    made = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(made)
    made.parent = parent
    return made


def collection(name: str) -> bpy.types.Collection:
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    return made


def part(
    name: str, parent: bpy.types.Object | None = None, x: float = 0.0, within: bpy.types.Collection | None = None
) -> bpy.types.Object:
    made = scenes.cube(name, collection=within)
    made.parent = parent
    made.location.x = x
    return made


def measured(block: bpy.types.Object | bpy.types.Collection | None = None, reading: Reading = ALL) -> list[str]:
    return [each.name for each in parts_of(block, reading).objects]


@pytest.mark.parametrize(
    "names",
    [
        ("Rock_LOD0", "Rock_LOD1"),
        ("Rock_LOD_0", "Rock_LOD_1"),
        ("LOD0_Rock", "LOD1_Rock"),
        ("x00_Rock", "x01_Rock"),
        ("Rock_L0", "Rock_L1"),
        ("Rock_high", "Rock_low"),
        ("rock_HighPoly", "rock_LowPoly"),
        ("Rock", "Rock_LOD1"),
    ],
)
def test_the_finest_level_is_measured_and_the_others_are_named(names: tuple[str, str]) -> None:
    for name in (*names, "Ground"):
        part(name)
    assert measured() == sorted(["Ground", names[0]])
    (note,) = parts_of(None, ALL).notes
    assert names[0] in note and names[1] in note
    assert find_lods(bpy.context.scene, bpy.data.objects[names[1]]).levels[0].name == names[0]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("names", "apart"),
    [
        (("table_low", "chair_high"), 0.0),
        (("Rock_LOD1", "Tree_LOD0"), 0.0),
        (("Rock_LOD1", "Rock_LOD1.001"), 0.0),
        (("rock_low", "rock_high"), 9.0),  # two rocks
        (("Arm_L0", "Arm_L1"), 9.0),
    ],
)
def test_what_is_no_chain_is_measured_whole(names: tuple[str, str], apart: float) -> None:
    for index, name in enumerate(names):
        part(name, x=apart * index)
    assert measured() == sorted(names) and not parts_of(None, ALL).notes


def test_levels_side_by_side_are_levels_by_their_size() -> None:
    part("Rock_LOD0")
    part("Rock_LOD1", x=9.0)
    assert measured() == ["Rock_LOD0"]
    bpy.data.objects["Rock_LOD1"].scale = (5, 5, 5)
    assert measured() == ["Rock_LOD0", "Rock_LOD1"]


def test_empties_that_name_levels_with_parts_below() -> None:
    car = empty("Car")
    for level in range(3):
        above = empty(f"Car_LOD{level}", car)
        part(f"body{level}", above)
        part(f"wheel{level}", above, x=3.0)
    assert measured() == measured(car) == ["body0", "wheel0"]
    assert measured(bpy.data.objects["Car_LOD1"]) == ["body1", "wheel1"]
    assert measured(bpy.data.objects["wheel2"]) == ["wheel2"]


def test_collections_that_name_levels(tmp_path: Path) -> None:
    for level in range(2):
        within = collection(f"LOD{level}")
        part(f"body.{level}", within=within)
        part(f"wheel.{level}", x=3.0, within=within)
    assert measured() == ["body.0", "wheel.0"]
    assert measured(bpy.data.collections["LOD1"]) == ["body.1", "wheel.1"]
    path = str(tmp_path / "car.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    assert chains_of_file(path) == [("", [(0, "LOD0"), (1, "LOD1")])]
    assert len(load_asset(f"{path}:LOD1").mesh.triangles) == 24
    with pytest.raises(FileError, match="no object or collection named LOD7"):
        load_asset(f"{path}:LOD7")


def test_a_level_below_another() -> None:
    """Some keep their levels below the finest; either is measured without the other."""
    finest = part("Rock_LOD0")
    below = part("Rock_LOD1", finest)
    assert measured(finest) == ["Rock_LOD0"] and measured(below) == ["Rock_LOD1"]
    assert not are_kin(finest, below)


def test_a_level_that_renders_hide_is_none() -> None:
    part("Rock_LOD0").hide_render = True
    part("Rock_LOD1")
    assert measured() == ["Rock_LOD1"]


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        *((f"{kind}_Rock_00", True) for kind in ("UCX", "UBX", "USP", "UCP", "ucx")),
        *(
            (f"Rock{end}", True)
            for end in ("-col", "-colonly", "-convcolonly", "_collider", "_collision", "_Collider_02")
        ),
        ("Rock-col.001", True),
        ("Rock", False),
        ("Column", False),
        ("UCXRock", False),
        ("Rock-color", False),
        ("Protocol", False),
    ],
)
def test_names_of_hulls(name: str, wanted: bool) -> None:
    assert is_collider(name) == wanted


@pytest.mark.parametrize("name", ["UCX_Rock_00", "Rock-colonly", "Rock_collision"])
def test_hulls_are_left_out_unless_nothing_else_is_there(name: str) -> None:
    rock, hull = part("Rock"), part(name)
    assert measured() == ["Rock"]
    assert name in parts_of(None, ALL).notes[0]
    hull.parent = rock
    assert measured(rock) == ["Rock"] and measured(hull) == [name]
    bpy.data.objects.remove(rock)
    assert measured() == [name] and not parts_of(None, ALL).notes


def test_patterns() -> None:
    truck = empty("Truck")
    part("Body", truck)
    part("Wheel_front", truck)
    part("Wheel_back", truck)
    part("Ghost", within=collection("Helpers"))
    assert measured(None, Reading(exclude=("wheel*", "helpers"))) == ["Body"]
    assert measured(None, Reading(include=("TRUCK",))) == ["Body", "Wheel_back", "Wheel_front"]
    assert measured(None, Reading(include=("Truck",), exclude=("*_front",))) == ["Body", "Wheel_back"]
    assert measured(truck, Reading(include=("Wheel_?ack",))) == ["Wheel_back"]
    for reading in (Reading(include=("Nothing",)), Reading(exclude=("*",))):
        with pytest.raises(MeshError, match="the patterns leave nothing"):
            parts_of(None, reading)


def test_a_pattern_chooses_a_level_or_a_hull() -> None:
    for name in ("Rock_LOD0", "Rock_LOD1", "UCX_Rock"):
        part(name)
    assert measured(None, Reading(include=("*_lod1",))) == ["Rock_LOD1"]
    assert measured(None, Reading(include=("ucx_*",))) == ["UCX_Rock"]


def test_a_root_stands_for_its_family(tmp_path: Path) -> None:
    """In the window, as a file and as file:NAME; whatever kind of object the root is."""
    truck = part("Truck")
    wheel = part("Wheel", truck, x=3.0)
    part("Nut", wheel, x=1.0)
    bones = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(bones)
    truck.parent = bones
    for block, triangles in ((bones, 36), (truck, 36), (wheel, 24)):
        assert len(take(target_of(block)).mesh.triangles) == triangles
    before = fingerprint(target_of(truck), False)
    wheel.location.x = 4.0
    bpy.context.view_layer.update()
    assert fingerprint(target_of(truck), False) != before  # the truck is another without having moved
    path = str(tmp_path / "truck.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    counts = [len(load_asset(path + name).mesh.triangles) for name in ("", ":Rig", ":Truck", ":Wheel")]
    assert counts == [36, 36, 36, 24]


def test_hidden_parts_of_a_family() -> None:
    truck = part("Truck")
    wheel = part("Wheel", truck)
    wheel.hide_render = True
    assert measured(truck) == ["Truck"] and measured(wheel) == ["Wheel"]
    truck.hide_render = True
    assert measured(truck) == ["Truck", "Wheel"]


def test_ancestors_and_descendants_are_not_compared() -> None:
    truck, other = part("Truck"), part("Other")
    wheel = part("Wheel", truck)
    outcomes = measuring(target_of(truck), [target_of(wheel), target_of(other)], FEW).run()
    assert "one hangs from the other" in (outcomes[0].error or "") and outcomes[1].error is None
    (outcome,) = measuring(target_of(wheel), [target_of(truck)], FEW).run()
    assert outcome.error


def test_an_object_without_its_modifiers_keeps_its_family() -> None:
    truck = part("Truck")
    part("Wheel", truck)
    truck.modifiers.new("Smooth", "SUBSURF")
    assert len(take(target_of(truck, bare=True)).mesh.triangles) == 24


@pytest.mark.parametrize(("name", "whole", "part_"), [("alllods", "lod0only", "lod1only"), ("ucx", "noucx", "")])
def test_the_shared_cases(shared_data: Path, name: str, whole: str, part_: str) -> None:
    folder = shared_data / "cases" / "lods"
    found, alone = (load_asset(str(folder / f"{each}.fbx")) for each in (name, whole))
    assert len(found.mesh.triangles) == len(alone.mesh.triangles) and found.mesh.notes
    if part_:
        level = load_asset(str(folder / f"{name}.fbx:SM_Rock_LOD1"))
        assert len(level.mesh.triangles) == len(load_asset(str(folder / f"{part_}.fbx")).mesh.triangles)


def test_the_shared_chains(shared_data: Path) -> None:
    folder = shared_data / "cases" / "lods"
    groups = chains_of_file(str(folder / "groups.fbx"))
    assert groups == [("Car", [(0, "Car_LOD0"), (1, "Car_LOD1"), (2, "Car_LOD2")])]
    assert chains_of_file(str(folder / "collections.blend")) == [("", [(0, "LOD0"), (1, "LOD1")])]
    for name, counts in (("groups.fbx:Car_LOD", (4416, 1056, 240)), ("collections.blend:LOD", (4416, 1056))):
        found = [len(load_asset(f"{folder}/{name}{level}").mesh.triangles) for level in range(len(counts))]
        assert found == list(counts)


def test_a_name_is_sure_or_needs_its_place() -> None:
    assert lod_of_name("Rock_LOD2") == ("rock", 2, True)
    assert lod_of_name("x02_Rock") == ("rock", 2, False)
    assert lod_of_name("Rock_low.001") == ("rock", 2, False)
    assert lod_of_name("low") is None and lod_of_name("Arm_L") is None
