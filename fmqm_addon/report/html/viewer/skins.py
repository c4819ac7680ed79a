# SPDX-License-Identifier: GPL-3.0-or-later
"""Measured colors as a graphics card can show them: images on texture coordinates, or colors at corners."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ....metric.geometry import Floats, Ints
from ....metric.surface import Surface
from ....metric.texture import Color, Material, Texture, image_arrays

LARGEST_SIDE = 2048  # pixels of an image
_TILES = 8  # an image of what a material calculates spans at most so many whole steps of its texture coordinates
_SMALLEST_CELL = 5  # pixels; two triangles share a cell
_LARGEST_CELL = 256
_ROWS = 1 << 18  # lookups at once
_PROBES = 4096  # corners that are asked whether a color depends on texture coordinates alone
_ALIKE = 1e-6
_WRAPS = {"repeat": "repeat", "mirror": "mirror", "extend": "clamp", "clip": "clamp"}


@dataclass(frozen=True)
class Skin:
    """What some triangles are colored by.

    Attributes:
        pixels: (H, W, 3) uint8 encoded colors, row 0 is the top; None: the colors at the corners.
        wrap: what lies outside [0, 1]: "repeat", "mirror" or "clamp".
        smooth: pixels are blended with their neighbors. shrinks: smaller versions of it may be made.
    """

    pixels: NDArray[np.uint8] | None
    wrap: str = "clamp"
    smooth: bool = True
    shrinks: bool = True


@dataclass(frozen=True)
class Coloring:
    """How a surface is colored.

    Attributes:
        skins: at least one. skin: (T,) into them.
        uv: (T, 3, 2) float64 at the corners; 0 where a skin has no image.
        colors: (T, 3, 3) uint8 encoded colors at the corners; 255 where a skin has an image.
    """

    skins: tuple[Skin, ...]
    skin: Ints
    uv: Floats
    colors: NDArray[np.uint8]


def coloring(surface: Surface) -> Coloring:
    """A surface's measured colors: an image is taken as it is where a material shows nothing else; what a material
    calculates is painted to an image, over its texture coordinates or triangle by triangle."""
    count = len(surface.triangles)
    skin, uv = np.zeros(count, np.int64), np.zeros((count, 3, 2))
    colors = np.full((count, 3, 3), 255, np.uint8)
    skins: list[Skin] = []
    rest: list[Ints] = []
    for index, material in enumerate(surface.materials):
        here = np.flatnonzero(surface.material == index)
        if not len(here):
            continue
        values = surface.corners[here].reshape(len(here) * 3, surface.corners.shape[2])
        if not any(True for _ in image_arrays(material.color)):
            colors[here] = _bytes(material.color.lookup(values)).reshape(-1, 3, 3)
            made, placed = Skin(None), None
        else:
            found = _image_skin(material.color, values) or _painted(material, values)
            if found is None:
                rest.append(here)
                continue
            made, placed = found
        if placed is not None:
            uv[here] = placed.reshape(-1, 3, 2)
        skin[here] = len(skins)
        skins.append(made)
    if rest:
        here = np.sort(np.concatenate(rest))
        skin[here] = len(skins)
        atlas = _atlas(surface, here)
        if atlas is None:
            corners = np.repeat(here, 3)
            colors[here] = _bytes(surface.color_at(corners, np.tile(np.eye(3), (len(here), 1)))).reshape(-1, 3, 3)
            skins.append(Skin(None))
        else:
            made, uv[here] = atlas
            skins.append(made)
    return Coloring(tuple(skins), skin, uv, colors)


def _image_skin(color: Color, values: Floats) -> tuple[Skin, Floats] | None:
    """A texture as it is, and (N, 2) where; None where a graphics card would show other colors."""
    if not isinstance(color, Texture) or color.linear or color.unassociate or color.pixels.dtype != np.uint8:
        return None
    if color.placement.fold != ("none", "none"):
        return None
    uv = np.stack(color.placement.at(values), axis=1)
    if color.extension == "clip" and not ((uv >= 0) & (uv <= 1)).all():
        return None
    if color.extension in ("repeat", "mirror"):  # 16 bits go to what is left
        period = 1 if color.extension == "repeat" else 2
        uv = uv - period * np.floor(uv.min(axis=0) / period)
    pixels = np.ascontiguousarray(color.pixels[:, :, :3])
    return Skin(pixels, _WRAPS[color.extension], color.interpolation != "closest"), uv


def _painted(material: Material, values: Floats) -> tuple[Skin, Floats] | None:
    """An image of what a material calculates over its texture coordinates, and (N, 2) where; None if it depends on
    more than these, or they span too much."""
    if material.uv is None or not _needs_only(material, values):
        return None
    own = values[:, material.uv : material.uv + 2]
    first, last = np.floor(own.min(axis=0) + _ALIKE), np.ceil(own.max(axis=0) - _ALIKE)
    tiles = np.maximum(last - first, 1)
    if (tiles > _TILES).any():
        return None
    sides = np.array([max(pixels.shape[k] for pixels in image_arrays(material.color)) for k in (1, 0)])
    width, height = np.minimum(sides * tiles, LARGEST_SIDE).astype(int).tolist()
    pixels = np.empty((height, width, 3), np.uint8)
    u = first[0] + tiles[0] * (np.arange(width) + 0.5) / width
    step = max(1, _ROWS // width)
    for top in range(0, height, step):
        rows = np.arange(top, min(top + step, height))
        v = first[1] + tiles[1] * (1 - (rows + 0.5) / height)
        asked = np.zeros((len(rows) * width, values.shape[1]))
        asked[:, material.uv], asked[:, material.uv + 1] = np.tile(u, len(rows)), np.repeat(v, width)
        pixels[rows] = _bytes(material.color.lookup(asked)).reshape(len(rows), width, 3)
    return Skin(pixels), (own - first) / tiles


def _needs_only(material: Material, values: Floats) -> bool:
    """Whether a color depends on the material's texture coordinates alone, as far as a part of the corners tells."""
    assert material.uv is not None
    some = values[:: max(1, len(values) // _PROBES)]
    bare = np.zeros_like(some)
    bare[:, material.uv : material.uv + 2] = some[:, material.uv : material.uv + 2]
    return bool(np.allclose(material.color.lookup(some), material.color.lookup(bare), rtol=0, atol=_ALIKE))


def _atlas(surface: Surface, triangles: Ints) -> tuple[Skin, Floats] | None:
    """An image with half a square cell for each of the triangles, and (n, 3, 2) their corners on it; None where cells
    would be too small to hold more than colors at corners do."""
    across = int(np.ceil(np.sqrt((len(triangles) + 1) // 2)))
    cell = min(LARGEST_SIDE // across, _LARGEST_CELL)
    if cell < _SMALLEST_CELL:
        return None
    side = across * cell
    reach = cell - 3  # pixels from corner to corner: one more is blended in, and one parts the halves
    x, y = (axis.ravel() for axis in np.meshgrid(np.arange(cell), np.arange(cell)))
    x, y = x[x + y <= cell - 2], y[x + y <= cell - 2]
    weights = np.stack([reach - x - y, x, y], axis=1).clip(min=0) / reach
    weights /= weights.sum(axis=1, keepdims=True)
    number = np.arange(len(triangles))
    left, top = number // 2 % across * cell, number // 2 // across * cell
    turned = (number % 2).astype(bool)
    pixels = np.zeros((side, side, 3), np.uint8)
    for some in _chunks(len(triangles), max(1, _ROWS // len(x))):
        colors = surface.color_at(np.repeat(triangles[some], len(x)), np.tile(weights, (len(some), 1)))
        flip = turned[some, None]
        columns = left[some, None] + np.where(flip, cell - 1 - x, x)
        rows = top[some, None] + np.where(flip, cell - 1 - y, y)
        pixels[rows, columns] = _bytes(colors).reshape(len(some), len(x), 3)
    corners = np.array([[0.5, 0.5], [0.5 + reach, 0.5], [0.5, 0.5 + reach]])
    placed = np.where(turned[:, None, None], cell - corners, corners) + np.stack([left, top], axis=1)[:, None]
    return Skin(pixels, shrinks=False), np.stack([placed[:, :, 0] / side, 1 - placed[:, :, 1] / side], axis=2)


def _chunks(count: int, step: int) -> Iterator[Ints]:
    for first in range(0, count, step):
        yield np.arange(first, min(first + step, count))


def _bytes(colors: Floats) -> NDArray[np.uint8]:
    return np.rint(np.clip(colors, 0, 1) * 255).astype(np.uint8)
