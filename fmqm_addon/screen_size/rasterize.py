# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangle each pixel of an orthographic view shows, and where on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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


@dataclass(frozen=True)
class CutOut:
    """Triangles that have holes.

    Attributes:
        some: (T,) which of them may have some.
        kept: whether there is something of (N,) triangles at (N, 3) barycentric places.
    """

    some: NDArray[np.bool_]
    kept: Callable[[Ints, Floats], NDArray[np.bool_]]


def rasterize(
    vertices: Floats, triangles: Ints, axes: Floats, scale: float, side: int, cut_out: CutOut | None = None
) -> Fragments:
    """Draws triangles, both sides of them, into a depth buffer.

    A pixel is covered where its center lies in a triangle; of neighbors that share an edge, exactly one covers it.

    Args:
        vertices: (V, 3) around the origin, which the image has at its center; some diagonals large at most.
        axes: (3, 3) rows right, up, toward the viewer. scale: pixels per unit. side: of the image, in pixels.
        cut_out: through holes one sees what lies behind.
    """
    view = vertices @ axes.T
    x, y, depth = view[:, 0] * scale + side / 2, side / 2 - view[:, 1] * scale, view[:, 2]
    planes = _planes(x, y, triangles)
    kept = None
    if cut_out is not None:
        some, asked_of = cut_out.some, cut_out.kept

        def kept(names: Ints, pixels: Ints) -> NDArray[np.bool_]:
            result = np.ones(len(names), bool)
            asked = np.flatnonzero(some[names])
            name = names[asked]
            result[asked] = asked_of(name, _barycentric(planes, name, pixels[asked], side))
            return result

    found = finish(finish(on_screen(x, y, depth, triangles, (side, side))).showing(kept=kept))
    pixels = np.flatnonzero(found != NOTHING)
    found = found[pixels]
    return Fragments(side, pixels, found, _barycentric(planes, found, pixels, side))


def _planes(x: Floats, y: Floats, triangles: Ints) -> Floats:
    """(T, 6) of each triangle: its first corner, and by what the second and third weight grow along x and y."""
    ax, bx, cx = (x[triangles[:, k]] for k in range(3))
    ay, by, cy = (y[triangles[:, k]] for k in range(3))
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    safe = np.where(area == 0, 1, area)
    return np.stack([ax, ay, (cy - ay) / safe, (ax - cx) / safe, (ay - by) / safe, (bx - ax) / safe], axis=1)


def _barycentric(planes: Floats, triangles: Ints, pixels: Ints, side: int) -> Floats:
    """(N, 3) of the pixels' centers on rows of planes."""
    row, column = np.divmod(pixels, side)
    ax, ay, beta_x, beta_y, gamma_x, gamma_y = planes.take(triangles, axis=0).T
    px, py = column + 0.5 - ax, row + 0.5 - ay
    beta, gamma = px * beta_x + py * beta_y, px * gamma_x + py * gamma_y
    weights = np.clip(np.stack([1 - beta - gamma, beta, gamma], axis=1), 0, 1)
    return weights / weights.sum(axis=1, keepdims=True)
