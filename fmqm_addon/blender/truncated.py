# SPDX-License-Identifier: GPL-3.0-or-later
"""Truncated and malformed files on which Blender's importers would end the whole process."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Literal

import bpy
import numpy as np

from ..metric.errors import FileError

_COUNT = re.compile(rb"-?0*\d{1,9}")  # Blender would end the process at 2^31
_PLY_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "int32", "uint32", "float", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}


def check_alembic(path: str) -> None:
    """An Ogawa archive must hold its root group, which is written last.

    Magic and version, 8 bytes; position of the root group; that group is the number of its children, then
    their positions. All whole numbers have 8 bytes, little-endian.

    Raises:
        FileError: it does not.
    """
    with open(path, "rb") as file:
        size = file.seek(0, 2)
        file.seek(0)
        header = file.read(16)
        if not header.startswith(b"Ogawa"):
            return  # the importer says what it is not
        root = int.from_bytes(header[8:], "little")
        file.seek(min(root, size))
        children = int.from_bytes(file.read(8), "little")
    if len(header) < 16 or root + 8 + 8 * children > size:
        raise FileError(f"{path}: the Alembic archive is truncated")


def check_usd(path: str) -> None:
    """The faces of a USD file's meshes must have no more corners than are listed: Blender 4.5 reads beyond the end.

    Raises:
        FileError: they have.
    """
    try:
        bpy.utils.expose_bundled_modules()
        from pxr import Tf, Usd, UsdGeom
    except ImportError:
        return  # Debian's Blender 5 has no pxr, and survives such files
    try:
        stage = Usd.Stage.Open(path, Usd.Stage.LoadAll)
    except Tf.ErrorException:
        return  # the importer says what is wrong
    for prim in stage.TraverseAll():
        mesh = UsdGeom.Mesh(prim)
        if not mesh:
            continue
        faces, corners = mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr()
        for time in {Usd.TimeCode.Default(), *map(Usd.TimeCode, {*faces.GetTimeSamples(), *corners.GetTimeSamples()})}:
            counts, listed = np.array(faces.Get(time) or [], np.int64), len(corners.Get(time) or [])
            if counts.min(initial=0) < 0 or counts.sum() > listed:
                raise FileError(
                    f"{path}: a mesh's faces have {counts.sum()} corners, {listed} are listed; export it again"
                )


def check_ply(path: str) -> None:
    """A PLY's header must make sense to Blender, and a binary file must hold the elements that it counts.

    Raises:
        FileError: it does not.
    """
    with open(path, "rb") as file:
        data = file.read()
    header, _, _ = data.partition(b"end_header")
    if data.startswith(b"ply") and b"\nproperty" in header.partition(b"\nelement")[0]:
        raise FileError(f"{path}: the PLY header lists properties of no element; export the file again")
    for line in header.splitlines():
        words = line.split()
        if words[:1] == [b"element"] and not (len(words) == 3 and _COUNT.fullmatch(words[2])):
            said = line.decode("latin-1")[:80]
            raise FileError(f"{path}: the PLY header says {said!r}; a name and a count below a billion are wanted")
    order: Literal["little", "big"] = "big" if b"format binary_big_endian" in header else "little"
    if not data.startswith(b"ply") or b"format binary_" not in header or len(header) == len(data):
        return  # text, whose end the importer notices, or what it refuses anyway
    position = data.find(b"\n", len(header)) + 1
    try:
        for count, properties in _ply_elements(header.decode("latin-1")):
            if all(count_bytes == 0 for count_bytes, _ in properties):
                position += count * sum(value_bytes for _, value_bytes in properties)
                continue
            alike = _alike(data, position, count, properties, order)
            if alike is not None:
                position += alike
                continue
            for _ in range(count):
                for count_bytes, value_bytes in properties:
                    length = int.from_bytes(data[position : position + count_bytes], order) if count_bytes else 1
                    position += count_bytes + length * value_bytes
                if position > len(data):
                    break
    except (KeyError, ValueError, IndexError):
        return  # a header that the importer judges
    if position > len(data):
        raise FileError(f"{path}: the PLY file is truncated")


def _alike(
    data: bytes, position: int, count: int, properties: list[tuple[int, int]], order: Literal["little", "big"]
) -> int | None:
    """Bytes of elements whose lists are all as long as the first one's, as in a mesh of triangles; None for others."""
    size = 0
    counts: list[int] = []  # where in an element the bytes of its lists' lengths stand
    for count_bytes, value_bytes in properties:
        start = position + size
        length = int.from_bytes(data[start : start + count_bytes], order) if count_bytes else 1
        counts += range(size, size + count_bytes)
        size += count_bytes + length * value_bytes
    if position + count * size > len(data) or not count:
        return None
    elements = np.frombuffer(data, np.uint8, count * size, position).reshape(count, size)
    lengths = elements.take(counts, axis=1)
    return count * size if (lengths == lengths[0]).all() else None


def _ply_elements(header: str) -> Iterator[tuple[int, list[tuple[int, int]]]]:
    """Count and properties of each element: bytes of a list's length, 0 for a single value, and of a value."""
    count = 0
    properties: list[tuple[int, int]] = []
    for words in (line.split() for line in header.splitlines()):
        if words[:1] == ["element"]:
            yield count, properties
            count, properties = int(words[2]), []
        elif words[:2] == ["property", "list"]:
            properties.append((_PLY_BYTES[words[2]], _PLY_BYTES[words[3]]))
        elif words[:1] == ["property"]:
            properties.append((0, _PLY_BYTES[words[1]]))
    yield count, properties
