# SPDX-License-Identifier: GPL-3.0-or-later
"""How pictures are encoded for files and pages: by Pillow, or by what is handed in where Python lacks it."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..metric.errors import FMQMError
from .render import Pixels, require_pillow

SUFFIXES = {"png": ".png", "jpeg": ".jpg"}
JPEG_QUALITY = 92  # with full color resolution: what is shown may be the artifacts of a texture


class EncodedPicture(NamedTuple):
    """The bytes of a file, and its kind: "png" or "jpeg"."""

    data: bytes
    kind: str


Encoder: TypeAlias = Callable[[Pixels], EncodedPicture]
_handed_in: list[Encoder] = []


@contextmanager
def encoded_by(encoder: Encoder | None) -> Iterator[None]:
    """Within it pictures are encoded by another; None: by Pillow, as ever."""
    if encoder is None:
        yield
        return
    _handed_in.append(encoder)
    try:
        yield
    finally:
        _handed_in.remove(encoder)


def encode(pixels: Pixels, lossless: bool = False) -> EncodedPicture:
    """A picture's bytes: PNG where it shall be lossless, else what the encoder likes.

    Raises:
        FMQMError: Pillow is missing, and nothing was handed in for it.
    """
    if _handed_in:
        return _handed_in[-1](pixels)
    require_encoder()
    from PIL import Image

    out, image = io.BytesIO(), Image.fromarray(pixels)
    if lossless:
        image.save(out, "PNG")
        return EncodedPicture(out.getvalue(), "png")
    # Not optimized: Pillow gives up where that takes more than a byte a pixel, as of noise.
    image.save(out, "JPEG", quality=JPEG_QUALITY, subsampling=0)
    return EncodedPicture(out.getvalue(), "jpeg")


def shrunk(pixels: Pixels, size: tuple[int, int]) -> Pixels:
    """A picture at a smaller width and height, each pixel the mean of what it covers."""
    found = _means(_means(pixels, size[1], 0), size[0], 1)
    shrunken: Pixels = np.rint(found).astype(np.uint8)
    return shrunken


def require_encoder() -> None:
    """Checks that pictures can be encoded.

    Raises:
        FMQMError: Pillow is missing, and nothing was handed in for it.
    """
    if not _handed_in:
        require_pillow()


def has_pillow() -> bool:
    """Whether this Python has it."""
    try:
        require_pillow()
    except FMQMError:
        return False
    return True


def _means(values: NDArray[np.uint8] | NDArray[np.float32], count: int, axis: int) -> NDArray[np.float32]:
    """The means of `count` equal stretches along an axis, whose ends may lie within pixels."""
    length = values.shape[axis]
    ends = np.arange(count + 1) * (length / count)
    whole = np.minimum(ends.astype(np.int64), length)
    rest = (ends - whole).astype(np.float32)
    moved = np.moveaxis(values, axis, 0)
    sums = np.zeros((count + 1, *moved.shape[1:]), np.float64)  # of all that lies before each end
    for number in range(count):
        stretch = moved[whole[number] : whole[number + 1]]
        sums[number + 1] = sums[number] + stretch.sum(axis=0, dtype=np.float64)
    partial = moved[np.minimum(whole, length - 1)] * rest.reshape(-1, *[1] * (moved.ndim - 1))
    means = np.diff(sums + partial, axis=0) / (length / count)
    return np.moveaxis(means, 0, axis).astype(np.float32)
