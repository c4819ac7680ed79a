# SPDX-License-Identifier: GPL-3.0-or-later
"""Truncated and malformed files on which Blender's importers would end the whole process, or never come back."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Literal
from urllib.parse import quote

import numpy as np

from ...metric.errors import FileError, MeshError
from ..limits import MAX_DEPTH
from ..materials.image_files import crashes
from ..materials.image_headers import file_header

_COUNT = re.compile(rb"-?0*\d{1,9}")  # Blender would end the process at 2^31
_PLY_ELEMENT = re.compile(rb"^element[ \t]+(\S+)[ \t]+(\d+)[ \t\r]*$", re.MULTILINE)
_PLY_POINTS = (b"vertex", b"chunk", b"sh", b"camera", b"point")  # what clouds consist of
_OGAWA_DATA = 1 << 63  # marks the position of data, not of a group
_JPEG_2000 = (".jp2", ".j2k", ".j2c", ".jpc")
_PLY_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "int32", "uint32", "float", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}


def check_beside(path: str) -> None:
    """Importers load what a file names: at a pipe or a device they would wait for ever, deaf to Ctrl-C.

    Looked at is what lies in its folder and in the folders there.

    Raises:
        FileError: it names a pipe, a device or an image at which Blender crashes.
    """
    beside = _entries(os.path.dirname(path) or ".")
    below = [inner for each in beside if each.is_dir() for inner in _entries(each.path)]
    bad = [(each, why) for each in (*beside, *below) if (why := _why_bad(each))]
    if not bad:
        return
    own = f"{Path(path).stem}.mtl"  # which an OBJ need not name
    text = Path(path).read_bytes()
    libraries = [each for each in beside if each.name.lower().endswith(".mtl") and each.is_file()]
    text += b"".join(
        Path(each).read_bytes() for each in libraries if each.name == own or os.fsencode(each.name) in text
    )
    for each, why in bad:
        names = [name for name in map(os.fsencode, (each.name, quote(each.name))) if name in text]
        words = rb"(?<![\w.-])(?:%b)(?![\w.-])" % b"|".join(map(re.escape, names))
        if each.name == own or (names and re.search(words, text)):
            raise FileError(f"{path}: it names {each.path}; {why}")


def _entries(folder: str) -> list[os.DirEntry[str]]:
    """What lies in a folder, links aside that lead nowhere or round in circles."""
    try:
        with os.scandir(folder) as found:
            return [entry for entry in found if not entry.is_symlink() or os.path.exists(entry.path)]
    except OSError:
        return []


def _why_bad(entry: os.DirEntry[str]) -> str:
    """Why an importer must not load something; "" where it may."""
    if entry.is_file():
        decoded = entry.name.lower().endswith(_JPEG_2000)  # while importing, the others later
        return crashes(file_header(entry.path)) if decoded else ""
    return "" if entry.is_dir() else "a file is wanted, not a pipe or a device"


def check_alembic(path: str) -> tuple[str, ...]:
    """An Ogawa archive must hold its root group, which is written last, and no group twice or too deep.

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
            return ()  # the importer says what it is not
        root = int.from_bytes(header[8:], "little")
        file.seek(min(root, size))
        children = int.from_bytes(file.read(8), "little")
        if len(header) < 16 or root + 8 + 8 * children > size:
            raise FileError(f"{path}: the Alembic archive is truncated")
        _check_groups(path, file, root, size)
    return ()


def _check_groups(path: str, file: BinaryIO, root: int, size: int) -> None:
    """Writers share data, never groups: groups that share groups multiply when they are read."""
    depths = {root: 1}
    waiting = [root]
    while waiting:
        at = waiting.pop()
        file.seek(at)
        count = int.from_bytes(file.read(8), "little")
        if at + 8 + 8 * count > size:
            continue  # the importer refuses it
        for child in np.frombuffer(file.read(8 * count), "<u8").tolist():
            if not child or child & _OGAWA_DATA or child >= size:
                continue
            depth = depths[at] + 1
            if child in depths:
                raise FileError(f"{path}: groups of the Alembic archive hold each other; export it again")
            if depth > MAX_DEPTH:
                raise FileError(
                    f"{path}: its groups are nested more than {MAX_DEPTH:,} deep; export it with fewer parents"
                )
            depths[child] = depth
            waiting.append(child)


def check_ply(path: str) -> tuple[str, ...]:
    """A PLY's header must make sense to Blender, and a binary file must hold the elements that it counts.

    Raises:
        FileError: it does not.
    """
    with open(path, "rb") as file:
        data = file.read()
    header, _, _ = data.partition(b"end_header")
    if data.startswith(b"ply") and b"\nproperty" in header.partition(b"\nelement")[0]:  # crashes Blender 4.5 at times
        raise FileError(f"{path}: the PLY header lists properties of no element; export the file again")
    for line in header.splitlines():
        words = line.split()
        if words[:1] == [b"element"] and not (len(words) == 3 and _COUNT.fullmatch(words[2])):
            said = line.decode("latin-1")[:80]
            raise FileError(f"{path}: the PLY header says {said!r}; a name and a count below a billion are wanted")
    _check_faces(path, data, header)
    order: Literal["little", "big"] = "big" if b"format binary_big_endian" in header else "little"
    if data.startswith(b"ply") and b"format ascii" in header and len(header) < len(data):
        _check_text(path, header, len(data) - len(header))
    if not data.startswith(b"ply") or b"format binary_" not in header or len(header) == len(data):
        return ()  # text, or what the importer refuses anyway
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
        return ()  # a header that the importer judges
    if position > len(data):
        raise FileError(f"{path}: the PLY file is truncated")
    return ()


def _check_faces(path: str, data: bytes, header: bytes) -> None:
    """Scans and splats are clouds of points: told before an importer says less of them."""
    elements = [(found[1], int(found[2])) for found in _PLY_ELEMENT.finditer(header)]
    points = dict(elements).get(b"vertex", 0)
    is_cloud = points > 0 and not any(count for name, count in elements if name not in _PLY_POINTS)
    if is_cloud and data.startswith(b"ply") and len(header) < len(data):
        raise MeshError(f"{path}: points or splats ({points:,}), no faces; a surface is wanted, so mesh them first")


def _check_text(path: str, header: bytes, length: int) -> None:
    """Each value takes a digit and a blank: Blender makes room for all elements before it reads one."""
    try:
        wanted = sum(2 * count * len(properties) for count, properties in _ply_elements(header.decode("latin-1")))
    except (KeyError, ValueError, IndexError):
        return  # a header that the importer judges
    if wanted > length:
        raise FileError(f"{path}: the PLY header promises more elements than the file holds; export it again")


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
