# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes between UV maps and images: where on an image the texture coordinates of a mesh lie."""

from __future__ import annotations

from typing import Protocol

import bpy
import numpy as np
from mathutils import Euler, Matrix

from ...metric.texture import Fold, Placement
from .expressions import finite
from .node_graph import NestedSocket, NotReadError
from .types import MeshLayer


class VectorReader(Protocol):
    """What reading vectors needs of the reader of a material."""

    def channel(self, layer: MeshLayer) -> int:
        """The first channel of the corner values that belongs to a layer."""

    def count(self, place: NestedSocket) -> None:
        """Counts a node that is read."""

    def number(self, place: NestedSocket, node: bpy.types.Node, what: str) -> float:
        """The constant number at an input of a node; NotReadError where it varies."""

    def vector(self, place: NestedSocket, node: bpy.types.Node) -> tuple[float, float, float]:
        """The constant vector at an input of a node; NotReadError where it varies."""


def placement_of(place: NestedSocket, reader: VectorReader) -> Placement:
    """Where the vector at an input lies on an image."""
    node, socket = place.node, place.socket
    fold: tuple[Fold, Fold] = ("none", "none")
    if socket.is_output and node.type == "COMBXYZ":
        fold, place = _folded(place, reader)
    name, matrix = _uv(place, reader)
    rows = np.array(matrix, np.float64)
    affine = None
    if not np.array_equal(rows, np.eye(4)):
        (a, b, c), (d, e, f) = np.vectorize(finite)(rows[:2][:, [0, 1, 3]]).tolist()
        affine = ((a, b, c), (d, e, f))
    return Placement(reader.channel(MeshLayer("uv", name)), affine, fold)


def _folded(place: NestedSocket, reader: VectorReader) -> tuple[tuple[Fold, Fold], NestedSocket]:
    """What is done to u and v apart, as the glTF importer does for unlike wrap modes; and the vector that they
    are taken from."""
    folds: list[Fold] = []
    vectors = set()
    for number, axis in enumerate("XY"):
        taken = place.input(number)
        fold: Fold = "none"
        if taken.node.type == "MATH":
            fold = _fold_of(taken, reader)
            taken = taken.input(0)
        if taken.node.type != "SEPXYZ" or taken.socket.name != axis:
            raise NotReadError(place.node, "combines a vector of more than wrapped u and v")
        folds.append(fold)
        vectors.add(taken.input(0))
    if len(vectors) > 1:
        raise NotReadError(place.node, "combines two vectors")
    return (folds[0], folds[1]), vectors.pop()


def _fold_of(place: NestedSocket, reader: VectorReader) -> Fold:
    node = place.node
    limits = [reader.number(place.input(number), node, "limit") for number in (1, 2)]
    if node.operation == "WRAP" and sorted(limits) == [0, 1]:
        return "wrap"
    if node.operation == "PINGPONG" and limits[0] == 1:
        return "pingpong"
    raise NotReadError(node, "is not read")


def _uv(place: NestedSocket, reader: VectorReader) -> tuple[str, Matrix]:
    """The UV map that a vector is taken from, and the (4, 4) matrix that leads from (u, v, 0, 1) to it."""
    reader.count(place)
    node, socket = place.node, place.socket
    if not socket.is_output:
        if node.type != "TEX_IMAGE":  # the socket of a group or a mapping: a constant vector
            raise NotReadError(node, "has no vector")
        return "", Matrix.Identity(4)
    if node.type == "TEX_COORD" and socket.name == "UV" and not node.from_instancer:
        return "", Matrix.Identity(4)
    if node.type == "UVMAP" and not node.from_instancer:
        return node.uv_map, Matrix.Identity(4)
    if is_of_mesh(node) and node.attribute_name and socket.name in {"Vector", "Color"}:
        return node.attribute_name, Matrix.Identity(4)
    if node.type == "MAPPING":
        name, before = _uv(place.input("Vector"), reader)
        return name, _mapping(place, reader) @ before
    raise NotReadError(node, "is not read as the vector of an image")


def _mapping(place: NestedSocket, reader: VectorReader) -> Matrix:
    node = place.node
    scale, rotation = (reader.vector(place.input(name), node) for name in ("Scale", "Rotation"))
    turned = Euler(rotation, "XYZ").to_matrix().to_4x4()
    if node.vector_type == "VECTOR":
        return turned @ Matrix.Diagonal((*scale, 1.0))
    if node.vector_type == "POINT":
        return Matrix.Translation(reader.vector(place.input("Location"), node)) @ turned @ Matrix.Diagonal((*scale, 1))
    if node.vector_type == "TEXTURE":
        back = Matrix.Diagonal((*(1 / x if x else 0.0 for x in scale), 1.0))  # as Blender divides by 0
        moved = Matrix.Translation([-x for x in reader.vector(place.input("Location"), node)])
        return back @ turned.transposed() @ moved
    raise NotReadError(node, f"maps as {node.vector_type.lower()}")


def is_of_mesh(node: bpy.types.Node) -> bool:
    """Whether an Attribute node reads an attribute of the mesh."""
    return bool(node.type == "ATTRIBUTE" and node.attribute_type == "GEOMETRY")


def is_mapped(mapping: bpy.types.TexMapping) -> bool:
    """Whether an image node's own, hidden mapping does anything."""
    return (
        any((*mapping.translation, *mapping.rotation))
        or tuple(mapping.scale) != (1, 1, 1)
        or mapping.use_min
        or mapping.use_max
        or (mapping.mapping_x, mapping.mapping_y, mapping.mapping_z) != ("X", "Y", "Z")
        or mapping.mapping != "FLAT"
    )
