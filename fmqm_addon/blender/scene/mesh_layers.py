# SPDX-License-Identifier: GPL-3.0-or-later
"""UV maps and color attributes of a mesh, as its materials want them at the triangles' corners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import bpy
import numpy as np
from numpy.typing import NDArray

from ...metric.errors import MeshError
from .. import arrays
from ..materials.images import DARKEST
from ..materials.types import Look, MeshLayer, Unread

_MOST_BEYOND = 0.5  # of an attribute's values; a few bright ones may be meant
Rows: TypeAlias = NDArray[np.intp] | slice  # of triangles; a slice where it is all of them


@dataclass(frozen=True)
class Triangles:
    """How a mesh is cut: (T, 3) int32."""

    loops: NDArray[np.int32]
    vertices: NDArray[np.int32]


def triangulated(mesh: bpy.types.Mesh, name: str) -> Triangles:
    """How Blender cuts a mesh into triangles.

    Raises:
        MeshError: Blender, which trusts its meshes, would read beyond its arrays.
    """
    corrupt = MeshError(f"{name}: its faces name corners or vertices that it has not; mesh.validate() mends that")
    if ".corner_vert" not in mesh.attributes:
        raise corrupt
    vertex = arrays.read_attribute(mesh, ".corner_vert", "value", 1, np.int32)[:, 0]
    if vertex.min(initial=0) < 0 or vertex.max(initial=0) >= len(mesh.vertices):
        raise corrupt
    if len(vertex) == 3 * len(mesh.polygons):  # Blender's own triangles are slow to read
        loops = np.arange(len(vertex), dtype=np.int32).reshape(-1, 3)
    else:
        starts = arrays.read(mesh.polygons, "loop_start", 1, np.int32)[:, 0]
        if starts[0] != 0 or np.diff(starts, append=len(vertex)).min() < 3:
            raise corrupt
        loops = arrays.read(mesh.loop_triangles, "loops", 3, np.int32)
    return Triangles(loops, vertex[loops])


def rows_by_slot(mesh: bpy.types.Mesh, cut: Triangles) -> dict[int, Rows]:
    """The triangles of each slot that has faces."""
    if "material_index" not in mesh.attributes:
        return {0: slice(None)}
    of_face = arrays.read_attribute(mesh, "material_index", "value", 1, np.int32)[:, 0]
    indices = np.unique(of_face).tolist()
    if len(indices) == 1:
        return {indices[0]: slice(None)}
    if len(of_face) != len(cut.loops):  # some faces are more than one triangle
        of_face = of_face[arrays.read(mesh.loop_triangles, "polygon_index", 1, np.int32)[:, 0]]
    return {index: np.flatnonzero(of_face == index) for index in indices}


def look_on_mesh(mesh: bpy.types.Mesh, look: Look) -> Look | Unread:
    """A look, or what the baker has to make of it on this mesh."""
    known = look.material.images, look.warnings, look.notes
    for layer in look.layers:
        if _layer_of(mesh, layer) is not None:
            continue
        if layer.name in mesh.attributes:  # of any domain and type, as Geometry Nodes make them
            return Unread(layer.name, "is an attribute of a kind that is not read", *known)
        if layer.kind == "color" and look.material.alpha is not None:  # its alpha depends on the node that asks
            return Unread(f"the color attribute {layer.name}".rstrip(), "is missing on the mesh", *known)
    return look


def missing_warning(layer: MeshLayer, material: bpy.types.Material | None) -> str:
    """The warning that a mesh has not what a material wants."""
    kind = {"uv": "UV map", "color": "color attribute"}[layer.kind]
    named = f" named {layer.name}" if layer.name else ""
    user = "its color" if material is None else f"material {material.name}"
    return f"the mesh has no {kind}{named}, which {user} needs; taken as 0, as Blender renders it"


def range_warnings(layer: MeshLayer, light: NDArray[np.float32]) -> list[str]:
    """Warnings of colors that an exporter wrote as other numbers than Blender reads them."""
    named = f"the color attribute {layer.name}".rstrip()
    if light.max() < DARKEST:
        return [f"{named} is black all over; unless it is meant to be, export its colors as bytes, or from 0 to 1"]
    beyond = np.mean(light > 1)
    if beyond > _MOST_BEYOND:
        return [f"{named} is beyond 1, and shown as 1, in {100 * beyond:.0f} % of its values; export them from 0 to 1"]
    return []


def layer_values(mesh: bpy.types.Mesh, layer: MeshLayer, cut: Triangles, rows: Rows) -> NDArray[np.float32] | None:
    """(rows, 3, channels) of a layer at the triangles' corners; None if the mesh has no such layer."""
    if layer.kind == "uv":
        uv_map = _uv_map(mesh, layer.name)
        return None if uv_map is None else arrays.read(uv_map.uv, "vector", 2, np.float32)[cut.loops[rows]]
    colors = _color_attribute(mesh, layer.name)
    if colors is None:
        return None
    linear = arrays.read(colors.data, "color", 4, np.float32)
    return linear[(cut.loops if colors.domain == "CORNER" else cut.vertices)[rows]]


def own_normals(mesh: bpy.types.Mesh, cut: Triangles) -> NDArray[np.float32] | None:
    """(T, 3, 3) normals at the triangles' corners as Blender shades them; None where all faces are flat, as most are
    in files that say nothing of normals."""
    if mesh.normals_domain == "FACE" and not mesh.has_custom_normals:
        return None
    return arrays.read(mesh.corner_normals, "vector", 3, np.float32)[cut.loops]


def _layer_of(mesh: bpy.types.Mesh, layer: MeshLayer) -> bpy.types.MeshUVLoopLayer | bpy.types.Attribute | None:
    return _uv_map(mesh, layer.name) if layer.kind == "uv" else _color_attribute(mesh, layer.name)


def _uv_map(mesh: bpy.types.Mesh, name: str) -> bpy.types.MeshUVLoopLayer | None:
    """The named UV map; "" is the one active for rendering, or the first where none is."""
    maps = mesh.uv_layers
    if name:
        return maps.get(name)
    return next((each for each in maps if each.active_render), maps[0] if len(maps) else None)


def _color_attribute(mesh: bpy.types.Mesh, name: str) -> bpy.types.Attribute | None:
    """The named color attribute; "" is the one for rendering, or the first where none is."""
    colors = mesh.color_attributes
    if name:
        return colors.get(name)
    return colors[max(colors.render_color_index, 0)] if len(colors) else None
