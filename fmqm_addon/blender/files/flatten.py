# SPDX-License-Identifier: GPL-3.0-or-later
"""What a session shows, as plain meshes, which all exporters write alike. For scripts: nothing else stays in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix

from ..scene.evaluated import Evaluated, Shown, evaluated, shown
from ..scene.members import lineage
from ..scene.mesh_arrays import slot_materials

_KEPT = ("EMPTY", "LIGHT", "CAMERA")  # beside what is measured
_SHEARED = 1e-5  # of the longest axis; below it is rounding


@dataclass(frozen=True)
class _Node:
    """An object to be.

    Attributes:
        data: its mesh, light or camera; None makes an empty. matrix: to the world. parent: its place in the list.
    """

    name: str
    data: bpy.types.ID | None
    matrix: Matrix
    parent: int | None


@dataclass(frozen=True)
class _Surface:
    """What an object shows somewhere; own: it may be the object's own mesh."""

    name: str
    mesh: bpy.types.Mesh
    matrix: Matrix
    own: bool


def flatten_objects(objects: Sequence[bpy.types.Object], alone: bool) -> list[bpy.types.Object]:
    """Replaces all objects of the session by what these show, as it is measured: evaluated meshes, without modifiers,
    skeletons, shape keys, constraints and animation, under their names and parents; instances are objects of their own.

    Args:
        alone: without their parents, and without the scene's empties, lights and cameras.

    Returns:
        The new objects, in the active scene.
    """
    kept = {object_.name_full: object_ for object_ in objects}
    if not alone:
        kept |= {each.name_full: each for each in bpy.context.scene.objects if each.type in _KEPT}
        kept |= {above.name_full: above for each in list(kept.values()) for above in lineage(each)}
    nodes = _nodes(sorted(kept.values(), key=lambda each: len(lineage(each))), set(objects))
    bpy.data.batch_remove(list(bpy.data.objects))
    made: list[tuple[bpy.types.Object, Matrix]] = []
    for node in nodes:
        made.append(_made(node, None if node.parent is None else made[node.parent]))
    bpy.context.view_layer.update()
    return [object_ for object_, _ in made]


def _nodes(kept: Sequence[bpy.types.Object], measured: set[bpy.types.Object]) -> list[_Node]:
    """Of objects, parents first, and of the instances that the measured ones show."""
    nodes: list[_Node] = []
    rows: dict[str, int] = {}
    with evaluated(kept) as found:
        surfaces = _surfaces([each for each in found if each.original in measured])
        for each in found:
            matrix, original = each.object.matrix_world.copy(), each.original
            here = surfaces.get(original.name_full, [])
            own = next((surface for surface in here if surface.own and surface.matrix == matrix), None)
            data = original.data if original.type in {"LIGHT", "CAMERA"} else own and own.mesh
            parent = None if original.parent is None else rows.get(original.parent.name_full)
            row = rows[original.name_full] = len(nodes)
            nodes.append(_Node(original.name, data, matrix, parent))
            nodes += [_Node(other.name, other.mesh, other.matrix, row) for other in here if other is not own]
    return nodes


def _surfaces(measured: list[Evaluated]) -> dict[str, list[_Surface]]:
    """What each object shows, by its name_full."""
    meshes: dict[tuple[int, ...], bpy.types.Mesh] = {}
    surfaces: dict[str, list[_Surface]] = {}
    for each in shown(measured):
        if each.particle:
            continue
        materials = [found and found.original for found in slot_materials(each.object)]
        key = (each.object.data.as_pointer(), *(0 if found is None else found.as_pointer() for found in materials))
        if key not in meshes:
            meshes[key] = _copied(each, materials)
        surface = _Surface(each.name, meshes[key], Matrix(each.matrix.tolist()), not each.instance or each.made)
        surfaces.setdefault(each.owner.original.name_full, []).append(surface)
    return surfaces


def _copied(each: Shown, materials: list[bpy.types.Material | None]) -> bpy.types.Mesh:
    """The evaluated mesh, with the object's materials, whether these were its own or the mesh's."""
    mesh = bpy.data.meshes.new_from_object(each.object)
    for index, material in enumerate(materials):
        if index < len(mesh.materials):
            mesh.materials[index] = material
        else:
            mesh.materials.append(material)
    mesh.rename(each.object.data.name if each.object.original.type == "MESH" else each.name, mode="ALWAYS")
    return mesh


def _made(node: _Node, parent: tuple[bpy.types.Object, Matrix] | None) -> tuple[bpy.types.Object, Matrix]:
    """The object, and where location, rotation and scale put it; what shears is done to its mesh: files cannot hold it
    otherwise."""
    object_ = bpy.data.objects.new(node.name, node.data)
    bpy.context.scene.collection.objects.link(object_)
    base = Matrix()
    if parent is not None:
        object_.parent, base = parent
    object_.matrix_basis = base.inverted_safe() @ node.matrix
    matrix = base @ object_.matrix_basis
    wanted = np.array(node.matrix)[:3, :3]
    if (
        isinstance(node.data, bpy.types.Mesh)
        and np.abs(np.array(matrix)[:3, :3] - wanted).max() > _SHEARED * np.abs(wanted).max()
    ):
        object_.data = node.data.copy()
        object_.data.transform(matrix.inverted_safe() @ node.matrix)
    return object_, matrix
