# SPDX-License-Identifier: GPL-3.0-or-later
"""The memory that an asset's textures take."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any

from numpy.typing import NDArray

from ..metric.surface import Surface
from ..metric.texture import Texture

BYTES_PER_PIXEL = 4  # of a texture in a graphics card's memory, uncompressed: RGBA


def texture_bytes(surface: Surface) -> int:
    """Memory of the images that the surface's colors are read from, as RGBA bytes; an image that is shared once."""
    images = {
        id(pixels): pixels.shape[0] * pixels.shape[1] * BYTES_PER_PIXEL
        for material in surface.materials
        for pixels in _images((material.color, material.alpha))
    }
    return sum(images.values())


def _images(part: object) -> Iterator[NDArray[Any]]:
    """The pixels of every texture in a material's color, whatever it is mixed from."""
    if isinstance(part, Texture):
        yield part.pixels
    elif isinstance(part, tuple):
        for item in part:
            yield from _images(item)
    elif is_dataclass(part):
        for field in fields(part):
            yield from _images(getattr(part, field.name))
