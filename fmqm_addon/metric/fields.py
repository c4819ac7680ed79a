# SPDX-License-Identifier: GPL-3.0-or-later
"""SDF (III-B) and NCF (IV-A) of one surface at given points."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .geometry import Floats, Ints, closest_on_triangles, cross, dot, ranges
from .surface import Surface, triangle_normals

# Below the resolution of a float32 tree in a box of diagonal 1, p - p_n has no direction: p = p_n.
ON_SURFACE = 1e-9
# A ray goes on this far behind a hit, some float32 steps, so as not to find the same place again.
RAY_STEP = 1e-6
# Upper bounds get this much, relative and absolute, for the float32 arithmetic of a tree.
BOUND_SLACK, BOUND_MARGIN = 1e-4, 1e-6
# Every so many-th point is looked up first; its triangle bounds the distance of the points after it.
_STRIDES = (64, 8, 1)
_BATCH = 1024  # queries of a step
_SURFACE_BATCH = 16384  # points of a step that asks no tree
_CANDIDATES = 1 << 20  # faces around nearest points that are looked at at once: a fan's hub may have any number
# Rays through a soup of overlapping triangles cross hundreds of them, and a tree is asked for each crossing, while
# testing a ray against a triangle without a tree costs about 1 / 300 of a question.
_PROBED_RAYS = 32
_SOUP_CROSSINGS, _SOUP_SHARE = 16, 1 / 300  # crossings of a ray from which on it is one; and of the triangles
_RAY_TESTS = 1 << 21  # rays times triangles of a step


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


def evaluate_fields(
    surface: Surface, points: Floats, order: Ints, reach: Floats | None = None
) -> Generator[float, None, Fields]:
    """Equations (3), (4) and (7) at the points; yields the share done.

    Args:
        points: (N, 3) in the metric's frame.
        order: (N,) an order in which neighbours are near in space.
        reach: (N,) upper bounds of the distances, where known; None finds its own.

    The tree says which triangle is nearest and what a ray hits; where on the triangle, and how far, is
    computed here in float64.
    """
    triangle = yield from _nearest_triangles(surface, points, order, reach)
    nearest = np.empty_like(points)
    ncf = np.empty(points.shape, np.float32)
    for first in range(0, len(order), _SURFACE_BATCH):
        batch = order[first : first + _SURFACE_BATCH]
        triangle[batch], nearest[batch], weights = _settled(surface, points[batch], triangle[batch])
        ncf[batch] = surface.color_at(triangle[batch], weights)
        yield 0.35 + 0.1 * (first + len(batch)) / len(order)
    away = points - nearest
    sdf = np.sqrt(dot(away, away))
    on_surface = sdf <= ON_SURFACE
    nearest[on_surface] = points[on_surface]
    sdf[on_surface] = 0.0

    off_surface = order[~on_surface[order]]
    count, size = count_crossings, _BATCH
    probe = off_surface[:: max(1, len(off_surface) // _PROBED_RAYS)]
    if _is_soup(surface, points[probe], away[probe] / sdf[probe, None]):
        count, size = count_crossings_of_all, max(1, _RAY_TESTS // len(surface.triangles))
    for first in range(0, len(off_surface), size):
        batch = off_surface[first : first + size]
        crossings = count(surface, points[batch], away[batch] / sdf[batch, None])
        sdf[batch[crossings % 2 == 1]] *= -1
        yield 0.45 + 0.55 * (first + len(batch)) / len(off_surface)
    return Fields(nearest, triangle, sdf, ncf)


def _nearest_triangles(
    surface: Surface, points: Floats, order: Ints, reach: Floats | None
) -> Generator[float, None, Ints]:
    """(N,) the triangle that is nearest to each point, up to float32; yields 0 to 0.35."""
    triangle = np.empty(len(points), np.int64)
    rounds = [order] if reach is not None else _coarse_to_fine(order)
    looked_up = 0
    for index, chosen in enumerate(rounds):
        guides = _guide(order, index) if index else chosen
        for first in range(0, len(chosen), _BATCH):
            batch = chosen[first : first + _BATCH]
            if reach is not None:
                bounds = reach[batch]
            elif index == 0:
                bounds = np.full(len(batch), np.inf)
            else:
                guide = triangle[guides[first : first + _BATCH]]
                bounds = np.linalg.norm(points[batch] - closest_on(surface, points[batch], guide)[0], axis=1)
            triangle[batch] = surface.query.nearest(points[batch], bounds * (1 + BOUND_SLACK) + BOUND_MARGIN)
            looked_up += len(batch)
            yield 0.35 * looked_up / len(points)
    return triangle


def count_crossings(surface: Surface, origins: Floats, directions: Floats) -> Ints:
    """(N,) how often the rays cross the surface; odd is inside (III-B).

    A ray crosses a triangle once: when the tree finds the last triangle again, rounding held the ray
    back, and it takes a longer step instead of counting.
    """
    count = np.zeros(len(origins), np.int64)
    last = np.full(len(origins), -1)
    step = np.full(len(origins), RAY_STEP)
    travelled = np.zeros(len(origins))
    rays = np.arange(len(origins))
    while rays.size:
        here = origins[rays] + travelled[rays, None] * directions[rays]
        triangle, distance = surface.query.first_hit(here, directions[rays])
        hit = triangle >= 0
        rays, triangle, distance = rays[hit], triangle[hit], distance[hit]
        again = triangle == last[rays]
        count[rays] += ~again
        step[rays] = np.where(again, 2 * step[rays], RAY_STEP)
        last[rays] = triangle
        travelled[rays] += distance + step[rays]
    return count


def count_crossings_of_all(surface: Surface, origins: Floats, directions: Floats) -> Ints:
    """As count_crossings, by testing every ray against every triangle.

    A line passes through a triangle when it runs around its three edges in one sense: the products of its Pluecker
    coordinates with theirs have one sign. They sum up to direction . normal.
    """
    corners = [surface.vertices.take(surface.triangles[:, k], axis=0) for k in range(3)]
    rays = np.concatenate([directions, cross(origins, directions)], axis=1)
    turns = []
    for a, b in zip(corners, corners[1:] + corners[:1], strict=True):
        turns.append(rays @ np.concatenate([cross(a, b), b - a], axis=1).T)
    one, two, three = turns
    along_normal = one + two + three
    normal = cross(corners[1] - corners[0], corners[2] - corners[0])
    height = dot(corners[0], normal) - origins @ normal.T
    inside = ((one >= 0) & (two >= 0) & (three >= 0)) | ((one <= 0) & (two <= 0) & (three <= 0))
    return np.count_nonzero(inside & (height * along_normal > 0), axis=1)


def _is_soup(surface: Surface, origins: Floats, directions: Floats) -> bool:
    """Whether rays like these cross so many triangles that asking a tree for each crossing takes too long."""
    rays, crossings = len(origins), 0
    limit = max(_SOUP_CROSSINGS, _SOUP_SHARE * len(surface.triangles)) * rays
    for first in range(0, rays, 8):  # in a soup already the first few tell, and each takes long
        crossings += int(count_crossings(surface, origins[first : first + 8], directions[first : first + 8]).sum())
        if crossings > limit:
            return True
    return False


def _settled(surface: Surface, points: Floats, triangle: Ints) -> tuple[Ints, Floats, Floats]:
    """Triangle, p_n and its barycentric weights, given the nearest triangles as a tree found them.

    Where p_n lies on an edge or vertex, its triangle becomes the one there that faces p most. All of them
    are equally near, but across a UV seam their colors differ: which one a tree happens to find first, in
    the order of a file, must not decide. (The paper has no rule for ties.)
    """
    nearest, weights = closest_on(surface, points, triangle)
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

    triangle = triangle.copy()
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
    return triangle, nearest, weights


def _faces_around(triangles: Ints, vertices: Ints) -> tuple[Ints, Ints, Ints]:
    """Faces around some vertices: those of vertices[k] are faces[first[k] : last[k]]."""
    asked = np.zeros(int(triangles.max()) + 1, bool)
    asked[vertices] = True
    face, corner = np.nonzero(asked[triangles])
    around = triangles[face, corner]
    order = np.argsort(around, kind="stable")
    around = around[order]
    return face[order], np.searchsorted(around, vertices), np.searchsorted(around, vertices, side="right")


def _coarse_to_fine(order: Ints) -> list[Ints]:
    """The order in rounds: every 64th, the rest of every 8th, the rest."""
    place = np.arange(len(order))
    rounds = []
    done = np.zeros(len(order), bool)
    for stride in _STRIDES:
        now = (place % stride == 0) & ~done
        done |= now
        rounds.append(order[now])
    return rounds


def _guide(order: Ints, index: int) -> Ints:
    """For each point of a round, the point of the round before it that comes just before in the order."""
    place = np.arange(len(order))
    before, stride = _STRIDES[index - 1], _STRIDES[index]
    now = (place % stride == 0) & (place % before != 0)
    return order[place[now] // before * before]


def closest_on(surface: Surface, points: Floats, triangle: Ints) -> tuple[Floats, Floats]:
    """Closest points to (N, 3) points on (N,) triangles of a surface, and their barycentric weights, both (N, 3)."""
    corners = surface.triangles.take(triangle, axis=0)
    a, b, c = (surface.vertices.take(corners[:, k], axis=0) for k in range(3))
    return closest_on_triangles(points, a, b, c)
