# SPDX-License-Identifier: GPL-3.0-or-later
"""SDF (III-B) and NCF (IV-A) of one surface at given points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .geometry import Floats, Ints, dot
from .queries import BatchQuery, crossing_counts, nearest_triangles, opened
from .settling import BATCH, ON_SURFACE, settling
from .signs import followers
from .stepper import Progress, Work, as_part
from .surface import Surface, is_closed


@dataclass(frozen=True)
class Fields:
    """Field values of one surface at N points, in the order of the points.

    Attributes:
        nearest: (N, 3) float64 nearest surface point p_n, metric's frame.
        triangle: (N,) int64 the triangle it lies on.
        sdf: (N,) float64, negative inside, in units of the frame.
        ncf: (N, 3) float32 sRGB in [0, 1].
    """

    nearest: Floats
    triangle: Ints
    sdf: Floats
    ncf: NDArray[np.float32]


def evaluate_fields(surface: Surface, points: Floats, order: Ints, reach: Floats | None = None) -> Work[Fields]:
    """Equations (3), (4) and (7) at the points; yields the share done.

    Args:
        points: (N, 3) in the metric's frame.
        order: (N,) an order in which neighbours are near in space.
        reach: (N,) upper bounds of the distances, where known; None finds its own.

    The tree says which triangle is nearest and what a ray hits; where on the triangle, and how far, is
    computed here in float64.
    """
    points = points.take(order, axis=0)  # in this order all below looks at rows that lie together
    with opened(surface.query):
        finding = nearest_triangles(surface, points, None if reach is None else reach.take(order))
        triangle = yield from as_part(finding, 0.0, 0.35)
        again = surface.query.one_by_one if isinstance(surface.query, BatchQuery) else None
        settled = settling(surface, points, triangle, again)
        triangle, nearest, weights = yield from as_part(settled, 0.35, 0.05)
        ncf = np.empty(points.shape, np.float32)
        for first in range(0, len(order), BATCH):
            batch = slice(first, first + BATCH)
            ncf[batch] = surface.color_at(triangle[batch], weights[batch])
            yield Progress("", 0.4 + 0.05 * min(1.0, (first + BATCH) / len(order)))
        away = points - nearest
        sdf = np.sqrt(dot(away, away))
        on_surface = sdf <= ON_SURFACE
        nearest[on_surface] = points[on_surface]
        sdf[on_surface] = 0.0

        off_surface = np.flatnonzero(~on_surface)
        closed = is_closed(surface.triangles)
        if not closed or getattr(surface.query, "every_ray", False):
            asked, as_asked = off_surface, np.arange(len(off_surface))
        else:
            following = followers(points.take(off_surface, axis=0), sdf.take(off_surface))
            leader = yield from as_part(following, 0.45, 0.1)
            leads = leader == np.arange(len(leader))
            asked, as_asked = off_surface[leads], (np.cumsum(leads) - 1).take(leader)
        directions = away.take(asked, axis=0) / sdf.take(asked)[:, None]
        counting = crossing_counts(surface, points.take(asked, axis=0), directions, closed)
        crossings = yield from as_part(counting, 0.55, 0.45)
        sdf[off_surface[(crossings % 2 == 1).take(as_asked)]] *= -1
    yield Progress("", 1.0)  # what follows is a step of its own: random access to all rows
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    return Fields(nearest.take(back, axis=0), triangle.take(back), sdf.take(back), ncf.take(back, axis=0))
