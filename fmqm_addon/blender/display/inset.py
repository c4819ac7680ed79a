# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that are drawn over the 3D view in exactly their colors, and are no data of the file.

`gpu` works only where there is a window: what needs it is made at the first drawing.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

from . import drawing

_VERTEX = """
void main() {
  place = at;
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 0.0, 1.0);
}
"""
_FRAGMENT = """
void main() {
  ivec2 size = textureSize(picture, 0), first = ivec2(floor(place * vec2(size / finer))) * finer;
  vec3 sum = vec3(0.0);
  for (int i = 0; i < finer * finer; i++) {
    sum += texelFetch(picture, min(first + ivec2(i % finer, i / finer), size - 1), 0).rgb;
  }
  color = vec4(pow(sum / float(finer * finer), vec3(POWER)), 1.0);
}
""".replace("POWER", str(drawing.VIEW_POWER))


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
    return drawing.shader(
        _VERTEX,
        _FRAGMENT,
        constants={"ModelViewProjectionMatrix": "MAT4", "finer": "INT"},
        sampler="picture",
        inputs={"pos": "VEC2", "at": "VEC2"},
        smooth={"place": "VEC2"},
    )


def _texture(pixels: NDArray[np.uint8]) -> Any:
    values = np.ones((*pixels.shape[:2], 4), np.float32)
    values[..., :3] = pixels[::-1] / np.float32(255)
    return drawing.texture(values, "RGBA8")
