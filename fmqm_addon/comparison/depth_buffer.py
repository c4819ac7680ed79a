# SPDX-License-Identifier: GPL-3.0-or-later
"""A depth buffer in numpy: which triangle each pixel of an image shows; for who projects vertices, however that is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..metric.geometry import Floats, Ints, ranges
from ..metric.stepper import Progress, Work

DEEPEST = 1.9  # how far from 0 nearness is told apart; what lies beyond is as near as this
NOTHING = -1  # the triangle of a pixel that shows none
CENTER = (0.5, 0.5)
# Of a step: few enough for a processor's cache.
_TRIANGLES, _SPANS, _FRAGMENTS = 1 << 16, 1 << 16, 1 << 17
_TILE = 8  # pixels
_NEAR_STEPS = float(1 << 29)  # a unit of nearness
_EMPTY = np.iinfo(np.int64).max

Kept = Callable[[Ints, Ints], NDArray[np.bool_]]


@dataclass(frozen=True)
class Screen:
    """Triangles as they lie on an image.

    Attributes:
        size: width and height of the image in pixels.
        x, y: (V,) float64 pixels from its left and its top.
        near: (V,) float64 from -DEEPEST to DEEPEST: of two places, the one where it is more hides the other. On the
            image it is linear over each triangle.
        names: (T,) int64 what showing() calls the triangles. corners: (T, 3) of each its vertices, from the top down.
    """

    size: tuple[int, int]
    x: Floats
    y: Floats
    near: Floats
    names: Ints
    corners: Ints

    def showing(
        self, pixels: Ints | None = None, at: tuple[float, float] = CENTER, kept: Kept | None = None
    ) -> Work[Ints]:
        """(N,) int64 the triangle that each pixel shows, from either side, or NOTHING; yields the share done.

        A pixel shows a triangle that holds a place in it; of neighbors that share an edge, exactly one does.

        Args:
            pixels: (N,) ascending, the row times the width plus the column of those that are asked; None: all.
            at: the place: shares of a pixel from its left and its top.
            kept: whether there is something of (N,) triangles at (N,) pixels; through holes one sees what lies behind.
        """
        width, height = self.size
        before = None  # of each pixel and of the end: how many that come before it are asked
        if pixels is not None:
            before = np.zeros(width * height + 1, np.int64)
            before[pixels + 1] = 1
            np.cumsum(before, out=before)
        buffer = np.full(width * height if pixels is None else len(pixels), _EMPTY, np.int64)
        for start in range(0, len(self.corners), _TRIANGLES):
            corners = self.corners[start : start + _TRIANGLES]
            first = np.maximum(np.ceil(self.y[corners[:, 0]] - at[1]), 0).astype(np.int64)
            last = np.minimum(np.ceil(self.y[corners[:, 2]] - at[1]), height).astype(np.int64)
            rows = np.maximum(last - first, 0)
            some = np.flatnonzero(rows)
            for part in _parts(rows[some], _SPANS):
                here = some[part]
                spans = self._spans(start + here, first[here], rows[here], at, before)
                for few in _parts(spans.count, _FRAGMENTS):
                    spans.draw(buffer, few, pixels, kept)
                    yield Progress("", min((start + int(here[-1])) / len(self.corners), 1.0))
        return np.where(buffer == _EMPTY, NOTHING, buffer & 0xFFFFFFFF)

    def about(self, pixels: Ints) -> Screen:
        """Only those of the triangles that may be seen in some pixels, to ask showing() about these.

        Args:
            pixels: (N,) as in showing().
        """
        width, height = self.size
        row, column = np.divmod(pixels, width)
        asked = np.zeros((height // _TILE + 2, width // _TILE + 2), np.int64)
        asked[row // _TILE + 1, column // _TILE + 1] = 1
        asked = asked.cumsum(axis=0).cumsum(axis=1)  # tiles above and to the left of each corner of one
        across = (np.clip(self.x, 0, width - 1) / _TILE).astype(np.int64)
        along = (np.clip(self.y, 0, height - 1) / _TILE).astype(np.int64)
        columns = across[self.corners]
        left, right = columns.min(axis=1), columns.max(axis=1) + 1
        top, bottom = along[self.corners[:, 0]], along[self.corners[:, 2]] + 1
        count = asked[bottom, right] - asked[top, right] - asked[bottom, left] + asked[top, left]
        some = np.flatnonzero(count)
        return replace(self, names=self.names[some], corners=self.corners[some])

    def _spans(self, which: Ints, first: Ints, rows: Ints, at: tuple[float, float], before: Ints | None) -> _Spans:
        """Where some of the triangles cross rows of the image.

        Args:
            which: of the triangles. first, rows: of the image, that each touches. before: as in showing().
        """
        corners = self.corners[which]
        x0, x1, x2 = (self.x[corners[:, k]] for k in range(3))
        y0, y1, y2 = (self.y[corners[:, k]] for k in range(3))
        z0, z1, z2 = (self.near[corners[:, k]] for k in range(3))
        with np.errstate(divide="ignore", invalid="ignore"):  # edges along a row are never asked
            long, upper, lower = (x2 - x0) / (y2 - y0), (x1 - x0) / (y1 - y0), (x2 - x1) / (y2 - y1)
            area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
            step_x = ((z1 - z0) * (y2 - y0) - (z2 - z0) * (y1 - y0)) / area
            step_y = ((x1 - x0) * (z2 - z0) - (x2 - x0) * (z1 - z0)) / area
        edge_on = ~(np.isfinite(step_x) & np.isfinite(step_y))
        step_x, step_y = np.where(edge_on, 0, step_x), np.where(edge_on, 0, step_y)

        of = np.repeat(np.arange(len(rows)), rows)
        row = ranges(first, first + rows)
        middle = row + at[1]
        above = middle < y1[of]
        # From the upper end of an edge, whichever triangle asks: both of an edge must get the same.
        with np.errstate(invalid="ignore"):
            short = np.where(above, x0[of] + (middle - y0[of]) * upper[of], x1[of] + (middle - y1[of]) * lower[of])
        other = x0[of] + (middle - y0[of]) * long[of]
        width = self.size[0]
        left = np.clip(np.ceil(np.minimum(short, other) - at[0]), 0, width).astype(np.int64)
        right = np.clip(np.ceil(np.maximum(short, other) - at[0]), 0, width).astype(np.int64)
        start, end = row * width + left, row * width + right
        place = start if before is None else before[start]
        count = np.maximum((end if before is None else before[end]) - place, 0)
        some = np.flatnonzero(count)
        of, row, left = of[some], row[some], left[some]
        z = z0[of] + (left + at[0] - x0[of]) * step_x[of] + (row + at[1] - y0[of]) * step_y[of]
        least, most = np.minimum(np.minimum(z0, z1), z2), np.maximum(np.maximum(z0, z1), z2)
        return _Spans(start[some], place[some], count[some], z, step_x[of], least[of], most[of], self.names[which][of])


@dataclass(frozen=True)
class _Spans:
    """Parts of rows of the image, (S,) each.

    Attributes:
        start: the first pixel. place: of the first that is asked, among them. count: of those that are asked.
        near: at the start; step: from pixel to pixel. least, most: of the triangle. name: its.
    """

    start: Ints
    place: Ints
    count: Ints
    near: Floats
    step: Floats
    least: Floats
    most: Floats
    name: Ints

    def draw(self, buffer: Ints, some: slice, pixels: Ints | None, kept: Kept | None) -> None:
        """Into the buffer: nearness in the upper half of an integer, the triangle in the lower; the least is seen."""
        place, count = self.place[some], self.count[some]
        of = np.repeat(np.arange(some.start, some.stop), count)
        place = ranges(place, place + count)
        across = (place if pixels is None else pixels[place]) - self.start[of]
        near = self.near[of] + across * self.step[of]
        # Slivers that are seen from their edge have no reliable slope.
        near = np.clip(near, self.least[of], self.most[of])
        key = ((2 - np.clip(near, -DEEPEST, DEEPEST)) * _NEAR_STEPS).astype(np.int64) << 32 | self.name[of]
        if kept is not None:
            there = kept(self.name[of], self.start[of] + across)
            place, key = place[there], key[there]
        np.minimum.at(buffer, place, key)


def on_screen(x: Floats, y: Floats, near: Floats, triangles: Ints, size: tuple[int, int]) -> Work[Screen]:
    """The triangles that may be seen on an image, named by their rows; yields the share done.

    Args:
        x, y, near: (V,) as in Screen. triangles: (T, 3) of vertices.
    """
    names, corners = [], []
    for start in range(0, max(len(triangles), 1), _TRIANGLES):
        some = triangles[start : start + _TRIANGLES]
        across, along = x[some], y[some]
        inside = (across.max(axis=1) >= 0) & (across.min(axis=1) < size[0])
        inside &= (along.max(axis=1) >= 0) & (along.min(axis=1) < size[1])
        here = np.flatnonzero(inside)
        order = np.argsort(along[here], axis=1, kind="stable")
        names.append(start + here)
        corners.append(np.take_along_axis(some[here], order, axis=1))
        yield Progress("", min(1.0, (start + _TRIANGLES) / max(len(triangles), 1)))
    return Screen(size, x, y, near, np.concatenate(names), np.concatenate(corners))


def _parts(weights: Ints, most: int) -> Iterator[slice]:
    """Slices of rows whose weights add up to about so much at most, a row at least."""
    if len(weights):
        total = np.cumsum(weights)
        yield from (slice(*ends) for ends in pairwise([0, *(np.flatnonzero(np.diff(total // most)) + 1), len(weights)]))
