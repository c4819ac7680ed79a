# SPDX-License-Identifier: GPL-3.0-or-later
"""Where on a baked image each triangle lies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...metric.errors import MeshError
from ...metric.geometry import Floats, Ints, dot, triangle_areas

LARGEST = 8192  # pixels a side
_ROOMY, _TIGHT = 4, 2  # smallest sides of cells: one that still shows gradients, one that is left if there is no room
_NUDGE = 0.004  # pixels; a baker draws pixels whose centers lie inside, and those on an edge only on two sides
_OVER = 1e-5  # outside of [0, 1] that is taken for rounding: far below half a pixel
_EVEN = 1 / 16  # least share of the image that an own map may give to a surface, by the surface's share of the area
_UNEVEN = 0.01  # share of the area that may be worse off

_SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
_HALF = np.array([(0, 0), (1, 0), (0, 1)])
_OUTWARD = np.array([(-1, -1), (2, -1), (-1, 2)])  # moves all three sides of _HALF out by one


@dataclass(frozen=True)
class Layout:
    """Triangles on a square image.

    Attributes:
        side: of the image, pixels.
        corners: (T, 3, 2) float32 texture coordinates for lookups.
        drawn: (T, 3, 2) float32 those for the baker, larger by a hair.
        halves: (P, 4) column and row of the right angle's pixel, direction of the legs (1 or -1), their length in
            pixels: the triangles for which fill() completes what bilinear lookups read.
        own: the corners are the mesh's own UV map.
    """

    side: int
    corners: NDArray[np.float32]
    drawn: NDArray[np.float32]
    halves: Ints
    own: bool = False

    def fill(self, pixels: NDArray[Any]) -> None:
        """Completes a baked image, (side, side, C) with row 0 at v = 0.

        A lookup near the longest side of a right triangle also reads the pixels beyond it. With these on the plane
        through their three neighbors it gives what lies between the triangle's own pixels.
        """
        for leg in np.unique(self.halves[:, 3]):
            x, y, way, _ = (column[:, None] for column in self.halves[self.halves[:, 3] == leg].T)
            step = np.arange(1, leg + 1)
            column, row = x + way * step, y + way * (leg + 1 - step)
            pixels[row, column] = (
                pixels[row, column - way] + pixels[row - way, column] - pixels[row - way, column - way]
            )


def own_layout(uv: NDArray[np.float32], areas: Floats, side: int) -> Layout | None:
    """The mesh's own UV map, where it serves; None where it does not.

    It must lie in [0, 1] and give nearly all of the surface its fair share of the image, and no pixel may belong to
    two triangles: overlaps thinner than a pixel pass, and are not seen in the image either.

    Args:
        uv: (T, 3, 2). areas: (T,) of the triangles on the surface. side: of the image.
    """
    if not (np.isfinite(uv).all() and uv.min(initial=0) >= -_OVER and uv.max(initial=1) <= 1 + _OVER):
        return None
    a, b, c = (uv[:, k].astype(np.float64) for k in range(3))
    shares = np.abs(_cross2(b - a, c - a)) / 2
    if areas[shares * areas.sum() < _EVEN * areas].sum() > _UNEVEN * areas.sum():
        return None
    if _covered(uv, side).max() > 1:
        return None
    return Layout(side, uv, uv, np.empty((0, 4), np.int64), own=True)


def new_layout(vertices: Floats, triangles: Ints, place: Ints, quad: Ints, side: int) -> Layout:
    """Squares of power-of-two sides for quads and for pairs of other triangles, large ones for large faces.

    No lookup in a triangle reads a pixel of another face.

    Args:
        vertices: (V, 3). triangles: (T, 3) integers into them.
        place: (T, 3) which of its polygon's corners each corner is.
        quad: (T,) number of the quad that the triangle is one of two halves of; -1 for others.
        side: of the image in pixels; rounded up to a power of two, and as far as the triangles need.

    Raises:
        MeshError: more triangles than the largest image has room for.
    """
    size = _sizes(vertices, triangles)
    loose, halves = np.flatnonzero(quad < 0), np.flatnonzero(quad >= 0)
    loose = loose[np.argsort(-size[loose], kind="stable")]  # neighbors in this order share a square
    quads, which = np.unique(quad[halves], return_inverse=True)
    wanted = np.zeros(len(quads) + (len(loose) + 1) // 2)
    cell = np.empty(len(quad), np.int64)
    cell[halves] = which
    cell[loose] = len(quads) + np.arange(len(loose)) // 2
    np.maximum.at(wanted, cell, size)

    side, smallest = _image_side(len(wanted), side)
    cell_side = _cell_sides(wanted, side, smallest)
    origin = _pack(cell_side)[cell].astype(np.float64)
    reach = (cell_side[cell] - 1).astype(np.float64)

    corners = np.empty((len(quad), 3, 2))
    drawn = np.empty_like(corners)
    unit = _SQUARE[place[halves]]
    corners[halves] = origin[halves, None] + unit * reach[halves, None, None]
    drawn[halves] = corners[halves] + _NUDGE * (2 * unit - 1)
    # The second of a pair is the first one turned by a half; a row of pixels stays free between them.
    second = (np.arange(len(loose)) % 2).astype(bool)
    way = np.where(second, -1.0, 1.0)
    angle = origin[loose] + np.where(second, reach[loose], 0.0)[:, None]
    leg = np.maximum(reach[loose] - 2, 0)
    nudge = np.where(leg > 0, _NUDGE, 1 / 3)  # a triangle that is one pixel only has it in its middle
    corners[loose] = angle[:, None] + way[:, None, None] * leg[:, None, None] * _HALF
    drawn[loose] = corners[loose] + way[:, None, None] * nudge[:, None, None] * _OUTWARD
    return Layout(
        side,
        ((corners + 0.5) / side).astype(np.float32),
        ((drawn + 0.5) / side).astype(np.float32),
        np.column_stack([angle, way, leg]).astype(np.int64)[leg > 0],
    )


def _sizes(vertices: Floats, triangles: Ints) -> Floats:
    """(T,) about how long triangles are: between the root of the area and the longest side, so that thin ones get
    some pixels along their length."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    longest = np.sqrt(np.maximum(np.maximum(dot(b - a, b - a), dot(c - b, c - b)), dot(a - c, a - c)))
    return np.sqrt(np.sqrt(triangle_areas(vertices, triangles)) * longest)


def _image_side(cells: int, side: int) -> tuple[int, int]:
    """Sides of the image and of the smallest cells, in pixels."""
    side = min(1 << max(side - 1, 1).bit_length(), LARGEST)
    while cells * _ROOMY**2 > side**2 and side < LARGEST:
        side *= 2
    smallest = _ROOMY if cells * _ROOMY**2 <= side**2 else _TIGHT
    if cells * smallest**2 > side**2:
        raise MeshError(f"{cells} faces are more than a baked image of {LARGEST} x {LARGEST} has room for")
    return side, smallest


def _cell_sides(wanted: Floats, side: int, smallest: int) -> Ints:
    """(C,) powers of two, about proportional to what is wanted; their squares fill side squared as far as they can."""
    least, most = smallest.bit_length() - 1, side.bit_length() - 1
    size = np.log2(np.maximum(wanted / (wanted.max(initial=0) or 1), 1e-9))

    def exponents(shift: float) -> Ints:
        return np.clip(np.floor(size + shift), least, most).astype(np.int64)

    low, high = least - size.max(initial=0), most - size.min(initial=0)  # all the smallest, all as large as the image
    for _ in range(24):
        middle = (low + high) / 2
        if (4 ** exponents(middle)).sum() <= side**2:
            low = middle
        else:
            high = middle
    exponent = exponents(low)
    # What room is left goes to those that came closest to the next size.
    order = np.argsort(exponent - size, kind="stable")
    order = order[exponent[order] < most]
    cost = np.cumsum(3 * 4 ** exponent[order])
    exponent[order[cost <= side**2 - (4**exponent).sum()]] += 1
    return 2**exponent


def _pack(cell_side: Ints) -> Ints:
    """(C, 2) column and row of the lower left pixel of squares with power-of-two sides.

    Along a Morton curve, the largest first, each starts at a multiple of its own area, and that stretch of the
    curve is a square.
    """
    order = np.argsort(-cell_side, kind="stable")
    area = cell_side[order] ** 2
    start = np.empty(len(order), np.int64)
    start[order] = np.cumsum(area) - area
    return np.stack([_even_bits(start), _even_bits(start >> 1)], axis=1)


def _even_bits(code: Ints) -> Ints:
    """Bits 0, 2, 4 ... of a number, moved together."""
    code = code & 0x5555555555555555
    for shift, mask in (
        (1, 0x3333333333333333),
        (2, 0x0F0F0F0F0F0F0F0F),
        (4, 0x00FF00FF00FF00FF),
        (8, 0x0000FFFF0000FFFF),
    ):
        code = (code | code >> shift) & mask
    return (code | code >> 16) & 0xFFFFFFFF


def _covered(uv: NDArray[np.float32], side: int) -> NDArray[np.int32]:
    """(side, side) how many triangles hold each pixel's center, row 0 at v = 0; of a shared edge one has them."""
    corners = uv.astype(np.float64) * side - 0.5
    order = np.argsort(corners[:, :, 1], axis=1, kind="stable")
    low, middle, high = (np.take_along_axis(corners, order[:, k, None, None], axis=1)[:, 0] for k in range(3))
    first = np.ceil(low[:, 1]).astype(np.int64)
    rows = np.maximum(np.ceil(high[:, 1]).astype(np.int64) - first, 0)
    which = np.repeat(np.arange(len(uv)), rows)
    row = np.arange(len(which)) - np.repeat(np.cumsum(rows) - rows, rows) + first[which]
    lower = row < middle[which, 1]
    long = _crossing(low[which], high[which], row)
    short = np.where(lower, _crossing(low[which], middle[which], row), _crossing(middle[which], high[which], row))
    begin = np.ceil(np.minimum(long, short)).astype(np.int64)
    end = np.ceil(np.maximum(long, short)).astype(np.int64)
    change = np.zeros((side, side + 1), np.int32)  # +1 where a span begins, -1 where it has ended
    np.add.at(change, (row, begin), 1)
    np.add.at(change, (row, end), -1)
    return np.cumsum(change, axis=1, dtype=np.int32)


def _crossing(a: Floats, b: Floats, row: Ints) -> Floats:
    """Where the line from a to b, a not above b, meets a row."""
    rise = b[:, 1] - a[:, 1]
    share = np.divide(row - a[:, 1], rise, out=np.zeros(len(row)), where=rise > 0)
    return a[:, 0] + np.clip(share, 0, 1) * (b[:, 0] - a[:, 0])


def _cross2(a: Floats, b: Floats) -> Floats:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
