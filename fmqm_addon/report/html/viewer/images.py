# SPDX-License-Identifier: GPL-3.0-or-later
"""Images as data URIs, as large as a page can carry."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...picture_files import encode, shrunk
from .skins import LARGEST_SIDE

MOST_PIXELS = 4 * LARGEST_SIDE**2  # of the images of a mesh
MOST_BYTES = 3_800_000  # of them, as text; a pair of 200,000 triangles stays below 25 MB with it, whatever it is
_SMALLEST_SIDE = 64
_LOSSLESS_SIDE = 512  # pixels; what is smaller stays as it is to the bit

Encoded = tuple[str, str]  # a digest of the content, and the data URI


def encoded(images: Sequence[NDArray[np.uint8]]) -> list[Encoded]:
    """The images as (digest, data URI); sides of at most LARGEST_SIDE, less where there are many or they are large.

    Args:
        images: (H, W, 3) uint8 each.
    """
    side = LARGEST_SIDE
    while side > _SMALLEST_SIDE and sum(_pixels(image, side) for image in images) > MOST_PIXELS:
        side = _smaller(side)
    while True:
        made = [_encoded(image, side) for image in images]
        if side <= _SMALLEST_SIDE or sum(len(data) for _, data in made) <= MOST_BYTES:
            return made
        side = _smaller(side)


def _smaller(side: int) -> int:
    """A side of half the pixels."""
    return round(side / 2**0.5)


def _size(image: NDArray[np.uint8], side: int) -> tuple[int, int]:
    """Width and height, both within a side, in the image's proportions."""
    height, width = image.shape[:2]
    shrink = max(1.0, max(width, height) / side)
    return max(1, round(width / shrink)), max(1, round(height / shrink))


def _pixels(image: NDArray[np.uint8], side: int) -> int:
    width, height = _size(image, side)
    return width * height


def _encoded(image: NDArray[np.uint8], side: int) -> Encoded:
    size = _size(image, side)
    pixels = image if size == image.shape[1::-1] else shrunk(image, size)
    digest = hashlib.sha256(f"{size}".encode() + pixels.tobytes()).hexdigest()[:16]
    data, kind = encode(pixels, lossless=max(size) <= _LOSSLESS_SIDE)
    return digest, f"data:image/{kind};base64,{base64.b64encode(data).decode()}"
