# SPDX-License-Identifier: GPL-3.0-or-later
"""Decimated versions of objects: live modifiers on a copy, or arrays with nothing left behind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

from ...comparison.candidates import AssetMesh
from ...comparison.decimation import Version, VersionReader
from ...metric.errors import FMQMError
from ...metric.surface import weld
from .. import arrays
from ..materials.color_images import give_smaller, remove_made
from ..materials.types import Reading
from .lod_names import without_level_0
from .members import lineage
from .mesh_arrays import AS_FOUND
from .target import asset_mesh

WELD, DECIMATE = "FMQM Weld", "FMQM Decimate"  # the modifiers' names
WELD_DISTANCE = 1e-6  # of the object's extent: float32 apart. With 0 the modifier merges nothing


def scene_reader(names: Sequence[str], label: str) -> VersionReader:
    """Reads versions of objects of the open file, by name_full, in the world; nothing is left behind.

    Raises, when it is called:
        FMQMError: one of them is gone.
        MeshError: no face is left of them.
    """
    return lambda version: read_version(names, label, version).world()


def read_version(
    names: Sequence[str],
    label: str,
    version: Version,
    reading: Reading = AS_FOUND,
    root: str | None = None,
    suffix: str = "",
) -> AssetMesh:
    """A version of objects of the open file, by name_full; nothing is left behind.

    Args:
        reading: how the materials are read. root: the one of names whose frame it is; None: as of asset_mesh.
        suffix: not "": texts name what add_version would make with it, the root's copy by the label.

    Raises:
        FMQMError: one of them is gone.
        MeshError: no face is left of them.
    """
    by_name = {object_.name_full: object_ for object_ in bpy.data.objects}
    gone = [name for name in names if name not in by_name]
    if gone:
        raise FMQMError(f"{gone[0]}: it is no longer in the file; choose another")
    with _copies([by_name[name] for name in names]) as copies:
        if suffix:
            for copy, name in zip(copies, names, strict=True):
                copy.name = label if name == root else f"{without_level_0(by_name[name].name)}{suffix}"
        made = give_smaller(copies, version.texture)
        try:
            for copy in copies:
                add_modifiers(copy, version.ratio)
            return asset_mesh(copies, label, reading, None if root is None else copies[names.index(root)])
        finally:
            remove_made(made)


def add_version(
    root: bpy.types.Object, names: Sequence[str], version: Version, name: str, suffix: str
) -> bpy.types.Object:
    """A version beside an object, in its collections, on the same meshes, with the modifiers live.

    Args:
        names: by name_full what is measured of the object and of those that hang from it.
        name: of the copy. suffix: of the copies of those that hang from it.

    Returns:
        The copy of the object.
    """
    parts = [object_ for object_ in (root, *root.children_recursive) if object_.name_full in names]
    needed = {above for part in parts for above in lineage(part)} - set(lineage(root.parent))
    copies: dict[bpy.types.Object, bpy.types.Object] = {}
    for object_ in (root, *(each for each in root.children_recursive if each in needed)):
        copy = copies[object_] = object_.copy()
        copy.name = name if object_ == root else f"{without_level_0(object_.name)}{suffix}"
        copy.parent = copies.get(object_.parent, object_.parent)
        for collection in object_.users_collection:
            collection.objects.link(copy)
    give_smaller([copies[part] for part in parts], version.texture)
    for part in parts:
        add_modifiers(copies[part], version.ratio)
    return copies[root]


def add_modifiers(object_: bpy.types.Object, ratio: float) -> None:
    """Adds Decimate, after a Weld where vertices coincide: importers split them at seams, which would tear open.

    Objects without a mesh of their own are left as they are.
    """
    if object_.type != "MESH" or ratio >= 1:
        return
    extent = _split_extent(object_.data)
    if extent:
        joining = object_.modifiers.new(WELD, "WELD")
        joining.merge_threshold = WELD_DISTANCE * extent
    decimate = object_.modifiers.new(DECIMATE, "DECIMATE")
    decimate.ratio = ratio


@contextmanager
def _copies(objects: Sequence[bpy.types.Object]) -> Iterator[list[bpy.types.Object]]:
    """Duplicates on the same meshes, in no scene."""
    copies: list[bpy.types.Object] = []
    try:
        for object_ in objects:
            if object_.mode == "EDIT":
                object_.update_from_editmode()
            copies.append(object_.copy())
        yield copies
    finally:
        for copy in copies:
            bpy.data.objects.remove(copy)


def _split_extent(mesh: bpy.types.Mesh) -> float:
    """The longest side of a mesh's box where some of its vertices coincide, else 0."""
    positions = arrays.read(mesh.vertices, "co", 3, np.float32)
    joined, _ = weld(positions.astype(np.float64), np.empty((0, 3), np.int64))
    if len(joined) == len(positions):
        return 0.0
    return float((positions.max(axis=0) - positions.min(axis=0)).max())
