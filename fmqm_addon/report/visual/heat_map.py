# SPDX-License-Identifier: GPL-3.0-or-later
"""A result on surfaces: which patch each triangle takes its color from, and from where to where the colors go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...metric.evaluation import Result
from ...metric.geometry import Floats, Ints
from ...metric.patches import split_edges

UNCOVERED = -1  # the patch of a place that was not measured
LOW_PERCENTILE = 5.0  # of the patches of all rows: where a fitted range begins
BARS = 32  # of a histogram

_PIECES = 6  # a triangle is split for display where it is longer than this part of a patch
_MOST_TRIANGLES = 400_000  # that splitting may make; a mesh with more has small ones anyway
_DISC = np.sqrt(1 / 8)  # radius of a disc by the diagonal of its bounding box, however it is turned
_REACH = 1.3  # a patch is no disc: how much further than one it may reach
_CHUNK = 1 << 22  # elements of a distance table at once
_STEPS = (1.0, 2.0, 5.0)
_LEAST_STEP = 0.002  # of a fitted range: below it, all is alike


@dataclass(frozen=True)
class HeatMesh:
    """A surface as it is painted.

    Attributes:
        vertices: (V, 3) metric's frame. triangles: (T, 3). patch: (T,) the patch that each is painted by, or UNCOVERED.
    """

    vertices: Floats
    triangles: Ints
    patch: Ints

    @property
    def centers(self) -> Floats:
        """(T, 3) of the triangles."""
        centers: Floats = self.vertices[self.triangles].mean(axis=1)
        return centers


def heat_mesh(vertices: Floats, triangles: Ints, result: Result) -> HeatMesh:
    """A surface in the metric's frame, painted by the patches; triangles larger than a part of one are split."""
    limit = float(np.median([patch.diagonal for patch in result.patches])) / _PIECES
    vertices, triangles = split_large(vertices, triangles, limit)
    return HeatMesh(vertices, triangles, nearest_patches(vertices[triangles].mean(axis=1), result))


def split_large(vertices: Floats, triangles: Ints, limit: float) -> tuple[Floats, Ints]:
    """Halves the edges of triangles with one above a length until none is, or there are too many; the surface stays."""
    while len(triangles) < _MOST_TRIANGLES:
        edges = vertices[triangles] - vertices[np.roll(triangles, 1, axis=1)]
        large = ((edges * edges).sum(axis=2) > limit * limit).any(axis=1)
        if not large.any():
            break
        vertices, triangles, _ = split_edges(vertices, triangles, large)
    return vertices, triangles


def nearest_patches(points: Floats, result: Result) -> Ints:
    """(N,) the patch whose center is nearest to each of (N, 3) points of the metric's frame.

    Where only some of the patches were scored, places out of their reach are UNCOVERED.
    """
    centers = result.patch_centers.astype(np.float32)
    squares = (centers * centers).sum(axis=1)
    nearest = np.empty(len(points), np.int64)
    step = max(1, _CHUNK // len(centers))
    for first in range(0, len(points), step):
        here = points[first : first + step].astype(np.float32)
        nearest[first : first + step] = (squares - 2 * here @ centers.T).argmin(axis=1)
    if len(result.patches) < result.settings.patches:
        reach = np.array([patch.diagonal for patch in result.patches]) * (_DISC * _REACH)
        away = np.linalg.norm(points - result.patch_centers[nearest], axis=1)
        nearest[away > reach[nearest]] = UNCOVERED
    return nearest


def fitted_range(values: Floats) -> tuple[float, float]:
    """From the 5th percentile of scores, rounded down so that ticks are round, to 1; (0, 1) where there are none."""
    if not len(values):
        return 0.0, 1.0
    span = 1 - float(np.percentile(values, LOW_PERCENTILE))
    step = max(_round_step(span), _LEAST_STEP)
    low = 1 - step * max(1, np.ceil(span / step - 1e-9))
    return max(round(float(low), 6), 0.0), 1.0


def round_ticks(low: float, high: float) -> list[float]:
    """Round numbers between two ends, both included where they are round: three to seven."""
    step = _round_step(high - low)
    first, last = np.ceil(low / step - 1e-6), np.floor(high / step + 1e-6)
    return [round(float(k * step), 9) for k in np.arange(first, last + 1)]


def histogram(values: Sequence[float] | Floats, low: float, high: float, bars: int = BARS) -> NDArray[np.int64]:
    """(bars,) how many values lie in each part from low to high; those beyond count in the first and the last."""
    place = (np.asarray(values, np.float64) - low) / max(high - low, 1e-12) * bars
    return np.bincount(np.clip(place.astype(np.int64), 0, bars - 1), minlength=bars)


def _round_step(span: float) -> float:
    """The smallest 1, 2 or 5 times a power of ten that is not below a fifth of a span."""
    wanted = max(span, 1e-9) / 5
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(next((step * power for step in _STEPS if step * power >= wanted * (1 - 1e-9)), 10 * power))
