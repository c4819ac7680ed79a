# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole comparisons: what must hold whatever the meshes are."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from fmqm_addon.metric.colorspace import channels
from fmqm_addon.metric.evaluation import COLUMNS, Evaluation, Result, Scores, fmqm
from fmqm_addon.metric.features import FieldValues, find_pairs, pool_features, unit_cosine
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.stepper import Stepper
from fmqm_addon.metric.surface import MeshArrays, prepare_surface
from fmqm_addon.metric.texture import PlainColor, Texture

from .meshes import (
    SMALL,
    TETRAHEDRON,
    TRIANGLE,
    cube,
    evaluate,
    grid,
    icosahedron,
    materials,
    mesh_arrays,
    moved,
    shaken,
    sphere,
    texture,
)
from .oracles import NaiveQuery, features_by_loop

few = hypothesis_settings(max_examples=10)
seeds = st.integers(0, 2**32 - 1)

TWO_TRIANGLES = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 9, 9], [10, 9, 9], [9, 10, 9.5]], float),
    np.arange(6).reshape(2, 3),
)
SLIVERS = (
    np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-6, 0], [0.3, -1e-9, 0.1], [0.5, 0.5, 0]]),
    np.array([[0, 1, 2], [1, 0, 3], [0, 2, 4]]),
)
SHAPES = {
    "triangle": TRIANGLE,
    "tetrahedron": TETRAHEDRON,
    "cube": cube(2),
    "icosahedron": icosahedron(),
    "grid": grid(4, 3),
    "loose parts": TWO_TRIANGLES,
    "slivers": SLIVERS,
}


def textured(name: str) -> MeshArrays:
    return mesh_arrays(
        SHAPES[name], (texture(1), PlainColor((0.9, 0.1, 0.4))) if name == "cube" else (texture(1),), name
    )


def pair(seed: int = 0, amount: float = 0.02) -> tuple[MeshArrays, MeshArrays]:
    """A sphere, and the same one shaken, in other colors."""
    reference = mesh_arrays(sphere(), (texture(1),), "ref")
    return reference, replace(shaken(reference, amount, seed), materials=materials(texture(2)), name="dist")


def same_bits(one: Result, other: Result) -> bool:
    fields = [
        (r.scores, r.patch_scores, r.patch_perceived, r.samples.positions, r.ref.sdf, r.dist.sdf, r.dist.ncf)
        for r in (one, other)
    ]
    return all(np.array_equal(a, b) for a, b in zip(*fields, strict=True))


def check_range(result: Result) -> None:
    for table in (np.array(result.scores), result.patch_scores, np.array(result.perceived), result.patch_perceived):
        assert np.isfinite(table).all()
        assert (table >= 0).all()
        assert (table <= 1).all()


# --- a surface against itself -----------------------------------------------------------------------------

VARIANTS: list[dict[str, Any]] = [
    {},
    {"color_space": "lab"},
    {"pooling": "arithmetic"},
    {"gradient_radius": math.inf},
    {"radius": math.inf, "color_space": "lab"},
    {"sigma": 0},
    {"sigma": 0, "gradient_radius": math.inf, "color_space": "lab"},
    {"sigma": 2.0},
    {"centers": "random", "seed": 3},
    {"samples": 32, "patches": 1, "color_units": 1},
    {"samples": 32 * 30, "patches": 30},
    {"normal_threshold": 0, "tangent_threshold": 1},
    {"normal_threshold": 1, "tangent_threshold": 0},
]


@pytest.mark.parametrize("variant", VARIANTS, ids=str)
@pytest.mark.parametrize("name", ["cube", "grid"])
def test_itself_is_exactly_1_under_every_option(name: str, variant: dict[str, Any]) -> None:
    mesh = textured(name)
    result = evaluate(mesh, mesh, replace(SMALL, **variant))
    assert [*result.scores, *result.perceived, result.fmqm_p10] == [1.0] * 12
    assert (result.patch_scores == 1.0).all() and (result.patch_perceived == 1.0).all()


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("scale", [1e-9, 1, 1e9])
def test_itself_is_exactly_1_for_every_shape(name: str, scale: float) -> None:
    """Open, closed, loose, one triangle, slivers; fewer vertices than patches; in any unit."""
    mesh = moved(textured(name), scale, np.array([3.0, -2.0, 1.0]) * scale)
    result = evaluate(mesh, mesh, Settings(samples=640, patches=20, color_units=10))
    assert [*result.scores, *result.perceived, result.fmqm_p10] == [1.0] * 12
    assert len(result.patches) <= 20


@few
@given(seeds)
def test_itself_is_exactly_1_for_random_soups(seed: int) -> None:
    """Triangles that cross, touch and overlap, some of them degenerate, with float32 and plain colors."""
    rng = np.random.default_rng(seed)
    positions = rng.integers(0, 4, (12, 3)).astype(float)
    triangles = rng.integers(0, 12, (25, 3))
    pixels = rng.random((3, 5, 3), np.float32)
    colors = (Texture(pixels, "mirror"), Texture(pixels, "clip", "closest"), PlainColor((0, 0, 0)))
    mesh = replace(mesh_arrays((positions, triangles), colors), corners=rng.normal(0, 2, (25, 3, 2)))
    result = evaluate(mesh, mesh, replace(SMALL, gradient_radius=[0.125, math.inf][seed % 2]))
    assert list(result.scores) == [1.0] * 5


def test_itself_in_another_order_is_1() -> None:
    """The same surface from other arrays: vertices split at every corner, triangles turned and shuffled."""
    mesh = textured("cube")
    rng = np.random.default_rng(0)
    order = rng.permutation(len(mesh.triangles))
    corners = np.stack([np.roll(np.arange(3), rng.integers(3)) for _ in order])
    other = MeshArrays(
        "other",
        mesh.positions[np.take_along_axis(mesh.triangles[order], corners, 1)].reshape(-1, 3),
        np.arange(3 * len(order)).reshape(-1, 3),
        np.take_along_axis(mesh.corners[order], corners[..., None], 1),
        mesh.material[order],
        mesh.materials,
    )
    np.testing.assert_allclose(evaluate(mesh, other).scores, 1, atol=1e-4)


# --- range ------------------------------------------------------------------------------------------------


@few
@given(seeds, st.sampled_from(sorted(SHAPES)), st.sampled_from(sorted(SHAPES)), st.sampled_from(VARIANTS))
def test_scores_of_any_pair_are_in_range(seed: int, one: str, other: str, variant: dict[str, Any]) -> None:
    distorted = replace(
        shaken(textured(other), 0.1, seed),
        materials=materials(PlainColor((0, 0, 0)), texture(3))[: len(textured(other).materials)],
    )
    check_range(evaluate(textured(one), distorted, replace(SMALL, **variant)))


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 1e3, 1e9])
@pytest.mark.parametrize("shift", [0.0, 1e3])
def test_a_distorted_mesh_of_any_size_and_place(scale: float, shift: float) -> None:
    reference = textured("cube")
    check_range(evaluate(reference, moved(reference, scale, np.array([shift, 0.5, 0.5]))))


@pytest.mark.parametrize(
    ("one", "other"), [((0.5, 0.5, 0.5), (0.5, 0.5, 0.5)), ((0, 0, 0), (0, 0, 0)), ((0, 0, 0), (1, 1, 1))]
)
@pytest.mark.parametrize("color_space", ["rgb", "lab"])
def test_constant_colors(one: tuple[float, float, float], other: tuple[float, float, float], color_space: str) -> None:
    """0/0 is 1: equal plain colors cannot differ; no gradient on either side is no difference."""
    reference, distorted = (mesh_arrays(cube(2), (PlainColor(rgb),)) for rgb in (one, other))
    result = evaluate(reference, distorted, replace(SMALL, color_space=color_space))
    geometry, gradient = list(result.scores[:2]), result.scores[3]
    assert geometry == [1, 1]
    assert gradient == 1
    assert (result.scores[2] == 1) == (one == other)
    check_range(result)


# --- determinism and independence -------------------------------------------------------------------------


def test_prepared_once_compared_twice() -> None:
    """One preparation serves any number of comparisons, and none leaves a trace."""
    reference, distorted = pair()
    ref = prepare_surface(reference, NaiveQuery)
    evaluation = Evaluation(ref, SMALL)
    evaluation.prepare().run()
    surfaces = [prepare_surface(mesh, NaiveQuery, ref.frame) for mesh in (distorted, reference, distorted)]
    first, itself, again = (evaluation.compare(each).run() for each in surfaces)
    assert same_bits(first, again)
    assert list(itself.scores) == [1.0] * 5
    assert same_bits(first, evaluate(reference, distorted))


def test_the_seed_decides_the_samples() -> None:
    reference, distorted = pair()
    assert same_bits(evaluate(reference, distorted), evaluate(reference, distorted, SMALL.with_seed(0)))
    other = evaluate(reference, distorted, SMALL.with_seed(1))
    assert not same_bits(evaluate(reference, distorted), other)
    np.testing.assert_allclose(other.scores, evaluate(reference, distorted).scores, atol=0.1)


@pytest.mark.parametrize("centers", ["fps", "random"])
@pytest.mark.parametrize("scored", [1, 4, 10, 50])
def test_a_subset_is_the_first_rows_of_the_whole(centers: str, scored: int) -> None:
    reference, distorted = pair()
    settings = replace(SMALL, centers=centers)
    whole = evaluate(reference, distorted, settings)
    part = evaluate(reference, distorted, replace(settings, scored_patches=scored))
    rows = min(scored, 10)
    assert np.array_equal(part.patch_scores, whole.patch_scores[:rows])
    assert np.array_equal(part.patch_perceived, whole.patch_perceived[:rows])
    assert np.array_equal(part.patch_centers, whole.patch_centers[:rows])
    assert np.array_equal(part.samples.positions, whole.samples.positions[: whole.samples.start[rows]])


def test_scores_are_the_means_of_the_patch_table() -> None:
    for pooling in ("geometric", "arithmetic"):
        result = evaluate(*pair(), replace(SMALL, pooling=pooling))
        np.testing.assert_allclose(result.scores, result.patch_scores.mean(axis=0), rtol=1e-15)
        assert np.array_equal(result.patch_scores[:, 4], pool_features(result.patch_scores[:, :4], pooling))
        assert result.patch_scores.shape == (10, len(COLUMNS))


def test_fmqm_needs_arrays_and_any_query() -> None:
    """From numpy arrays and a query without Blender to the five numbers, which have the paper's names."""
    reference, distorted = pair()
    scores = fmqm(reference, distorted, SMALL, NaiveQuery)
    assert scores == evaluate(reference, distorted).scores
    assert Scores._fields == COLUMNS == ("geoSSIM", "geoGraSSIM", "colorSSIM", "colorGraSSIM", "FMQM")
    assert [getattr(scores, name) for name in COLUMNS] == list(scores)
    assert {type(score) for score in scores} == {float} and 0 < scores.FMQM < 1
    assert fmqm(reference, moved(reference, 1, np.zeros(3)), SMALL, NaiveQuery) == Scores(1, 1, 1, 1, 1)


@pytest.mark.parametrize("color_space", ["rgb", "lab"])
@pytest.mark.parametrize("radius", [0.125, math.inf])
def test_the_patch_table_follows_from_the_saved_fields(color_space: str, radius: float) -> None:
    """From what a result holds, the formulas give its table again: lengths in each patch's own diagonal."""
    settings = Settings(
        samples=320,
        patches=5,
        color_units=12,
        color_space=color_space,
        gradient_radius=radius,
        radius=0.3,
        tangent_threshold=0.2,
    )
    result = evaluate(*pair(), settings)
    samples = result.samples
    for k, patch in enumerate(result.patches):
        here = slice(samples.start[k], samples.start[k + 1])
        ref, dist = (
            FieldValues(
                fields.nearest[here] / patch.diagonal,
                fields.sdf[here] / patch.diagonal,
                channels(fields.ncf[here], color_space),
            )
            for fields in (result.ref, result.dist)
        )
        positions, units = samples.positions[here] / patch.diagonal, np.flatnonzero(samples.unit[here])
        weights = np.array([6.0, 1.0, 1.0] if color_space == "lab" else [1.0, 1.0, 1.0])
        expected = features_by_loop(positions, ref, dist, units, weights, settings)
        np.testing.assert_allclose(result.patch_scores[k, :4], expected, atol=2e-5)


# --- units and places -------------------------------------------------------------------------------------


@pytest.mark.parametrize("scale", [1e-5, 1e-2, 1 / 3, 10, 1e5])
@pytest.mark.parametrize("diagonals", [0.0, 1.0, 1e3, 1e5])
def test_scaled_and_moved_pairs_score_the_same(scale: float, diagonals: float) -> None:
    reference, distorted = pair()
    shift = diagonals * np.linalg.norm(np.ptp(reference.positions, axis=0)) * scale * np.array([0.6, -0.64, 0.48])
    here = evaluate(reference, distorted)
    there = evaluate(moved(reference, scale, shift), moved(distorted, scale, shift))
    np.testing.assert_allclose(there.scores, here.scores, rtol=0, atol=2e-3)


@pytest.mark.parametrize("diagonals", [1e3, 1e5])
def test_moved_regular_meshes_keep_their_patches(diagonals: float) -> None:
    """Rows that are level only up to rounding: that must not decide which vertex is which."""
    positions, triangles = grid(12, 12)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    reference = mesh_arrays((positions @ turn.T @ turn, triangles), (texture(1),))
    distorted = replace(shaken(reference, 0.01), materials=materials(texture(2)))
    shift = diagonals * 17 * np.array([0.6, -0.64, 0.48])
    here = evaluate(reference, distorted)
    there = evaluate(moved(reference, 1, shift), moved(distorted, 1, shift))
    np.testing.assert_allclose(there.patch_centers, here.patch_centers, atol=1e-9)
    np.testing.assert_allclose(there.scores, here.scores, rtol=0, atol=2e-3)


def test_a_turned_pair_is_still_a_good_pair() -> None:
    """The box decides L, so a turn changes the numbers, but not their order."""
    reference, distorted = pair(amount=0.03)
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    ref, dist = (replace(mesh, positions=mesh.positions @ turn.T) for mesh in (reference, distorted))
    np.testing.assert_allclose(evaluate(ref, dist).scores, evaluate(reference, distorted).scores, atol=0.1)


# --- each option does what it names -----------------------------------------------------------------------


def test_samples_sets_the_density() -> None:
    reference, distorted = pair()
    counts = [len(evaluate(reference, distorted, replace(SMALL, samples=n)).samples.positions) for n in (640, 1280)]
    assert counts[1] == pytest.approx(2 * counts[0], rel=0.02)


@pytest.mark.parametrize("patches", [1, 5, 20])
def test_patches_sets_their_number_and_size(patches: int) -> None:
    result = evaluate(*pair(), Settings(samples=640, patches=patches))
    assert len(result.patches) == len(result.patch_scores) == patches
    assert all(patch.area >= result.patch_mesh.area / patches * (1 - 1e-8) for patch in result.patches)


def test_sigma_scales_the_distances() -> None:
    """Over a flat reference |SDF| is the offset itself."""
    mesh = mesh_arrays(grid(4, 4))
    near, far = (evaluate(mesh, mesh, replace(SMALL, sigma=sigma)) for sigma in (0.01, 0.04))
    inner = np.linalg.norm(near.samples.positions[:, :2], axis=1) < 0.1
    np.testing.assert_allclose(np.abs(near.ref.sdf[inner]), np.abs(near.samples.offset[inner]), atol=1e-9)
    np.testing.assert_allclose(np.abs(far.ref.sdf[inner]), 4 * np.abs(near.ref.sdf[inner]), atol=1e-9)
    flat = evaluate(mesh, mesh, replace(SMALL, sigma=0))
    assert (flat.ref.sdf == 0).all()


def pair_counts(settings: Settings) -> tuple[int, int, int]:
    """How many pairs the units of the first patch have, and how many are normal and tangent."""
    result = evaluate(*pair(), settings)
    here = slice(0, result.samples.start[1])
    length = result.patches[0].diagonal
    positions, nearest = result.samples.positions[here] / length, result.ref.nearest[here] / length
    units = np.flatnonzero(result.samples.unit[here])
    pairs = find_pairs(positions, units, settings.radius)
    along = unit_cosine(pairs, units, nearest - positions)
    return len(along), int((along > settings.normal_threshold).sum()), int((along < settings.tangent_threshold).sum())


def test_radius_and_thresholds_choose_the_members() -> None:
    every, normal, tangent = pair_counts(SMALL)
    assert pair_counts(replace(SMALL, radius=0.25))[0] > every
    assert pair_counts(replace(SMALL, normal_threshold=0.5))[1] > normal
    assert pair_counts(replace(SMALL, tangent_threshold=0.2))[2] > tangent


@pytest.mark.parametrize(
    ("variant", "changed"),
    [
        ({"radius": 0.3}, (False, False, True, False)),
        ({"normal_threshold": 0.5}, (False, False, True, False)),
        ({"tangent_threshold": 0.5}, (False, False, True, True)),
        ({"gradient_radius": math.inf}, (False, False, False, True)),
        ({"color_units": 40}, (False, False, True, True)),
        ({"color_space": "lab"}, (False, False, True, True)),
        ({"pooling": "arithmetic"}, (False, False, False, False)),
        ({"sigma": 0.1}, (True, True, True, True)),
        ({"seed": 5}, (True, True, True, True)),
    ],
    ids=str,
)
def test_an_option_changes_its_own_features_and_no_other(variant: dict[str, Any], changed: tuple[bool, ...]) -> None:
    base, other = (evaluate(*pair(), settings) for settings in (SMALL, replace(SMALL, **variant)))
    assert tuple(a != b for a, b in zip(base.scores[:4], other.scores[:4], strict=True)) == changed
    assert base.scores[4] != other.scores[4]


def test_color_units_sets_their_number() -> None:
    for wanted in (1, 13, 10**6):
        result = evaluate(*pair(), replace(SMALL, color_units=wanted))
        counts = np.add.reduceat(result.samples.unit, result.samples.start[:-1])
        assert counts.tolist() == np.minimum(wanted, np.diff(result.samples.start)).tolist()


def test_arithmetic_pooling_is_at_least_geometric() -> None:
    geometric, arithmetic = (evaluate(*pair(), replace(SMALL, pooling=p)) for p in ("geometric", "arithmetic"))
    assert np.array_equal(geometric.patch_scores[:, :4], arithmetic.patch_scores[:, :4])
    assert (arithmetic.patch_scores[:, 4] > geometric.patch_scores[:, 4]).all()


def test_random_centers_are_seeded_and_not_the_farthest() -> None:
    runs = [
        evaluate(*pair(), replace(SMALL, centers=c, seed=s))
        for c, s in (("fps", 0), ("random", 0), ("random", 0), ("random", 1))
    ]
    centers = [[patch.center for patch in run.patches] for run in runs]
    assert centers[1] == centers[2]
    assert len({tuple(row) for row in centers}) == 3


@pytest.mark.parametrize("amounts", [(0.002, 0.01, 0.05)])
def test_more_distortion_scores_less(amounts: tuple[float, ...]) -> None:
    """Shaken geometry lowers the geometry, a noisier texture the color."""
    reference, _ = pair()
    geometry = [evaluate(reference, shaken(reference, amount)).scores for amount in amounts]
    assert geometry[0][0] > geometry[1][0] > geometry[2][0]
    assert geometry[0][1] > geometry[1][1] > geometry[2][1]
    pixels = reference.materials[0].color.pixels.astype(float)  # type: ignore[union-attr]
    noise = np.random.default_rng(0).normal(0, 1, pixels.shape)
    color = []
    for amount in (3, 30, 200):
        noisy = Texture((pixels + amount * noise).clip(0, 255).astype(np.uint8))
        color.append(evaluate(reference, replace(reference, materials=materials(noisy))).scores)
    assert color[0][2] > color[1][2] > color[2][2]
    assert color[0][3] > color[1][3] > color[2][3]
    assert all(list(scores[:2]) == [1, 1] for scores in color)


# --- warnings, frames and the stepper ---------------------------------------------------------------------


def test_warnings_and_notes_name_what_was_done() -> None:
    split = evaluate(textured("triangle"), textured("triangle"))
    assert any("3 vertices are too few for 10 patches" in note for note in split.notes) and not split.warnings
    loose = evaluate(textured("loose parts"), textured("loose parts"), Settings(samples=640, patches=1))
    assert [patch.extended for patch in loose.patches] == [True] and not loose.warnings
    assert evaluate(*pair()).warnings == ()
    reference, distorted = pair()
    broken = replace(distorted, triangles=np.concatenate([distorted.triangles[:-1], [[0, 0, 1]]]), warnings=("seen",))
    result = evaluate(replace(reference, warnings=("seen",)), broken)
    assert [warning for warning in result.warnings if warning == "seen"] == ["seen"]
    assert any(note.startswith("dist: 1 of 80 triangles") for note in result.notes)


@pytest.mark.parametrize(("patches", "scored", "split"), [(12, None, False), (12, 40, False), (13, 1, True)])
def test_all_patches_must_find_a_vertex_and_not_the_scored_ones(patches: int, scored: int | None, split: bool) -> None:
    mesh = textured("icosahedron")
    result = evaluate(mesh, mesh, Settings(samples=640, patches=patches, scored_patches=scored))
    assert result.patch_mesh.was_split == split == bool(result.notes)


def test_the_distorted_surface_must_share_the_frame() -> None:
    ref, other = (prepare_surface(mesh, NaiveQuery) for mesh in pair())
    evaluation = Evaluation(ref, SMALL)
    with pytest.raises(RuntimeError, match="prepare"):
        evaluation.compare(prepare_surface(pair()[1], NaiveQuery, ref.frame))
    evaluation.prepare().run()
    with pytest.raises(ValueError, match="frame"):
        evaluation.compare(other)


def test_progress_grows_from_0_to_1() -> None:
    reference, distorted = pair()
    ref = prepare_surface(reference, NaiveQuery)
    evaluation = Evaluation(ref, SMALL)
    check_progress(evaluation.prepare())
    check_progress(evaluation.compare(prepare_surface(distorted, NaiveQuery, ref.frame)))


def check_progress(stepper: Stepper[Any]) -> None:
    done = [0.0]
    while stepper.step():
        done.append(stepper.progress.done)
        assert stepper.progress.stage
    assert done == sorted(done)
    assert done[-1] == pytest.approx(1)
    assert len(done) > 5
    assert all(seconds >= 0 for seconds in stepper.seconds.values())


def test_a_canceled_preparation_leaves_nothing_prepared() -> None:
    ref = prepare_surface(pair()[0], NaiveQuery)
    evaluation = Evaluation(ref, SMALL)
    stepper = evaluation.prepare()
    stepper.step()
    stepper.cancel()
    with pytest.raises(RuntimeError, match="prepare"):
        evaluation.compare(ref)
