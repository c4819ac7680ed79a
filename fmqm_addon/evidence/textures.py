# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures made worse: smaller, or encoded and decoded again. Needs Pillow, inside functions."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..metric.errors import FMQMError
from .distortions import Distortion

if TYPE_CHECKING:
    from PIL import Image


def worse_texture(pixels: NDArray[np.uint8], distortion: Distortion) -> NDArray[np.uint8]:
    """(H, W, 3 or 4) pixels, row 0 at the top, as a decoder gives them back; a fourth channel, alpha, is only resized.

    Sizes by Lanczos' filter; JPEG with Pillow's default of half the chroma. Never larger than it was.

    Raises:
        FMQMError: there is no Pillow.
    """
    modes = [(pixels[..., :3], "RGB"), *([(pixels[..., 3], "L")] if pixels.shape[2] == 4 else [])]
    sized = [_resized(_image(np.ascontiguousarray(values), mode), distortion) for values, mode in modes]
    if distortion.codec:
        sized[0] = _decoded(sized[0], distortion.codec, distortion.quality)
    channels: list[NDArray[Any]] = [np.atleast_3d(np.asarray(each)) for each in sized]
    return np.concatenate(channels, axis=2)


def png_bytes(pixels: NDArray[np.uint8]) -> bytes:
    """A PNG of (H, W, 3 or 4) pixels, row 0 at the top."""
    file = BytesIO()
    _image(pixels, "RGBA" if pixels.shape[2] == 4 else "RGB").save(file, "PNG", compress_level=1)
    return file.getvalue()


def _image(pixels: NDArray[np.uint8], mode: str) -> Image.Image:
    try:
        from PIL import Image
    except ImportError as error:
        raise FMQMError("textures are damaged by Pillow, which this Python has not: pip install pillow") from error
    size = (pixels.shape[1], pixels.shape[0])
    return Image.frombytes(mode, size, pixels.tobytes())


def _resized(image: Image.Image, distortion: Distortion) -> Image.Image:
    from PIL import Image

    longest = max(image.size)
    wanted = longest / distortion.divisor
    if distortion.side:
        wanted = min(wanted, distortion.side)
    if wanted >= longest:
        return image
    width, height = (max(1, round(side * wanted / longest)) for side in image.size)
    return image.resize((width, height), Image.Resampling.LANCZOS)


def _decoded(image: Image.Image, codec: str, quality: int) -> Image.Image:
    from PIL import Image

    file = BytesIO()
    image.save(file, codec, quality=quality)
    file.seek(0)
    return Image.open(file).convert("RGB")
