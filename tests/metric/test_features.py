# SPDX-License-Identifier: GPL-3.0-or-later
"""The four similarities (V-E) against the formulas of docs/metric.md in plain loops, and by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fmqm_addon.metric.features import (
    FieldValues,
    Gradient,
    Pairs,
    color_gradient,
    colors_around,
    features_of_patches,
    find_pairs,
    geometry_gradient_similarity,
    gradient_similarity,
    pairs_of_patches,
    pool_features,
    similarity,
    similarity_of_units,
    unit_cosine,
)
from fmqm_addon.metric.geometry import Floats, Ints
from fmqm_addon.metric.settings import Settings

from .oracles import (
    features_by_loop,
    gradient_cosines,
    s_of,
    steepest,
    unit_members,
)

seeds = st.integers(0, 2**32 - 1)
RGB, LAB = np.ones(3), np.array([6.0, 1.0, 1.0])
KINDS = ("random", "coincident", "on surface", "one color", "same", "plain reference", "few")


class Case:
    """A patch of n samples with both meshes' fields, in patch diagonals, and some color units."""

    def __init__(self, seed: int, kind: str) -> None:
        rng = np.random.default_rng(seed)
        n = int(rng.integers(1, 5)) if kind == "few" else int(rng.integers(5, 40))
        self.positions = rng.uniform(-0.3, 0.3, (n, 3)) * rng.uniform(0.2, 1, 3)
        if kind == "coincident":
            self.positions = self.positions[rng.integers(0, n, n)]
        self.units = np.sort(rng.choice(n, int(rng.integers(1, n + 1)), replace=False))
        self.ref, self.dist = (self.field(rng, kind) for _ in range(2))
        if kind == "same":
            self.dist = self.ref
        if kind == "plain reference":
            self.ref.channels[:] = 0.25

    def field(self, rng: np.random.Generator, kind: str) -> FieldValues:
        n = len(self.positions)
        nearest = self.positions + rng.normal(0, 0.05, (n, 3))
        if kind == "on surface":
            on = rng.random(n) < 0.5
            nearest[on] = self.positions[on]
        sdf = np.linalg.norm(nearest - self.positions, axis=1) * rng.choice([-1, 1], n)
        channels = rng.random((n, 3))
        if kind == "one color":
            channels[:] = channels[0]
        return FieldValues(nearest, sdf, channels.astype(np.float32).astype(np.float64))

    def towards(self, field: FieldValues) -> Floats:
        return field.nearest - self.positions


cases = st.builds(Case, seeds, st.sampled_from(KINDS))


def members_by_unit(pairs: Pairs, units: Ints) -> list[list[int]]:
    return [pairs.other[pairs.row == k].tolist() for k in range(len(units))]


def similarity_of(pairs: Pairs, units: Ints, ref: FieldValues, dist: FieldValues) -> Floats:
    """Of units with all their pairs."""
    around = colors_around(pairs, units, ref.channels, dist.channels)
    return similarity_of_units(pairs, np.arange(len(pairs.other)), around)


def gradient_of(pairs: Pairs, units: Ints, channels: Floats) -> Gradient:
    """Of units with all their pairs."""
    return color_gradient(pairs, np.arange(len(pairs.other)), colors_around(pairs, units, channels, channels).ref)


# --- color units ------------------------------------------------------------------------------------------


@given(cases, st.sampled_from([0.05, 0.125, 0.3, math.inf]), st.floats(0.3, 0.97), st.floats(0.03, 0.6))
def test_members_of_the_units(case: Case, radius: float, normal: float, tangent: float) -> None:
    """0 < |pp'| < r, and |cos(pp_n, pp')| above or below its threshold; 0 where p = p_n."""
    towards = case.towards(case.ref)
    pairs = find_pairs(case.positions, case.units, radius)
    along = unit_cosine(pairs, case.units, towards)
    above = members_by_unit(pairs.pick(along > normal), case.units)
    below = members_by_unit(pairs.pick(along < tangent), case.units)
    for k, unit in enumerate(case.units.tolist()):
        assert above[k] == unit_members(case.positions, towards, unit, radius, above=normal)
        assert below[k] == unit_members(case.positions, towards, unit, radius, below=tangent)


@given(cases)
def test_pairs_hold_what_they_say(case: Case) -> None:
    pairs = find_pairs(case.positions, case.units, 0.2)
    assert (np.diff(pairs.row) >= 0).all(), "unit after unit"
    offset = case.positions[pairs.other] - case.positions[case.units[pairs.row]]
    assert np.array_equal(pairs.offset, offset)
    np.testing.assert_allclose(pairs.distance, np.linalg.norm(offset, axis=1), rtol=1e-14)


def test_the_radius_is_open_and_zero_distance_is_left_out() -> None:
    positions = np.array([[0, 0, 0], [0.5, 0, 0], [0, 0.25, 0], [0, 0, 0], [0, 0, 0.499]])
    pairs = find_pairs(positions, np.array([0]), 0.5)
    assert pairs.other.tolist() == [2, 4]
    assert find_pairs(positions, np.array([0]), math.inf).other.tolist() == [1, 2, 4]


def near_the_radius(spread: float) -> tuple[Floats, Ints, list[list[int]]]:
    """Hundred units with two neighbors each, one just inside the radius of 0.125 and one just outside."""
    rng = np.random.default_rng(0)
    centers, direction = rng.normal(0, spread, (100, 3)), rng.normal(size=(100, 3))
    direction *= 0.125 / np.linalg.norm(direction, axis=1, keepdims=True)
    positions = np.concatenate([centers, centers + direction * (1 - 1e-7), centers + direction * (1 + 1e-7)])
    units = np.arange(100)
    towards = np.zeros_like(positions)
    return positions, units, [unit_members(positions, towards, unit, 0.125, below=1) for unit in units.tolist()]


@pytest.mark.parametrize("spread", [0.1, 1, 10, 1000])
def test_the_radius_is_exact(spread: float) -> None:
    """Any sigma is allowed, so samples may lie many diagonals apart."""
    positions, units, expected = near_the_radius(spread)
    assert members_by_unit(find_pairs(positions, units, 0.125), units) == expected


def test_units_by_hand() -> None:
    """p is 0.1 above its nearest point: what lies above is normal, what lies beside is tangent, the rest neither."""
    positions = np.array([[0, 0, 0], [0, 0, 0.1], [0.1, 0, 0], [0.1, 0, 0.1], [0, 0.01, -0.1], [0.1, 0.1, 0.002]])
    towards = np.tile([0.0, 0.0, -0.1], (6, 1))
    unit = np.array([0])
    pairs = find_pairs(positions, unit, math.inf)
    along = unit_cosine(pairs, unit, towards)
    np.testing.assert_allclose(
        along, [1, 0, 1 / np.sqrt(2), 0.1 / np.hypot(0.1, 0.01), 0.002 / np.hypot(np.hypot(0.1, 0.1), 0.002)]
    )
    assert pairs.other[along > 0.95].tolist() == [1, 4]
    assert pairs.other[along < 0.05].tolist() == [2, 5]
    assert unit_cosine(pairs, unit, np.zeros((6, 3))).tolist() == [0] * 5, "on the surface every direction is tangent"


# --- s(a, b) ----------------------------------------------------------------------------------------------


def of_samples(a: Floats, b: Floats, epsilon: float) -> float:
    """The similarity of two plain samples, by way of their moments."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    moments = (a.mean(), b.mean(), a.var(), b.var(), ((a - a.mean()) * (b - b.mean())).mean())
    mean_a, mean_b, var_a, var_b, cov = (np.asarray(moment) for moment in moments)
    return float(similarity(mean_a, mean_b, var_a, var_b, cov, epsilon))


@given(seeds, st.integers(1, 30), st.sampled_from([1e-9, 1e-3, 1, 1e3]), st.sampled_from([1e-12, 1e-10]))
def test_similarity_is_s(seed: int, n: int, scale: float, epsilon: float) -> None:
    a, b = np.random.default_rng(seed).normal(seed % 3 - 1, 1, (2, n)) * scale
    found = of_samples(a, b, epsilon)
    assert found == pytest.approx(s_of(a.tolist(), b.tolist(), epsilon), rel=1e-6)
    assert 0 <= found <= 1


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ([1, 2, 3], [1, 2, 3], 1),
        ([0, 0], [0, 0], 1),  # 0/0 is 1
        ([5, 5], [5, 5], 1),
        ([-1, 1], [1, -1], 1),  # the covariance is taken as an absolute value, both means are 0
        ([1, 3], [-1, -3], 1),  # so is the mean's term
        ([1, 1], [3, 3], (6 / 10) ** (1 / 3)),
        ([0, 2], [0, 4], (2 * 1 * 2 / (1 + 4) * 2 * 2 / (1 + 4)) ** (1 / 3)),  # 0.8 of mean, 0.8 of deviation
        ([0, 1, 2, 3], [1, 1, 1, 1], 0),  # nothing varies together
        ([1, 0, 1, 0], [1, 1, 0, 0], 0),
        ([1, 2, 3], [0, 0, 0], 0),
    ],
)
def test_similarity_by_hand(a: list[float], b: list[float], expected: float) -> None:
    for epsilon in (1e-12, 1e-10):
        assert of_samples(np.array(a), np.array(b), epsilon) == pytest.approx(
            expected, abs=3e-3 if expected == 0 else 1e-8
        )


@given(seeds, st.integers(1, 30), st.floats(-12, 3))
def test_a_sample_against_itself_is_exactly_1(seed: int, n: int, exponent: float) -> None:
    a = np.random.default_rng(seed).normal(seed % 3 - 1, 1, n) * 10**exponent
    for epsilon in (1e-12, 1e-10):
        assert of_samples(a, a, epsilon) == 1.0


@given(cases, st.sampled_from([0.1, 0.3, math.inf]))
def test_similarity_of_units_is_s_over_each_unit_with_p(case: Case, radius: float) -> None:
    pairs = find_pairs(case.positions, case.units, radius)
    found = similarity_of(pairs, case.units, case.ref, case.dist)
    assert found.shape == (3, len(case.units))
    for k, others in enumerate(members_by_unit(pairs, case.units)):
        here = [int(case.units[k]), *others]
        for channel in range(3):
            a, b = (f.channels[here, channel].tolist() for f in (case.ref, case.dist))
            assert found[channel, k] == pytest.approx(s_of(a, b, 1e-10), rel=1e-4, abs=1e-4)
    assert (found >= 0).all()
    assert (found <= 1).all()


def test_a_unit_without_others_compares_p_alone() -> None:
    fields = [FieldValues(np.zeros((2, 3)), np.zeros(2), np.full((2, 3), value)) for value in (0.2, 0.6)]
    units = np.array([1])
    pairs = find_pairs(np.array([[0, 0, 0], [9.0, 0, 0]]), units, 1)
    expected = (2 * 0.2 * 0.6 / (0.04 + 0.36)) ** (1 / 3)
    np.testing.assert_allclose(similarity_of(pairs, units, *fields), np.full((3, 1), expected), rtol=1e-8)


@given(seeds, st.floats(-7, -2))
def test_moments_of_a_nearly_plain_unit_do_not_cancel(seed: int, exponent: float) -> None:
    """Bright colors that vary little: the deviations are the small differences', not rounding's."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(0, 0.1, (20, 3))
    a, b = 0.9 + rng.normal(0, 10**exponent, (2, 20, 3))
    ref, dist = (FieldValues(positions, np.zeros(20), values) for values in (a, b))
    units = np.array([3])
    found = similarity_of(find_pairs(positions, units, math.inf), units, ref, dist)
    expected = [s_of(a[:, c].tolist(), b[:, c].tolist(), 1e-10) for c in range(3)]
    np.testing.assert_allclose(found[:, 0], expected, rtol=1e-5)


# --- gradients --------------------------------------------------------------------------------------------


@given(cases)
def test_geometry_gradients(case: Case) -> None:
    towards = (case.ref.nearest - case.positions, case.dist.nearest - case.positions)
    found = float(geometry_gradient_similarity(*towards, np.array([0, len(case.positions)]))[0])
    assert found == pytest.approx(gradient_cosines(case.positions, case.ref.nearest, case.dist.nearest), rel=1e-9)
    assert 0 <= found <= 1


@pytest.mark.parametrize(
    ("ref", "dist", "expected"),
    [
        ([[1, 0, 0]], [[3, 0, 0]], 1),
        ([[1, 0, 0]], [[-2, 0, 0]], 1),  # on the other side: the SDF's sign turns it back
        ([[1, 0, 0]], [[0, 1, 0]], 0),
        ([[1, 0, 0]], [[1, 1, 0]], math.sqrt(0.5)),
        ([[1, 0, 0], [1, 0, 0]], [[1, 0, 0], [0, 1, 0]], math.sqrt(0.5)),
        ([[0, 0, 0]], [[1, 0, 0]], 1),  # a sample on either surface counts 1
        ([[1, 0, 0]], [[0, 0, 0]], 1),
        ([[0, 0, 0]], [[0, 0, 0]], 1),
        ([[1, 0, 0], [0, 0, 0]], [[0, 0, 1], [0, 0, 1]], math.sqrt(0.5)),
    ],
)
def test_geometry_gradients_by_hand(ref: list[list[float]], dist: list[list[float]], expected: float) -> None:
    found = geometry_gradient_similarity(np.array(ref, float), np.array(dist, float), np.array([0, len(ref)]))
    assert found.tolist() == pytest.approx([expected])


@given(cases, st.sampled_from([0.1, 0.3, math.inf]))
def test_color_gradients(case: Case, radius: float) -> None:
    """Equations (28) and (29): the steepest difference of each unit and channel, and where it leads."""
    pairs = find_pairs(case.positions, case.units, radius)
    gradient = gradient_of(pairs, case.units, case.ref.channels)
    assert gradient.magnitude.shape == (3, len(case.units))
    for k, others in enumerate(members_by_unit(pairs, case.units)):
        for channel in range(3):
            values = case.ref.channels[:, channel]
            magnitude, direction = steepest(case.positions, values, int(case.units[k]), others)
            assert gradient.magnitude[channel, k] == pytest.approx(magnitude, rel=1e-9)
            step = gradient.step[channel, k]
            if magnitude == 0:
                assert (step == 0).all()
            else:
                along = step / np.linalg.norm(step) @ direction
                assert abs(along) == pytest.approx(1) or case.positions[others].tolist().count(
                    (case.positions[case.units[k]] + step).tolist()
                )


def test_color_gradients_by_hand() -> None:
    """0.2 within 0.1 is steeper than 0.3 within 0.2; a difference of 1e-6 or less is none."""
    positions = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 1e-3]])
    channels = np.array([[0.5, 0.5, 0.5], [0.3, 0.5, 0.5], [0.8, 0.5, 0.5 + 2e-6], [0.5, 0.5 + 9e-7, 0.5]])
    units = np.array([0])
    gradient = gradient_of(find_pairs(positions, units, 1), units, channels)
    np.testing.assert_allclose(gradient.magnitude[:, 0], [2, 0, 1e-5], rtol=1e-9)
    assert gradient.step[:, 0].tolist() == [[0.1, 0, 0], [0, 0, 0], [0, 0.2, 0]]
    alone = gradient_of(find_pairs(positions, units, 1e-4), units, channels)
    assert (alone.magnitude == 0).all(), "no neighbor: gradient 0"
    assert (alone.step == 0).all()


def gradients(*units: tuple[float, Sequence[float]]) -> Gradient:
    """The same gradients in each of three channels."""
    magnitude = np.array([[m for m, _ in units]] * 3, float)
    return Gradient(magnitude, np.array([[step for _, step in units]] * 3, float))


def similarity_of_gradients(ref: Gradient, dist: Gradient, weights: Floats) -> float:
    """Of a patch that has all the units."""
    return float(gradient_similarity(ref, dist, np.array([0, ref.magnitude.shape[1]]), weights)[0])


X, Y, XY, NONE = (1.0, 0.0, 0.0), (0.0, 2.0, 0.0), (1.0, 1.0, 0.0), (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("ref", "dist", "angular", "magnitude"),
    [
        ([(2, X)], [(2, X)], 1, 1),
        ([(2, X)], [(2, [-3, 0, 0])], 1, 1),
        ([(2, X)], [(2, XY)], math.sqrt(0.5), 1),
        ([(2, X)], [(1, X)], 1, 1 - math.sqrt(3 / 5)),
        ([(2, X)], [(2, Y)], 0, 1),
        ([(0, NONE)], [(0, NONE)], 1, 1),  # both zero count 1
        ([(0, NONE)], [(3, X)], 0, 0),  # one zero counts 0
        ([(2, X), (0, NONE)], [(2, X), (3, X)], math.sqrt(0.5), 1 - math.sqrt(0.5)),
        ([(2, X), (0, NONE)], [(2, Y), (0, NONE)], math.sqrt(0.5), 1),
    ],
)
def test_gradient_similarity_by_hand(
    ref: list[tuple[float, Sequence[float]]],
    dist: list[tuple[float, Sequence[float]]],
    angular: float,
    magnitude: float,
) -> None:
    for one, other in ((ref, dist), (dist, ref)):
        found = similarity_of_gradients(gradients(*one), gradients(*other), RGB)
        assert found == pytest.approx(math.sqrt(angular * magnitude), abs=1e-5)


def test_channels_are_weighed_6_1_1_in_lab() -> None:
    """Only the first channel differs: 6 of 8 parts in Lab, one of 3 in RGB; A and G alike."""
    ref, dist = gradients((1, X)), gradients((1, X))
    dist.step[0, 0] = XY
    assert similarity_of_gradients(ref, dist, RGB) == pytest.approx(math.sqrt((2 + math.sqrt(0.5)) / 3))
    assert similarity_of_gradients(ref, dist, LAB) == pytest.approx(math.sqrt((2 + 6 * math.sqrt(0.5)) / 8))
    dist = gradients((1, X))
    dist.magnitude[0, 0] = 3
    assert similarity_of_gradients(ref, dist, LAB) == pytest.approx(math.sqrt((2 + 6 * (1 - math.sqrt(0.8))) / 8))


# --- a whole patch ----------------------------------------------------------------------------------------


def features_of(
    positions: Floats, ref: FieldValues, dist: FieldValues, units: Ints, weights: Floats, settings: Settings
) -> list[float]:
    """The features of one patch."""
    start, pairs = np.array([0, len(positions)]), find_pairs(positions, units, settings.radius)
    around = colors_around(pairs, units, ref.channels, dist.channels)
    return features_of_patches(positions, start, ref, dist, units, pairs, around, weights, settings)[0].tolist()


THRESHOLDS = {"normal_threshold": 0.8, "tangent_threshold": 0.4}


@given(
    cases,
    st.sampled_from([RGB, LAB]),
    st.sampled_from([0.125, 0.4, math.inf]),
    st.sampled_from([0.125, 0.3, math.inf]),
)
@example(Case(0, "same"), RGB, 0.4, 0.3)
def test_features_of_a_patch(case: Case, weights: Floats, radius: float, gradient_radius: float) -> None:
    settings = Settings(radius=radius, gradient_radius=gradient_radius, **THRESHOLDS)  # type: ignore[arg-type]
    found = features_of(case.positions, case.ref, case.dist, case.units, weights, settings)
    assert found == pytest.approx(
        features_by_loop(case.positions, case.ref, case.dist, case.units, weights, settings), abs=2e-5
    )
    assert all(0 <= value <= 1 for value in found)


@given(seeds, st.sampled_from(KINDS), st.sampled_from([RGB, LAB]), st.sampled_from([0.125, math.inf]))
def test_a_patch_against_itself_is_exactly_1(seed: int, kind: str, weights: Floats, radius: float) -> None:
    case = Case(seed, kind)
    settings = Settings(gradient_radius=radius, **THRESHOLDS)  # type: ignore[arg-type]
    assert features_of(case.positions, case.ref, case.ref, case.units, weights, settings) == [1, 1, 1, 1]


@given(seeds)
def test_gradients_use_each_fields_own_tangent_plane(seed: int) -> None:
    """Color units take the reference's p_n for both meshes, gradients each their own."""
    case = Case(seed, "random")
    settings = Settings(radius=math.inf, gradient_radius=math.inf, **THRESHOLDS)  # type: ignore[arg-type]
    turned = FieldValues(case.positions[:, [1, 2, 0]] + 0.3, case.dist.sdf, case.dist.channels)
    straight = features_of(case.positions, case.ref, case.dist, case.units, RGB, settings)
    other = features_of(case.positions, case.ref, turned, case.units, RGB, settings)
    assert straight[2] == other[2]
    assert other == pytest.approx(
        features_by_loop(case.positions, case.ref, turned, case.units, RGB, settings), abs=2e-5
    )


@given(seeds)
def test_pooling(seed: int) -> None:
    """The fourth root of the product, or the plain mean, which is never less."""
    features = np.random.default_rng(seed).random((7, 4))
    geometric, arithmetic = pool_features(features, "geometric"), pool_features(features, "arithmetic")
    np.testing.assert_allclose(geometric, [(a * b * c * d) ** 0.25 for a, b, c, d in features.tolist()])
    np.testing.assert_allclose(arithmetic, [(a + b + c + d) / 4 for a, b, c, d in features.tolist()])
    assert (arithmetic >= geometric - 1e-15).all()


def test_pooling_by_hand() -> None:
    features = np.array([[1, 1, 1, 1], [0, 1, 1, 1], [0.0625, 1, 1, 1]])
    assert pool_features(features, "geometric").tolist() == [1, 0, 0.5]
    assert pool_features(features, "arithmetic").tolist() == [1, 0.75, 0.765625]


@given(seeds, seeds)
def test_patches_together_are_the_patches_alone(one: int, other: int) -> None:
    cases = Case(one, "random"), Case(other, "few")
    settings = Settings(gradient_radius=0.3, **THRESHOLDS)  # type: ignore[arg-type]
    first = len(cases[0].positions)

    def joined(name: str, field: str = "") -> Floats:
        parts = [getattr(case, name) for case in cases]
        return np.concatenate([getattr(part, field) if field else part for part in parts])

    ref, dist = (
        FieldValues(*(joined(name, field) for field in ("nearest", "sdf", "channels"))) for name in ("ref", "dist")
    )
    positions, start = joined("positions"), np.array([0, first, first + len(cases[1].positions)])
    units = np.concatenate([cases[0].units, cases[1].units + first])
    pairs = pairs_of_patches(positions, start, units, settings.radius)
    around = colors_around(pairs, units, ref.channels, dist.channels)
    together = features_of_patches(positions, start, ref, dist, units, pairs, around, RGB, settings)
    alone = [features_of(case.positions, case.ref, case.dist, case.units, RGB, settings) for case in cases]
    np.testing.assert_allclose(together, alone, rtol=1e-12)
