# SPDX-License-Identifier: GPL-3.0-or-later
"""Perceived quality against its definition in plain loops, by hand, and in whole comparisons."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from fmqm_addon.metric.evaluation import Result
from fmqm_addon.metric.features import FieldValues, colors_around, find_pairs, pairs_of_patches
from fmqm_addon.metric.geometry import Floats, Ints
from fmqm_addon.metric.perceived import (
    PERCEIVED_COLUMNS,
    RADIUS,
    color_similarities,
    facing_similarity,
    perceived_of_patches,
    shape_similarity,
)
from fmqm_addon.metric.texture import PlainColor, Texture

from .meshes import SMALL, cube, evaluate, grid, materials, mesh_arrays, moved, shaken, sphere, texture
from .oracles import perceived_by_loop, perceived_color, perceived_shape
from .test_features import KINDS, Case

few = hypothesis_settings(max_examples=10)
seeds = st.integers(0, 2**32 - 1)
cases = st.builds(Case, seeds, st.sampled_from(KINDS))


def perceived_of(positions: Floats, ref: FieldValues, dist: FieldValues, units: Ints) -> list[float]:
    """The row of one patch."""
    start = np.array([0, len(positions)])
    near = pairs_of_patches(positions, start, units, RADIUS, itself=True)
    around = colors_around(near, units, ref.channels, dist.channels)
    return perceived_of_patches(positions, start, ref, dist, units, near, around)[0].tolist()


def true_distances(case: Case) -> None:
    """SDFs as long as the way to the nearest point, and no sign of the distorted one's own."""
    for field, sign in ((case.ref, np.sign(case.ref.sdf)), (case.dist, 1.0)):
        field.sdf[:] = sign * np.linalg.norm(field.nearest - case.positions, axis=1)


# --- a whole patch ----------------------------------------------------------------------------------------


@given(cases, st.sampled_from([1.0, 0.3]))
def test_a_patch_is_its_definition_in_loops(case: Case, size: float) -> None:
    """At 0.3 a patch's samples lie close together: units of many samples."""
    case.positions *= size
    true_distances(case)
    found = perceived_of(case.positions, case.ref, case.dist, case.units)
    expected = perceived_by_loop(case.positions, case.ref, case.dist, case.units)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert all(0 <= value <= 1 for value in found)


@given(cases)
def test_a_patch_against_itself_is_exactly_1(case: Case) -> None:
    assert perceived_of(case.positions, case.ref, case.ref, case.units) == [1.0] * 5


@given(seeds, seeds)
def test_patches_together_are_the_patches_alone(one: int, other: int) -> None:
    pair = Case(one, "random"), Case(other, "few")
    start = np.cumsum([0, *(len(case.positions) for case in pair)])
    positions = np.concatenate([case.positions for case in pair])
    units = np.concatenate([case.units + first for case, first in zip(pair, start, strict=False)])
    ref, dist = (
        FieldValues(*(np.concatenate([getattr(f, n) for f in fields]) for n in ("nearest", "sdf", "channels")))
        for fields in ([case.ref for case in pair], [case.dist for case in pair])
    )
    near = pairs_of_patches(positions, start, units, RADIUS, itself=True)
    around = colors_around(near, units, ref.channels, dist.channels)
    together = perceived_of_patches(positions, start, ref, dist, units, near, around)
    alone = [perceived_of(case.positions, case.ref, case.dist, case.units) for case in pair]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


def test_a_point_between_the_surfaces_is_inside_one_of_them() -> None:
    """Left of both walls, between them, right of both: only the middle one changes sides, whatever a ray says."""
    positions = np.array([[-0.1, 0, 0], [0.05, 0, 0], [0.3, 0, 0]])
    walls = [positions * [0, 1, 1] + [x, 0, 0] for x in (0.0, 0.1)]
    sdf_r = np.array([-0.1, 0.05, 0.3])
    grey = np.full((3, 3), 0.5)
    expected = perceived_shape(sdf_r.tolist(), [-0.2, -0.05, 0.2])
    for signs in ([1, 1, 1], [-1, 1, -1]):
        dist = FieldValues(walls[1], np.array([0.2, 0.05, 0.2]) * signs, grey)
        found = perceived_of(positions, FieldValues(walls[0], sdf_r, grey), dist, np.array([0]))
        assert found[0] == pytest.approx(expected, rel=1e-12)
        assert found[1:4] == [1, 1, 1]


# --- shape ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("r", "d", "expected"),
    [
        ([1, 2, 3], [1, 2, 3], 1),
        ([-1, 1], [1, -1], 0),  # opposite is not similar
        ([1, 3], [-1, -3], 0),
        ([0, 0], [0, 0], 1),  # no spread on either side: equal means, or nothing
        ([5, 5], [5, 5], 1),
        ([5, 5], [6, 6], 0),
        ([0, 1], [2, 2], 0),
        ([2, 2], [0, 1], 0),
        ([-1, 1], [1, 3], (2 / 6) ** (1 / 3)),  # means 0 and 2, variances 1: M = (0 + 2) / (4 + 2)
        ([-1, 1], [-2, 2], 0.8 ** (1 / 3)),  # deviations 1 and 2
        ([-1, 1, -1, 1], [-1, -1, 1, 1], 0),  # nothing varies together
    ],
)
def test_shape_by_hand(r: list[float], d: list[float], expected: float) -> None:
    """Alone, and beside patches of other sizes."""
    one, more = [0.5, -1.0, 0.25], np.array([0, 3, 3 + len(r)])
    alone = shape_similarity(np.array(r, float), np.array(d, float), np.array([0, len(r)]))
    beside = shape_similarity(np.array([*one, *r], float), np.array([*one, *d], float), more)
    assert alone.tolist() == pytest.approx([expected], abs=1e-12)
    assert beside.tolist() == pytest.approx([1, expected], abs=1e-12)


# --- facing -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ref", "dist", "expected"),
    [
        ([1, 0, 0], [3, 0, 0], 1),
        ([1, 0, 0], [-2, 0, 0], 1),  # a line has no direction
        ([1, 0, 0], [0, 5, 0], 0),
        ([1, 0, 0], [1, 1, 0], 0.5),
        ([1, 0, 0], [-1, 0, 1], 0.5),
        ([1, 0, 0], [math.cos(math.radians(9)), math.sin(math.radians(9)), 0], 0.9),
        ([0, 0, 0], [0, 1, 0], 1),  # a sample on either surface counts 1
        ([0, 1, 0], [0, 0, 0], 1),
    ],
)
def test_facing_by_hand(ref: list[float], dist: list[float], expected: float) -> None:
    found = facing_similarity(np.array([ref], float), np.array([dist], float))
    assert found.tolist() == pytest.approx([expected], abs=1e-15)
    assert found[0] >= 0


# --- color and detail -------------------------------------------------------------------------------------


def near_units(positions: Floats, units: Ints) -> Any:
    return find_pairs(positions, units, RADIUS, itself=True)


def color_and_detail(positions: Floats, units: Ints, one: Floats, other: Floats) -> tuple[Floats, Floats]:
    near = near_units(positions, units)
    return color_similarities(near, colors_around(near, units, one, other))


def test_units_hold_p_and_all_that_lies_at_its_place() -> None:
    """The paper's pairs leave out distance 0; here it counts, and the radius stays open."""
    positions = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0, 0], [0.125, 0, 0], [0, np.nextafter(0.125, 0), 0]])
    units = np.array([0, 3])
    near = near_units(positions, units)
    assert near.other[near.row == 0].tolist() == [0, 1, 2, 4]
    assert near.other[near.row == 1].tolist() == [1, 3]
    assert np.array_equal(near.pick(near.distance > 0).other, find_pairs(positions, units, RADIUS).other)


@given(cases, st.sampled_from([0.2, 1.0]))
def test_color_and_detail_of_units(case: Case, size: float) -> None:
    positions = case.positions * size
    found = color_and_detail(positions, case.units, case.ref.channels, case.dist.channels)
    for k, unit in enumerate(case.units.tolist()):
        expected = perceived_color(positions, case.ref.channels, case.dist.channels, unit)
        np.testing.assert_allclose([part[:, k] for part in found], np.array(expected).T, rtol=1e-9, atol=1e-12)


def ramp(slope: float, level: float = 0.5) -> tuple[Floats, Floats]:
    """A disc of samples around the first, in the plane z = 0, and grey that grows along x."""
    angle, radius = np.meshgrid(np.arange(12) * np.pi / 6, [0.04, 0.08, 0.12])
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * radius], axis=-1).reshape(-1, 3)
    positions = np.concatenate([np.zeros((1, 3)), ring])
    return positions, np.repeat(level + slope * positions[:, :1], 3, axis=1)


def of_ramps(one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> tuple[float, float]:
    unit = np.array([0])
    color, detail = color_and_detail(one[0], unit, one[1], other[1])
    assert (color == color[0]).all() and (detail == detail[0]).all()
    return float(color[0, 0]), float(detail[0, 0])


def test_color_and_detail_of_ramps_by_hand() -> None:
    """Var x is v: slope s gives the colors s^2 v, and the ridge leaves v / (v + 1e-5) of the slope; K = 0.2304."""
    positions, _ = ramp(0)
    v = 12 / 2 * (0.04**2 + 0.08**2 + 0.12**2) / 37
    assert v == pytest.approx(positions[:, 0].var())
    c2, k, fitted = 0.0009, 0.2304, (v / (v + 1e-5)) ** 2
    for s, t in ((1.0, 1.0), (2.0, 1.0), (1.0, 0.0), (1.0, -1.0), (3.0, -0.5)):
        color, detail = of_ramps(ramp(s), ramp(t))
        assert color == pytest.approx(max(0, (2 * s * t * v + c2) / ((s * s + t * t) * v + c2)), rel=1e-12)
        assert detail == pytest.approx(max(0, (2 * s * t * fitted + k) / ((s * s + t * t) * fitted + k)), rel=1e-12)
    assert of_ramps(ramp(0, 0.2), ramp(0, 0.6)) == pytest.approx(((0.24 + 1e-4) / (0.4 + 1e-4), 1))


def test_opposite_contrast_is_0() -> None:
    color, detail = of_ramps(ramp(5), ramp(-5))
    assert (color, detail) == (0, 0)


def test_what_nobody_sees_hardly_counts() -> None:
    """Noise of one step of an 8-bit image on a plain color."""
    positions, plain = ramp(0)
    noise = np.random.default_rng(0).integers(-1, 2, plain.shape) / 255
    unit = np.array([0])
    color, detail = color_and_detail(positions, unit, plain, plain + noise)
    assert color.min() > 0.98 and detail.min() > 0.99


@given(seeds, st.floats(-9, -2))
def test_moments_of_a_nearly_plain_unit_do_not_cancel(seed: int, exponent: float) -> None:
    """Equal up to rounding is 1 up to rounding, and the order of meshes does not count."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(0, 0.06, (20, 3))
    a, b = 0.9 + rng.normal(0, 10**exponent, (2, 20, 3))
    unit = np.array([3])
    found, turned = (np.array(color_and_detail(positions, unit, *pair)) for pair in ((a, b), (b, a)))
    np.testing.assert_allclose(found, turned, rtol=1e-12)
    np.testing.assert_allclose(found[:, :, 0].T, perceived_color(positions, a, b, 3), rtol=1e-10)


# --- whole comparisons ------------------------------------------------------------------------------------


def pair(amount: float = 0.02) -> tuple[Any, Any]:
    reference = mesh_arrays(sphere(), (texture(1),), "ref")
    return reference, replace(shaken(reference, amount), materials=materials(texture(2)), name="dist")


VARIANTS: list[dict[str, Any]] = [
    {},
    {"color_space": "lab"},
    {"pooling": "arithmetic"},
    {"radius": 0.3, "gradient_radius": math.inf},
    {"normal_threshold": 0.5, "tangent_threshold": 0.3},
]


@pytest.mark.parametrize("variant", VARIANTS, ids=str)
def test_no_setting_changes_what_it_is(variant: dict[str, Any]) -> None:
    """RGB, 0.125 and the geometric mean, whatever the paper's features take; from what a result holds."""
    settings = replace(SMALL, **variant)
    result = evaluate(*pair(), settings)
    assert np.array_equal(result.patch_perceived, evaluate(*pair(), SMALL).patch_perceived)
    for k, patch in enumerate(result.patches):
        here = slice(result.samples.start[k], result.samples.start[k + 1])
        ref, dist = (
            FieldValues(f.nearest[here] / patch.diagonal, f.sdf[here] / patch.diagonal, f.ncf[here].astype(float))
            for f in (result.ref, result.dist)
        )
        expected = perceived_by_loop(
            result.samples.positions[here] / patch.diagonal, ref, dist, np.flatnonzero(result.samples.unit[here])
        )
        np.testing.assert_allclose(result.patch_perceived[k], expected, rtol=1e-9, atol=1e-9)


def test_a_pair_has_the_means_and_the_worst_tenth() -> None:
    result = evaluate(*pair())
    assert result.patch_perceived.shape == (10, len(PERCEIVED_COLUMNS))
    perceived = result.perceived
    assert [*perceived[1:5], perceived.score] == result.patch_perceived.mean(axis=0).tolist()
    features = result.patch_perceived[:, :4]
    np.testing.assert_allclose(result.patch_perceived[:, 4], features.prod(axis=1) ** 0.25, rtol=1e-15)
    ranked = np.sort(result.patch_perceived[:, 4])
    assert result.perceived.p10 == pytest.approx(0.1 * ranked[0] + 0.9 * ranked[1], rel=1e-12)  # rank 0.1 * 9


def check_same(one: Result, other: Result, atol: float) -> None:
    np.testing.assert_allclose(other.perceived[:5], one.perceived[:5], rtol=0, atol=atol)
    assert other.perceived.p10 == pytest.approx(one.perceived.p10, abs=5 * atol)


@pytest.mark.parametrize("scale", [1e-5, 1 / 3, 1e5])
@pytest.mark.parametrize("diagonals", [0.0, 1e5])
def test_scaled_and_moved_pairs_score_the_same(scale: float, diagonals: float) -> None:
    reference, distorted = pair()
    shift = diagonals * np.linalg.norm(np.ptp(reference.positions, axis=0)) * scale * np.array([0.6, -0.64, 0.48])
    there = evaluate(moved(reference, scale, shift), moved(distorted, scale, shift))
    check_same(evaluate(reference, distorted), there, 2e-3)


@few
@given(seeds)
def test_itself_is_exactly_1_for_random_soups(seed: int) -> None:
    """Triangles that cross, touch and overlap; rays say little about inside there."""
    rng = np.random.default_rng(seed)
    positions, triangles = rng.integers(0, 4, (12, 3)).astype(float), rng.integers(0, 12, (25, 3))
    pixels = rng.random((3, 5, 3), np.float32)
    colors = (Texture(pixels, "mirror"), Texture(pixels, "clip", "closest"), PlainColor((0, 0, 0)))
    mesh = replace(mesh_arrays((positions, triangles), colors), corners=rng.normal(0, 2, (25, 3, 2)))
    result = evaluate(mesh, mesh, replace(SMALL, sigma=[0.05, 0.0, 2.0][seed % 3]))
    assert (result.patch_perceived == 1).all() and result.perceived.p10 == 1


@few
@given(seeds, st.sampled_from(["cube", "grid"]), st.sampled_from([0.0, 0.05, 3.0]))
def test_any_pair_is_in_range(seed: int, name: str, sigma: float) -> None:
    reference = mesh_arrays({"cube": cube(2), "grid": grid(4, 3)}[name], (texture(1),))
    distorted = replace(shaken(reference, 0.2, seed), materials=materials(PlainColor((0, 0, 0))))
    table = evaluate(reference, distorted, replace(SMALL, sigma=sigma)).patch_perceived
    assert np.isfinite(table).all() and (table >= 0).all() and (table <= 1).all()


def test_each_feature_sees_its_own() -> None:
    """A shaken surface in the same colors, and another texture on the same surface."""
    reference, distorted = pair()
    bent, painted = (
        evaluate(reference, shaken(reference, 0.02)),
        evaluate(reference, replace(distorted, positions=reference.positions)),
    )
    assert bent.perceived.shape < 1 and bent.perceived.facing < 1
    *surface, color, detail = painted.perceived[1:5]
    assert surface == [1, 1] and color < 0.9 and detail < 0.9
