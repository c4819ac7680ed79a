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

Array = NDArray[Any]

_WIDTH = 4096  # of the texture that holds the colors

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
""".replace("WIDTH", str(_WIDTH))


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
            self._batch, self._table = _batch(*self._arrays[:4]), _texture(self._arrays[4])
            self._arrays = None
        shader = _shader(light, ambient)
        depth, mask, blend = gpu.state.depth_test_get(), gpu.state.depth_mask_get(), gpu.state.blend_get()
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        gpu.state.blend_set("NONE")
        try:
            shader.bind()
            shader.uniform_float("to_view", to_view)
            shader.uniform_float("to_clip", to_clip)
            shader.uniform_sampler("table", self._table)
            self._batch.draw(shader)
        finally:
            gpu.state.blend_set(blend)
            gpu.state.depth_mask_set(mask)
            gpu.state.depth_test_set(depth)


@cache
def _shader(light: tuple[float, float, float], ambient: float) -> Any:
    info = gpu.types.GPUShaderCreateInfo()
    info.push_constant("MAT4", "to_view")
    info.push_constant("MAT4", "to_clip")  # with the other one as much as every graphics card takes
    info.sampler(0, "FLOAT_2D", "table")
    between = gpu.types.GPUStageInterfaceInfo("fmqm_sampled")
    info.vertex_in(0, "VEC3", "pos")
    info.vertex_in(1, "VEC3", "direction")
    info.vertex_in(2, "VEC2", "corner")
    info.vertex_in(3, "VEC2", "cell")
    between.smooth("VEC3", "normal")
    between.smooth("VEC3", "seen")
    between.smooth("VEC2", "weight")
    between.flat("VEC2", "grid")
    info.vertex_out(between)
    info.fragment_out(0, "VEC4", "color")
    info.vertex_source(_VERTEX)
    info.define("LIGHT", "normalize(vec3({}, {}, {}))".format(*light))
    info.define("AMBIENT", f"float({ambient})")
    info.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(info)


def _batch(positions: Array, normals: Array, first: Array, cells: Array) -> Any:
    values = {
        "pos": positions,
        "direction": normals,
        "corner": np.tile(np.array([(0, 0), (1, 0), (0, 1)]), (len(first), 1)),
        "cell": np.stack([first, cells], axis=1).repeat(3, axis=0),
    }
    form = gpu.types.GPUVertFormat()
    for name, rows in values.items():
        form.attr_add(id=name, comp_type="F32", len=rows.shape[1], fetch_mode="FLOAT")
    buffer = gpu.types.GPUVertBuf(form, len(positions))
    for name, rows in values.items():
        buffer.attr_fill(name, np.ascontiguousarray(rows, np.float32))
    return gpu.types.GPUBatch(type="TRIS", buf=buffer)


def _texture(colors: Array) -> Any:
    rows = -(-len(colors) // _WIDTH)
    values = np.zeros((rows * _WIDTH, 4), np.float32)
    values[: len(colors), :3] = colors / np.float32(255)
    return gpu.types.GPUTexture(
        (_WIDTH, rows), format="RGBA8", data=gpu.types.Buffer("FLOAT", values.size, values.ravel())
    )
