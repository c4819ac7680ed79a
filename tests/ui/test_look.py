# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers and their colors by hand; the sub-panels' operators: what they add, keep, replace and clear."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Euler

import fmqm_addon
from fmqm_addon.blender.display import scene_objects
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays
from fmqm_addon.comparison.measurement import Comparison, Measurement
from fmqm_addon.metric.colorspace import decode_srgb, srgb_to_lab
from fmqm_addon.metric.evaluation import Result, Scores
from fmqm_addon.metric.fields import Fields
from fmqm_addon.metric.geometry import dot, triangle_areas, triangle_normals
from fmqm_addon.metric.sampling import Samples
from fmqm_addon.metric.settings import Settings
from fmqm_addon.report.visual import colormap, layers
from fmqm_addon.report.visual.heat_map import UNCOVERED
from fmqm_addon.report.visual.shells import SHELLS, fields_at, shell_points, slice_points
from fmqm_addon.report.visual.units import unit_grid, unit_of
from fmqm_addon.report.visual.worst import worst_patches
from fmqm_addon.ui import session
from fmqm_addon.ui.properties.items import is_asset
from fmqm_addon.ui.view import heat, overlay, slice_plane
from fmqm_addon.ui.view import shells as shell_view
from fmqm_addon.ui.view.kept import grid, keep_as_objects
from fmqm_addon.ui.view.result import measured_row, world_length, world_matrix
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


def drawn() -> heat.Shown:
    found = heat.shown_in(bpy.context.scene)
    assert found is not None
    return found


def legend() -> dict:
    return drawn().legend


def point_colors(part: int = 0) -> np.ndarray:
    """(N, 3) encoded, of each point or triangle."""
    return drawn().parts[part].mesh.colors[:, :3]


def seen(part: int = 0) -> np.ndarray:
    """(N,) which points or triangles are drawn."""
    return drawn().parts[part].mesh.colors[:, 3] > 0


def show_points() -> None:
    bpy.context.scene.fmqm.look.show = "POINTS"


def show_surface() -> None:
    bpy.context.scene.fmqm.look.show = "SURFACE"


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
    assert layers.value_range("FMQM", values, True, 10.0) == (0.4, 1)
    low, high = layers.value_range("FMQM", np.ones(5), True, 10.0)
    assert 0.99 < low < high == 1
    assert layers.value_range("SDF_DIFFERENCE", values, False, 10.0) == pytest.approx((0, 0.1))
    low, high = layers.value_range("SDF_REFERENCE", np.array([-5.0, 1]), True, 10.0)
    assert low == -high and 4 < high <= 5
    assert layers.value_range("NCF_DIFFERENCE", np.zeros(3), True, 10.0)[1] > 0


def test_legend_tells_its_numbers(measured: session.Measured) -> None:
    result = measured.comparison.result
    of_scores = layers.legend("geoSSIM", (0.95, 0.97), "LOD1", result)
    assert [text for _, text in of_scores.ticks] == ["0.950", "0.955", "0.960", "0.965", "0.970"]
    assert of_scores.mark is not None and of_scores.mark[1] == f"{result.scores[0]:.4f}"
    of_lengths = layers.legend("SDF_REFERENCE", (-2, 2), "LOD1", result, lambda value: f"{value} m")
    assert of_lengths.ticks[-1] == (1.0, "2.0 m") and of_lengths.mark is None
    assert len(layers.legend("SIDES", (0, 1), "LOD1", result).swatches) == 4


def test_worst_patches_name_who_is_to_blame(measured: session.Measured) -> None:
    scores = np.full((4, 5), 0.9)
    scores[:, 3] = 0.4  # low everywhere: nothing special
    scores[2] = [0.9, 0.45, 0.9, 0.4, 0.3]
    scores[0] = [0.9, 0.9, 0.9, 0.1, 0.2]
    result = dataclasses.replace(
        measured.comparison.result, patch_scores=scores, patch_perceived=scores, scores=Scores(*scores.mean(axis=0))
    )
    worst = worst_patches(result, 3)
    assert [(w.patch, w.blame, w.value) for w in worst[:2]] == [(0, "detail", 0.1), (2, "detail", 0.4)]
    assert [w.patch for w in worst] == [0, 2, 1]


# --- Probes


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


def test_points_are_at_the_original_and_at_the_lod(scene: bpy.types.Scene, measured: session.Measured) -> None:
    show_points()
    assert [part.place for part in drawn().parts] == [heat.ORIGINAL, heat.LOD]
    result = measured.comparison.result
    corners = drawn().parts[0].mesh.vertices.reshape(-1, 4, 3)
    assert corners.mean(axis=1) == pytest.approx(result.samples.positions, abs=1e-6)
    at = [np.array(heat.placed(measured, part.place, [])) for part in drawn().parts]
    assert at[0][:3, :3] * result.frame.scale**0 == pytest.approx(np.eye(3) * result.frame.scale)
    assert at[1][:3, 3] - at[0][:3, 3] == pytest.approx([10, 0, 0], abs=1e-5)
    scene.fmqm.look.place = "COMPARED"
    assert [part.place for part in drawn().parts] == [heat.LOD]


def test_surfaces_are_painted_by_the_nearest_patch(scene: bpy.types.Scene, measured: session.Measured) -> None:
    show_surface()
    result = measured.comparison.result
    for part, surface in zip(drawn().parts, (measured.reference, measured.comparison.distorted), strict=True):
        mesh = part.heat_mesh
        assert triangle_areas(mesh.vertices, mesh.triangles).sum() == pytest.approx(
            triangle_areas(surface.vertices, surface.triangles).sum()
        )
        away = np.linalg.norm(mesh.centers[:, None] - result.patch_centers, axis=2)
        assert (away[np.arange(len(away)), part.patch] <= away.min(axis=1) + 1e-5).all()
    scores = result.of_patches("FMQM")[drawn().parts[1].patch]
    assert point_colors(1) == pytest.approx(layers.layer_colors("FMQM", scores, *drawn().ends), abs=1e-6)


def test_colors_go_along_with_an_object(scene: bpy.types.Scene, measured: session.Measured) -> None:
    """Its transform may change without the result: LODs are put side by side."""
    mine = scenes.cube()
    mine.location.x = 3
    bpy.context.view_layer.update()
    stood = dataclasses.replace(measured, distorted_stood=np.array(mine.matrix_world))
    mine.location.x = 5
    bpy.context.view_layer.update()
    before = np.array(heat.placed(measured, heat.LOD, [mine]))
    assert np.array(heat.placed(stood, heat.LOD, [mine]))[:3, 3] - before[:3, 3] == pytest.approx([2, 0, 0], abs=1e-5)


def test_nothing_is_in_the_file(scene: bpy.types.Scene, tmp_path: Path) -> None:
    mine = scenes.cube()
    bpy.ops.fmqm.worst_step()
    bpy.ops.fmqm.clear()  # the list of the worst places stays
    before = scenes.blocks()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "before.blend"), copy=True)
    for scene.fmqm.look.show in ("SURFACE", "POINTS"):
        for name in layers.LAYERS:
            scene.fmqm.look.layer = name
        bpy.ops.fmqm.worst_step()
        scene.fmqm.look.show_shells = scene.fmqm.look.show_slice = True
        bpy.ops.fmqm.unit_step()
        assert scenes.blocks() == before and mine.select_get() == (mine in bpy.context.selected_objects)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "after.blend"), copy=True)
    sizes = [(tmp_path / name).stat().st_size for name in ("before.blend", "after.blend")]
    assert abs(sizes[1] - sizes[0]) < 1000


def test_what_has_changed_is_not_painted(scene: bpy.types.Scene) -> None:
    show_surface()
    assert heat.is_current(scene)
    session.stale["row"] = "changed"
    assert heat.shown_in(scene) is None and not heat.is_current(scene)
    heat.build_all()
    assert heat.is_current(scene)
    del session.stale["row"]
    heat.build_all()
    assert heat.shown_in(scene) is not None


def test_every_layer_shows(scene: bpy.types.Scene, measured: session.Measured) -> None:
    look = scene.fmqm.look
    for show in (show_points, show_surface):
        show()
        colors = []
        for name, layer in layers.LAYERS.items():
            for look.range in ("FIXED", "FITTED"):
                look.layer = name
                assert legend()["title"].startswith(layer.label)
            colors.append(point_colors(1))
        assert all((a != b).any() for a, b in zip(colors[:-1], colors[1:], strict=True))
    show_points()
    look.layer = "NCF_REFERENCE"
    assert point_colors() == pytest.approx(measured.comparison.result.ref.ncf, abs=1e-5)


def test_only_what_is_below_is_shown(scene: bpy.types.Scene, measured: session.Measured) -> None:
    scores = measured.comparison.result.of_patches("FMQM")
    look, middle = scene.fmqm.look, float(np.median(scores))
    for show in (show_points, show_surface):
        show()
        look.only_below, look.below = True, middle
        for part, _ in enumerate(drawn().parts):
            assert (seen(part) == (scores < look.below)[drawn().parts[part].patch]).all() and seen(part).any()
        look.only_below = False
        assert seen().all()


def test_ends_of_ones_own(scene: bpy.types.Scene, measured: session.Measured) -> None:
    show_surface()
    scene.fmqm.look.low, scene.fmqm.look.high, scene.fmqm.look.range = 0.25, 0.75, "CUSTOM"
    assert drawn().ends == pytest.approx((0.25, 0.75))
    scene.fmqm.look.low = 0.9  # beyond the other
    low, high = drawn().ends
    assert low < high


def test_the_legend_counts_all_patches(scene: bpy.types.Scene) -> None:
    show_surface()
    assert max(legend()["histogram"]) == 1.0
    scene.fmqm.look.layer = "NCF_REFERENCE"
    assert "histogram" not in legend()


def test_quick_results_do_not_paint_the_rest(scene: bpy.types.Scene, measured: session.Measured) -> None:
    few = 3
    old = measured.comparison.result
    inside = old.samples.patch < few
    samples = dataclasses.replace(
        old.samples,
        positions=old.samples.positions[inside],
        patch=old.samples.patch[inside],
        start=old.samples.start[: few + 1],
    )
    ref, dist = (
        dataclasses.replace(each, nearest=each.nearest[inside], sdf=each.sdf[inside], ncf=each.ncf[inside])
        for each in (old.ref, old.dist)
    )
    result = dataclasses.replace(
        old, patches=old.patches[:few], ref=ref, dist=dist, patch_centers=old.patch_centers[:few], samples=samples,
        patch_scores=old.patch_scores[:few], patch_perceived=old.patch_perceived[:few],
    )  # fmt: skip
    session.put(
        "row", dataclasses.replace(measured, comparison=dataclasses.replace(measured.comparison, result=result))
    )
    show_surface()
    original = drawn().parts[0]
    mesh = original.heat_mesh
    areas = triangle_areas(mesh.vertices, mesh.triangles)
    covered = areas[original.patch != UNCOVERED].sum() / areas.sum()
    share = sum(patch.area for patch in result.patches) / areas.sum()
    assert 0.9 * share < covered < 2 * share < 0.8
    assert np.abs(point_colors()[original.patch == UNCOVERED] - colormap.NO_PATCH).max() < 1e-6
    assert legend()["note"] == "grey: not among the 3 patches"


def test_a_fitted_range_holds_for_all_rows(scene: bpy.types.Scene, measured: session.Measured) -> None:
    show_surface()
    alone = drawn().ends
    worse = dataclasses.replace(
        measured.comparison,
        result=dataclasses.replace(
            measured.comparison.result, patch_scores=measured.comparison.result.patch_scores * 0.5
        ),
    )
    row = scene.fmqm.rows.add()
    row.uid = row.name = "Worse"
    session.put("Worse", dataclasses.replace(measured, comparison=worse))
    heat.refresh(scene)
    assert drawn().ends[0] < alone[0] and drawn().ends[1] == alone[1] == 1.0
    scene.fmqm.row_index = 1
    assert drawn().uid == "Worse"
    both = drawn().ends
    scene.fmqm.row_index = 0
    assert drawn().ends == both


def test_kept_objects_replace_those_before_and_clear_takes_all(scene: bpy.types.Scene) -> None:
    mine = scenes.cube()
    mine.select_set(True)
    bpy.context.view_layer.objects.active = mine
    before, looks = scenes.blocks(), shadings()
    assert not bpy.ops.fmqm.keep.poll()
    for show in (show_points, show_surface):
        show()
        assert bpy.ops.fmqm.keep() == {"FINISHED"}
    bpy.ops.fmqm.slice()
    bpy.ops.fmqm.shells()
    bpy.ops.fmqm.keep()
    once = scenes.blocks()
    assert once > before and len(list(scene_objects.objects(scene))) == 7
    for show in (show_points, show_surface):
        show()
        bpy.ops.fmqm.keep()
    assert scenes.blocks() == once and bpy.context.object == mine
    assert not any(is_asset(object_) for object_ in scene_objects.objects(scene))
    assert shadings() == looks

    assert bpy.ops.fmqm.clear() == {"FINISHED"}
    assert scenes.blocks() == before and shadings() == looks
    assert bpy.context.selected_objects == [mine] and bpy.context.object == mine
    assert len(scene.fmqm.rows) == 1 and overlay.figure is None and heat.shown_in(scene) is None
    assert not bpy.ops.fmqm.clear.poll()


def shadings() -> list[tuple[str, str]]:
    views = (s for screen in bpy.data.screens for a in screen.areas for s in a.spaces if s.type == "VIEW_3D")
    return [(view.shading.color_type, view.shading.studio_light) for view in views]


def test_works_in_edit_mode_and_leaves_it_alone(scene: bpy.types.Scene) -> None:
    mine = scenes.cube()
    bpy.context.view_layer.objects.active = mine
    bpy.ops.object.mode_set(mode="EDIT")
    show_points()
    bpy.ops.fmqm.keep()
    bpy.ops.fmqm.clear()
    assert mine.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")


def test_worst_places_show_only_their_patch(scene: bpy.types.Scene, measured: session.Measured) -> None:
    look, result = scene.fmqm.look, measured.comparison.result

    def patches() -> set[int]:
        return set(drawn().parts[0].patch[seen()].tolist())

    order = np.argsort(result.patch_scores[:, 4], kind="stable").tolist()
    bpy.ops.fmqm.worst_step(step=1)
    assert look.show == "SURFACE" and patches() == {order[0]} and [item.patch for item in look.worst] == order
    bpy.ops.fmqm.worst_step(step=1)
    assert patches() == {order[1]} and look.worst_index == 1
    show_points()
    look.point_size = 2.0
    assert patches() == {order[1]}
    bpy.ops.fmqm.worst_step(step=-1)
    assert patches() == {order[0]}
    look.worst_index = 3  # a click in the list
    assert patches() == {order[3]}
    bpy.ops.fmqm.worst_all()
    assert patches() == set(order)


def slice_of(scene: bpy.types.Scene) -> slice_plane.Slice:
    found = slice_plane.shown_in(scene)
    assert found is not None
    return found


def world_slice(scene: bpy.types.Scene, measured: session.Measured) -> np.ndarray:
    """(4, 4) from the square to the world of the original."""
    return world_matrix(measured, "REFERENCE") @ slice_of(scene).to_frame


def test_slice_shows_the_field_where_it_is(scene: bpy.types.Scene, measured: session.Measured) -> None:
    """It is no object of the file, and every pixel has the color of the field at its place."""
    look, before = scene.fmqm.look, scenes.blocks()
    look.slice_layer = "NCF_REFERENCE"
    bpy.ops.fmqm.slice()
    assert scenes.blocks() == before
    color = measured.comparison.result.ref.ncf[0]  # the reference has but one
    outline = np.abs(slice_of(scene).picture.colors - color).max(axis=1) > 2 / 255
    assert slice_of(scene).picture.side == 128 and 0.01 < outline.mean() < 0.2
    look.slice_layer, look.slice_offset = "SDF_REFERENCE", 40
    shown = slice_of(scene)
    sdf = fields_at(measured.reference, slice_points(shown.to_frame, 128)).sdf * world_length(measured)
    ends = layers.value_range("SDF_REFERENCE", sdf, True, world_length(measured))
    wanted = layers.layer_colors("SDF_REFERENCE", sdf, *ends)
    same = np.abs(shown.picture.colors - wanted).max(axis=1) < 1e-6
    assert same.mean() > 0.9, "all but the outline"
    bpy.ops.fmqm.slice()  # off
    assert slice_plane.shown_in(scene) is None and not look.show_slice


@pytest.mark.parametrize(("axis", "column", "normal"), [("X", 0, 1), ("Y", 1, -1), ("Z", 2, 1)])
def test_slice_goes_through_the_box_along_its_axis(
    scene: bpy.types.Scene, measured: session.Measured, axis: str, column: int, normal: int
) -> None:
    look = scene.fmqm.look
    look.slice_axis = axis
    bpy.ops.fmqm.slice()
    into = world_matrix(measured, "REFERENCE")
    vertices = measured.reference.vertices @ into[:3, :3].T + into[:3, 3]
    low, high = vertices.min(axis=0)[column], vertices.max(axis=0)[column]
    for offset, place in ((-100, low), (0, (low + high) / 2), (50, 0.25 * low + 0.75 * high), (100, high)):
        look.slice_offset = offset
        square = world_slice(scene, measured)
        assert square[column, 3] == pytest.approx(place, abs=1e-6)
        towards = square[:3, 2] / np.linalg.norm(square[:3, 2])
        assert towards == pytest.approx(normal * np.eye(3)[column], abs=1e-6)
        assert np.linalg.det(square[:3, :3]) > 0, "as it is seen from there, not mirrored"


def test_slice_across_the_view_faces_it(scene: bpy.types.Scene, measured: session.Measured) -> None:
    look, turn = scene.fmqm.look, Euler((0.9, 0.2, 0.5)).to_quaternion()
    look.slice_turn, look.slice_axis = turn, "VIEW"
    bpy.ops.fmqm.slice()
    square = world_slice(scene, measured)[:3, :3]
    assert square / np.linalg.norm(square, axis=0) == pytest.approx(np.array(turn.to_matrix()), abs=1e-6)


def test_slice_is_rough_while_it_is_moved(scene: bpy.types.Scene) -> None:
    look = scene.fmqm.look
    bpy.ops.fmqm.slice()
    slice_plane.moving.add(scene.name)
    try:
        look.slice_offset = 10
        assert slice_of(scene).picture.side == slice_plane.ROUGH
    finally:
        slice_plane.moving.clear()
    assert not slice_plane.is_current(scene)
    slice_plane.refresh_all()
    assert slice_of(scene).picture.side == 128


def add_row(scene: bpy.types.Scene, measured: session.Measured, name: str) -> None:
    """A second result, of a compared object of this name."""
    row = scene.fmqm.rows.add()
    row.uid, row.name = name, name
    comparison = dataclasses.replace(
        measured.comparison, distorted=dataclasses.replace(measured.comparison.distorted, name=name)
    )
    session.put(name, dataclasses.replace(measured, comparison=comparison))


def show_all() -> None:
    show_points()
    for act in (bpy.ops.fmqm.shells, bpy.ops.fmqm.slice):
        act()


def test_all_follows_the_chosen_row(scene: bpy.types.Scene, measured: session.Measured) -> None:
    scene.fmqm.look.shell_field = "COMPARED"
    show_all()
    bpy.ops.fmqm.unit_step()
    add_row(scene, measured, "Other")
    scene.fmqm.row_index = 1
    titles = [legend()["subtitle"], slice_of(scene).legend["subtitle"], shells_of(scene).legend["title"]]
    assert all("Other" in text for text in titles)
    assert overlay.figure is not None and overlay.figure.uid == "Other"
    scene.fmqm.rows.add().error = "broken"
    scene.fmqm.row_index = 2  # nothing to follow
    assert heat.shown_in(scene) is slice_plane.shown_in(scene) is shell_view.shown_in(scene) is None


def shells_of(scene: bpy.types.Scene) -> shell_view.Shells:
    found = shell_view.shown_in(scene)
    assert found is not None
    return found


def test_all_follows_the_place(scene: bpy.types.Scene) -> None:
    show_all()
    bpy.ops.fmqm.unit_step()
    lines, view = overlay.figure.lines, SimpleNamespace(local_view=None)

    def slices() -> list[float]:
        return [matrix.translation.x for matrix in slice_plane.placed(scene, slice_of(scene), view)]

    before, stood = shell_view.matrix_of(scene, shells_of(scene)).translation.x, slices()
    assert np.subtract(*reversed(stood)) == pytest.approx(10, abs=1e-5), "on both, as the heat map"
    scene.fmqm.look.place = "COMPARED"
    after = shell_view.matrix_of(scene, shells_of(scene)).translation.x
    assert after - before == pytest.approx(10, abs=1e-5) and slices() == stood[1:]
    assert overlay.figure.lines == pytest.approx(lines + (10, 0, 0))


def test_worst_places_are_the_chosen_rows(scene: bpy.types.Scene, measured: session.Measured) -> None:
    look = scene.fmqm.look
    show_points()
    bpy.ops.fmqm.clear()
    add_row(scene, measured, "Other")
    scene.fmqm.rows.add().error = "broken"
    scene.fmqm.row_index = 1
    assert look.worst_uid == "Other" and len(look.worst) == FEW.patches
    look.worst_index = 3  # a click in the list
    assert look.worst_index == 3 and look.focused
    scene.fmqm.row_index = 2
    assert not len(look.worst) and not look.focused


def test_each_scene_shows_its_own(scene: bpy.types.Scene, measured: session.Measured) -> None:
    show_all()
    mine = slice_of(scene)
    two = bpy.data.scenes.new("Two")
    add_row(two, measured, "Other")
    two.fmqm.look.show, two.fmqm.look.show_slice = "POINTS", True
    assert slice_of(scene) is mine and slice_of(two).uid == "Other"
    assert drawn().uid == "row" and heat.shown_in(two).uid == "Other"
    keep_as_objects(scene)
    keep_as_objects(two)
    theirs = {object_.name for object_ in scene_objects.objects(two)}
    assert len(theirs) == 4 and not theirs & {object_.name for object_ in scene_objects.objects(scene)}
    bpy.ops.fmqm.clear()
    assert not scene_objects.anything() and heat.shown_in(two) is slice_plane.shown_in(two) is None


def test_what_was_hidden_is_shown_when_asked_for(scene: bpy.types.Scene) -> None:
    show_points()
    bpy.ops.fmqm.keep()
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
        bpy.ops.fmqm.keep()
        assert cloud.visible_get(), hide


def test_kept_slice_and_shells_look_as_drawn(scene: bpy.types.Scene, measured: session.Measured) -> None:
    scene.fmqm.look.slice_offset = 30
    bpy.ops.fmqm.slice()
    bpy.ops.fmqm.shells()
    assert bpy.ops.fmqm.keep() == {"FINISHED"}
    plane = scene_objects.find_object(scene, scene_objects.SLICE)
    points = slice_points(slice_of(scene).to_frame, 128)
    into = world_matrix(measured, "REFERENCE")
    stand = np.array([plane.matrix_world @ vertex.co for vertex in plane.data.vertices])
    assert stand == pytest.approx(points @ into[:3, :3].T + into[:3, 3], abs=1e-5)
    colors = np.empty(4 * len(stand), np.float32)
    plane.data.attributes[scene_objects.COLOR].data.foreach_get("color", colors)
    assert colors.reshape(-1, 4)[:, :3] == pytest.approx(decode_srgb(slice_of(scene).picture.colors), abs=1e-6)
    shells = scene_objects.find_object(scene, scene_objects.SHELLS)
    assert len(shells.data.vertices) == 4 * len(shells_of(scene).positions)


def test_grids_face_as_their_square() -> None:
    points, triangles = slice_points(np.eye(4), 3), grid(3)
    assert len(triangles) == 8 and triangle_areas(points, triangles).sum() == pytest.approx((2 / 3) ** 2)
    assert triangle_normals(points, triangles) == pytest.approx(np.tile([0, 0, 1], (8, 1)))


def test_lengths_of_the_shells_have_the_scenes_unit(scene: bpy.types.Scene) -> None:
    bpy.ops.fmqm.shells()
    assert shells_of(scene).legend["subtitle"].endswith(" cm apart")
    scene.unit_settings.system = "NONE"
    shell_view.refresh(scene)
    assert float(shells_of(scene).legend["subtitle"].removesuffix(" apart")) > 0


def test_figure_goes_with_its_row(scene: bpy.types.Scene) -> None:
    bpy.ops.fmqm.unit_step()
    show_points()
    assert overlay.figure is not None and overlay.belongs_here(overlay.figure)
    scene.fmqm.rows.clear()  # as undo past the measurement would, which leaves the session alone
    assert session.get("row") is not None and not overlay.belongs_here(overlay.figure)
    assert heat.shown_in(scene) is None


def test_switched_off_it_leaves_nothing(scene: bpy.types.Scene) -> None:
    show_all()
    bpy.ops.fmqm.worst_step()
    fmqm_addon.unregister()
    try:
        assert not scene_objects.anything() and overlay.figure is None
    finally:
        fmqm_addon.register()
    assert not bpy.context.scene.fmqm.look.focused and bpy.context.scene.fmqm.look.show == "OFF"


def test_without_samples_it_says_measure_again(scene: bpy.types.Scene) -> None:
    show_points()
    session.clear()
    scene.fmqm.look.layer = "PATCH"  # no error: there is nobody to tell
    assert heat.shown_in(scene) is None
    scene.fmqm.look.show_slice = scene.fmqm.look.show_shells = True
    assert slice_plane.shown_in(scene) is shell_view.shown_in(scene) is None
    assert not bpy.ops.fmqm.keep.poll() and not bpy.ops.fmqm.slice.poll()
    with pytest.raises(fmqm_addon.metric.errors.FMQMError, match="press Measure Quality again"):
        measured_row(scene)
    assert bpy.ops.fmqm.clear() == {"FINISHED"}


def test_switching_layers_of_many_samples_is_quick(scene: bpy.types.Scene, measured: session.Measured) -> None:
    session.put("row", dataclasses.replace(measured, comparison=many(measured.comparison, 200_000)))
    began = time.perf_counter()
    show_points()
    print(f"built in {time.perf_counter() - began:.3f} s")
    for name in reversed(layers.LAYERS):
        began = time.perf_counter()
        scene.fmqm.look.layer = name
        print(f"{name} in {time.perf_counter() - began:.3f} s")
        assert len(point_colors()) == 200_000


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
