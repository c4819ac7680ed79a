# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers and their colors by hand; the sub-panels' operators: what they add, keep, replace and clear."""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

import fmqm_addon
from fmqm_addon.blender.display import scene_objects, viewport
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays
from fmqm_addon.comparison.measurement import Comparison, Measurement
from fmqm_addon.metric.colorspace import decode_srgb, srgb_to_lab
from fmqm_addon.metric.evaluation import Result, Scores
from fmqm_addon.metric.fields import Fields
from fmqm_addon.metric.geometry import dot
from fmqm_addon.metric.sampling import Samples
from fmqm_addon.metric.settings import Settings
from fmqm_addon.report.visual import colormap, layers
from fmqm_addon.report.visual.shells import SHELLS, fields_at, shell_points, slice_points
from fmqm_addon.report.visual.units import unit_grid, unit_of
from fmqm_addon.report.visual.worst import worst_patches
from fmqm_addon.ui import session
from fmqm_addon.ui.view import cloud, overlay, shown, slice_plane
from fmqm_addon.ui.view.result import measured_row
from tests.blender import scenes

FEW = Settings(samples=1600, patches=16)
SHIFT = np.array([[1.0, 0, 0, 10], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> session.Measured:
    """A plain monkey against itself, squashed and textured; the session's arrays outlive the objects."""
    image = scenes.write_png(tmp_path_factory.mktemp("look") / "noise.png", scenes.noise())
    scenes.clear()
    a = scenes.monkey("Monkey_LOD0", [scenes.material("A", (0.5, 0.2, 0.1))])
    b = scenes.monkey("Monkey_LOD1", [scenes.textured(image)])
    b.scale.z *= 0.9
    bpy.context.view_layer.update()
    measurement = Measurement(mesh_arrays([a], a.name), BVHQuery, FEW)
    measurement.prepare().run()
    comparison = measurement.compare(mesh_arrays([b], b.name)).run()
    return session.Measured(measurement.reference, comparison, np.eye(4), SHIFT)


@pytest.fixture
def scene(measured: session.Measured) -> Iterator[bpy.types.Scene]:
    """The add-on switched on, and one result."""
    fmqm_addon.register()
    try:
        scene = bpy.context.scene
        row = scene.fmqm.rows.add()
        row.uid, row.name = "row", "Monkey_LOD1"
        session.put("row", measured)
        yield scene
    finally:
        session.clear()
        fmqm_addon.unregister()


def by_hand() -> tuple[Fields, Fields]:
    ref = Fields(np.zeros((4, 3)), np.zeros(4, np.int64), np.array([1.0, -1, 2, -2]), np.zeros((4, 3), np.float32))
    ncf = np.array([[0, 0, 0], [1, 1, 1], [1, 0, 0], [0.5, 0, 0]], np.float32)
    return ref, dataclasses.replace(ref, sdf=np.array([1.0, -1.5, -2, 2]), ncf=ncf)


def legend() -> dict:
    return json.loads(scene_objects.find_object(bpy.context.scene, scene_objects.CLOUD)[overlay.LEGEND])


def point_colors(kind: str = scene_objects.CLOUD) -> np.ndarray:
    """(N, 3) linear, of the first corner of each point."""
    mesh = scene_objects.find_object(bpy.context.scene, kind).data
    values = np.empty(4 * len(mesh.vertices), np.float32)
    mesh.attributes[scene_objects.COLOR].data.foreach_get("color", values)
    return values.reshape(-1, 4)[:: 4 if kind == scene_objects.CLOUD else 1, :3]


# --- Values and colors


def test_values_of_the_fields_by_hand() -> None:
    ref, dist = by_hand()
    assert layers.field_values("SDF_REFERENCE", ref, dist, 10.0).tolist() == [10, -10, 20, -20]
    assert layers.field_values("SDF_DIFFERENCE", ref, dist, 10.0).tolist() == [0, 5, 40, 40]
    assert layers.field_values("NCF_DIFFERENCE", ref, dist, 1.0) == pytest.approx([0, 1, 3**-0.5, 0.5 * 3**-0.5])
    assert layers.field_values("SIDES", ref, dist, 1.0).tolist() == [0, 1, 3, 2]
    assert layers.field_values("NCF_COMPARED", ref, dist, 1.0).tolist() == dist.ncf.tolist()


def test_values_of_the_patches_go_to_their_samples(measured: session.Measured) -> None:
    result = measured.comparison.result
    values = layers.layer_values(result, "FMQM")
    assert len(values) == len(result.samples.positions)
    assert values[result.samples.start[3]] == result.patch_scores[3, 4]
    assert (layers.layer_values(result, "PATCH") == result.samples.patch).all()


def test_bad_is_hot() -> None:
    hot, cold = colormap.score_colors(np.array([0.0, 1.0]))
    assert (layers.layer_colors("FMQM", np.array([0.2, 0.9]), 0.2, 0.9) == [hot, cold]).all()
    for name in ("NCF_DIFFERENCE", "SDF_DIFFERENCE"):
        assert (layers.layer_colors(name, np.array([0.0, 2.0]), 0.0, 2.0) == [cold, hot]).all()


def test_inside_is_blue_and_outside_orange() -> None:
    inside, middle, outside = layers.layer_colors("SDF_COMPARED", np.array([-3.0, 0, 3]), -3, 3)
    assert inside[2] > inside[0] and outside[0] > outside[2] and middle.min() > 0.9
    for end in (-1, 1):
        lab = srgb_to_lab(colormap.signed_colors(np.linspace(0, end, 21)))
        steps = np.linalg.norm(np.diff(lab, axis=0), axis=1)
        assert steps.max() < 1.4 * steps.min()  # a chord where two anchors meet
        assert (np.diff(lab[:, 0]) < 0).all()  # lightness alone tells how far


def test_neighbors_in_number_differ() -> None:
    lab = srgb_to_lab(colormap.number_colors(np.arange(250)))
    for away in (1, 2, 3):
        assert np.linalg.norm(lab[away:] - lab[:-away], axis=1).min() > 0.15


def test_ranges() -> None:
    values = np.array([0.4, 0.8])
    assert layers.value_range("FMQM", values, False, 10.0) == (0, 1)
    assert layers.value_range("FMQM", values, True, 10.0) == (0.4, 0.8)
    low, high = layers.value_range("FMQM", np.ones(5), True, 10.0)
    assert low < high == 1
    assert layers.value_range("SDF_DIFFERENCE", values, False, 10.0) == pytest.approx((0, 0.1))
    low, high = layers.value_range("SDF_REFERENCE", np.array([-5.0, 1]), True, 10.0)
    assert low == -high and 4 < high <= 5
    assert layers.value_range("NCF_DIFFERENCE", np.zeros(3), True, 10.0)[1] > 0


def test_legend_tells_its_numbers(measured: session.Measured) -> None:
    result = measured.comparison.result
    of_scores = layers.legend("geoSSIM", (0.95, 0.97), "LOD1", result)
    assert [text for _, text in of_scores.ticks] == ["0.9500", "0.9550", "0.9600", "0.9650", "0.9700"]
    assert of_scores.mark is not None and of_scores.mark[1] == f"{result.scores[0]:.4f}"
    of_lengths = layers.legend("SDF_REFERENCE", (-2, 2), "LOD1", result, lambda value: f"{value} m")
    assert of_lengths.ticks[-1] == (1.0, "2.0 m") and of_lengths.mark is None
    assert len(layers.legend("SIDES", (0, 1), "LOD1", result).swatches) == 4


def test_worst_patches_name_who_is_to_blame(measured: session.Measured) -> None:
    scores = np.full((4, 5), 0.9)
    scores[:, 3] = 0.4  # low everywhere: nothing special
    scores[2] = [0.9, 0.45, 0.9, 0.4, 0.3]
    scores[0] = [0.9, 0.9, 0.9, 0.1, 0.2]
    result = dataclasses.replace(measured.comparison.result, patch_scores=scores, scores=Scores(*scores.mean(axis=0)))
    worst = worst_patches(result, 3)
    assert [(w.patch, w.blame, w.value) for w in worst[:2]] == [(0, "colorGraSSIM", 0.1), (2, "geoGraSSIM", 0.45)]
    assert [w.patch for w in worst] == [0, 2, 1]


# --- Probes


def test_painted_scores_lie_between_those_of_the_patches(measured: session.Measured) -> None:
    result = measured.comparison.result
    values = layers.blended_scores(result, "FMQM")
    scores = result.patch_scores[:, 4]
    assert len(values) == len(result.patch_mesh.vertices)
    assert scores.min() <= values.min() and values.max() <= scores.max() and values.std() > 0
    alike = dataclasses.replace(result, patch_scores=np.full_like(result.patch_scores, 0.7))
    assert layers.blended_scores(alike, "FMQM") == pytest.approx(0.7)
    numbers = layers.blended_scores(result, "PATCH")
    assert numbers[[patch.center for patch in result.patches]].tolist() == list(range(len(result.patches)))


def test_shells_stand_at_their_distances(measured: session.Measured) -> None:
    shells = shell_points(measured.reference, 500, 0.01)
    assert np.bincount(shells.shell).tolist() == [500] * SHELLS
    fields = fields_at(measured.reference, shells.positions)
    assert np.abs(fields.sdf[:500]).max() < 1e-6
    assert (np.abs(fields.sdf) <= 0.01 * shells.shell + 1e-6).all()


def test_units_are_the_metrics(measured: session.Measured) -> None:
    result = measured.comparison.result
    samples = result.samples
    for sample in np.flatnonzero(samples.unit)[::300].tolist():
        unit = unit_of(result, sample)
        here = np.flatnonzero(samples.patch == samples.patch[sample])
        offset = samples.positions[here] - samples.positions[sample]
        distance = np.linalg.norm(offset, axis=1)
        axis = result.ref.nearest[sample] - samples.positions[sample]
        cosine = np.abs(offset @ axis) / np.maximum(distance * np.linalg.norm(axis), 1e-30)
        within = (distance > 0) & (distance < unit.radius)
        assert sorted(unit.normal) == sorted([sample, *here[within & (cosine > 0.95)]])
        assert sorted(unit.tangent) == sorted([sample, *here[within & (cosine < 0.05)]])
        for tangent in (False, True):
            pixels, inside, dots, members = unit_grid(result, unit, tangent, 16)
            assert inside.any() and (np.abs(dots) <= 1).all() and len(dots) == len(members)
            gap = pixels[inside] - samples.positions[sample]
            assert np.sqrt(dot(gap, gap)).max() <= unit.radius


def test_slice_points_are_the_centers_of_pixels() -> None:
    points = slice_points(SHIFT, 2)
    assert points.tolist() == [[9.75, -0.25, 0], [10.25, -0.25, 0], [9.75, 0.25, 0], [10.25, 0.25, 0]]


# --- In the scene


def test_cloud_is_at_the_reference_or_the_compared(scene: bpy.types.Scene, measured: session.Measured) -> None:
    bpy.ops.fmqm.look()
    cloud = scene_objects.find_object(bpy.context.scene, scene_objects.CLOUD)
    result = measured.comparison.result
    world = result.frame.leave(result.samples.positions)

    def center_of_first() -> np.ndarray:
        bpy.context.view_layer.update()
        corners = [np.array(cloud.matrix_world @ cloud.data.vertices[k].co) for k in range(4)]
        return np.mean(corners, axis=0)

    assert center_of_first() == pytest.approx(world[0], abs=1e-5)
    scene.fmqm.look.place = "COMPARED"
    assert center_of_first() == pytest.approx(world[0] + (10, 0, 0), abs=1e-5)


def test_every_layer_shows_and_adds_nothing(scene: bpy.types.Scene, measured: session.Measured) -> None:
    bpy.ops.fmqm.look()
    before, look = scenes.blocks(), scene.fmqm.look
    seen = []
    for name, layer in layers.LAYERS.items():
        for look.range in ("FIXED", "FITTED"):
            look.layer = name
            assert legend()["title"].startswith(layer.label)
        seen.append(point_colors())
    assert scenes.blocks() == before
    assert all((a != b).any() for a, b in zip(seen[:-1], seen[1:], strict=True))
    look.layer = "NCF_REFERENCE"
    assert point_colors() == pytest.approx(decode_srgb(measured.comparison.result.ref.ncf), abs=1e-5)


def test_looking_again_replaces_and_clear_takes_all(scene: bpy.types.Scene) -> None:
    mine = scenes.cube()
    mine.select_set(True)
    bpy.context.view_layer.objects.active = mine
    before = scenes.blocks()
    shading = [
        (space.shading.color_type, space.shading.studio_light)
        for screen in bpy.data.screens
        for area in screen.areas
        for space in area.spaces
        if space.type == "VIEW_3D"
    ]
    acts = (bpy.ops.fmqm.look, bpy.ops.fmqm.paint_surface, bpy.ops.fmqm.shells, bpy.ops.fmqm.slice)
    for act in (*acts, bpy.ops.fmqm.worst_step, bpy.ops.fmqm.unit_step):
        assert act() == {"FINISHED"}
    once = scenes.blocks()
    assert once > before
    for act in acts:
        act()
    assert scenes.blocks() == once and not any(name.endswith(".001") for _, name in once - before)
    assert bpy.context.selected_objects == [mine] and bpy.context.object == mine

    assert bpy.ops.fmqm.clear() == {"FINISHED"}
    assert scenes.blocks() == before
    assert shading == [
        (space.shading.color_type, space.shading.studio_light)
        for screen in bpy.data.screens
        for area in screen.areas
        for space in area.spaces
        if space.type == "VIEW_3D"
    ]
    assert bpy.context.selected_objects == [mine] and bpy.context.object == mine
    assert len(scene.fmqm.rows) == 1 and overlay.figure is None
    assert not bpy.ops.fmqm.clear.poll()


def test_works_in_edit_mode_and_leaves_it_alone(scene: bpy.types.Scene) -> None:
    mine = scenes.cube()
    bpy.context.view_layer.objects.active = mine
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.fmqm.look()
    bpy.ops.fmqm.clear()
    assert mine.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")


def test_worst_places_show_only_their_patch(scene: bpy.types.Scene, measured: session.Measured) -> None:
    look, result = scene.fmqm.look, measured.comparison.result

    def shown() -> set[int]:
        mesh = scene_objects.find_object(bpy.context.scene, scene_objects.CLOUD).data
        values = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", values)
        corners = values.reshape(-1, 4, 3)
        return set(result.samples.patch[(corners[:, 0] != corners[:, 1]).any(axis=1)].tolist())

    order = np.argsort(result.patch_scores[:, 4], kind="stable").tolist()
    bpy.ops.fmqm.worst_step(step=1)
    assert shown() == {order[0]} and [item.patch for item in look.worst] == order
    bpy.ops.fmqm.worst_step(step=1)
    assert shown() == {order[1]} and look.worst_index == 1
    look.point_size = 2.0
    assert shown() == {order[1]}
    bpy.ops.fmqm.worst_step(step=-1)
    assert shown() == {order[0]}
    look.worst_index = 3  # a click in the list
    assert shown() == {order[3]}
    bpy.ops.fmqm.worst_all()
    assert shown() == set(order)


def test_slice_shows_the_field_where_it_is(scene: bpy.types.Scene, measured: session.Measured) -> None:
    look = scene.fmqm.look
    look.slice_layer, look.slice_resolution = "NCF_REFERENCE", "128"
    bpy.ops.fmqm.slice()
    plane = scene_objects.find_object(bpy.context.scene, scene_objects.SLICE)

    def pixels() -> np.ndarray:
        values = np.empty(128 * 128 * 4, np.float32)
        plane.data.pixels.foreach_get(values)
        return values.reshape(-1, 4)[:, :3]

    color = measured.comparison.result.ref.ncf[0]  # the reference has but one
    outline = np.abs(pixels() - color).max(axis=1) > 2 / 255
    assert 0.01 < outline.mean() < 0.2
    look.slice_layer = "SDF_REFERENCE"
    first = pixels()
    plane.location.z += 0.5
    bpy.context.view_layer.update()
    assert slice_plane.slice_has_moved(scene)
    slice_plane.draw_slice(scene)
    assert not slice_plane.slice_has_moved(scene) and (pixels() != first).any()


def test_cloud_follows_the_chosen_row(scene: bpy.types.Scene, measured: session.Measured) -> None:
    bpy.ops.fmqm.look()
    row = scene.fmqm.rows.add()
    row.uid, row.name = "other", "Other"
    session.put("other", dataclasses.replace(measured, comparison=many(measured.comparison, 50)))
    before = len(scenes.blocks())
    scene.fmqm.row_index = 1
    scene.fmqm.look.layer = "PATCH"
    assert len(point_colors()) == 50 and len(scenes.blocks()) == before


def subtitle(kind: str) -> str:
    return str(json.loads(scene_objects.find_object(bpy.context.scene, kind)[overlay.LEGEND])["subtitle"])


def add_row(scene: bpy.types.Scene, measured: session.Measured, name: str) -> None:
    """A second result, of a compared object of this name."""
    row = scene.fmqm.rows.add()
    row.uid, row.name = name, name
    comparison = dataclasses.replace(
        measured.comparison, distorted=dataclasses.replace(measured.comparison.distorted, name=name)
    )
    session.put(name, dataclasses.replace(measured, comparison=comparison))


SHOWN = (scene_objects.CLOUD, scene_objects.PAINTED, scene_objects.SHELLS, scene_objects.SLICE)


def show_all() -> None:
    for act in (bpy.ops.fmqm.look, bpy.ops.fmqm.paint_surface, bpy.ops.fmqm.shells, bpy.ops.fmqm.slice):
        act()


def test_all_follows_the_chosen_row(scene: bpy.types.Scene, measured: session.Measured) -> None:
    scene.fmqm.look.shell_field = "COMPARED"
    show_all()
    bpy.ops.fmqm.unit_step()
    add_row(scene, measured, "Other")
    scene.fmqm.row_index = 1
    legends = [scene_objects.find_object(scene, kind)[overlay.LEGEND] for kind in SHOWN]
    assert all("Other" in text and "Monkey_LOD1" not in text for text in legends)
    assert overlay.figure is not None and overlay.figure.uid == "Other"
    scene.fmqm.rows.add().error = "broken"
    scene.fmqm.row_index = 2  # nothing to follow
    assert legends == [scene_objects.find_object(scene, kind)[overlay.LEGEND] for kind in SHOWN]


def test_all_but_the_slice_follows_the_place(scene: bpy.types.Scene) -> None:
    show_all()
    bpy.ops.fmqm.unit_step()
    lines = overlay.figure.lines

    def places() -> np.ndarray:
        return np.array([scene_objects.find_object(scene, kind).location.x for kind in SHOWN])

    before = places()
    scene.fmqm.look.place = "COMPARED"
    assert places() - before == pytest.approx([10, 10, 10, 0], abs=1e-5)
    assert overlay.figure.lines == pytest.approx(lines + (10, 0, 0))


def test_worst_places_are_the_chosen_rows(scene: bpy.types.Scene, measured: session.Measured) -> None:
    look = scene.fmqm.look
    bpy.ops.fmqm.look()
    bpy.ops.fmqm.clear()
    add_row(scene, measured, "Other")
    scene.fmqm.rows.add().error = "broken"
    scene.fmqm.row_index = 1
    assert look.worst_uid == "Other" and len(look.worst) == FEW.patches
    look.worst_index = 3  # a click in the list
    assert look.worst_index == 3 and look.focused
    scene.fmqm.row_index = 2
    assert not len(look.worst)
    bpy.ops.fmqm.worst_all()  # still there for the points that are shown
    assert not look.focused


def test_worst_places_are_the_judges(scene: bpy.types.Scene, measured: session.Measured) -> None:
    look, result = scene.fmqm.look, measured.comparison.result
    bpy.ops.fmqm.look()
    look.worst_index = 2  # a click in the list
    for judge, column in (("PERCEIVED", "perceived"), ("FMQM", "FMQM")):
        scene.fmqm.judge = judge
        lowest = np.sort(result.of_patches(column))[: len(look.worst)]
        np.testing.assert_allclose([item.score for item in look.worst], lowest, rtol=1e-6)
        assert look.layer == column and not look.focused and look.worst_index == 0
    look.layer = "SIDES"
    scene.fmqm.judge = "PERCEIVED"
    assert look.layer == "SIDES", "only a score gives way to a score"


def test_each_scene_shows_its_own(scene: bpy.types.Scene, measured: session.Measured) -> None:
    show_all()
    mine = [scene_objects.find_object(scene, kind) for kind in SHOWN]
    two = bpy.data.scenes.new("Two")
    add_row(two, measured, "Other")
    cloud.show_cloud(two)
    slice_plane.show_slice(two)
    assert [scene_objects.find_object(scene, kind) for kind in SHOWN] == mine and subtitle(SHOWN[0]) == "Monkey_LOD1"
    theirs = list(scene_objects.objects(two))
    assert len(theirs) == 2 and not set(theirs) & set(mine)
    assert all(len(shown.users_scene) == 1 for shown in (*mine, *theirs))
    bpy.ops.fmqm.clear()
    assert not scene_objects.anything()


def test_what_was_hidden_is_shown_when_asked_for(scene: bpy.types.Scene) -> None:
    bpy.ops.fmqm.look()
    cloud = scene_objects.find_object(scene, scene_objects.CLOUD)
    (collection,) = cloud.users_collection

    def layer() -> bpy.types.LayerCollection:
        return bpy.context.view_layer.layer_collection.children[collection.name]

    def hide_collection() -> None:
        collection.hide_viewport = True

    def hide_in_layer() -> None:
        layer().hide_viewport = True

    def leave_out() -> None:
        layer().exclude = True

    def disable() -> None:
        cloud.hide_viewport = True

    for hide in (lambda: cloud.hide_set(True), disable, hide_collection, hide_in_layer, leave_out):
        hide()
        assert not cloud.visible_get()
        scene.fmqm.row_index = 0  # following is not asking
        assert not cloud.visible_get()
        bpy.ops.fmqm.look()
        assert cloud.visible_get(), hide
    cloud.hide_set(True)
    bpy.ops.fmqm.worst_step()
    assert cloud.visible_get()


def test_slice_is_in_the_saved_file(scene: bpy.types.Scene, tmp_path: Path) -> None:
    bpy.ops.fmqm.slice()

    def pixels() -> list[float]:
        return list(scene_objects.find_object(bpy.context.scene, scene_objects.SLICE).data.pixels)

    for height in (0.0, 0.3):  # a picture that was packed can be drawn again
        scene_objects.find_object(scene, scene_objects.SLICE).location.z = height
        bpy.context.view_layer.update()
        slice_plane.draw_slice(scene)
        before = pixels()
        path = str(tmp_path / f"{height}.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
        with bpy.data.libraries.load(path) as (_, into):
            into.images = ["FMQM Slice"]
        assert list(into.images[0].pixels) == before and len(set(before)) > 3
        bpy.data.images.remove(into.images[0])


def test_lengths_of_the_shells_have_the_scenes_unit(scene: bpy.types.Scene) -> None:
    bpy.ops.fmqm.shells()
    assert subtitle(scene_objects.SHELLS).endswith(" cm apart")
    scene.unit_settings.system = "NONE"
    bpy.ops.fmqm.shells()
    assert float(subtitle(scene_objects.SHELLS).removesuffix(" apart")) > 0


def test_undo_takes_the_views_colors_along(scene: bpy.types.Scene) -> None:
    """Undo and redo change the file but not the views; the window calls this after them."""
    view = next(s for screen in bpy.data.screens for a in screen.areas for s in a.spaces if s.type == "VIEW_3D")
    before = view.shading.color_type
    bpy.ops.fmqm.slice()
    shown.settle_colors()
    assert view.shading.color_type == before  # a slice needs no other colors
    bpy.ops.fmqm.look()
    view.shading.color_type = "RANDOM"
    shown.settle_colors()
    assert view.shading.color_type == "RANDOM"  # the user's choice
    view.shading.color_type = "VERTEX"
    scene_objects.clear()  # as undo would
    shown.settle_colors()
    assert view.shading.color_type == before and not viewport.colors_changed()
    cloud.show_cloud(scene)
    viewport.restore_colors()
    shown.settle_colors()  # after redo
    assert view.shading.color_type == "VERTEX"


def test_figure_goes_with_its_row(scene: bpy.types.Scene) -> None:
    bpy.ops.fmqm.unit_step()
    assert overlay.figure is not None and overlay.belongs_here(overlay.figure)
    scene.fmqm.rows.clear()  # as undo past the measurement would, which leaves the session alone
    assert session.get("row") is not None and not overlay.belongs_here(overlay.figure)


def test_switched_off_it_leaves_nothing(scene: bpy.types.Scene) -> None:
    show_all()
    bpy.ops.fmqm.worst_step()
    fmqm_addon.unregister()
    try:
        assert not scene_objects.anything() and not viewport.colors_changed() and overlay.figure is None
    finally:
        fmqm_addon.register()
    assert not bpy.context.scene.fmqm.look.focused


def test_without_samples_it_says_measure_again(scene: bpy.types.Scene) -> None:
    bpy.ops.fmqm.look()
    before = point_colors()
    session.clear()
    scene.fmqm.look.layer = "PATCH"  # no error: there is nobody to tell
    assert (point_colors() == before).all()
    assert not bpy.ops.fmqm.look.poll() and not bpy.ops.fmqm.slice.poll()
    with pytest.raises(fmqm_addon.metric.errors.FMQMError, match="press Measure Quality again"):
        measured_row(scene)
    assert bpy.ops.fmqm.clear() == {"FINISHED"}


def test_switching_layers_of_many_samples_is_quick(scene: bpy.types.Scene, measured: session.Measured) -> None:
    session.put("row", dataclasses.replace(measured, comparison=many(measured.comparison, 200_000)))
    began = time.perf_counter()
    bpy.ops.fmqm.look()
    print(f"built in {time.perf_counter() - began:.3f} s")
    worst = 0.0
    for name in reversed(layers.LAYERS):
        began = time.perf_counter()
        scene.fmqm.look.layer = name
        worst = max(worst, time.perf_counter() - began)
        print(f"{name} in {time.perf_counter() - began:.3f} s")
    began = time.perf_counter()
    scene.fmqm.look.point_size = 1.5
    print(f"resized in {time.perf_counter() - began:.3f} s")
    assert worst < 0.2


def many(comparison: Comparison, count: int) -> Comparison:
    """The comparison with other, random samples."""
    rng = np.random.default_rng(0)
    old: Result = comparison.result
    patch = np.sort(rng.integers(0, len(old.patches), count)).astype(np.int32)
    start = np.searchsorted(patch, np.arange(len(old.patches) + 1))
    positions = rng.normal(size=(count, 3))
    samples = Samples(positions, np.zeros(count), patch, start, np.zeros(count, bool))
    fields = [
        Fields(positions * 0.9, np.zeros(count, np.int64), rng.normal(size=count), rng.random((count, 3), np.float32))
        for _ in range(2)
    ]
    return dataclasses.replace(
        comparison, result=dataclasses.replace(old, samples=samples, ref=fields[0], dist=fields[1])
    )
