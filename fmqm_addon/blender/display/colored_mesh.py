# SPDX-License-Identifier: GPL-3.0-or-later
"""Colored triangles that are drawn over the 3D view and are no data of the file: nothing can select, render,
export or save them.

`gpu` works only where there is a window: what needs it is made at the first drawing.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from mathutils import Matrix, Vector
from numpy.typing import NDArray

from . import drawing

Array = NDArray[Any]

# How much nearer to the viewer it is drawn than the surface that it lies on, in distances: the same one, or one that
# is shown with other levels of detail than renders have.
SAME, SIMILAR = 4e-4, 4e-3
_DEPTH_STEPS = 1e-6

_VERTEX = """
void main() {
  number = entry;
  place = pos;
  gl_Position = matrix * vec4(pos, 1.0);
}
"""
# Facets that face sideways are a little darker, or the shape could not be seen.
_FRAGMENT = """
void main() {
  int row = int(number + 0.5);
  vec4 found = texelFetch(table, ivec2(row % WIDTH, row / WIDTH), 0);
  if (found.a < 0.5) discard;
  vec3 normal = cross(dFdx(place), dFdy(place));
  float facing = abs(dot(normal, towards)) / max(length(normal) * length(towards), 1e-20);
  color = vec4(found.rgb * mix(0.55, 1.0, facing), 1.0);
}
""".replace("WIDTH", str(drawing.TABLE_WIDTH))


class ColoredMesh:
    """Triangles with a color each, out of a table that can be exchanged."""

    def __init__(self, vertices: Array, triangles: Array, entry: Array) -> None:
        """Triangles to be drawn.

        Args:
            vertices: (V, 3). triangles: (T, 3). entry: (V,) the row of the table of each vertex; the last vertex of a
                triangle counts.
        """
        self.vertices, self._triangles, self._entry = vertices, triangles, entry
        self._batch: Any = None
        self._table: Any = None
        self.colors = np.zeros((0, 4), np.float32)

    def set_colors(self, colors: Array, shown: Any = True) -> None:
        """Gives each row of the table another color.

        Args:
            colors: (E, 3) encoded (sRGB) in [0, 1]. shown: (E,) which are drawn, or all.
        """
        self.colors = np.ones((len(colors), 4), np.float32)
        self.colors[:, :3] = colors
        self.colors[:, 3] = shown
        self._table = None

    def draw(self, matrix: Matrix, region_3d: Any, nearer: float = SAME) -> None:
        """Draws it in a 3D view, from a POST_VIEW handler.

        Args:
            matrix: from the vertices to the world. region_3d: of the view. nearer: to the viewer, in distances.
        """
        if not len(self.colors):
            return
        shader = _shader()
        if self._batch is None:
            self._batch = drawing.triangles({"pos": self.vertices, "entry": self._entry}, self._triangles)
        if self._table is None:
            shown = self.colors.copy()
            shown[:, :3] = drawing.for_view(shown[:, :3])
            self._table = drawing.table(shown, "RGBA32F")
        with drawing.depth_tested():
            shader.bind()
            shader.uniform_float("matrix", clip_matrix(region_3d, nearer) @ region_3d.view_matrix @ matrix)
            shader.uniform_float("towards", _towards(region_3d, matrix))
            shader.uniform_sampler("table", self._table)
            self._batch.draw(shader)


def from_faces(vertices: Array, triangles: Array, entry: Array) -> ColoredMesh:
    """A surface with a row of the table for each of its (T,) triangles."""
    corners = vertices[triangles].reshape(-1, 3)
    return ColoredMesh(corners, np.arange(len(corners)).reshape(-1, 3), np.repeat(entry, 3))


def clip_matrix(region_3d: Any, nearer: float = SAME) -> Matrix:
    """From the view to the screen, a little nearer to the viewer."""
    moved = Matrix.Scale(1 - nearer, 4)
    if not region_3d.is_perspective:
        moved = Matrix.Translation((0.0, 0.0, nearer * region_3d.view_distance))
    clip = region_3d.window_matrix @ moved
    clip[2] -= _DEPTH_STEPS * clip[3]
    return clip


def _towards(region_3d: Any, matrix: Matrix) -> Vector:
    """The direction to the viewer in the mesh's own space, for normals: they go by the transpose."""
    back = region_3d.view_matrix.inverted_safe().col[2].to_3d()
    return matrix.to_3x3().transposed() @ back


@cache
def _shader() -> Any:
    return drawing.shader(
        _VERTEX,
        _FRAGMENT,
        constants={"matrix": "MAT4", "towards": "VEC3"},
        sampler="table",
        inputs={"pos": "VEC3", "entry": "FLOAT"},
        smooth={"place": "VEC3"},
        flat={"number": "FLOAT"},
    )
