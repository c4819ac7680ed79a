# SPDX-License-Identifier: GPL-3.0-or-later
"""How well a metric's numbers agree with people's: correlations after a fitted curve, and how sure they are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.special import expit
from scipy.stats import kendalltau, pearsonr, spearmanr

Array = NDArray[np.float64]

FEWEST = 4  # rows below which no correlation is told
FEWEST_FOR_CURVE = 10  # rows below which five parameters follow noise: a line is fitted
RESAMPLES = 1000
LEVEL = 0.95
STATISTICS = ("PLCC", "SROCC", "KROCC", "RMSE")


@dataclass(frozen=True)
class Curve:
    """The five-parameter logistic of the Video Quality Experts Group, from a metric's scale to people's.

    b1 (1/2 - 1 / (1 + exp(b2 (x - b3)))) + b4 x + b5. A straight line has b1 = 0.
    """

    b1: float
    b2: float
    b3: float
    b4: float
    b5: float

    def __call__(self, x: Array) -> Array:
        """Opinions, (n,), as the curve predicts them from a metric's numbers, (n,)."""
        return np.asarray(self.b1 * (expit(self.b2 * (x - self.b3)) - 0.5) + self.b4 * x + self.b5)


@dataclass(frozen=True)
class Agreement:
    """One metric against people.

    Attributes:
        rows: how many have both numbers.
        values: of STATISTICS; empty where none can be told. intervals: 95 %, by the same names.
        curve: what was fitted. note: why something is missing or other than usual, or "".
    """

    rows: int
    values: dict[str, float] = field(default_factory=dict)
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    curve: Curve | None = None
    note: str = ""


def fit_curve(x: Array, opinions: Array) -> Curve:
    """The logistic nearest to the opinions by least squares, from several starts; never farther than the best line."""
    center, scale = float(x.mean()), float(x.std())
    t = (x - center) / scale
    slope, level = np.polyfit(t, opinions, 1)
    span = float(np.ptp(opinions)) or 1.0
    best, cost = np.array([0.0, 1.0, 0.0, slope, level]), float(np.square(slope * t + level - opinions).sum())
    if len(x) >= FEWEST_FOR_CURVE:
        for steepness in (0.5, 2.0, 8.0):
            for middle in np.quantile(t, (0.25, 0.5, 0.75)):
                start = np.array([np.copysign(span, slope), steepness, middle, 0.0, opinions.mean()])
                found = least_squares(_misfit, start, args=(t, opinions), max_nfev=400)
                if np.isfinite(found.cost) and 2 * found.cost < cost * (1 - 1e-9):
                    best, cost = found.x, 2 * float(found.cost)
    b1, b2, b3, b4, b5 = (float(each) for each in best)
    return Curve(b1, b2 / scale, center + scale * b3, b4 / scale, b5 - b4 * center / scale)


def _misfit(b: Array, t: Array, opinions: Array) -> Array:
    return np.asarray(b[0] * (expit(b[1] * (t - b[2])) - 0.5) + b[3] * t + b[4] - opinions)


def agreement(x: Array, opinions: Array, weights: Array | None = None) -> Agreement:
    """PLCC and RMSE after the curve, SROCC and KROCC (tau-b) without it.

    Args:
        x, opinions: (n,); rows where x is NaN are left out.
        weights: (resamples, n), how often a resample has each row (draws); None tells no intervals. The curve stays as
            fitted to all rows, so an interval holds the choice of rows, not that of the curve.
    """
    known = np.isfinite(x)
    if weights is not None:
        weights = weights[:, known]
    x, opinions = x[known], opinions[known]
    if len(x) < FEWEST:
        return Agreement(len(x), note=f"too few rows ({len(x)}; at least {FEWEST} are wanted)")
    if np.ptp(x) == 0:
        return Agreement(len(x), note="the same number everywhere: nothing to rank")
    if np.ptp(opinions) == 0:
        return Agreement(len(x), note="people gave one score to all: nothing to rank")
    curve = fit_curve(x, opinions)
    fitted = curve(x)
    note = "" if len(x) >= FEWEST_FOR_CURVE else f"{len(x)} rows: a line is fitted instead of the curve"
    # A curve that is flat to the last digit predicts the same everywhere.
    linear = float(pearsonr(fitted, opinions).statistic) if np.ptp(fitted) > 0 else 0.0
    values = {
        "PLCC": linear,
        "SROCC": float(spearmanr(x, opinions).statistic),
        "KROCC": float(kendalltau(x, opinions).statistic),
        "RMSE": float(np.sqrt(np.square(fitted - opinions).mean())),
    }
    intervals = {}
    if weights is not None:
        for name, found in resampled(x, fitted, opinions, weights).items():
            found = found[np.isfinite(found)]
            if 2 * len(found) > len(weights):
                low, high = np.quantile(found, ((1 - LEVEL) / 2, (1 + LEVEL) / 2))
                intervals[name] = (float(low), float(high))
    return Agreement(len(x), values, intervals, curve, note)


def draws(rows: int, resamples: int = RESAMPLES, seed: int = 0) -> Array:
    """How often each row is in each resample with replacement, (resamples, rows)."""
    return np.random.default_rng(seed).multinomial(rows, np.full(rows, 1 / rows), resamples).astype(float)


def resampled(x: Array, fitted: Array, opinions: Array, weights: Array) -> dict[str, Array]:
    """STATISTICS of every resample, (resamples,) each; NaN where a resample has only one value."""
    total = weights.sum(1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return {
            "PLCC": _correlation(fitted[None], opinions[None], weights),
            "SROCC": _correlation(_ranks(x, weights), _ranks(opinions, weights), weights),
            "KROCC": _concordance(x, opinions, weights),
            "RMSE": np.sqrt(weights @ np.square(fitted - opinions) / total),
        }


def _correlation(a: Array, b: Array, weights: Array) -> Array:
    total = weights.sum(1, keepdims=True)
    a = a - (weights * a).sum(1, keepdims=True) / total
    b = b - (weights * b).sum(1, keepdims=True) / total
    return np.asarray((weights * a * b).sum(1) / np.sqrt((weights * a * a).sum(1) * (weights * b * b).sum(1)))


def _ranks(values: Array, weights: Array) -> Array:
    """Middle ranks within each resample, (resamples, n): equal values share one."""
    order = np.argsort(values, kind="stable")
    is_first = np.r_[True, np.diff(values[order]) > 0]
    in_group = np.add.reduceat(weights[:, order], np.flatnonzero(is_first), axis=1)
    middle = np.cumsum(in_group, axis=1) - (in_group - 1) / 2
    ranks = np.empty_like(weights)
    ranks[:, order] = middle[:, np.cumsum(is_first) - 1]
    return ranks


def _concordance(x: Array, y: Array, weights: Array) -> Array:
    """Kendall's tau-b of each resample: pairs of rows count as often as both are there."""
    of_x, of_y = (np.sign(values[:, None] - values).astype(np.float32) for values in (x, y))
    counts = weights.astype(np.float32)  # all are whole numbers, and small enough to stay exact

    def pairs(signs: NDArray[np.float32]) -> Array:
        return np.asarray(((counts @ signs) * weights).sum(1))

    return np.asarray(pairs(of_x * of_y) / np.sqrt(pairs(of_x * of_x) * pairs(of_y * of_y)))


@dataclass(frozen=True)
class Difference:
    """Two metrics on the same rows: how much nearer to people the first is.

    Attributes:
        rows: where both have numbers. differences, intervals: of |SROCC| and |PLCC|, first minus second.
        chances: two-sided, of such a difference if there were none. note: why nothing is told, or "".
    """

    rows: int
    differences: dict[str, float] = field(default_factory=dict)
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    chances: dict[str, float] = field(default_factory=dict)
    note: str = ""


def difference(first: Array, second: Array, opinions: Array, weights: Array) -> Difference:
    """A paired bootstrap: both metrics see the same resamples, (resamples, n)."""
    known = np.isfinite(first) & np.isfinite(second)
    found = [agreement(np.where(known, each, np.nan), opinions) for each in (first, second)]
    rows = int(known.sum())
    note = next((each.note for each in found if not each.values), "")
    if note:
        return Difference(rows, note=note)
    samples = []
    for x, whole in zip((first[known], second[known]), found, strict=True):
        assert whole.curve is not None
        each = resampled(x, whole.curve(x), opinions[known], weights[:, known])
        samples.append({name: each[name] * (np.sign(whole.values[name]) or 1) for name in ("SROCC", "PLCC")})
    differences, intervals, chances = {}, {}, {}
    for name in ("SROCC", "PLCC"):
        differences[name] = abs(found[0].values[name]) - abs(found[1].values[name])
        delta = samples[0][name] - samples[1][name]
        delta = delta[np.isfinite(delta)]
        if 2 * len(delta) > len(weights):
            low, high = np.quantile(delta, ((1 - LEVEL) / 2, (1 + LEVEL) / 2))
            intervals[name] = (float(low), float(high))
            smaller = min(int((delta <= 0).sum()), int((delta >= 0).sum()))
            chances[name] = min(1.0, 2 * (smaller + 1) / (len(delta) + 1))
    return Difference(rows, differences, intervals, chances)
