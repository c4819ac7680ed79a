# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as PNG files in memory, by Blender: its Python has no Pillow."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from .. import arrays


def png_bytes(pixels: NDArray[np.uint8]) -> bytes:
    """The bytes of a PNG file with just these colors; nothing stays in the file that is open.

    Args:
        pixels: (height, width, 3), row 0 at the top.
    """
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("FMQM picture", width, height, alpha=False)
    try:
        values = np.ones((height, width, 4), np.float32)
        values[:, :, :3] = pixels[::-1] / np.float32(255)
        arrays.write_pixels(image, values)
        image.pack()
        return bytes(image.packed_file.data)
    finally:
        bpy.data.images.remove(image)
