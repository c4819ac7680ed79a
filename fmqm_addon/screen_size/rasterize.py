# SPDX-License-Identifier: GPL-3.0-or-later
"""A depth buffer in numpy: which triangle each pixel of an orthographic view shows."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..metric.geometry import Floats, Ints, ranges

_FRAGMENTS = 1_000_000  # at once: what is held in memory
_DEPTH_STEPS = float(1 << 29)  # a unit of depth; depths lie within a few diagonals of the center
_DEEPEST = 1.9  # diagonals from the center; what lies farther is as deep as this
_EMPTY = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Fragments:
    """What a view shows.

    Attributes:
        side: of the square image, in pixels.
        pixels: (N,) int64, ascending: the row times side plus the column of those that are covered; row 0 is the top.
        triangles: (N,) int64, nearest to the viewer there.
        barycentric: (N, 3) float64: where the pixel's center lies on it.
    """

    side: int
    pixels: Ints
    triangles: Ints
    barycentric: Floats


def rasterize(vertices: Floats, triangles: Ints, axes: Floats, scale: float, side: int) -> Fragments:
    """Draws triangles, both sides of them, into a depth buffer.

    A pixel is covered where its center lies in a triangle; of neighbors that share an edge, exactly one covers it.

    Args:
        vertices: (V, 3) around the origin, which the image has at its center; some diagonals large at most.
        axes: (3, 3) rows right, up, toward the viewer. scale: pixels per unit. side: of the image, in pixels.
    """
    view = vertices @ axes.T
    x, y, depth = view[:, 0] * scale + side / 2, side / 2 - view[:, 1] * scale, view[:, 2]
    shown = _on_image(x, y, triangles, side)
    corners = triangles[shown]
    order = np.argsort(y[corners], axis=1, kind="stable")
    ordered = np.take_along_axis(corners, order, axis=1)
    first = np.maximum(np.ceil(y[ordered[:, 0]] - 0.5), 0).astype(np.int64)
    last = np.minimum(np.ceil(y[ordered[:, 2]] - 0.5), side).astype(np.int64)
    rows = np.maximum(last - first, 0)
    some = np.flatnonzero(rows)
    shown, ordered, first, rows = shown[some], ordered[some], first[some], rows[some]
    buffer = np.full(side * side, _EMPTY, np.int64)
    most = np.cumsum(rows * np.minimum(np.ptp(x[ordered], axis=1) + 1, side))  # pixels, or fewer
    bounds = [0, *(np.flatnonzero(np.diff(most // _FRAGMENTS)) + 1).tolist(), len(rows)]
    for start, end in pairwise(bounds):
        part = slice(start, end)
        _draw(buffer, x, y, depth, ordered[part], first[part], rows[part], shown[part], side)
    pixels = np.flatnonzero(buffer != _EMPTY)
    found = buffer[pixels] & 0xFFFFFFFF
    return Fragments(side, pixels, found, _barycentric(x, y, triangles[found], pixels, side))


def _on_image(x: Floats, y: Floats, triangles: Ints, side: int) -> Ints:
    """Rows of the triangles whose boxes touch the image."""
    across, along = x[triangles], y[triangles]
    inside = (across.max(axis=1) >= 0) & (across.min(axis=1) < side)
    inside &= (along.max(axis=1) >= 0) & (along.min(axis=1) < side)
    return np.flatnonzero(inside)


def _draw(
    buffer: Ints, x: Floats, y: Floats, depth: Floats, ordered: Ints, first: Ints, rows: Ints, names: Ints, side: int
) -> None:
    """Into the buffer: depth in the upper half of an integer, the triangle in the lower; the nearest is the least.

    Args:
        ordered: (T, 3) vertices of the triangles, from the top down. first, rows: of the image that they touch.
    """
    x0, x1, x2 = (x[ordered[:, k]] for k in range(3))
    y0, y1, y2 = (y[ordered[:, k]] for k in range(3))
    z0, z1, z2 = (depth[ordered[:, k]] for k in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):  # edges along a row are never asked
        long, upper, lower = (x2 - x0) / (y2 - y0), (x1 - x0) / (y1 - y0), (x2 - x1) / (y2 - y1)
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        step_x = ((z1 - z0) * (y2 - y0) - (z2 - z0) * (y1 - y0)) / area
        step_y = ((x1 - x0) * (z2 - z0) - (x2 - x0) * (z1 - z0)) / area
    edge_on = ~(np.isfinite(step_x) & np.isfinite(step_y))
    step_x, step_y = np.where(edge_on, 0, step_x), np.where(edge_on, 0, step_y)

    which = np.repeat(np.arange(len(rows)), rows)
    row = ranges(first, first + rows)
    middle = row + 0.5
    above = middle < y1[which]
    # From the upper end of an edge, whichever triangle asks: both of an edge must get the same.
    with np.errstate(invalid="ignore"):
        short = np.where(
            above,
            x0[which] + (middle - y0[which]) * upper[which],
            x1[which] + (middle - y1[which]) * lower[which],
        )
    other = x0[which] + (middle - y0[which]) * long[which]
    left = np.clip(np.ceil(np.minimum(short, other) - 0.5), 0, side).astype(np.int64)
    right = np.clip(np.ceil(np.maximum(short, other) - 0.5), 0, side).astype(np.int64)
    some = np.flatnonzero(right > left)
    which, row, left, right = which[some], row[some], left[some], right[some]
    z = z0[which] + (left + 0.5 - x0[which]) * step_x[which] + (row + 0.5 - y0[which]) * step_y[which]

    count = right - left
    span = np.repeat(np.arange(len(count)), count)
    start = row * side + left
    place = ranges(start, start + count)
    of = which[span]
    near = z[span] + (place - start[span]) * step_x[of]
    # Slivers that are seen from their edge have no reliable slope.
    near = np.clip(near, np.minimum(np.minimum(z0, z1), z2)[of], np.maximum(np.maximum(z0, z1), z2)[of])
    key = ((2 - np.clip(near, -_DEEPEST, _DEEPEST)) * _DEPTH_STEPS).astype(np.int64) << 32 | names[of]
    np.minimum.at(buffer, place, key)


def _barycentric(x: Floats, y: Floats, corners: Ints, pixels: Ints, side: int) -> Floats:
    row, column = np.divmod(pixels, side)
    px, py = column + 0.5, row + 0.5
    ax, bx, cx = (x[corners[:, k]] for k in range(3))
    ay, by, cy = (y[corners[:, k]] for k in range(3))
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    safe = np.where(area == 0, 1, area)
    beta = ((px - ax) * (cy - ay) - (cx - ax) * (py - ay)) / safe
    gamma = ((bx - ax) * (py - ay) - (px - ax) * (by - ay)) / safe
    weights = np.clip(np.stack([1 - beta - gamma, beta, gamma], axis=1), 0, 1)
    return weights / weights.sum(axis=1, keepdims=True)
