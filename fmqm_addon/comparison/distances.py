# SPDX-License-Identifier: GPL-3.0-or-later
"""How far two surfaces are apart, from points spread over each of them: what other programs tell of a pair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..metric.geometry import Floats, Ints, dot, morton_order
from ..metric.queries import closest_on, nearest_one_by_one
from ..metric.sampling import draw_barycentric, triangles_evenly
from ..metric.stepper import Work
from ..metric.surface import Surface

POINTS = 10_000  # over a mesh; a share of 0.5 % is known to 0.07 %


@dataclass(frozen=True)
class Apart:
    """How far points spread over one surface are from the other, in the metric's frame.

    Attributes:
        mean, rms, largest: distances. beyond: share of the points that are farther than what was asked.
    """

    mean: float
    rms: float
    largest: float
    beyond: float


def apart(surface: Surface, other: Surface, reach: float, seed: int, count: int = POINTS) -> Work[Apart]:
    """Distances from a surface to another; yields the share done.

    Args:
        reach: beyond counts the points that are farther than this.
    """
    points = spread_points(surface, count, seed)
    points = points[morton_order(points)]
    triangle = yield from nearest_one_by_one(other, points)
    squares = _squared_distances(other, points, triangle)
    distances = np.sqrt(squares)
    return Apart(
        mean=float(distances.mean()),
        rms=float(np.sqrt(squares.mean())),
        largest=float(distances.max()),
        beyond=float(np.count_nonzero(squares > reach * reach)) / count,
    )


def squared_distances(surface: Surface, points: Floats) -> Floats:
    """(n,) from (n, 3) points to a surface."""
    return _squared_distances(surface, points, surface.query.nearest(points, None))


def _squared_distances(surface: Surface, points: Floats, triangle: Ints) -> Floats:
    nearest, _ = closest_on(surface, points, triangle)
    away = points - nearest
    return np.asarray(dot(away, away))


def spread_points(surface: Surface, count: int, seed: int) -> Floats:
    """(count, 3) points on a surface, even over its area: one drawn in each of count equal shares of it."""
    rng = np.random.default_rng(seed)
    return points_at(surface, triangles_evenly(surface.areas, rng.random(count)), rng)


def points_at(surface: Surface, triangle: Ints, rng: np.random.Generator) -> Floats:
    """A point, drawn evenly, on each of (n,) triangles."""
    corners = surface.triangles[triangle]
    return np.asarray(np.einsum("nk,nkc->nc", draw_barycentric(rng, len(corners)), surface.vertices[corners]))
