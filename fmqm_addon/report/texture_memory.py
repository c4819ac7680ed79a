# SPDX-License-Identifier: GPL-3.0-or-later
"""The memory that an asset's textures take."""

from __future__ import annotations

from ..metric.surface import Surface
from ..metric.texture import image_arrays

BYTES_PER_PIXEL = 4  # of a texture in a graphics card's memory, uncompressed: RGBA


def texture_bytes(surface: Surface) -> int:
    """Memory of the images that the surface's colors are read from, as RGBA bytes; an image that is shared once."""
    images = {
        id(pixels): pixels.shape[0] * pixels.shape[1] * BYTES_PER_PIXEL
        for material in surface.materials
        for pixels in image_arrays(material)
    }
    return sum(images.values())
