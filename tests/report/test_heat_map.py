# SPDX-License-Identifier: GPL-3.0-or-later
"""Ranges, ticks and histograms by hand; splitting for display."""

from __future__ import annotations

import numpy as np
import pytest

from fmqm_addon.metric.geometry import triangle_areas
from fmqm_addon.report.visual.heat_map import fitted_range, histogram, round_ticks, split_large


@pytest.mark.parametrize(
    ("low", "expected"),
    [(0.72, 0.7), (0.95, 0.95), (0.951, 0.95), (0.1, 0.0), (0.43, 0.4), (1.0, 0.998), (0.9999, 0.998)],
)
def test_a_fitted_range_ends_at_one_and_begins_round(low: float, expected: float) -> None:
    values = np.linspace(low, 1.0, 1001)
    values[:60] = low  # the 5th percentile, and one far below it says nothing
    values[0] = 0.0
    assert fitted_range(values) == pytest.approx((expected, 1.0))


def test_without_values_all_is_shown() -> None:
    assert fitted_range(np.zeros(0)) == (0.0, 1.0)


@pytest.mark.parametrize("low", [0.0, 0.4, 0.7, 0.85, 0.98, 0.998])
def test_ticks_are_round_and_few(low: float) -> None:
    ticks = round_ticks(low, 1.0)
    assert 3 <= len(ticks) <= 7 and ticks[0] == low and ticks[-1] == 1.0
    assert len({round(b - a, 9) for a, b in zip(ticks[:-1], ticks[1:], strict=True)}) == 1


def test_ticks_between_ends_that_are_not_round() -> None:
    assert round_ticks(0.63, 0.97) == [0.7, 0.8, 0.9]


def test_histogram_counts_all_and_those_beyond_at_its_ends() -> None:
    assert histogram([0.5, 0.6, 0.74, 0.76, 1.0, 0.1], 0.5, 1.0, bars=2).tolist() == [4, 2]


def test_split_for_display_is_the_same_surface() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0.01, 0], [0, 0, 5]])
    triangles = np.array([[0, 1, 2], [0, 1, 3]])
    fine, cut = split_large(vertices, triangles, 0.3)
    edges = np.linalg.norm(fine[cut] - fine[np.roll(cut, 1, axis=1)], axis=2)
    assert edges.max() <= 0.3
    assert triangle_areas(fine, cut).sum() == pytest.approx(triangle_areas(vertices, triangles).sum())
    same, whole = split_large(vertices, triangles, 6.0)
    assert same is vertices and whole is triangles


def test_ticks_from_zero_begin_at_0_and_not_at_minus_0() -> None:
    assert str(round_ticks(0.0, 1.0)[0]) == "0.0"
