# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that are drawn over the 3D view in exactly their colors, and are no data of the file.

`gpu` works only where there is a window: what needs it is made at the first drawing.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

_VERTEX = """
void main() {
  place = at;
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 0.0, 1.0);
}
"""
# Blender takes what is drawn over a view for linear light, and shows it by a power of 2.2, whatever the screen.
_FRAGMENT = """
void main() {
  ivec2 size = textureSize(picture, 0), first = ivec2(floor(place * vec2(size / finer))) * finer;
  vec3 sum = vec3(0.0);
  for (int i = 0; i < finer * finer; i++) {
    sum += texelFetch(picture, min(first + ivec2(i % finer, i / finer), size - 1), 0).rgb;
  }
  color = vec4(pow(sum / float(finer * finer), vec3(2.2)), 1.0);
}
"""


class Inset:
    """An image, drawn in the pixels of a region."""

    def __init__(self, pixels: NDArray[np.uint8]) -> None:
        """An image to be drawn.

        Args:
            pixels: (H, W, 3) encoded (sRGB), the top row first.
        """
        self.pixels = pixels
        self._texture: Any = None

    def draw(self, x: float, y: float, width: float, height: float) -> None:
        """Draws it, from a POST_PIXEL handler, with its lower left corner at a place."""
        if self._texture is None:
            self._texture = _texture(self.pixels)
        draw_texture(self._texture, x, y, width, height)


def draw_texture(
    texture: Any, x: float, y: float, width: float, height: float, part: tuple[float, float] = (0, 1), finer: int = 1
) -> None:
    """Draws a texture of encoded colors, the bottom row first; as Inset.draw.

    Args:
        part: from where to where across it is drawn. finer: so many of its pixels along a side are averaged to one.
    """
    shader = _shader()
    corners = [(x, y), (x + width, y), (x, y + height), (x + width, y + height)]
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners, "at": [(u, v) for v in (0, 1) for u in part]})
    shader.bind()
    shader.uniform_sampler("picture", texture)
    shader.uniform_int("finer", finer)
    batch.draw(shader)


@cache
def _shader() -> Any:
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "ModelViewProjectionMatrix")
    info.push_constant("INT", "finer")
    info.sampler(0, "FLOAT_2D", "picture")
    info.vertex_in(0, "VEC2", "pos")
    info.vertex_in(1, "VEC2", "at")
    between = gpu.types.GPUStageInterfaceInfo("fmqm_inset")
    between.smooth("VEC2", "place")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "color")
    info.vertex_source(_VERTEX)
    info.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(info)


def _texture(pixels: NDArray[np.uint8]) -> Any:
    height, width, _ = pixels.shape
    values = np.ones((height, width, 4), np.float32)
    values[..., :3] = pixels[::-1] / np.float32(255)
    buffer = gpu.types.Buffer("FLOAT", values.size, values.ravel())
    return gpu.types.GPUTexture((width, height), format="RGBA8", data=buffer)
