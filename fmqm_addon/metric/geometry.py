# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry of points and triangles that the fields and patches need."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEEDLE = 1e-8  # sine of a triangle's angle below which rounding decides its plane; its edges remain
_MORTON_BITS = 10
_PLACE_BITS = 63 - 3 * _MORTON_BITS


def cross(a: Floats, b: Floats) -> Floats:
    """(N, 3) cross products, each axis in one piece of memory; np.cross takes several times as long."""
    ax, ay, az = a.T
    bx, by, bz = b.T
    product = np.empty((3, len(ax)))
    np.subtract(ay * bz, az * by, out=product[0])
    np.subtract(az * bx, ax * bz, out=product[1])
    np.subtract(ax * by, ay * bx, out=product[2])
    return product.T


def dot(a: Floats, b: Floats) -> Floats:
    """(N,) inner products of the rows; np.einsum adds them up in this order too, and takes twice as long."""
    ax, ay, az = a.T
    bx, by, bz = b.T
    product: Floats = ax * bx
    product += az * bz
    product += ay * by
    return product


def lengths(rows: Floats) -> Floats:
    """(N,) Euclidean lengths of the rows, to the last bit those of np.linalg.norm, which takes four times as long."""
    x, y, z = rows.T
    squared: Floats = x * x
    squared += y * y
    squared += z * z
    return np.sqrt(squared, out=squared)


def triangle_edges(vertices: Floats, triangles: Ints) -> tuple[Floats, Floats]:
    """(T, 3) vectors from the first corner of each triangle to the two others; each axis in one piece of memory."""
    a, b, c = (vertices.take(triangles[:, k], axis=0) for k in range(3))
    return np.subtract(b, a, order="F"), np.subtract(c, a, order="F")


def triangle_areas(vertices: Floats, triangles: Ints) -> Floats:
    """(T,) areas."""
    return lengths(cross(*triangle_edges(vertices, triangles))) / 2


def triangle_normals(vertices: Floats, triangles: Ints) -> Floats:
    """(T, 3) unit normals; the triangles must not be degenerate."""
    normals = cross(*triangle_edges(vertices, triangles))
    return np.asarray((normals.T / lengths(normals)).T)


def weighted(weights: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    """(N, K) sums of the rows of (N, K) a, b and c, with (N, 3) weights; each column in one piece of memory."""
    of_a, of_b, of_c = weights.T
    total = np.empty((a.shape[1], len(a)))
    for row, ka, kb, kc in zip(total, a.T, b.T, c.T, strict=True):
        np.multiply(of_a, ka, out=row)
        row += of_b * kb
        row += of_c * kc
    return total.T


def first_of_each(ascending: Ints) -> Ints:
    """Where each of the values, none negative, stands for the first time."""
    return np.flatnonzero(np.diff(ascending, prepend=-1))


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
    place = np.arange(len(points))  # below the cell in each key: sorts several times faster than a stable argsort
    return np.sort((x | y << 1 | z << 2) << _PLACE_BITS | place) & ((1 << _PLACE_BITS) - 1)


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
    # Each axis in one piece of memory, which all that follows is faster for.
    ab, ac, ap = (np.subtract(end, start, order="F") for end, start in ((b, a), (c, a), (points, a)))
    normal = cross(ab, ac)
    # Cross products keep these two exact for slivers, where inner products would cancel.
    squared = dot(normal, normal)
    weights = np.empty((len(points), 3), order="F")
    alpha, beta, gamma = weights.T
    np.divide(dot(cross(ap, ac), normal), squared, out=beta)
    np.divide(dot(cross(ab, ap), normal), squared, out=gamma)
    np.subtract(1 - beta, gamma, out=alpha)
    needle = squared < NEEDLE * NEEDLE * dot(ab, ab) * dot(ac, ac)
    outside = np.flatnonzero((alpha < 0) | (beta < 0) | (gamma < 0) | needle)
    if outside.size:
        weights[outside] = _closest_on_edges(*(rows.take(outside, axis=0) for rows in (points, a, b, c)))
    return weighted(weights, a, b, c), weights


def _closest_on_edges(points: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    corners = (a, b, c)
    best = np.full(len(points), np.inf)
    weights = np.zeros((3, len(points)))
    for k in range(3):
        start, end = corners[k], corners[(k + 1) % 3]
        edge, away = np.subtract(end, start, order="F"), np.subtract(points, start, order="F")
        t = np.clip(dot(away, edge) / dot(edge, edge), 0, 1)
        gap = away - (t * edge.T).T
        distance = dot(gap, gap)
        nearer = distance < best
        np.copyto(best, distance, where=nearer)
        for corner, weight in ((k, 1 - t), ((k + 1) % 3, t), ((k + 2) % 3, 0.0)):
            np.copyto(weights[corner], weight, where=nearer)
    return weights.T
