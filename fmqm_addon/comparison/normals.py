# SPDX-License-Identifier: GPL-3.0-or-later
"""Normals at the corners of triangles: a mesh's own, or smoothed where edges are not sharp."""

from __future__ import annotations

import numpy as np

from ..metric.geometry import Floats, Ints, cross, dot, lengths, triangle_edges, triangle_normals
from ..metric.surface import Surface

SMOOTH_ANGLE = 60.0  # degrees; where a mesh has no normals, they are smoothed over edges that are less sharp


def corner_normals(surface: Surface, smooth_angle: float = SMOOTH_ANGLE, faces: Ints | None = None) -> Floats:
    """(T, 3, 3) float64 unit normals: the surface's own; smoothed at corners where it has none.

    Args:
        smooth_angle: degrees; edges that are at least as sharp stay so.
        faces: (F,) rows of the triangles that are asked for, and the result's rows; None: all.
    """
    if surface.normals is None:
        return smoothed_normals(surface, smooth_angle, faces)
    given = surface.normals if faces is None else surface.normals[faces]
    length = np.linalg.norm(given, axis=2, keepdims=True)
    known = np.isfinite(length) & (length > 0)
    if known.all():
        return given / length
    return np.where(known, given / np.where(known, length, 1), smoothed_normals(surface, smooth_angle, faces))


def smoothed_normals(surface: Surface, smooth_angle: float = SMOOTH_ANGLE, faces: Ints | None = None) -> Floats:
    """(T, 3, 3) float64 unit normals: at each corner, the mean of the faces around it up to the next sharp edges.

    Faces count by their angle at the corner, as in Blender: a mesh looks alike whether its file has the normals of
    Shade Auto Smooth or none. Those that do not touch the faces asked for change nothing, and cost nothing.
    """
    if faces is None:
        return _smoothed(surface.vertices, surface.triangles, smooth_angle)
    touched = np.zeros(len(surface.vertices), bool)
    touched[surface.triangles[faces]] = True
    around = np.flatnonzero(touched[surface.triangles].any(axis=1))
    return _smoothed(surface.vertices, surface.triangles[around], smooth_angle)[np.searchsorted(around, faces)]


def _smoothed(vertices: Floats, triangles: Ints, smooth_angle: float) -> Floats:
    flat = triangle_normals(vertices, triangles)
    weighted = (flat[:, None] * _angles(vertices, triangles)[..., None]).reshape(-1, 3)
    fan = _fans(triangles, flat, float(np.cos(np.radians(smooth_angle))))
    total = np.stack([np.bincount(fan, column, len(fan)) for column in weighted.T], axis=1)[fan]
    length = np.linalg.norm(total, axis=1, keepdims=True)
    smooth = np.where(length > 0, total / np.where(length > 0, length, 1), np.repeat(flat, 3, axis=0))
    return smooth.reshape(-1, 3, 3)


def _angles(vertices: Floats, triangles: Ints) -> Floats:
    """(T, 3) radians at the corners of triangles that are not degenerate."""
    ab, ac = triangle_edges(vertices, triangles)
    bc, double_area = ac - ab, lengths(cross(ab, ac))
    adjacent = (dot(ab, ac), -dot(ab, bc), dot(ac, bc))
    return np.stack([np.arctan2(double_area, each) for each in adjacent], axis=1)


def _fans(triangles: Ints, flat: Floats, sharp: float) -> Ints:
    """(3 T,) a number for each corner, the same for those at one vertex that edges join which are not sharp:
    whose faces' normals have at least this cosine."""
    corner = np.arange(3 * len(flat)).reshape(-1, 3)
    # Each edge of each triangle, with the corners at its two ends: at the lower vertex first.
    starts, ends = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    at_start, at_end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    at_low, at_high = np.where(starts < ends, at_start, at_end), np.where(starts < ends, at_end, at_start)
    order = np.argsort(low * (int(triangles.max(initial=0)) + 1) + high, kind="stable")
    one, other = order[:-1], order[1:]
    joined = (low[one] == low[other]) & (high[one] == high[other])
    joined &= dot(flat[one // 3], flat[other // 3]) >= sharp
    one, other = one[joined], other[joined]
    first, second = np.concatenate([at_low[one], at_high[one]]), np.concatenate([at_low[other], at_high[other]])
    fan = np.arange(3 * len(flat))
    while True:  # the least number spreads; what points to it is followed twice as far each time
        least = np.minimum(fan[first], fan[second])
        spread = fan.copy()
        np.minimum.at(spread, fan[first], least)
        np.minimum.at(spread, fan[second], least)
        spread = spread[spread]
        if np.array_equal(spread, fan):
            return fan
        fan = spread
