# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture on a square that is drawn over the 3D view and is no data of the file."""

from __future__ import annotations

from typing import Any

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ...metric.colorspace import decode_srgb
from ...metric.geometry import Floats
from .colored_mesh import clip_matrix

_CORNERS = ((-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0))
_FACES = ((0, 1, 2), (0, 2, 3))
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
            self._texture = _texture(self.colors, self.side)
        depth, mask = gpu.state.depth_test_get(), gpu.state.depth_mask_get()
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        try:
            with gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
                gpu.matrix.load_projection_matrix(clip_matrix(region_3d))
                gpu.matrix.load_matrix(region_3d.view_matrix @ matrix)
                shader = gpu.shader.from_builtin("IMAGE")
                places = [(x + 0.5, y + 0.5) for x, y, _ in _CORNERS]
                batch = batch_for_shader(shader, "TRIS", {"pos": _CORNERS, "texCoord": places}, indices=_FACES)
                shader.uniform_sampler("image", self._texture)
                batch.draw(shader)
                rim = gpu.shader.from_builtin("UNIFORM_COLOR")
                rim.uniform_float("color", _RIM)
                batch_for_shader(rim, "LINE_STRIP", {"pos": (*_CORNERS, _CORNERS[0])}).draw(rim)
        finally:
            gpu.state.depth_mask_set(mask)
            gpu.state.depth_test_set(depth)


def _texture(colors: Floats, side: int) -> Any:
    pixels = np.ones((len(colors), 4), np.float32)
    pixels[:, :3] = decode_srgb(colors)  # views are drawn into linear buffers
    return gpu.types.GPUTexture(
        (side, side), format="RGBA16F", data=gpu.types.Buffer("FLOAT", pixels.size, pixels.ravel())
    )
