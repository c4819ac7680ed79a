# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's collections as arrays, and back: the only quick way between the two."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray


def read(collection: Any, name: str, channels: int, dtype: type) -> NDArray[Any]:
    """A property of each item of a collection as (N, channels).

    Args:
        dtype: Blender's own for the property; another is far slower.
    """
    values: NDArray[Any] = np.empty((len(collection), channels), dtype)
    collection.foreach_get(name, values.reshape(-1))
    return values


def write(collection: Any, name: str, values: NDArray[Any]) -> None:
    """Sets a property of each item of a collection from (N,) or (N, channels) of Blender's own dtype."""
    collection.foreach_set(name, np.ascontiguousarray(values).ravel())


def read_attribute(mesh: bpy.types.Mesh, name: str, key: str, channels: int, dtype: type) -> NDArray[Any]:
    """A built-in attribute as (N, channels): many times as fast as by Mesh.vertices, loops and polygons.

    Args:
        key: what its type calls a value: "value", "vector" or "color".
    """
    return read(mesh.attributes[name].data, key, channels, dtype)


def fill(mesh: bpy.types.Mesh, positions: NDArray[Any], faces: NDArray[Any]) -> None:
    """Gives a mesh that is empty (V, 3) vertices and (F, k) faces, all of k corners."""
    mesh.vertices.add(len(positions))
    write(mesh.attributes["position"].data, "vector", positions.astype(np.float32, copy=False))
    add_faces(mesh, faces)


def add_faces(mesh: bpy.types.Mesh, faces: NDArray[Any]) -> None:
    """Gives a mesh that has vertices and no faces these (F, k), all of k corners."""
    mesh.loops.add(faces.size)
    # Through the attribute this is a copy of memory; through the loops a hundred times slower.
    write(mesh.attributes[".corner_vert"].data, "value", faces.astype(np.int32, copy=False))
    mesh.polygons.add(len(faces))
    write(mesh.polygons, "loop_start", np.arange(0, faces.size, faces.shape[1], dtype=np.int32))


def read_pixels(image: bpy.types.Image) -> NDArray[np.float32]:
    """All values of an image in a row: pixel after pixel with its channels, row 0 at the bottom."""
    values: NDArray[np.float32] = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values


def write_pixels(image: bpy.types.Image, values: NDArray[np.float32]) -> None:
    """Sets all values of an image; as read_pixels has them."""
    image.pixels.foreach_set(np.ascontiguousarray(values).ravel())
