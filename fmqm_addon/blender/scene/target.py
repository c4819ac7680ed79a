# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user named in a scene, as arrays and a transform."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...comparison.alignment import AssetMesh
from ...metric.errors import MeshError, one_line
from ...metric.geometry import Floats
from ..materials.images import TextureCache
from ..materials.types import Reading
from .evaluated import evaluated
from .members import collection_members, family_members, instances_of, is_measured, lineage, shows_surface
from .mesh_arrays import AS_FOUND, mesh_arrays, to_bake
from .motion import pose_of
from .parts import parts_of
from .render_levels import render_notes, viewport_notes
from .shaping import check_shaping_images

OBJECT, COLLECTION = "OBJECT", "COLLECTION"


@dataclass(frozen=True)
class Target:
    """An asset by its name: Blender may delete, undo or reload the thing itself at any time.

    Attributes:
        kind: OBJECT or COLLECTION. name: with its library, as name_full has it.
        bare: without its own modifiers; for mesh objects.
    """

    kind: str
    name: str
    bare: bool = False

    @property
    def label(self) -> str:
        return f"{self.name} (no modifiers)" if self.bare else self.name

    def find(self) -> bpy.types.Object | bpy.types.Collection | None:
        blocks = bpy.data.objects if self.kind == OBJECT else bpy.data.collections
        return next((block for block in blocks if block.name_full == self.name), None)

    def is_gone(self) -> bool:
        block = self.find()
        return block is None or (isinstance(block, bpy.types.Object) and not block.users_scene)

    def members(self) -> list[bpy.types.Object]:
        """The objects that the asset consists of, instances aside; none if it is gone."""
        block = self.find()
        if block is None:
            return []
        if isinstance(block, bpy.types.Collection):
            return collection_members(block)
        return family_members(block)


def target_of(block: bpy.types.Object | bpy.types.Collection, bare: bool = False) -> Target:
    return Target(OBJECT if isinstance(block, bpy.types.Object) else COLLECTION, block.name_full, bare)


def take(target: Target, reading: Reading = AS_FOUND, cache: TextureCache | None = None) -> AssetMesh:
    """The asset's arrays, read from Blender; nothing stays behind.

    An object stands for itself and what hangs from it, with their instances, a collection for what it holds; what is
    hidden from rendering is left out of either, unless all is, and what parts.parts_of leaves out.

    Args:
        reading: how it is read. cache: of bakes, just before.

    Raises:
        MeshError: it is gone, of another type, or holds nothing that can be measured.
    """
    block = target.find()
    if block is None:
        raise MeshError(f"{target.name}: it is no longer in the file; choose another")
    if isinstance(block, bpy.types.Object) and not block.users_scene:
        raise MeshError(f"{target.name}: it has been deleted from the scene; choose another")
    parts = parts_of(block, reading)
    if target.bare:
        found = _without_modifiers(block, parts.objects, target.label, reading, cache)
    else:
        origin = block if isinstance(block, bpy.types.Object) else None
        found = asset_mesh(parts.objects, target.label, reading, origin, cache)
    notes = tuple(one_line(f"{target.label}: {note}") for note in parts.notes)
    return replace(found, mesh=replace(found.mesh, notes=(*notes, *found.mesh.notes)))


def bakes(target: Target, reading: Reading, cache: TextureCache) -> tuple[str, ...]:
    """Names of the materials that take will bake; as mesh.to_bake."""
    block = target.find()
    try:
        return () if block is None else to_bake(parts_of(block, reading).objects, reading, cache)
    except MeshError:
        return ()  # take says why


def asset_mesh(
    objects: Sequence[bpy.types.Object],
    name: str,
    reading: Reading = AS_FOUND,
    origin: bpy.types.Object | None = None,
    cache: TextureCache | None = None,
) -> AssetMesh:
    """Objects as one mesh in the frame of their origin.

    Args:
        origin: the object whose frame it is; None is the only one, or the one that all hang from, or else the world.
        reading: how the materials are read.

    Raises:
        MeshError: none of them has a face, or a color cannot be read.
    """
    if origin is None and len(objects) == 1:
        origin = objects[0]
    elif origin is None:
        roots = {root.name_full: root for root in (lineage(object_)[-1] for object_ in objects)}
        origin = next(iter(roots.values())) if len(roots) == 1 else None
    matrix = np.eye(4) if origin is None else _matrix_of(origin)
    check_shaping_images(objects)
    mesh = mesh_arrays(objects, name, reading, matrix, cache)
    notes = tuple(map(one_line, (*render_notes(objects), *viewport_notes(instances_of(objects)))))
    return AssetMesh(replace(mesh, notes=(*mesh.notes, *notes)), matrix, pose_of(objects))


def contains_surface(block: bpy.types.Object | bpy.types.Collection) -> bool:
    """Whether there is something to measure in an object or collection, faces or not."""
    if isinstance(block, bpy.types.Collection):
        return any(is_measured(object_) for object_ in block.all_objects)
    return shows_surface(block)


def _without_modifiers(
    object_: bpy.types.Object,
    family: Sequence[bpy.types.Object],
    label: str,
    reading: Reading,
    cache: TextureCache | None,
) -> AssetMesh:
    """By way of a duplicate of the object, on the same mesh; those that hang from it are as they are."""
    if object_.mode == "EDIT":
        object_.update_from_editmode()
    duplicate = object_.copy()
    try:
        duplicate.modifiers.clear()
        others = [each for each in family if each != object_]
        result = asset_mesh([duplicate, *others], label, reading, duplicate, cache)
        found = result.mesh
        warnings, notes, objects = (
            tuple(text.replace(duplicate.name, object_.name, 1) for text in texts)
            for texts in (found.warnings, found.notes, found.objects)
        )
        return replace(result, mesh=replace(found, warnings=warnings, notes=notes, objects=objects))
    except MeshError as error:
        raise MeshError(str(error).replace(duplicate.name, object_.name)) from error
    finally:
        bpy.data.objects.remove(duplicate)


def _matrix_of(object_: bpy.types.Object) -> Floats:
    """(4, 4) float64, up to date, wherever the object is."""
    with evaluated([object_]) as [found]:
        return np.array(found.object.matrix_world, np.float64)
