# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the nearest surface point p_n lies on the triangle that a tree found, and which triangle counts where several
are equally near."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .geometry import Floats, Ints, cross, dot, first_of_each, lengths, ranges
from .queries import closest_on, normals_at
from .stepper import Progress, Work, finish
from .surface import Surface

# Below the resolution of a float32 tree in a box of diagonal 1, p - p_n has no direction: p = p_n.
ON_SURFACE = 1e-9
# What two float32 trees may take for one distance, some roundings of a position.
TIE = 5e-7
BATCH = 8192  # points of a step that asks no tree: few enough for what is computed of them to stay in a core's cache
_CANDIDATES = 1 << 16  # faces around nearest points that are looked at at once: a fan's hub may have any number

Again = Callable[[Floats, Floats], Ints]


def settling(
    surface: Surface, points: Floats, triangle: Ints, again: Again | None
) -> Work[tuple[Ints, Floats, Floats]]:
    """Triangle, p_n and its barycentric weights, given the nearest triangles as a tree found them; yields the share
    done.

    Where p_n lies on an edge or vertex, its triangle becomes the one there that faces p most. All of them
    are equally near, but across a UV seam their colors differ: which one a tree happens to find first, in
    the order of a file, must not decide. (The paper has no rule for ties.)

    Where float32 cannot tell two of them apart and p_n differs, it does decide: what another tree found is asked again.

    Args:
        again: nearest triangles of points, given upper bounds of their distances, by the tree that decides.
    """
    triangle = triangle.copy()
    nearest, weights = np.empty((2, len(points), 3))
    all_faces = surface.triangles if again is not None and len(surface.triangles) <= len(points) else None
    heights = None if all_faces is None else _least_heights(surface.vertices, all_faces)
    touching = []
    for first in range(0, len(points), BATCH):
        here = slice(first, first + BATCH)
        found, found_weights = closest_on(surface, points[here], triangle[here])
        if again is not None:
            rows = _close_to_edges(surface, points[here], triangle[here], found, found_weights, heights)
            if rows.size:
                asked = points[here].take(rows, axis=0)
                triangle[first + rows] = again(asked, lengths(asked - found.take(rows, axis=0)))
                found[rows], found_weights[rows] = closest_on(surface, asked, triangle[first + rows])
        nearest[here], weights[here] = found, found_weights
        of_a, of_b, of_c = found_weights.T
        touching.append(first + np.flatnonzero((of_a == 0) | (of_b == 0) | (of_c == 0)))
        yield Progress("", 0.6 * min(1.0, (first + BATCH) / len(points)))
    differing = yield from _settling_edges(surface, points, np.concatenate(touching), triangle, nearest, weights)
    if again is not None:
        for first in range(0, len(differing), BATCH):
            at = differing[first : first + BATCH]
            asked = points.take(at, axis=0)
            found_first = again(asked, lengths(asked - nearest.take(at, axis=0)))
            triangle[at], nearest[at], weights[at] = finish(settling(surface, asked, found_first, None))
            yield Progress("", 1.0)
    return triangle, nearest, weights


def _close_to_edges(
    surface: Surface, points: Floats, triangle: Ints, nearest: Floats, weights: Floats, heights: Floats | None
) -> Ints:
    """Rows whose p_n lies inside a triangle, but so close to an edge that the next one is as near in float32.

    Moved along the surface by s, p_n is farther from p by s^2 / (2 |pp_n|).

    Args:
        heights: _least_heights of all triangles, where they are fewer than the points.
    """
    of_a, of_b, of_c = weights.T
    least = np.minimum(np.minimum(of_a, of_b), of_c)
    rows = np.flatnonzero(least > 0)
    away = points - nearest
    reach = TIE + np.sqrt(2 * TIE * np.sqrt(dot(away, away)))
    own = triangle.take(rows)
    height = _least_heights(surface.vertices, surface.triangles.take(own, axis=0)) if heights is None else heights[own]
    return rows[least.take(rows) * height < reach.take(rows)]


def _least_heights(vertices: Floats, triangles: Ints) -> Floats:
    """(T,) the least of the three heights of each triangle."""
    a, b, c = (vertices.take(triangles[:, k], axis=0) for k in range(3))
    ab, ac, bc = (np.subtract(end, start, order="F") for end, start in ((b, a), (c, a), (c, b)))
    area = cross(ab, ac)
    longest = np.maximum(np.maximum(dot(ab, ab), dot(bc, bc)), dot(ac, ac))
    return np.sqrt(dot(area, area) / longest)


def _settling_edges(
    surface: Surface, points: Floats, rows: Ints, triangle: Ints, nearest: Floats, weights: Floats
) -> Work[Ints]:
    """Settles the rows whose p_n lies on an edge or vertex, in place; yields 0.8.

    Returns:
        Those for which float32 cannot tell p_n from another one, elsewhere.
    """
    if not rows.size:
        return rows
    of_a, of_b, of_c = weights.take(rows, axis=0).T
    a, b, c = surface.triangles.take(triangle.take(rows), axis=0).T
    # Of a vertex's triangles all count, of an edge's those with both of its vertices, found at either of them.
    one, other = np.where(of_a > 0, a, np.where(of_b > 0, b, c)), np.where(of_c > 0, c, np.where(of_b > 0, b, a))
    incident, first, last = _faces_around(surface.triangles, np.concatenate([one, other]))
    (first, first_2), (last, last_2) = np.split(first, 2), np.split(last, 2)
    fewer = last_2 - first_2 < last - first
    second = np.where(fewer, one, other)
    first, last = np.where(fewer, first_2, first), np.where(fewer, last_2, last)
    yield Progress("", 0.8)

    differing = np.zeros(len(rows), bool)
    group = np.cumsum(last - first) // _CANDIDATES
    for here in np.split(np.arange(len(rows)), np.flatnonzero(np.diff(group)) + 1):
        row = np.repeat(here, last[here] - first[here])
        face = incident.take(ranges(first[here], last[here]))
        (a, b, c), also = surface.triangles.take(face, axis=0).T, second.take(row)
        with_both = np.flatnonzero((a == also) | (b == also) | (c == also))
        row, face = row.take(with_both), face.take(with_both)

        asked = points.take(rows.take(row), axis=0)
        candidates, candidate_weights = closest_on(surface, asked, face)
        away = asked - candidates
        distance = np.sqrt(dot(away, away))
        facing = np.abs(dot(away, normals_at(surface, face)))
        start = first_of_each(row)
        count = np.diff(start, append=len(row))
        least = np.repeat(np.minimum.reduceat(distance, start), count)
        facing[distance > least + ON_SURFACE] = -1.0
        best = np.flatnonzero(facing == np.repeat(np.maximum.reduceat(facing, start), count))
        chosen = best.take(first_of_each(row.take(best)))
        at = rows[here]
        triangle[at], nearest[at], weights[at] = face[chosen], candidates[chosen], candidate_weights[chosen]
        gap = candidates - candidates.take(np.repeat(chosen, count), axis=0)
        differing[row[(dot(gap, gap) > ON_SURFACE**2) & (distance < least + TIE)]] = True
        yield Progress("", 0.8)
    return rows[differing]


def _faces_around(triangles: Ints, vertices: Ints) -> tuple[Ints, Ints, Ints]:
    """Faces around some vertices: those of vertices[k] are faces[first[k] : last[k]]."""
    asked = np.zeros(int(triangles.max()) + 1, bool)
    asked[vertices] = True
    corner = np.flatnonzero(asked.take(triangles))
    around = triangles.ravel().take(corner)
    order = np.argsort(around, kind="stable")
    around = around[order]
    return corner[order] // 3, np.searchsorted(around, vertices), np.searchsorted(around, vertices, side="right")
