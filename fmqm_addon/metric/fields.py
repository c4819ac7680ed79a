# SPDX-License-Identifier: GPL-3.0-or-later
"""SDF (III-B) and NCF (IV-A) of one surface at given points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .geometry import Floats, Ints, cross, dot, ranges
from .queries import BatchQuery, closest_on, crossing_counts, nearest_triangles, opened
from .signs import followers
from .stepper import Progress, Work, as_part
from .surface import Surface, is_closed, triangle_normals

# Below the resolution of a float32 tree in a box of diagonal 1, p - p_n has no direction: p = p_n.
ON_SURFACE = 1e-9
# What two float32 trees may take for one distance, some roundings of a position.
TIE = 5e-7
_SURFACE_BATCH = 16384  # points of a step that asks no tree
_CANDIDATES = 1 << 20  # faces around nearest points that are looked at at once: a fan's hub may have any number


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
        nearest = np.empty_like(points)
        ncf = np.empty(points.shape, np.float32)
        for first in range(0, len(order), _SURFACE_BATCH):
            batch = slice(first, first + _SURFACE_BATCH)
            triangle[batch], nearest[batch], weights = _settled(surface, points[batch], triangle[batch], again)
            ncf[batch] = surface.color_at(triangle[batch], weights)
            yield Progress("", 0.35 + 0.1 * min(1.0, (first + _SURFACE_BATCH) / len(order)))
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
    back = np.empty_like(order)
    back[order] = np.arange(len(order))
    return Fields(nearest.take(back, axis=0), triangle.take(back), sdf.take(back), ncf.take(back, axis=0))


def _settled(
    surface: Surface, points: Floats, triangle: Ints, again: Callable[[Floats, Floats], Ints] | None
) -> tuple[Ints, Floats, Floats]:
    """Triangle, p_n and its barycentric weights, given the nearest triangles as a tree found them.

    Where p_n lies on an edge or vertex, its triangle becomes the one there that faces p most. All of them
    are equally near, but across a UV seam their colors differ: which one a tree happens to find first, in
    the order of a file, must not decide. (The paper has no rule for ties.)

    Where float32 cannot tell two of them apart and p_n differs, it does decide: what another tree found is asked again.

    Args:
        again: nearest triangles of points, given upper bounds of their distances, by the tree that decides.
    """
    triangle = triangle.copy()
    nearest, weights = closest_on(surface, points, triangle)
    if again is not None:
        rows = _close_to_edges(surface, points, triangle, nearest, weights)
        if rows.size:
            triangle[rows] = again(points[rows], np.linalg.norm(points[rows] - nearest[rows], axis=1))
            nearest[rows], weights[rows] = closest_on(surface, points[rows], triangle[rows])
    rows = np.flatnonzero((weights[:, 0] == 0) | (weights[:, 1] == 0) | (weights[:, 2] == 0))
    if not rows.size:
        return triangle, nearest, weights
    by_weight = np.argsort(weights[rows], axis=1)
    corners = np.take_along_axis(surface.triangles[triangle[rows]], by_weight, axis=1)
    pivot = corners[:, 2]
    on_edge = weights[rows, by_weight[:, 1]] > 0
    second = np.where(on_edge, corners[:, 1], pivot)  # of a vertex's triangles all count, of an edge's those with both
    incident, first, last = _faces_around(surface.triangles, np.concatenate([pivot, second]))
    (first, first_2), (last, last_2) = np.split(first, 2), np.split(last, 2)
    fewer = last_2 - first_2 < last - first  # an edge's triangles are found at either of its ends
    second = np.where(fewer, pivot, second)
    first, last = np.where(fewer, first_2, first), np.where(fewer, last_2, last)

    differing = np.zeros(len(rows), bool)
    group = np.cumsum(last - first) // _CANDIDATES
    for here in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(group)) + 1):
        row = np.repeat(here, last[here] - first[here])
        face = incident[ranges(first[here], last[here])]
        a, b, c = surface.triangles[face].T
        with_both = (a == second[row]) | (b == second[row]) | (c == second[row])
        row, face = row[with_both], face[with_both]

        candidates, candidate_weights = closest_on(surface, points[rows[row]], face)
        away = points[rows[row]] - candidates
        distance = np.sqrt(dot(away, away))
        facing = np.abs(dot(away, triangle_normals(surface.vertices, surface.triangles[face])))
        start = np.flatnonzero(np.diff(row, prepend=-1))
        least = np.repeat(np.minimum.reduceat(distance, start), np.diff(start, append=len(row)))
        facing[distance > least + ON_SURFACE] = -1.0
        most = np.repeat(np.maximum.reduceat(facing, start), np.diff(start, append=len(row)))
        is_best = facing == most
        _, winner = np.unique(row[is_best], return_index=True)
        chosen = np.flatnonzero(is_best)[winner]
        at = rows[here]
        triangle[at], nearest[at], weights[at] = face[chosen], candidates[chosen], candidate_weights[chosen]
        if again is not None:
            gap = candidates - nearest[rows[row]]
            differing[row[(dot(gap, gap) > ON_SURFACE**2) & (distance < least + TIE)]] = True
    if again is not None and differing.any():
        at = rows[differing]
        first_found = again(points[at], np.linalg.norm(points[at] - nearest[at], axis=1))
        triangle[at], nearest[at], weights[at] = _settled(surface, points[at], first_found, None)
    return triangle, nearest, weights


def _close_to_edges(surface: Surface, points: Floats, triangle: Ints, nearest: Floats, weights: Floats) -> Ints:
    """Rows whose p_n lies inside a triangle, but so close to an edge that the next one is as near in float32.

    Moved along the surface by s, p_n is farther from p by s^2 / (2 |pp_n|).
    """
    least = weights.min(axis=1)
    rows = np.flatnonzero((least > 0) & (least < 0.5))
    away = points.take(rows, axis=0) - nearest.take(rows, axis=0)
    reach = TIE + np.sqrt(2 * TIE * np.sqrt(dot(away, away)))
    a, b, c = (surface.vertices.take(surface.triangles[triangle[rows], k], axis=0) for k in range(3))
    area = cross(b - a, c - a)
    longest = np.maximum(np.maximum(dot(b - a, b - a), dot(c - b, c - b)), dot(a - c, a - c))
    height = np.sqrt(dot(area, area) / longest)  # the least of the three: at least as many rows as there must be
    return rows[least[rows] * height < reach]


def _faces_around(triangles: Ints, vertices: Ints) -> tuple[Ints, Ints, Ints]:
    """Faces around some vertices: those of vertices[k] are faces[first[k] : last[k]]."""
    asked = np.zeros(int(triangles.max()) + 1, bool)
    asked[vertices] = True
    face, corner = np.nonzero(asked[triangles])
    around = triangles[face, corner]
    order = np.argsort(around, kind="stable")
    around = around[order]
    return face[order], np.searchsorted(around, vertices), np.searchsorted(around, vertices, side="right")
