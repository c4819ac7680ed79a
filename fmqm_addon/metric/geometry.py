# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry of points and triangles that the fields and patches need."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEEDLE = 1e-8  # sine of a triangle's angle below which rounding decides its plane; its edges remain
_MORTON_BITS = 10


def cross(a: Floats, b: Floats) -> Floats:
    """(N, 3) cross products; np.cross takes several times as long."""
    ax, ay, az = a.T
    bx, by, bz = b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def dot(a: Floats, b: Floats) -> Floats:
    """(N,) inner products of the rows."""
    return np.einsum("ij,ij->i", a, b)


def ranges(first: Ints, last: Ints) -> Ints:
    """The whole numbers first[0] .. last[0] - 1, first[1] .. last[1] - 1, and so on, in one array."""
    counts = last - first
    ends = np.cumsum(counts)
    return np.arange(counts.sum()) + np.repeat(first - ends + counts, counts)


def morton_order(points: Floats) -> Ints:
    """(N,) indices that put (N, 3) points along a Z-order curve: neighbours in the order are near in space."""
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max())
    cells = (points - low) * ((2**_MORTON_BITS - 1) / extent if extent > 0 else 0.0)
    x, y, z = (_spread(column) for column in cells.astype(np.int64).T)
    return np.argsort(x | y << 1 | z << 2, kind="stable")


def _spread(x: Ints) -> Ints:
    """Two zero bits between each of the ten bits of x."""
    x = (x | x << 16) & 0x030000FF
    x = (x | x << 8) & 0x0300F00F
    x = (x | x << 4) & 0x030C30C3
    return (x | x << 2) & 0x09249249


def closest_on_triangles(points: Floats, a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats]:
    """Closest point of triangle n to point n, in float64.

    Args:
        points, a, b, c: (N, 3); the triangles have area.

    Returns:
        (N, 3) closest points and their (N, 3) barycentric coordinates, none negative, summing to 1.
    """
    ab, ac, ap = b - a, c - a, points - a
    normal = cross(ab, ac)
    # Cross products keep these two exact for slivers, where inner products would cancel.
    squared = dot(normal, normal)
    beta = dot(cross(ap, ac), normal) / squared
    gamma = dot(cross(ab, ap), normal) / squared
    weights = np.stack([1 - beta - gamma, beta, gamma], axis=1)
    needle = squared < NEEDLE * NEEDLE * dot(ab, ab) * dot(ac, ac)
    outside = np.flatnonzero((weights < 0).any(axis=1) | needle)
    if outside.size:
        weights[outside] = _closest_on_edges(points[outside], a[outside], b[outside], c[outside])
    return weights[:, :1] * a + weights[:, 1:2] * b + weights[:, 2:] * c, weights


def _closest_on_edges(points: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    corners = (a, b, c)
    best = np.full(len(points), np.inf)
    weights = np.zeros((len(points), 3))
    for k in range(3):
        start, end = corners[k], corners[(k + 1) % 3]
        edge = end - start
        t = np.clip(dot(points - start, edge) / dot(edge, edge), 0, 1)
        gap = points - start - t[:, None] * edge
        distance = dot(gap, gap)
        nearer = distance < best
        best = np.where(nearer, distance, best)
        w = np.zeros_like(weights)
        w[:, k], w[:, (k + 1) % 3] = 1 - t, t
        weights[nearer] = w[nearer]
    return weights
