# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles with colors at a grid of places on each and smooth normals, drawn into an image of their own.

`gpu` works only where there is a window: what needs it is made at the first drawing.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import gpu
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from . import drawing

Array = NDArray[Any]

_VERTEX = """
void main() {
  normal = transpose(inverse(mat3(to_view))) * direction;
  seen = (to_view * vec4(pos, 1.0)).xyz;
  weight = corner;
  grid = cell;
  gl_Position = to_clip * vec4(seen, 1.0);
}
"""
_FRAGMENT = """
vec3 at(int i, int j) {
  int row = int(grid.x + 0.5) + j * (int(grid.y + 0.5) + 1) - j * (j - 1) / 2 + i;
  return texelFetch(table, ivec2(row % WIDTH, row / WIDTH), 0).rgb;
}
void main() {
  int cells = int(grid.y + 0.5);
  vec2 place = clamp(weight, vec2(0.0), vec2(1.0)) * float(cells);
  int i = min(int(place.x), cells - 1), j = min(int(place.y), cells - 1 - i);
  vec2 part = clamp(place - vec2(i, j), vec2(0.0), vec2(1.0));
  float over = part.x + part.y - 1.0;
  vec3 found;
  if (over <= 0.0 || i + j + 1 >= cells) {
    found = at(i, j) * max(-over, 0.0) + at(i + 1, j) * part.x + at(i, j + 1) * part.y;
    found /= max(-over, 0.0) + part.x + part.y;
  } else {
    found = at(i + 1, j + 1) * over + at(i, j + 1) * (1.0 - part.x) + at(i + 1, j) * (1.0 - part.y);
  }
  vec3 facing = cross(dFdx(seen), dFdy(seen));
  vec3 away = normal / max(length(normal), 1e-20);
  float lit = dot(away, LIGHT) * sign(dot(away, facing) * facing.z);
  color = vec4(found * mix(AMBIENT, 1.0, max(lit, 0.0)), 1.0);
}
""".replace("WIDTH", str(drawing.TABLE_WIDTH))


class SampledMesh:
    """Triangles that are drawn in their own colors, from both sides."""

    def __init__(self, positions: Array, normals: Array, first: Array, cells: Array, colors: Array) -> None:
        """Triangles to be drawn; the arrays are as in report.visual.mesh_colors.MeshColors."""
        self._arrays: tuple[Array, ...] | None = (positions, normals, first, cells, colors)
        self._batch: Any = None
        self._table: Any = None

    def draw(self, to_view: Matrix, to_clip: Matrix, light: tuple[float, float, float], ambient: float) -> None:
        """Draws it into the image that is bound.

        Args:
            to_view: from the positions to a view. to_clip: from there to the image. light: direction to it, right, up
                and towards the viewer.
            ambient: the share of their color that unlit faces have.
        """
        if self._arrays is not None:
            self._batch, self._table = _batch(*self._arrays[:4]), drawing.table(self._arrays[4] / 255, "RGBA8")
            self._arrays = None
        shader = _shader(light, ambient)
        blend = gpu.state.blend_get()
        gpu.state.blend_set("NONE")
        try:
            with drawing.depth_tested():
                shader.bind()
                shader.uniform_float("to_view", to_view)
                shader.uniform_float("to_clip", to_clip)
                shader.uniform_sampler("table", self._table)
                self._batch.draw(shader)
        finally:
            gpu.state.blend_set(blend)


@cache
def _shader(light: tuple[float, float, float], ambient: float) -> Any:
    return drawing.shader(
        _VERTEX,
        _FRAGMENT,
        constants={"to_view": "MAT4", "to_clip": "MAT4"},  # the two are as much as every graphics card takes
        sampler="table",
        inputs={"pos": "VEC3", "direction": "VEC3", "corner": "VEC2", "cell": "VEC2"},
        smooth={"normal": "VEC3", "seen": "VEC3", "weight": "VEC2"},
        flat={"grid": "VEC2"},
        defines={"LIGHT": "normalize(vec3({}, {}, {}))".format(*light), "AMBIENT": f"float({ambient})"},
    )


def _batch(positions: Array, normals: Array, first: Array, cells: Array) -> Any:
    return drawing.triangles(
        {
            "pos": positions,
            "direction": normals,
            "corner": np.tile(np.array([(0, 0), (1, 0), (0, 1)]), (len(first), 1)),
            "cell": np.stack([first, cells], axis=1).repeat(3, axis=0),
        }
    )
