# SPDX-License-Identifier: GPL-3.0-or-later
"""Many questions to the spatial query of a surface: in which order they are put, and how many at once."""

from __future__ import annotations

import contextlib
from contextlib import AbstractContextManager
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from .geometry import Floats, Ints, closest_on_triangles, cross, dot, lengths, triangle_normals
from .stepper import Progress, Work, as_part, finish
from .surface import Surface, SurfaceQuery

# A ray goes on this far behind a hit, some float32 steps, so as not to find the same place again.
RAY_STEP = 1e-6
# Upper bounds get this much, relative and absolute, for the float32 arithmetic of a tree.
BOUND_SLACK, BOUND_MARGIN = 1e-4, 1e-6
# Axes that rays are turned about where they met a fold, by a thousandth of a radian or less.
_TILTS = 1e-3 * np.array([[0.36, 0.48, 0.8], [0.8, -0.36, 0.48], [-0.48, 0.8, 0.36]])
# Every so many-th point is looked up first; its triangle bounds the distance of the points after it.
_STRIDES = (64, 8, 1)
_BATCH = 1024  # questions of a step that are asked one after the other
# Rays through a soup of overlapping triangles cross hundreds of them, and a tree is asked for each crossing, while
# testing a ray against a triangle without a tree costs about 1 / 300 of a question.
_PROBED_RAYS = 32
_SOUP_CROSSINGS, _SOUP_SHARE = 16, 1 / 300  # crossings of a ray from which on it is one; and of the triangles
_RAY_TESTS = 1 << 21  # rays times triangles of a step


@runtime_checkable
class BatchQuery(SurfaceQuery, Protocol):
    """A spatial query that answers many questions at once, sooner than one after the other by another tree.

    Attributes:
        batch: how many are a step.
    """

    batch: int

    def opened(self) -> AbstractContextManager[None]:
        """While many questions are asked: what the query sets up for them is gone afterwards."""

    def one_by_one(self, points: Floats, bounds: Floats) -> Ints:
        """As nearest, by the tree that decides where several triangles are equally near in float32."""


def opened(query: SurfaceQuery) -> AbstractContextManager[None]:
    """query.opened(), where it has that."""
    return query.opened() if isinstance(query, BatchQuery) else contextlib.nullcontext()


def batch_size(query: SurfaceQuery) -> int:
    """How many questions a step asks."""
    return query.batch if isinstance(query, BatchQuery) else _BATCH


def nearest_triangles(surface: Surface, points: Floats, reach: Floats | None) -> Work[Ints]:
    """(N,) the triangle that is nearest to each point, up to float32; yields the share done.

    Args:
        points: in an order in which neighbours are near in space.
        reach: (N,) upper bounds of the distances, where known.
    """
    query, size = surface.query, batch_size(surface.query)
    if reach is None and not isinstance(query, BatchQuery):  # which asks at once: no answer bounds another
        return (yield from nearest_one_by_one(surface, points))
    triangle = np.empty(len(points), np.int64)
    for first in range(0, len(points), size):
        here = slice(first, first + size)
        triangle[here] = query.nearest(points[here], None if reach is None else loosened(reach[here]))
        yield Progress("", min(1.0, (first + size) / len(points)))
    return triangle


def nearest_one_by_one(surface: Surface, points: Floats) -> Work[Ints]:
    """As nearest_triangles, one question after the other: what was found for some bounds the others' distances."""
    query = surface.query
    triangle = np.empty(len(points), np.int64)
    order, looked_up = np.arange(len(points)), 0
    for index, chosen in enumerate(_coarse_to_fine(order)):
        guides = _guide(order, index) if index else chosen
        for first in range(0, len(chosen), _BATCH):
            batch = chosen[first : first + _BATCH]
            here, bounds = points.take(batch, axis=0), np.full(len(batch), np.inf)
            if index:
                guide = triangle.take(guides[first : first + _BATCH])
                bounds = lengths(here - closest_on(surface, here, guide)[0])
            if isinstance(query, BatchQuery):
                triangle[batch] = query.one_by_one(here, bounds)
            else:
                triangle[batch] = query.nearest(here, loosened(bounds))
            looked_up += len(batch)
            yield Progress("", looked_up / len(points))
    return triangle


def loosened(bounds: Floats) -> Floats:
    """Upper bounds, with room for the float32 of a tree."""
    return bounds * (1 + BOUND_SLACK) + BOUND_MARGIN


def crossing_counts(surface: Surface, origins: Floats, directions: Floats, closed: bool) -> Work[Ints]:
    """(N,) how often the rays cross the surface, by a tree or, in a soup, without; yields the share done.

    Odd is inside (III-B).

    Args:
        closed: mind folds, as careful_counts does. On an open surface the direction decides anyway.
    """
    if not len(origins):
        return np.zeros(0, np.int64)
    if not _is_soup(surface, origins, directions):
        counting = careful_counts if closed else counting_crossings
        return (yield from counting(surface, origins, directions))
    count, size = np.empty(len(origins), np.int64), max(1, _RAY_TESTS // len(surface.triangles))
    for first in range(0, len(origins), size):
        here = slice(first, first + size)
        count[here] = count_crossings_of_all(surface, origins[here], directions[here])
        yield Progress("", min(1.0, (first + size) / len(origins)))
    return count


def count_crossings(surface: Surface, origins: Floats, directions: Floats) -> Ints:
    """counting_crossings, run to its end."""
    return finish(counting_crossings(surface, origins, directions))


def counting_crossings(surface: Surface, origins: Floats, directions: Floats) -> Work[Ints]:
    """(N,) how often the rays cross the surface; yields the share done."""
    count, _ = yield from _counting(surface, origins, directions, False)
    return count


def careful_counts(surface: Surface, origins: Floats, directions: Floats) -> Work[Ints]:
    """As counting_crossings, on a closed surface, where no direction matters.

    Near a fold a ray may leave again within the step that it takes behind a hit. Looking back tells such rays; they
    are counted in directions that differ a little. A few that meet folds in all of them are tested against every
    triangle; many, as where sheets coincide, keep their first count.
    """
    count, folded = yield from _counting(surface, origins, directions, True)
    doubtful = np.flatnonzero(folded)
    for axis in _TILTS:
        if not doubtful.size:
            return count
        tilted = directions[doubtful] + cross(directions[doubtful], np.tile(axis, (len(doubtful), 1)))
        tilted /= np.linalg.norm(tilted, axis=1, keepdims=True)
        found, folded = yield from as_part(_counting(surface, origins[doubtful], tilted, True), 1.0, 0.0)
        count[doubtful[~folded]] = found[~folded]
        doubtful = doubtful[folded]
    if len(doubtful) * len(surface.triangles) <= _RAY_TESTS:
        count[doubtful] = count_crossings_of_all(surface, origins[doubtful], directions[doubtful])
    return count


def _counting(
    surface: Surface, origins: Floats, directions: Floats, look_back: bool
) -> Work[tuple[Ints, NDArray[np.bool_]]]:
    """(N,) crossings, and (N,) whether, looking back, a ray has found another triangle within the step behind a hit.

    Yields the share done. A ray crosses a triangle once: when the tree finds the last triangle again, rounding held
    the ray back, and it takes a longer step instead of counting.
    """
    size, query = batch_size(surface.query), surface.query
    count = np.zeros(len(origins), np.int64)
    folded = np.zeros(len(origins), bool)
    last = np.full(len(origins), -1)
    step = np.full(len(origins), RAY_STEP)
    travelled = np.zeros(len(origins))
    going, begun = np.zeros(0, np.int64), 0  # rays that have hit go on in the next step, beside others that begin
    while begun < len(origins) or going.size:
        more = min(len(origins), begun + max(0, size - going.size))
        rays, waiting = np.concatenate([going[:size], np.arange(begun, more)]), going[size:]
        begun = more
        triangle, distance = query.first_hit(_along(origins, travelled, directions, rays), directions[rays])
        hit = triangle >= 0
        rays, triangle, distance = rays[hit], triangle[hit], distance[hit]
        again = triangle == last[rays]
        count[rays] += ~again
        step[rays] = np.where(again, 2 * step[rays], RAY_STEP)
        last[rays] = triangle
        travelled[rays] += distance + step[rays]
        if look_back and rays.size:
            behind, _ = query.first_hit(_along(origins, travelled, directions, rays), -directions[rays])
            folded[rays] |= behind != triangle
        going = np.concatenate([waiting, rays])
        yield Progress("", (begun - going.size / 2) / len(origins))
    return count, folded


def _along(origins: Floats, travelled: Floats, directions: Floats, rays: Ints) -> Floats:
    along = directions.take(rays, axis=0)
    along *= travelled.take(rays)[:, None]
    along += origins.take(rays, axis=0)
    return along


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
    probe = slice(None, None, max(1, len(origins) // _PROBED_RAYS))
    origins, directions = origins[probe], directions[probe]
    rays, crossings = len(origins), 0
    limit = max(_SOUP_CROSSINGS, _SOUP_SHARE * len(surface.triangles)) * rays
    at_once = 8  # in a soup already the first few tell, and each takes long
    if isinstance(surface.query, BatchQuery):
        at_once = rays
    for first in range(0, rays, at_once):
        here = slice(first, first + at_once)
        crossings += int(count_crossings(surface, origins[here], directions[here]).sum())
        if crossings > limit:
            return True
    return False


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


def normals_at(surface: Surface, triangle: Ints) -> Floats:
    """(N, 3) unit normals of (N,) triangles, which may come again and again: each is computed once, where that pays."""
    if len(surface.triangles) > len(triangle):
        return triangle_normals(surface.vertices, surface.triangles.take(triangle, axis=0))
    return np.ascontiguousarray(triangle_normals(surface.vertices, surface.triangles)).take(triangle, axis=0)
