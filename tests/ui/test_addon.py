# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar's operators, as scripts call them: inputs, measuring, results. tests/window looks at the window."""

from __future__ import annotations

import gc
import inspect
import json
import re
import subprocess
import sys
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

import fmqm_addon
from fmqm_addon import api
from fmqm_addon.blender.scene import fingerprint, measure
from fmqm_addon.blender.scene.target import target_of
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.errors import SettingsError
from fmqm_addon.metric.evaluation import COLUMNS
from fmqm_addon.metric.settings import SETTING_NAMES, Settings, info_of
from fmqm_addon.metric.stepper import Progress, Stepper, Work
from fmqm_addon.ui import operators, panels, properties, session, stale
from fmqm_addon.ui.modal import SteppedOperator
from fmqm_addon.ui.operators import inputs
from fmqm_addon.ui.operators import measure as measuring
from fmqm_addon.ui.properties.items import item_target
from fmqm_addon.ui.properties.rows import comparable, row_scores, settings_name
from fmqm_addon.ui.properties.scene import FMQMScene
from fmqm_addon.ui.properties.settings import FMQMSettings, metric_settings
from tests.blender import scenes
from tests.blender.script import read_json, score

ROOT = Path(fmqm_addon.__file__).parents[1]
QUICK = Settings(samples=8_000, patches=40)


@pytest.fixture(autouse=True)
def addon(empty_session: None) -> Iterator[None]:
    fmqm_addon.register()
    yield
    fmqm_addon.unregister()


@pytest.fixture
def fmqm() -> FMQMScene:
    made = bpy.context.scene.fmqm
    made.settings.samples, made.settings.patches = QUICK.samples, QUICK.patches
    return made


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    return scenes.write_png(tmp_path / "noise.png", scenes.noise(32))


@pytest.fixture
def lods(picture: Path) -> list[bpy.types.Object]:
    """Three monkeys on the same place: the original, one with a Decimate, one with other colors."""
    made = [scenes.monkey(f"Rock_LOD{level}", [scenes.textured(picture)]) for level in range(2)]
    made.append(scenes.monkey("Rock_LOD2", [scenes.material("Red", (0.8, 0.1, 0.1))]))
    made[1].modifiers.new("Decimate", "DECIMATE").ratio = 0.4
    return made


def select(*objects: bpy.types.Object) -> None:
    """The last one becomes active."""
    bpy.ops.object.select_all(action="DESELECT")
    for object_ in objects:
        object_.select_set(True)
    bpy.context.view_layer.objects.active = objects[-1]


def compare(reference: bpy.types.Object, *compared: bpy.types.ID) -> None:
    inputs.set_reference(bpy.context.scene.fmqm, reference)
    inputs.set_compared(bpy.context.scene.fmqm, compared)


def numbers(row: bpy.types.PropertyGroup) -> list[float]:
    scores = row_scores(row)
    assert scores is not None, row.error
    return [scores[name] for name in COLUMNS]


def why_not() -> str:
    with pytest.raises(RuntimeError) as caught:
        bpy.ops.fmqm.measure()
    return str(caught.value)


def test_use_selection(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    light = bpy.data.objects.new("Light", bpy.data.lights.new("Light", "SUN"))
    bpy.context.scene.collection.objects.link(light)
    select(light, lods[2], lods[1], lods[0])
    assert bpy.ops.fmqm.use_selection() == {"FINISHED"}
    assert fmqm.reference == lods[0]
    assert [item.object for item in fmqm.compared] == lods[1:]
    select(lods[0])
    with pytest.raises(RuntimeError, match="Select the objects to compare"):
        bpy.ops.fmqm.use_selection()


def test_the_list(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    assert bpy.ops.fmqm.find_lods() == {"FINISHED"}
    assert [item.object for item in fmqm.compared] == lods[1:]
    assert bpy.ops.fmqm.remove_compared() == {"FINISHED"}
    assert [item.object for item in fmqm.compared] == lods[2:]
    select(*lods)
    assert bpy.ops.fmqm.add_selected() == {"FINISHED"}  # neither the reference nor what is there already
    assert [item.object for item in fmqm.compared] == [lods[2], lods[1]]
    assert bpy.ops.fmqm.clear_compared() == {"FINISHED"}
    assert not fmqm.compared


def test_find_lods_without_any(fmqm: FMQMScene) -> None:
    scenes.cube()
    assert bpy.ops.fmqm.find_lods() == {"CANCELLED"}
    assert fmqm.reference is None


def test_reasons_for_a_grey_button(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    assert "Choose the original" in why_not()
    fmqm.reference = lods[0]
    assert "Add an LOD" in why_not()
    compare(lods[0], lods[0])
    assert "Rock_LOD0 is the original and in the list too" in why_not()


def test_settings_that_contradict(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    compare(lods[0], lods[1])
    fmqm.settings.samples = 100
    assert "at least 32 for each" in why_not()
    assert not fmqm.rows


def test_the_same_doubles_as_the_script(fmqm: FMQMScene, lods: list[bpy.types.Object], tmp_path: Path) -> None:
    lods[1].location.x += 5  # set beside the reference
    fmqm.settings.sigma, fmqm.settings.seed, fmqm.settings.repeats = 0.07, 3, 2
    compare(lods[0], *lods[1:])
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    rows = {row.name: numbers(row) for row in fmqm.rows}
    outcomes = api.measure(lods[0], lods[1:], metric_settings(fmqm.settings), repeats=2)
    assert {outcome.target.name: list(outcome.scores) for outcome in outcomes} == rows
    spaces = {row.name: row.space for row in fmqm.rows}
    assert spaces == {"Rock_LOD1": "world without location", "Rock_LOD2": "world"}

    blend = scenes.export(tmp_path, "blend")
    report = tmp_path / "report.json"
    specs = [f"{blend}:{lod.name}" for lod in lods]
    flags = ["--samples", "8000", "--patches", "40", "--sigma", "0.07", "--seed", "3", "--repeats", "2"]
    done = score(*specs, *flags, "--json", str(report), "--quiet")
    assert done.returncode == 0, done.stderr
    document = read_json(report)
    for pair in document["pairs"]:
        name = pair["distorted"].rpartition(":")[2]
        assert [pair[column] for column in COLUMNS] == rows[name]
        assert pair["space"] == spaces[name]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"settings": {"samples": 8_000}}, "settings are {'samples': 8000}"),
        ({"repeats": 0}, "repeats is 0"),
        ({"space": "moon"}, "space is 'moon'; it must be one of auto, world, local"),
        ({"bake": -1}, "bake is -1"),
    ],
)
def test_python_is_told_what_cannot_be_asked(lods: list[bpy.types.Object], wrong: dict[str, Any], said: str) -> None:
    with pytest.raises(SettingsError, match=re.escape(said)):
        api.measure(lods[0], lods[1], **wrong)


def test_python_is_told_what_is_no_asset(lods: list[bpy.types.Object]) -> None:
    for reference, distorted in (("Rock_LOD0", lods[1]), (lods[0], None), (lods[0], [lods[1].data])):
        with pytest.raises(TypeError, match="is given; an object or a collection"):
            api.measure(reference, distorted)
    with pytest.raises(TypeError, match="not the scene's own"):
        api.measure(lods[0], bpy.context.scene.collection)


def test_space_and_match_scale_of_the_script(lods: list[bpy.types.Object], tmp_path: Path) -> None:
    lods[1].location.x += 5
    lods[2].scale *= 100
    blend, report = scenes.export(tmp_path, "blend"), tmp_path / "report.json"
    specs = [f"{blend}:{lod.name}" for lod in lods]
    flags = ["--samples", "8000", "--patches", "40", "--json", str(report), "--quiet"]
    assert score(*specs, *flags, "--space", "world").returncode == 0
    world = read_json(report)
    assert [pair["space"] for pair in world["pairs"]] == ["world", "world"]
    assert world["pairs"][0]["FMQM"] < 0.5
    assert any("Match Scale" in warning for warning in world["pairs"][1]["warnings"])
    assert score(*specs, *flags, "--space", "local", "--match-scale").returncode == 0
    local = read_json(report)
    assert [pair["space"] for pair in local["pairs"]] == ["local", "local"]
    assert local["settings"]["space"] == "local" and local["settings"]["match_scale"] is True


def test_nothing_is_left_and_nothing_is_touched(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    lods[1].hide_set(True)
    lods[2].hide_viewport = True
    select(lods[0])
    bpy.ops.object.mode_set(mode="EDIT")
    compare(lods[0], *lods[1:])
    before = scenes.blocks()
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    assert scenes.blocks() == before
    assert [row.error for row in fmqm.rows] == ["", ""]
    assert bpy.context.mode == "EDIT_MESH"
    assert bpy.context.view_layer.objects.active == lods[0]
    assert [lod.select_get() for lod in lods] == [True, False, False]
    assert lods[1].hide_get() and lods[2].hide_viewport


def test_own_modifiers(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    lod = lods[1]
    select(lods[0])
    with pytest.raises(RuntimeError, match="has no modifiers"):
        bpy.ops.fmqm.own_modifiers()
    select(lod)
    assert bpy.ops.fmqm.own_modifiers() == {"FINISHED"}
    before = scenes.blocks()
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    assert scenes.blocks() == before
    live = numbers(fmqm.rows[0])
    assert live[-1] < 1
    assert fmqm.rows[0].share == pytest.approx(40, abs=2)
    # Rock_LOD0 is the same mesh without the modifier: the same pair by other means.
    compare(lods[0], lod)
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    assert numbers(fmqm.rows[1]) == live
    lod.modifiers.clear()
    select(lod)
    outcome = api.measure(lod, lod, QUICK, reference_without_modifiers=True)[0]
    assert list(outcome.scores) == [1.0] * 5


def test_own_modifiers_in_edit_mode_and_switched_off(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    lod = lods[1]
    select(lod)
    bpy.ops.fmqm.own_modifiers()
    bpy.ops.fmqm.measure()
    expected = numbers(fmqm.rows[0])
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.fmqm.measure()
    assert numbers(fmqm.rows[0]) == expected
    bpy.ops.object.mode_set(mode="OBJECT")
    lod.hide_viewport = True
    bpy.ops.fmqm.measure()
    assert numbers(fmqm.rows[0]) == expected


def test_empties_and_collections_count_as_one(fmqm: FMQMScene, picture: Path) -> None:
    skin = scenes.textured(picture)
    whole = scenes.cube("Whole", materials=[skin])
    halves = [
        scenes.add(f"Half{k}", scenes.CUBE_CORNERS, scenes.CUBE_FACES[3 * k : 3 * k + 3], materials=[skin])
        for k in range(2)
    ]
    parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(parent)
    group = bpy.data.collections.new("Group")
    for half in halves:
        half.parent = parent
        group.objects.link(half)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", group
    instance.location.x = 7
    bpy.context.scene.collection.objects.link(instance)
    compare(whole, parent, group, instance)
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    for row in fmqm.rows:
        assert row.triangles == 12
        assert numbers(row)[-1] == pytest.approx(1, abs=1e-6)
    assert [row.kind for row in fmqm.rows] == ["OBJECT", "COLLECTION", "OBJECT"]


def test_an_error_is_one_rows(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    bare = scenes.add("Bare", [(0, 0, 0)], [])
    no_image = scenes.material("Blank")
    scenes.image_node(no_image, None)
    flat = scenes.cube("No Image", materials=[no_image])
    hollow = bpy.data.objects.new("Hollow", None)
    bpy.context.scene.collection.objects.link(hollow)
    compare(lods[0], bare, flat, hollow, lods[1])
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    errors = {row.name: row.error for row in fmqm.rows}
    assert "no faces" in errors["Bare"]
    assert "holds no image" in errors["No Image"]
    assert "no mesh in it" in errors["Hollow"]
    assert not errors["Rock_LOD1"] and numbers(fmqm.rows[3])
    assert row_scores(fmqm.rows[0]) is None
    bpy.ops.fmqm.sort_rows(column="FMQM")
    assert fmqm.rows[0].name == "Rock_LOD1"


def test_a_reference_that_cannot_be_measured(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    compare(scenes.add("Bare", [(0, 0, 0)], []), lods[1])
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    assert "no faces" in fmqm.rows[0].error


def test_rows_are_replaced_and_saved(fmqm: FMQMScene, lods: list[bpy.types.Object], tmp_path: Path) -> None:
    compare(lods[0], lods[1], lods[2])
    bpy.ops.fmqm.measure()
    uids = [row.uid for row in fmqm.rows]
    assert all(session.get(uid) is not None for uid in uids)
    bpy.ops.fmqm.measure()
    assert [row.name for row in fmqm.rows] == ["Rock_LOD1", "Rock_LOD2"]
    assert all(session.get(uid) is None for uid in uids)
    before = [numbers(row) for row in fmqm.rows]
    blend = scenes.export(tmp_path, "blend")
    scenes.clear()
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert [numbers(row) for row in bpy.context.scene.fmqm.rows] == before


def test_the_place_of_the_compared(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    lods[1].location.x += 5
    compare(lods[0], lods[1])
    bpy.ops.fmqm.measure()
    measured = session.get(fmqm.rows[0].uid)
    assert measured is not None
    assert np.array_equal(measured.reference_to_world, np.eye(4))
    np.testing.assert_allclose(measured.distorted_to_world[:3, 3], (5, 0, 0), atol=1e-6)


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (lambda lods: None, {}),
        (lambda lods: setattr(lods[1].modifiers[0], "ratio", 0.3), {"Rock_LOD1"}),
        (lambda lods: setattr(lods[2].data.vertices[0], "co", (0, 0, 9)), {"Rock_LOD2"}),
        (
            lambda lods: setattr(scenes.base_color(lods[2].active_material), "default_value", (0, 1, 0, 1)),
            {"Rock_LOD2"},
        ),
        (lambda lods: lods[0].data.transform(scenes.PLACED), {"Rock_LOD1", "Rock_LOD2"}),
        (lambda lods: bpy.data.objects.remove(lods[1]), {"Rock_LOD1"}),
        (lambda lods: setattr(lods[1], "hide_viewport", True), {}),
    ],
)
def test_rows_that_are_out_of_date(
    fmqm: FMQMScene, lods: list[bpy.types.Object], change: object, names: set[str]
) -> None:
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    change(lods)  # type: ignore[operator]
    bpy.context.view_layer.update()
    stale.check(bpy.context.scene)
    assert {row.name for row in fmqm.rows if row.uid in session.stale} == (names or set())


def stale_names(fmqm: FMQMScene) -> set[str]:
    bpy.context.view_layer.update()
    stale.check(bpy.context.scene)
    return {row.name for row in fmqm.rows if row.uid in session.stale}


def test_painting_marks_and_saving_the_image_does_not_take_the_mark_away(
    fmqm: FMQMScene, lods: list[bpy.types.Object], tmp_path: Path
) -> None:
    own = scenes.write_png(tmp_path / "own.png", scenes.noise(32))
    lods[1].data.materials[0] = scenes.textured(own, "Own")
    image = bpy.data.images["own.png"]
    compare(lods[0], lods[1])
    bpy.ops.fmqm.measure()
    values = np.full(len(image.pixels), 0.5, np.float32)
    image.pixels.foreach_set(values)
    assert image.is_dirty and stale_names(fmqm) == {"Rock_LOD1"}
    bpy.ops.fmqm.measure()
    assert not stale_names(fmqm)
    image.pixels[0] = 0.7
    assert stale_names(fmqm) == {"Rock_LOD1"}, "painted further"
    bpy.ops.fmqm.measure()
    image.save()
    assert not image.is_dirty
    bpy.ops.fmqm.measure()
    assert not stale_names(fmqm)
    image.pixels.foreach_set(values)
    image.save()
    assert not image.is_dirty and stale_names(fmqm) == {"Rock_LOD1"}


def test_painting_of_large_images_marks(
    fmqm: FMQMScene, lods: list[bpy.types.Object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a look at all their pixels."""
    monkeypatch.setattr(fingerprint, "_MOST_PAINTED", 32 * 32 * 4 - 1)
    lods[1].data.materials[0] = scenes.textured(scenes.write_png(tmp_path / "own.png", scenes.noise(32)))
    image = bpy.data.images["own.png"]
    compare(lods[0], lods[1])
    bpy.ops.fmqm.measure()
    image.pixels[0] = 0.7
    assert image.is_dirty and stale_names(fmqm) == {"Rock_LOD1"}
    image.save()
    assert not image.is_dirty and stale_names(fmqm) == {"Rock_LOD1"}


def test_painting_of_packed_images_marks(fmqm: FMQMScene, lods: list[bpy.types.Object], tmp_path: Path) -> None:
    """As glTF files bring them, and of a UDIM set."""
    materials = [scenes.textured(scenes.write_png(tmp_path / f"{n}.100{n}.png", scenes.noise(32))) for n in (1, 2)]
    one, tiles = (scenes.base_color(each).links[0].from_node.image for each in materials)
    tiles.source, tiles.filepath = "TILED", str(tmp_path / "2.<UDIM>.png")
    tiles.tiles[0].number = 1002
    for image, lod, material in zip((one, tiles), lods[1:], materials, strict=False):
        image.pack()
        lod.data.materials[0] = material
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    assert not [row.error for row in fmqm.rows if row.error] and not stale_names(fmqm)
    one.pixels.foreach_set(np.full(len(one.pixels), 0.5, np.float32))
    one.pack()
    assert not one.is_dirty and stale_names(fmqm) == {lods[1].name}


def test_vertex_colors_mark(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    mesh = lods[1].data
    mesh.materials.clear()
    colors = mesh.color_attributes.new("Col", "FLOAT_COLOR", "POINT")
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    assert not stale_names(fmqm)
    colors.data.foreach_set("color", [0.0, 1.0, 0.0, 1.0] * len(mesh.vertices))
    assert stale_names(fmqm) == {"Rock_LOD1"}


def test_a_pose_marks_and_moving_all_together_does_not(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    rig = scenes.skeleton()
    scenes.hang(lods[1], rig)
    fmqm.settings.space = "LOCAL"
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    for moved in (rig, lods[1]):
        moved.location.y += 0.73
    assert not stale_names(fmqm)
    rig.pose.bones["Bone"].rotation_quaternion = (0.9, 0.3, 0, 0)
    assert stale_names(fmqm) == {"Rock_LOD1"}
    bpy.ops.fmqm.measure()
    rig.location.x += 0.2
    assert stale_names(fmqm) == {"Rock_LOD1"}, "its place to the object"


def test_saving_the_file_and_edit_mode_change_nothing(
    fmqm: FMQMScene, lods: list[bpy.types.Object], tmp_path: Path
) -> None:
    lods[2].data.color_attributes.new("Col", "BYTE_COLOR", "CORNER")
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    fmqm = bpy.context.scene.fmqm
    assert bpy.data.images["noise.png"].filepath.startswith("//") and not stale_names(fmqm)
    select(*(bpy.data.objects[f"Rock_LOD{level}"] for level in (2, 1, 0)))
    bpy.ops.object.mode_set(mode="EDIT")
    before = scenes.blocks()
    assert not stale_names(fmqm)
    bpy.ops.fmqm.measure()
    assert scenes.blocks() == before
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not stale_names(fmqm), "measured in edit mode, and nothing changed there"
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.transform.translate(value=(0, 0, 1))
    assert not stale_names(fmqm), "it may still be undone"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert stale_names(fmqm) == {"Rock_LOD1", "Rock_LOD2"}


def test_deleted_objects_are_gone_and_let_go_of(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    before = numbers(fmqm.rows[1])
    select(lods[2])
    bpy.ops.object.delete()
    assert fmqm.compared[1].object is not None, "Blender keeps what a property points at"
    assert item_target(fmqm.compared[1]) is None and item_target(fmqm.compared[0]) == lods[1]
    bpy.ops.fmqm.measure()
    assert [row.error for row in fmqm.rows] == ["", ""] and numbers(fmqm.rows[1]) == before
    assert stale_names(fmqm) == {"Rock_LOD2"}
    select(lods[1])
    bpy.ops.object.delete()
    assert why_not().endswith("Add an LOD to compare with the original")
    select(lods[0])
    bpy.ops.object.delete()
    assert why_not().endswith("Rock_LOD0 is gone; choose another original")
    stale.forget_deleted(bpy.context.scene)
    assert fmqm.reference is None and [item.object for item in fmqm.compared] == [None, None]
    assert [item.name for item in fmqm.compared] == ["Rock_LOD1", "Rock_LOD2"]
    assert not any(object_.users for object_ in bpy.data.objects if object_.name.startswith("Rock"))


def test_scores_stay_where_an_object_is_deleted_while_it_is_measured(
    fmqm: FMQMScene, lods: list[bpy.types.Object]
) -> None:
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    before = [row.scores for row in fmqm.rows]
    error = measure.Outcome(target_of(lods[0]), target_of(lods[2]), error="why")
    bpy.data.objects.remove(lods[2])
    measuring.write_row(fmqm, error, "{}")
    assert [row.scores for row in fmqm.rows] == before and not fmqm.rows[1].error


def test_a_slice_of_work_ends_before_something_else_begins() -> None:
    """So that what is announced is on the screen while a long step is at work."""
    begun: list[str] = []

    def work() -> Work[None]:
        for stage in ("Reading", "Reading: baking", "Preparing"):
            yield Progress(stage, 0.0)
            begun.append(stage)

    operator = SteppedOperator()
    operator.stepper = Stepper(work())
    seen = []
    while operator._slice():
        seen.append((operator.stepper.progress.stage, len(begun)))
    assert seen == [("Reading", 0), ("Reading: baking", 1), ("Preparing", 2)]


def test_sorting_keeps_the_choice(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    chosen = fmqm.rows[fmqm.row_index].name
    orders = set()
    for _ in range(2):
        bpy.ops.fmqm.sort_rows(column="colorSSIM")
        assert fmqm.rows[fmqm.row_index].name == chosen
        orders.add(tuple(row.name for row in fmqm.rows))
    assert len(orders) == 2
    bpy.ops.fmqm.remove_row()
    assert len(fmqm.rows) == 1
    bpy.ops.fmqm.clear_results()
    assert not fmqm.rows


def test_saving(fmqm: FMQMScene, lods: list[bpy.types.Object], tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="Nothing has been measured"):
        bpy.ops.fmqm.save_results(filepath=str(tmp_path / "a.json"))
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    for kind in ("json", "csv", "npz"):
        assert bpy.ops.fmqm.save_results(filepath=str(tmp_path / "out"), file_format=kind) == {"FINISHED"}
    document = json.loads((tmp_path / "out.json").read_text())
    assert [[pair[name] for name in COLUMNS] for pair in document["pairs"]] == [numbers(row) for row in fmqm.rows]
    assert document["settings"]["samples"] == QUICK.samples
    assert (tmp_path / "out.csv").read_text().count("\n") == 3
    with np.load(tmp_path / "out.npz") as fields:
        assert fields["patch_scores"].mean(axis=0).tolist() == pytest.approx(numbers(fmqm.rows[0]))
    (tmp_path / "loud").mkdir()
    for kind in ("JSON", "CSV", "NPZ"):
        path = tmp_path / "loud" / f"out.{kind}"
        assert bpy.ops.fmqm.save_results(filepath=str(path), file_format=kind.lower()) == {"FINISHED"}
        assert path.stat().st_size > 100
    assert len(list((tmp_path / "loud").iterdir())) == 3
    with pytest.raises(RuntimeError, match="No file is named"):
        bpy.ops.fmqm.save_results()
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.fmqm.save_results(filepath=str(tmp_path / "no" / "out.json"))
    fmqm.settings.seed = 7  # other settings: another file
    compare(lods[0], lods[1])
    bpy.ops.fmqm.measure()
    bpy.ops.fmqm.save_results(filepath=str(tmp_path / "out.json"))
    assert len(json.loads((tmp_path / "out.json").read_text())["pairs"]) == 1
    session.clear()
    with pytest.raises(RuntimeError, match="measure again"):
        bpy.ops.fmqm.save_results(filepath=str(tmp_path / "out.npz"), file_format="npz")


def remembered(fmqm: FMQMScene) -> dict[str, list[weakref.ref[object]]]:
    """What each row has of its own: samples and the reference are the same for all."""
    found = {}
    for row in fmqm.rows:
        measured = session.get(row.uid)
        held = (measured.comparison, measured.comparison.distorted, measured.comparison.result.dist.sdf)
        found[row.name] = [weakref.ref(each) for each in held]
    return found


def alive(references: list[weakref.ref[object]]) -> bool:
    gc.collect()
    return any(each() is not None for each in references)


def remove_chosen(_: FMQMScene) -> None:
    bpy.ops.fmqm.remove_row()


def by_script_or_undo(fmqm: FMQMScene) -> None:
    fmqm.rows.remove(0)
    stale._on_undo()  # as in the window


def by_hand_in_the_window(fmqm: FMQMScene) -> None:
    fmqm.rows.remove(0)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    stale._on_change(bpy.context.scene, depsgraph)


@pytest.mark.parametrize("remove", [remove_chosen, by_script_or_undo, by_hand_in_the_window])
def test_arrays_go_with_their_row(fmqm: FMQMScene, lods: list[bpy.types.Object], remove: Callable[..., None]) -> None:
    compare(lods[0], *lods[1:])
    bpy.ops.fmqm.measure()
    fmqm.row_index = 0
    for act in (bpy.ops.fmqm.keep, bpy.ops.fmqm.slice, bpy.ops.fmqm.unit_step):
        act()
    held = remembered(fmqm)
    remove(fmqm)
    assert not alive(held["Rock_LOD1"]) and alive(held["Rock_LOD2"])
    bpy.ops.fmqm.clear_results()
    assert not alive(held["Rock_LOD2"])


def test_arrays_go_when_measured_again(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    compare(lods[0], lods[1])
    bpy.ops.fmqm.measure()
    held = remembered(fmqm)
    bpy.ops.fmqm.measure()
    assert not alive(held["Rock_LOD1"]) and alive(remembered(fmqm)["Rock_LOD1"])


def test_arrays_go_with_their_scene_but_not_those_of_a_copy(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    compare(lods[0], lods[1])
    bpy.ops.fmqm.measure()
    held = remembered(fmqm)["Rock_LOD1"]
    first, other = bpy.context.scene, bpy.data.scenes.new("Other")
    copy = first.copy()
    bpy.context.window.scene = other
    for scene in (first, copy):
        assert alive(held)
        bpy.data.scenes.remove(scene)
        stale._on_change(other, other.view_layers[0].depsgraph or bpy.context.evaluated_depsgraph_get())
    assert not alive(held)


def test_rows_at_other_settings_are_told_apart(fmqm: FMQMScene, lods: list[bpy.types.Object]) -> None:
    rows = []
    for lod, preset, seed in ((lods[1], "FAST", 0), (lods[2], "FAST", 3), (lods[0], "CUSTOM", 3)):
        fmqm.settings.preset, fmqm.settings.seed = preset, seed
        if preset == "CUSTOM":
            fmqm.settings.samples = QUICK.samples
        outcome = measure.Outcome(target_of(lods[0]), target_of(lod))
        measuring.write_row(fmqm, outcome, json.dumps(metric_settings(fmqm.settings).as_dict()))
        rows.append(fmqm.rows[len(rows)])
    assert [settings_name(row) for row in rows] == ["Quick", "Quick", "Custom"]
    assert comparable(rows[0], rows[1]) and not comparable(rows[1], rows[2])


def test_presets() -> None:
    settings = bpy.context.scene.fmqm.settings
    assert metric_settings(settings) == Settings()
    settings.preset = "FAST"
    assert metric_settings(settings) == Settings(**api.PRESETS["fast"])
    settings.sigma = 0.03
    assert settings.preset == "CUSTOM"
    assert metric_settings(settings).sigma == 0.03  # the double, not the single of the property
    settings.preset = "PAPER"
    assert metric_settings(settings) == Settings()
    settings.gradient_whole = settings.radius_whole = True
    chosen = metric_settings(settings)
    assert chosen.gradient_radius == chosen.radius == float("inf")
    settings.seed = 5
    settings.preset = "PAPER"
    assert metric_settings(settings) == Settings(seed=5)


def test_operator_presets(fmqm: FMQMScene) -> None:
    fmqm.settings.color_units, fmqm.settings.attribution = 77, True
    assert bpy.ops.fmqm.preset_add(name="Mine") == {"FINISHED"}
    paths = bpy.utils.preset_paths("fmqm")
    saved = Path(paths[0]) / "Mine.py"
    fmqm.settings.preset, fmqm.settings.attribution = "PAPER", False
    bpy.ops.script.execute_preset(filepath=str(saved), menu_idname="FMQM_PT_presets")
    assert fmqm.settings.color_units == 77 and fmqm.settings.preset == "CUSTOM"
    assert fmqm.settings.attribution is False, "what is measured besides is not a preset's"
    saved.unlink()


def test_every_flag_of_the_script_is_a_property() -> None:
    from fmqm_addon.metric.settings import SETTING_NAMES

    properties = bpy.context.scene.fmqm.settings.bl_rna.properties
    for name in (*SETTING_NAMES, "repeats", "space", "match_scale", "align", "both", "attribution", "preset"):
        assert name in properties


def test_texts() -> None:
    """Names and tooltips as Blender's: Title Case, no full stop at the end."""
    small = {"and", "as", "by", "for", "in", "is", "of", "on", "the", "to", "with"}
    for cls in properties.CLASSES:
        for prop in cls.bl_rna.properties:
            if prop.identifier in {"rna_type"} or (prop.identifier == "name" and not prop.description):
                continue
            assert prop.name and prop.description, (cls, prop.identifier)
            assert not prop.description.endswith("."), prop.description
            assert all(word in small or word[0].isupper() or word[0] in "(" for word in prop.name.split()), prop.name
    for cls in (*operators.CLASSES, *panels.CLASSES):
        # Blender writes into that of the presets.
        label = "" if cls is panels.settings.FMQM_PT_presets else getattr(cls, "bl_label", "")
        assert all(word in small or not word[0].islower() for word in label.split()), label
        if issubclass(cls, bpy.types.Operator):
            description = getattr(cls, "bl_description", "")
            assert description or "description" in vars(cls), cls
            assert not description.endswith("."), cls


def test_drawing_computes_nothing() -> None:
    """No panel asks for arrays, files or evaluated data."""
    for cls in panels.CLASSES:
        source = inspect.getsource(cls)
        for word in ("numpy", "np.", "foreach_get", "evaluated", "children_recursive", "mesh_arrays"):
            assert word not in source, (cls, word)


def test_python_api(lods: list[bpy.types.Object]) -> None:
    before = scenes.blocks()
    outcomes = api.measure(lods[0], lods, QUICK)
    assert scenes.blocks() == before
    assert list(outcomes[0].scores) == [1.0] * 5
    assert not bpy.context.scene.fmqm.rows
    assert outcomes[1].triangles < outcomes[1].reference_triangles == 968
    assert outcomes[1].comparison.result.patch_scores.shape == (QUICK.patches, 5)
    bad = api.measure(lods[0], scenes.add("Bare", [(0, 0, 0)], []), QUICK)[0]
    assert bad.scores is None and "no faces" in bad.error


def test_stepping_needs_no_scene(lods: list[bpy.types.Object]) -> None:
    """Objects may be deleted, or the file replaced, once the first steps have read them."""
    from fmqm_addon.blender.scene.measure import measuring
    from fmqm_addon.blender.scene.target import target_of
    from fmqm_addon.comparison.pair import PairOptions

    expected = api.measure(lods[0], lods[1], QUICK)[0].scores
    stepper = measuring(target_of(lods[0]), [target_of(lods[1])], PairOptions(settings=QUICK))
    while stepper.progress.stage.startswith("Reading") or not stepper.progress.stage:
        assert stepper.step()
    bpy.data.objects.remove(lods[1])
    scenes.clear()
    assert np.array_equal(stepper.run()[0].scores, expected)


def test_the_scene_changes_before_it_is_read(lods: list[bpy.types.Object]) -> None:
    from fmqm_addon.blender.scene.measure import measuring
    from fmqm_addon.blender.scene.target import target_of
    from fmqm_addon.comparison.pair import PairOptions

    stepper = measuring(target_of(lods[0]), [target_of(lod) for lod in lods[1:]], PairOptions(settings=QUICK))
    stepper.step()
    bpy.data.objects.remove(lods[2])
    outcomes = stepper.run()
    assert outcomes[0].error is None
    assert "no longer in the file" in (outcomes[1].error or "")


def test_register_leaves_nothing_when_undone() -> None:
    fmqm_addon.unregister()
    try:
        assert not hasattr(bpy.types.Scene, "fmqm")
        assert not [name for name in dir(bpy.types) if name.upper().startswith("FMQM")]
        assert not any("fmqm" in repr(draw) for draw in bpy.types.VIEW3D_MT_object._dyn_ui_initialize())
        for name in dir(bpy.app.handlers):
            handlers = getattr(bpy.app.handlers, name)
            if isinstance(handlers, list):
                assert not any("fmqm" in getattr(handler, "__module__", "") for handler in handlers)
    finally:
        fmqm_addon.register()


@pytest.mark.parametrize("handlers", [False, True], ids=["plain", "handlers"])
def test_python_ends_after_the_add_on(handlers: bool) -> None:
    """bpy 4.5 hangs at the end of Python as long as anything refers to what it has registered."""
    lines = ["import bpy, fmqm_addon", "fmqm_addon.register()"]
    if handlers:  # which only the window has
        lines.append("from fmqm_addon.ui.stale import _HANDLERS")
        lines.append("for name, handler in _HANDLERS: getattr(bpy.app.handlers, name).append(handler)")
    lines.append("fmqm_addon.unregister()")
    done = subprocess.run([sys.executable, "-c", "\n".join(lines)], cwd=ROOT, timeout=300, check=False)
    assert done.returncode == 0


def test_the_sidebar_has_the_defaults_limits_and_texts_of_the_settings() -> None:
    properties = FMQMSettings.bl_rna.properties
    for owner, names in ((Settings, SETTING_NAMES), (PairOptions, ("repeats", "match_scale", "both", "attribution"))):
        for name in names:
            info, found = info_of(owner, name), properties[name]
            assert found.description.lower() == info.text.lower()
            default = getattr(owner, name)
            if default is not None:
                assert found.default == (pytest.approx(default, rel=1e-6) if info.kind is float else default)
            if info.kind in (int, float):
                assert found.hard_min >= info.minimum and (info.maximum is None or found.hard_max <= info.maximum)
            if info.choices:
                assert tuple(item.identifier for item in found.enum_items) == info.choices
