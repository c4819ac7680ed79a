# SPDX-License-Identifier: GPL-3.0-or-later
"""A result on surfaces: which patch each triangle takes its color from, and from where to where the colors go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...metric.evaluation import Result
from ...metric.fields import Fields
from ...metric.geometry import Floats, Ints
from ...metric.patches import split_edges
from ...metric.surface import Surface

UNCOVERED = -1  # the patch of a place that was not measured
LOW_PERCENTILE = 5.0  # of the patches of all rows: where a fitted range begins
BARS = 32  # of a histogram

_PIECES = 6  # a triangle is split for display where it is longer than this part of a patch
_MOST_TRIANGLES = 400_000  # that splitting may make; a mesh with more has small ones anyway
_SPACINGS = 1.0  # of samples: a place with none within about so many was not measured
_CHUNK = 1 << 17  # elements of a distance table at once, for a processor's cache
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


def heat_mesh(surface: Surface, result: Result, fields: Fields) -> HeatMesh:
    """One of the two surfaces, painted by the patches; triangles longer than a part of one are split.

    Args:
        fields: of this surface at the samples.
    """
    limit = float(np.median([patch.diagonal for patch in result.patches])) / _PIECES
    vertices, triangles = split_large(surface.vertices, surface.triangles, limit)
    return HeatMesh(vertices, triangles, patches_at(vertices[triangles].mean(axis=1), result, fields))


def patches_at(points: Floats, result: Result, fields: Fields) -> Ints:
    """(N,) the patch that (N, 3) points of a surface are painted by: the nearest.

    Where only some of the patches were scored, places without samples around them are UNCOVERED.
    """
    patch = nearest_patches(points, result)
    if len(result.patches) < result.settings.patches:
        area = sum(patch.area for patch in result.patches)
        patch[~has_near(points, fields.nearest, _SPACINGS * float(np.sqrt(area / len(fields.nearest))))] = UNCOVERED
    return patch


def has_near(points: Floats, others: Floats, reach: float) -> NDArray[np.bool_]:
    """(N,) whether one of the others lies within about a reach: in the same cell of a grid, or in one beside it."""
    low = np.minimum(points.min(axis=0), others.min(axis=0)) - reach
    sides = np.maximum(points.max(axis=0), others.max(axis=0)) - low
    width = int(sides.max() / reach) + 3

    def keys(cells: Ints) -> Ints:
        joined: Ints = (cells[:, 0] * width + cells[:, 1]) * width + cells[:, 2]
        return joined

    taken = np.unique(keys(((others - low) / reach).astype(np.int64)))
    here = ((points - low) / reach).astype(np.int64)
    found = np.zeros(len(points), bool)
    for step in np.ndindex(3, 3, 3):
        found |= np.isin(keys(here + np.array(step) - 1), taken)
    return found


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
    """(N,) the patch whose center is nearest to each of (N, 3) points of the metric's frame."""
    centers = result.patch_centers.astype(np.float32)
    # Squared distances less what all have in common, as one product.
    table = np.vstack([-2 * centers.T, (centers * centers).sum(axis=1)])
    nearest = np.empty(len(points), np.int64)
    step = max(1, _CHUNK // len(centers))
    for first in range(0, len(points), step):
        here = np.ones((len(points[first : first + step]), 4), np.float32)
        here[:, :3] = points[first : first + step]
        nearest[first : first + step] = (here @ table).argmin(axis=1)
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
    return [round(float(k * step), 9) + 0.0 for k in np.arange(first, last + 1)]  # no -0


def histogram(values: Sequence[float] | Floats, low: float, high: float, bars: int = BARS) -> NDArray[np.int64]:
    """(bars,) how many values lie in each part from low to high; those beyond count in the first and the last."""
    place = (np.asarray(values, np.float64) - low) / max(high - low, 1e-12) * bars
    return np.bincount(np.clip(place.astype(np.int64), 0, bars - 1), minlength=bars)


def _round_step(span: float) -> float:
    """The smallest 1, 2 or 5 times a power of ten that is not below a fifth of a span."""
    wanted = max(span, 1e-9) / 5
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(next((step * power for step in _STEPS if step * power >= wanted * (1 - 1e-9)), 10 * power))
