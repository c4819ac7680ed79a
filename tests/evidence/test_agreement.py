# SPDX-License-Identifier: GPL-3.0-or-later
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("scipy", reason="make test installs scipy")

from scipy.stats import kendalltau, pearsonr, spearmanr

from fmqm_addon.evidence.agreement import STATISTICS, Curve, agreement, difference, draws, fit_curve, resampled

X = np.array([0.1, 0.4, 0.4, 0.8, 0.9, 1.0, 0.2, 0.3, 0.6, 0.7, 0.5, 0.05])
OPINIONS = np.array([1.0, 2.5, 2.0, 4.0, 4.5, 4.5, 1.5, 1.0, 3.0, 3.5, 3.0, 1.2])


def test_the_curve_is_found_again() -> None:
    true = Curve(3.0, 12.0, 0.6, 0.4, 2.5)
    x = np.linspace(0, 1, 60)
    assert np.abs(fit_curve(x, true(x))(x) - true(x)).max() < 1e-3


def test_the_curve_by_hand() -> None:
    # b1 (1/2 - 1/2) at its middle, and half of b1 far above it.
    curve = Curve(2.0, 100.0, 0.5, 0.0, 3.0)
    assert curve(np.array([0.5, 9.0, -9.0])) == pytest.approx([3.0, 4.0, 2.0])


def test_the_curve_never_fits_worse_than_a_line() -> None:
    slope, level = np.polyfit(X, OPINIONS, 1)
    line = np.square(slope * X + level - OPINIONS).sum()
    assert np.square(fit_curve(X, OPINIONS)(X) - OPINIONS).sum() <= line + 1e-9


def test_a_falling_metric_has_a_falling_curve_and_the_same_error() -> None:
    up, down = agreement(X, OPINIONS), agreement(-X, OPINIONS)
    assert down.values["SROCC"] == pytest.approx(-up.values["SROCC"])
    assert down.values["RMSE"] == pytest.approx(up.values["RMSE"], abs=1e-3)
    assert down.values["PLCC"] > 0.9  # after the curve both rise


def test_values_are_scipys() -> None:
    found = agreement(X, OPINIONS)
    assert found.curve is not None
    fitted = found.curve(X)
    assert found.values["SROCC"] == pytest.approx(spearmanr(X, OPINIONS).statistic)
    assert found.values["KROCC"] == pytest.approx(kendalltau(X, OPINIONS).statistic)
    assert found.values["PLCC"] == pytest.approx(pearsonr(fitted, OPINIONS).statistic)
    assert found.values["RMSE"] == pytest.approx(np.sqrt(np.mean((fitted - OPINIONS) ** 2)))


@given(st.integers(0, 1000))
@settings(max_examples=20)
def test_a_resample_counts_rows_as_if_they_stood_there_again(seed: int) -> None:
    weights = draws(len(X), 3, seed)
    fitted = X * 2 + 1
    found = resampled(X, fitted, OPINIONS, weights)
    for index, counts in enumerate(weights.astype(int)):
        rows = np.repeat(np.arange(len(X)), counts)
        assert found["PLCC"][index] == pytest.approx(pearsonr(fitted[rows], OPINIONS[rows]).statistic)
        assert found["SROCC"][index] == pytest.approx(spearmanr(X[rows], OPINIONS[rows]).statistic)
        assert found["KROCC"][index] == pytest.approx(kendalltau(X[rows], OPINIONS[rows]).statistic)
        assert found["RMSE"][index] == pytest.approx(np.sqrt(np.mean((fitted[rows] - OPINIONS[rows]) ** 2)))


def test_intervals_hold_the_values_and_narrow_with_rows() -> None:
    random = np.random.default_rng(1)

    def width(rows: int) -> float:
        x = random.random(rows)
        opinions = 4 * x + random.normal(0, 0.7, rows)
        found = agreement(x, opinions, draws(rows))
        for name in STATISTICS:
            low, high = found.intervals[name]
            assert low <= found.values[name] <= high
        low, high = found.intervals["SROCC"]
        return high - low

    assert width(400) < width(25) / 2


@pytest.mark.parametrize(
    ("x", "opinions", "words"),
    [
        ([1, 1, 1, 1], [1, 2, 3, 4], "same number"),
        ([1, 2, 3, 4], [2, 2, 2, 2], "one score"),
        ([1, 2, np.nan, np.nan, 3], [1, 2, 3, 4, 5], "too few rows (3"),
    ],
)
def test_what_cannot_be_told_is_said_in_words(x: list[float], opinions: list[float], words: str) -> None:
    numbers = np.array(x, float), np.array(opinions, float)
    found = agreement(*numbers, draws(len(x)))
    assert words in found.note
    assert not found.values and not found.intervals
    assert words in difference(*numbers[:1], np.arange(len(x), dtype=float), numbers[1], draws(len(x))).note


def test_a_metric_differs_from_itself_by_nothing() -> None:
    found = difference(X, X, OPINIONS, draws(len(X)))
    assert found.differences == {"SROCC": 0.0, "PLCC": 0.0}
    assert found.chances == {"SROCC": 1.0, "PLCC": 1.0}


def test_the_better_metric_is_told_even_where_it_falls() -> None:
    random = np.random.default_rng(2)
    truth = random.random(200)
    good, bad = -truth + random.normal(0, 0.05, 200), truth + random.normal(0, 0.5, 200)
    found = difference(good, bad, truth, draws(200))
    assert found.differences["SROCC"] > 0.2
    assert found.intervals["SROCC"][0] > 0 and found.chances["SROCC"] < 0.01
