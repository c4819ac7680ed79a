# SPDX-License-Identifier: GPL-3.0-or-later
"""A surface's own colors at a grid of places on each triangle: what a graphics card can show without materials.

Between three neighbors on the grid colors are interpolated. No texture coordinates are needed (mesh colors: C. Yuksel,
J. Keyser, D. H. House).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...comparison.normals import corner_normals
from ...metric.geometry import Floats, Ints, triangle_areas
from ...metric.stepper import Progress, Work
from ...metric.surface import Surface

MOST_CELLS = 255  # along an edge
_BATCH = 1 << 15  # colors of a step
_FACES = 1 << 13  # triangles of a step
_LARGER = 1.15  # each time there would be too many places


@dataclass(frozen=True)
class MeshColors:
    """A surface for a graphics card.

    Attributes:
        positions: (3 T, 3) float32, the corners of each triangle one after the other. normals: (3 T, 3) float32, unit.
        first: (T,) row in colors of each triangle's first place. cells: (T,) along each of its edges.
        colors: (N, 3) uint8 encoded. In a triangle, place (i, j) is i cells from its first corner towards the second
            and j towards the third, i + j <= cells; i runs first.
    """

    positions: NDArray[np.float32]
    normals: NDArray[np.float32]
    first: Ints
    cells: Ints
    colors: NDArray[np.uint8]


def sampling_colors(surface: Surface, places: int) -> Work[MeshColors]:
    """About so many places on a surface, evenly, and at least the corners of its triangles; in small steps."""
    count = len(surface.triangles)
    normals = np.empty((count, 3, 3), np.float32)
    for first in range(0, count, _FACES):
        faces = np.arange(first, min(first + _FACES, count))
        normals[faces] = corner_normals(surface, faces=faces)
        yield Progress("", 0.4 * faces[-1] / count)
    cells = _cells(surface, places)
    order = np.argsort(cells, kind="stable")
    sizes = (cells + 1) * (cells + 2) // 2
    starts = np.empty(count, np.int64)
    starts[order] = np.cumsum(sizes[order]) - sizes[order]
    colors = np.empty((int(sizes.sum()), 3), np.uint8)
    bounds = np.flatnonzero(np.diff(cells[order], prepend=-1))
    for begin, end in zip(bounds, [*bounds[1:], count], strict=True):
        same = order[begin:end]  # triangles with equally many cells
        grid = _grid(int(cells[same[0]]))
        step = max(1, _BATCH // len(grid))
        for first in range(0, len(same), step):
            here = same[first : first + step]
            weights = np.tile(grid, (len(here), 1))
            found = np.clip(surface.color_at(np.repeat(here, len(grid)), weights), 0, 1) * 255 + 0.5
            row = starts[here[0]]
            colors[row : row + len(found)] = found.astype(np.uint8)
            yield Progress("", 0.4 + 0.6 * (row + len(found)) / len(colors))
    positions = surface.vertices[surface.triangles].reshape(-1, 3).astype(np.float32)
    return MeshColors(positions, normals.reshape(-1, 3), starts, cells, colors)


def _cells(surface: Surface, places: int) -> Ints:
    """(T,) cells along the edges of each triangle, by its longest, for about so many places in all."""
    corners = surface.vertices[surface.triangles]
    edges = corners - np.roll(corners, 1, axis=1)
    longest = np.sqrt((edges * edges).sum(axis=2).max(axis=1))
    spacing = float(np.sqrt(triangle_areas(surface.vertices, surface.triangles).sum() / places))
    while True:
        cells = np.clip(np.ceil(longest / spacing), 1, MOST_CELLS).astype(np.int64)
        if ((cells + 1) * (cells + 2) // 2).sum() <= max(places, 3 * len(cells)):
            return cells
        spacing *= _LARGER


def _grid(cells: int) -> Floats:
    """((cells + 1) (cells + 2) / 2, 3) barycentric weights of a triangle's places."""
    j, i = np.nonzero(np.add.outer(np.arange(cells + 1), np.arange(cells + 1)) <= cells)
    return np.stack([cells - i - j, i, j], axis=1) / cells
