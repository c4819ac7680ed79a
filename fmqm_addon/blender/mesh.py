# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated, triangulated arrays of one or many objects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..metric.color import Material, Texture
from ..metric.errors import MeshError
from ..metric.spatial import Floats
from ..metric.surface import MeshArrays, join_meshes
from .material import SlotColor, TextureCache, slot_color


def mesh_arrays(
    objects: Sequence[bpy.types.Object], name: str, texture: Texture | None = None, frame: Floats | None = None
) -> MeshArrays:
    """The objects as one mesh: modifiers applied, triangulated, in the world frame.

    Args:
        name: what messages call the whole.
        texture: replaces what the materials say.
        frame: (4, 4) to the world from the frame that positions are wanted in; None is the world's own.

    Raises:
        MeshError: none of the objects has a face, or a color cannot be read.
    """
    cache = TextureCache()
    parts = []
    with evaluated(objects) as pairs:
        for original, (object_, depsgraph) in zip(objects, pairs, strict=True):
            part = _object_arrays(object_, depsgraph, original.name, texture, cache, frame)
            if part is not None:
                parts.append(part)
    if not parts:
        what = "the mesh has no faces" if objects else "no mesh in it"
        raise MeshError(f"{name}: {what}; a surface is wanted")
    return join_meshes(parts, name)


@contextmanager
def evaluated(
    objects: Sequence[bpy.types.Object],
) -> Iterator[list[tuple[bpy.types.Object, bpy.types.Depsgraph]]]:
    """The evaluated counterparts of objects, each with the depsgraph it belongs to.

    Objects that the view layer leaves out (excluded collection, disabled in viewports) have no evaluated
    data there; they are evaluated as temporary duplicates in a temporary scene.
    """
    for object_ in objects:
        if object_.mode == "EDIT":
            object_.update_from_editmode()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    depsgraph.update()
    found = [object_.evaluated_get(depsgraph) for object_ in objects]
    left_out = [index for index, object_ in enumerate(found) if not object_.is_evaluated]
    if not left_out:
        yield [(object_, depsgraph) for object_ in found]
        return
    frame = bpy.context.scene.frame_current
    scene = bpy.data.scenes.new("FMQM evaluation")
    duplicates: dict[int, bpy.types.Object] = {}
    try:
        scene.frame_current = frame
        for index in left_out:
            duplicates[index] = duplicate = objects[index].copy()
            duplicate.hide_viewport = False
            scene.collection.objects.link(duplicate)
        view_layer = scene.view_layers[0]
        view_layer.update()
        aside = view_layer.depsgraph
        yield [
            (duplicates[index].evaluated_get(aside), aside) if index in duplicates else (object_, depsgraph)
            for index, object_ in enumerate(found)
        ]
    finally:
        for duplicate in duplicates.values():
            bpy.data.objects.remove(duplicate)
        bpy.data.scenes.remove(scene)


def _object_arrays(
    object_: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    name: str,
    texture: Texture | None,
    cache: TextureCache,
    frame: Floats | None,
) -> MeshArrays | None:
    """Arrays of one evaluated object; None if it has no faces. The name is the original's, for messages."""
    mesh = object_.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    try:
        if mesh is None or not len(mesh.polygons):
            return None
        local = _read(mesh.vertices, "co", (len(mesh.vertices), 3), np.float32)
        matrix = _relative(np.array(object_.matrix_world, np.float64), frame, name)
        faces = mesh.loop_triangles
        triangles = _read(faces, "vertices", (len(faces), 3), np.int32)
        loops = _read(faces, "loops", (len(faces), 3), np.int32)
        polygon = _read(faces, "polygon_index", (len(faces),), np.int32)
        slot = _read(mesh.polygons, "material_index", (len(mesh.polygons),), np.int32)[polygon]
        slots, material = np.unique(slot, return_inverse=True)

        if texture is not None:
            looks = [SlotColor(texture, "")] * len(slots)
        else:
            looks = [slot_color(_slot_material(object_, index), cache, name) for index in slots.tolist()]
        uv = np.zeros((len(faces), 3, 2), np.float32)
        for index, look in enumerate(looks):
            if look.uv_map is not None:
                here = material == index
                uv[here] = _uv_map(mesh, look.uv_map, name)[loops[here]]
        return MeshArrays(
            name=name,
            positions=local.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3],
            triangles=triangles,
            corners=uv,
            material=material,
            materials=tuple(Material(name, look.color) for look in looks),
            warnings=tuple(warning for look in looks for warning in look.warnings),
        )
    finally:
        object_.to_mesh_clear()


def _relative(matrix: Floats, frame: Floats | None, name: str) -> Floats:
    """(4, 4) from the object to the frame; exactly the identity where the frame is the object's own."""
    if frame is None:
        return matrix
    if np.array_equal(matrix, frame):
        return np.eye(4)
    try:
        return np.asarray(np.linalg.inv(frame) @ matrix)
    except np.linalg.LinAlgError as error:
        raise MeshError(f"{name}: its parent has a scale of zero; mend that transform") from error


def _slot_material(object_: bpy.types.Object, index: int) -> bpy.types.Material | None:
    """Blender draws a face whose slot does not exist with the last slot there is."""
    slots = object_.material_slots
    return slots[min(index, len(slots) - 1)].material if len(slots) else None


def _uv_map(mesh: bpy.types.Mesh, name: str, owner: str) -> NDArray[np.float32]:
    """(loops, 2) of the named UV map; "" is the one active for rendering."""
    layers = mesh.uv_layers
    layer = layers.get(name) if name else next((layer for layer in layers if layer.active_render), None)
    if layer is None:
        raise MeshError(
            f"{owner}: the mesh has no UV map{f' named {name}' if name else ''}, which its image needs; unwrap it first"
        )
    return _read(layer.uv, "vector", (len(mesh.loops), 2), np.float32)


def _read(
    collection: bpy.types.bpy_prop_collection, attribute: str, shape: tuple[int, ...], dtype: type
) -> NDArray[Any]:
    values: NDArray[Any] = np.empty(shape, dtype)
    collection.foreach_get(attribute, values.reshape(-1))
    return values
