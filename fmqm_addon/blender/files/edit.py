# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes of the opened objects in place, from arrays: their meshes, texture coordinates and images. For scripts, which
write a file of them next."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import bmesh
import bpy
import numpy as np
from numpy.typing import NDArray

from ...metric.colorspace import encode_srgb
from ...metric.geometry import Floats
from .. import arrays

_JOINED = 1e-6  # of the longest side: vertices that importers have split are this near to each other at most


def apply_modifiers(objects: Iterable[bpy.types.Object]) -> None:
    """Each object's mesh becomes what its modifiers make of it."""
    graph = bpy.context.evaluated_depsgraph_get()
    graph.update()
    made = [bpy.data.meshes.new_from_object(each.evaluated_get(graph), depsgraph=graph) for each in objects]
    for each, mesh in zip(objects, made, strict=True):
        each.modifiers.clear()
        each.data = mesh


def split_at_seams(mesh: bpy.types.Mesh) -> None:
    """Cuts a mesh open where its texture coordinates jump: decimation keeps borders nearly where they are."""
    edit = bmesh.new()
    try:
        edit.from_mesh(mesh)
        corners = [vertex.co for vertex in edit.verts]
        extent = max(max(axis) - min(axis) for axis in zip(*corners, strict=True))
        bmesh.ops.remove_doubles(edit, verts=edit.verts[:], dist=_JOINED * extent)
        layer = edit.loops.layers.uv.active
        if layer is not None:
            inner = [edge for edge in edit.edges if len(edge.link_loops) == 2]
            seams = [edge for edge in inner if _is_seam(edge.link_loops[0], edge.link_loops[1], layer)]
            bmesh.ops.split_edges(edit, edges=seams)
        edit.to_mesh(mesh)
    finally:
        edit.free()


def _is_seam(one: Any, other: Any, layer: Any) -> bool:
    """Whether the two faces of an edge have other texture coordinates at one of its ends.

    Args:
        one, other: the edge's first corners in the two faces.
    """
    ends = {each.vert: each[layer].uv for each in (one, one.link_loop_next)}
    return any(ends[each.vert] != each[layer].uv for each in (other, other.link_loop_next))


def world_positions(objects: Sequence[bpy.types.Object]) -> tuple[Floats, list[slice]]:
    """(N, 3) float64 of all vertices, and where those of each object are."""
    parts, places, first = [], [], 0
    for each in objects:
        matrix = np.array(each.matrix_world)
        own = arrays.read(each.data.vertices, "co", 3, np.float32).astype(np.float64)
        parts.append(own @ matrix[:3, :3].T + matrix[:3, 3])
        places.append(slice(first, first + len(own)))
        first += len(own)
    return np.concatenate(parts), places


def move_vertices(objects: Sequence[bpy.types.Object], positions: Floats, places: Sequence[slice]) -> None:
    """Puts the vertices to (N, 3) world positions, as world_positions gives them."""
    for each, place in zip(objects, places, strict=True):
        matrix = np.array(each.matrix_world)
        own = np.linalg.solve(matrix[:3, :3], (positions[place] - matrix[:3, 3]).T).T
        arrays.write(each.data.vertices, "co", own.astype(np.float32))
        each.data.update()


def change_coordinates(objects: Sequence[bpy.types.Object], change: Callable[[Floats], Floats]) -> None:
    """Puts what a function makes of the (n, 2) float64 coordinates of each layer in their place."""
    for layer in (layer for each in objects for layer in each.data.uv_layers):
        own = arrays.read(layer.uv, "vector", 2, np.float32).astype(np.float64)
        arrays.write(layer.uv, "vector", change(own).astype(np.float32))


def pixels_of(image: bpy.types.Image) -> NDArray[np.uint8]:
    """(height, width, 3 or 4) sRGB of an image, its first row at the top."""
    width, height = image.size
    values = arrays.read_pixels(image).reshape(height, width, image.channels)[::-1]
    if image.channels < 3:
        values = np.repeat(values[..., :1], 3, axis=2)
    if image.is_float:  # linear light
        values = np.concatenate([encode_srgb(values[..., :3]), values[..., 3:]], axis=2)
    return np.asarray(np.round(np.clip(values, 0.0, 1.0) * 255).astype(np.uint8))


def replace_image(image: bpy.types.Image, data: bytes) -> None:
    """Puts an image file's content in the place of an image, for all that use it."""
    other = bpy.data.images.new(image.name, 1, 1)
    other.pack(data=data, data_len=len(data))
    other.source = "FILE"
    other.colorspace_settings.name = "sRGB" if image.is_float else image.colorspace_settings.name
    other.alpha_mode = image.alpha_mode
    image.user_remap(other)
