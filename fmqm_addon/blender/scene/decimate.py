# SPDX-License-Identifier: GPL-3.0-or-later
"""Decimated versions of objects: live modifiers on a copy, or arrays with nothing left behind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import bpy
import numpy as np

from ...comparison.decimation import Version, VersionReader
from ...metric.errors import FMQMError
from ...metric.surface import MeshArrays, weld
from .. import arrays
from .target import asset_mesh

WELD, DECIMATE = "FMQM Weld", "FMQM Decimate"  # the modifiers' names
WELD_DISTANCE = 1e-6  # of the object's extent: float32 apart. With 0 the modifier merges nothing


def scene_reader(names: Sequence[str], label: str) -> VersionReader:
    """Reads objects of the open file, by name_full, decimated; nothing is left behind.

    Raises, when it is called:
        FMQMError: one of them is gone.
        MeshError: no face is left of them.
    """

    def read(version: Version) -> MeshArrays:
        by_name = {object_.name_full: object_ for object_ in bpy.data.objects}
        gone = [name for name in names if name not in by_name]
        if gone:
            raise FMQMError(f"{gone[0]}: it is no longer in the file; choose another")
        with _copies([by_name[name] for name in names]) as copies:
            for copy in copies:
                add_modifiers(copy, version.ratio)
            return asset_mesh(copies, label).world()

    return read


def decimated_copy(object_: bpy.types.Object, ratio: float, name: str) -> bpy.types.Object:
    """A copy beside the object, in its collections, on the same mesh, with the modifiers live."""
    copy = object_.copy()
    copy.name = name
    for collection in object_.users_collection:
        collection.objects.link(copy)
    add_modifiers(copy, ratio)
    return copy


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
