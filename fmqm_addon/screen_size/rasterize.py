# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangle each pixel of an orthographic view shows, and where on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..comparison.depth_buffer import NOTHING, on_screen
from ..metric.geometry import Floats, Ints
from ..metric.stepper import finish


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
    found = finish(finish(on_screen(x, y, depth, triangles, (side, side))).showing())
    pixels = np.flatnonzero(found != NOTHING)
    found = found[pixels]
    return Fragments(side, pixels, found, _barycentric(x, y, triangles[found], pixels, side))


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
