# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture on a square that is drawn over the 3D view and is no data of the file."""

from __future__ import annotations

from functools import cache
from typing import Any

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ...metric.geometry import Floats
from . import drawing
from .colored_mesh import clip_matrix

_CORNERS = ((-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0))
_FACES = ((0, 1, 2), (0, 2, 3))
_VERTEX = """
void main() {
  place = pos.xy + 0.5;
  gl_Position = ModelViewProjectionMatrix * vec4(pos, 1.0);
}
"""
_FRAGMENT = """
void main() {
  color = vec4(pow(texture(picture, place).rgb, vec3(POWER)), 1.0);
}
""".replace("POWER", str(drawing.VIEW_POWER))
_RIM = (0.05, 0.05, 0.05, 1.0)


class Picture:
    """A square from -0.5 to 0.5 in X and Y, as colorful on both sides.

    Attributes:
        colors: (side * side, 3) encoded, rows upwards. side: in pixels.
    """

    def __init__(self, colors: Floats) -> None:
        self.colors, self.side = colors, round(len(colors) ** 0.5)
        self._texture: Any = None

    def draw(self, matrix: Matrix, region_3d: Any) -> None:
        """Draws it in a 3D view, from a POST_VIEW handler.

        Args:
            matrix: from the square to the world. region_3d: of the view.
        """
        if self._texture is None:
            pixels = np.ones((self.side, self.side, 4), np.float32)
            pixels[..., :3] = self.colors.reshape(self.side, self.side, 3)
            self._texture = drawing.texture(pixels, "RGBA16F")
        with drawing.depth_tested(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
            gpu.matrix.load_projection_matrix(clip_matrix(region_3d))
            gpu.matrix.load_matrix(region_3d.view_matrix @ matrix)
            shader = _shader()
            batch = batch_for_shader(shader, "TRIS", {"pos": _CORNERS}, indices=_FACES)
            shader.bind()
            shader.uniform_sampler("picture", self._texture)
            batch.draw(shader)
            rim = gpu.shader.from_builtin("UNIFORM_COLOR")
            rim.uniform_float("color", _RIM)
            batch_for_shader(rim, "LINE_STRIP", {"pos": (*_CORNERS, _CORNERS[0])}).draw(rim)


@cache
def _shader() -> Any:
    return drawing.shader(
        _VERTEX,
        _FRAGMENT,
        constants={"ModelViewProjectionMatrix": "MAT4"},
        sampler="picture",
        inputs={"pos": "VEC3"},
        smooth={"place": "VEC2"},
    )
