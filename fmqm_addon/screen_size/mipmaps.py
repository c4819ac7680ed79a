# SPDX-License-Identifier: GPL-3.0-or-later
"""Smaller textures for small images: every texture of a surface as the mip level that a rendering needs."""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..metric.colorspace import decode_srgb, encode_srgb
from ..metric.geometry import Floats, cross
from ..metric.surface import Surface
from ..metric.texture import Texture

T = TypeVar("T")
Pixels = NDArray[Any]  # uint8 or float32

_LIGHT = decode_srgb(np.arange(256) / 255).astype(np.float32)  # of each byte
_STEPS = 1 << 16
# By the root of light, where bytes lie more evenly.
_BYTES = np.round(255 * encode_srgb((np.arange(_STEPS + 1) / _STEPS) ** 2)).astype(np.uint8)
_ROWS = 256  # of a smaller image that are made at once


class Mipmaps:
    """Smaller images, each made once."""

    def __init__(self) -> None:
        self._made: dict[tuple[int, int], tuple[Pixels, Pixels]] = {}  # the source is kept, so that its id stays

    def for_scale(self, surface: Surface, scale: float) -> Surface:
        """The surface with each texture at the nearest level for an image of so many pixels per unit.

        A texture's density on a surface is the median over the surface's area; the level is the nearest to its
        logarithm over the scale's.
        """
        area = np.linalg.norm(_edges_cross(surface.vertices[surface.triangles]), axis=1)
        materials = []
        for index, material in enumerate(surface.materials):
            rows = np.flatnonzero(surface.material == index)

            def smaller(texture: Texture, rows: NDArray[np.intp] = rows) -> Texture:
                density = _density(texture, surface.corners[rows], area[rows])
                level = int(np.round(np.log2(max(density / scale, 1.0))))
                return replace(texture, pixels=self._level(texture, level)) if level > 0 else texture

            color, alpha = _with_textures(material.color, smaller), _with_textures(material.alpha, smaller)
            materials.append(replace(material, color=color, alpha=alpha))
        return replace(surface, materials=tuple(materials))

    def _level(self, texture: Texture, level: int) -> Pixels:
        pixels = texture.pixels
        for step in range(1, level + 1):
            if max(pixels.shape[:2]) == 1:
                break
            key = (id(texture.pixels), step)
            if key not in self._made:
                self._made[key] = (halved(pixels, texture.linear), texture.pixels)
            pixels = self._made[key][0]
        return pixels


def halved(pixels: Pixels, linear: bool) -> Pixels:
    """(H, W, channels) at half the size, means in linear light; what has an odd size repeats its last row or column.

    Args:
        linear: the pixels hold linear light; otherwise the first three channels are encoded for display.
    """
    height, width, depth = pixels.shape
    rows, columns = (height + 1) // 2, (width + 1) // 2
    result = np.empty((rows, columns, depth), pixels.dtype)
    right = np.minimum(2 * np.arange(columns) + 1, width - 1)
    for start in range(0, rows, _ROWS):
        end = min(start + _ROWS, rows)
        upper = pixels[2 * start : 2 * end : 2]
        lower = pixels[np.minimum(2 * np.arange(start, end) + 1, height - 1)]
        for channel in range(depth):
            light = channel < 3 and not linear
            parts = [
                _light(line[:, at, channel], light) for line in (upper, lower) for at in (slice(0, None, 2), right)
            ]
            result[start:end, :, channel] = _stored(sum(parts[1:], parts[0]) / 4, light, pixels.dtype)
    return result


def _light(values: NDArray[Any], encoded: bool) -> NDArray[np.float32]:
    if values.dtype == np.uint8:
        return _LIGHT[values] if encoded else values.astype(np.float32)
    return (decode_srgb(values) if encoded else values).astype(np.float32)


def _stored(light: NDArray[np.float32], encoded: bool, dtype: np.dtype[Any]) -> NDArray[Any]:
    if dtype != np.uint8:
        return encode_srgb(light).astype(np.float32) if encoded else light
    if not encoded:
        return np.round(light).astype(np.uint8)
    return _BYTES[np.round(np.sqrt(np.clip(light, 0, 1)) * _STEPS).astype(np.int64)]


def _density(texture: Texture, corners: Floats, area: Floats) -> float:
    """Pixels of the texture per unit of length on the surface, for triangles with these corner values."""
    if not len(corners):
        return 0.0
    u, v = texture.placement.at(corners.reshape(-1, corners.shape[2]))
    height, width = texture.pixels.shape[:2]
    place = np.stack([u * width, v * height, np.zeros_like(u)], axis=1).reshape(-1, 3, 3)
    ratio = np.linalg.norm(_edges_cross(place), axis=1) / area
    order = np.argsort(ratio)
    total = np.cumsum(area[order])
    return float(np.sqrt(ratio[order[np.searchsorted(total, total[-1] / 2)]]))


def _edges_cross(corners: Floats) -> Floats:
    return cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def _with_textures(part: T, smaller: Callable[[Texture], Texture]) -> T:
    """A sampler, of whatever dataclasses it is made, with other textures."""
    if isinstance(part, Texture):
        return smaller(part)  # type: ignore[return-value]
    if isinstance(part, tuple):
        new = tuple(_with_textures(each, smaller) for each in part)
        return part if all(map(operator.is_, part, new)) else new  # type: ignore[return-value]
    if not is_dataclass(part) or isinstance(part, type):
        return part
    changed = {}
    for field in fields(part):
        old = getattr(part, field.name)
        new = _with_textures(old, smaller)
        if new is not old:
            changed[field.name] = new
    return replace(part, **changed) if changed else part
