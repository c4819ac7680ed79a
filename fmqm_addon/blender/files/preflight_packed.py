# SPDX-License-Identifier: GPL-3.0-or-later
"""What is packed in FBX and .blend files, and to how much it unpacks."""

from __future__ import annotations

import struct
import zlib
from typing import BinaryIO

from ...metric.errors import FileError
from ..limits import MAX_BYTES, MAX_DEPTH

_FBX_MAGIC = b"Kaydara FBX Binary  \x00"
_FBX_ARRAYS = {ord("b"): 1, ord("c"): 1, ord("i"): 4, ord("f"): 4, ord("l"): 8, ord("d"): 8}  # bytes of a value
_FBX_VALUES = {ord("C"): 1, ord("B"): 1, ord("Y"): 2, ord("I"): 4, ord("F"): 4, ord("L"): 8, ord("D"): 8}

_ZSTD, _ZSTD_SKIPPED, _GZIP = 0xFD2FB528, 0x184D2A50, b"\x1f\x8b"
_ZSTD_BLOCK = 128 * 1024  # bytes that one unpacks to, at most


def check_fbx(path: str) -> tuple[str, ...]:
    """A binary FBX file's arrays must not promise to unpack to more than the limit together.

    Raises:
        FileError: they do.
    """
    with open(path, "rb") as file:
        data = file.read()
    if not data.startswith(_FBX_MAGIC) or len(data) < 27:
        return ()  # text, in which all is written out, or what the importer refuses
    try:
        _check_nodes(path, data)
    except (struct.error, IndexError):
        return ()  # the importer says what is wrong
    return ()


def _check_nodes(path: str, data: bytes) -> None:
    """Nodes follow each other, each with its end, properties and nodes within; an empty one ends a list."""
    (version,) = struct.unpack_from("<I", data, 23)
    head = struct.Struct("<QQQB" if version >= 7500 else "<IIIB")
    ends: list[int] = []
    at, unpacked = 27, 0
    while at + head.size <= len(data):
        while ends and at >= ends[-1]:
            ends.pop()
        end, count, length, name = head.unpack_from(data, at)
        at += head.size + name
        if not end:
            continue
        if end <= at or end > len(data) or at + length > end:
            return  # the importer refuses it
        unpacked += _unpacked(data, at, count, at + length)
        if unpacked > MAX_BYTES:
            raise FileError(f"{path}: its arrays unpack to more than {MAX_BYTES:,} bytes; divide the file")
        at += length
        ends.append(end)
        if len(ends) > MAX_DEPTH:
            raise FileError(f"{path}: its nodes are nested more than {MAX_DEPTH:,} deep; export it again")


def _unpacked(data: bytes, at: int, count: int, end: int) -> int:
    """Bytes that a node's arrays unpack to."""
    total = 0
    for _ in range(count):
        if at >= end:
            break
        kind = data[at]
        at += 1
        if kind in _FBX_ARRAYS:
            values, _, length = struct.unpack_from("<III", data, at)
            at += 12 + length
            total += values * _FBX_ARRAYS[kind]
        elif kind in (ord("S"), ord("R")):
            at += 4 + struct.unpack_from("<I", data, at)[0]
        elif kind in _FBX_VALUES:
            at += _FBX_VALUES[kind]
        else:
            break  # the importer refuses it
    return total


def check_blend(path: str) -> tuple[str, ...]:
    """A compressed .blend file must not unpack to more than the limit.

    Raises:
        FileError: it does.
    """
    with open(path, "rb") as file:
        start = file.read(4)
        file.seek(0)
        if start[:2] == _GZIP:  # before Blender 3.0
            size = _gzip_size(file)
        elif len(start) == 4 and _is_zstd(int.from_bytes(start, "little")):
            size = _zstd_size(file)
        else:
            return ()
    if size > MAX_BYTES:
        raise FileError(f"{path}: it unpacks to more than {MAX_BYTES:,} bytes; divide the file")
    return ()


def _is_zstd(magic: int) -> bool:
    return magic == _ZSTD or magic & 0xFFFFFFF0 == _ZSTD_SKIPPED


def _gzip_size(file: BinaryIO) -> int:
    """Bytes that it unpacks to; stops beyond the limit. What it says of itself is only the remainder by 4 GB."""
    total, stream = 0, zlib.decompressobj(31)
    try:
        while total <= MAX_BYTES:
            data = stream.unconsumed_tail or stream.unused_data or file.read(1 << 20)
            if not data:
                break
            if stream.eof:
                stream = zlib.decompressobj(31)
            total += len(stream.decompress(data, 1 << 24))
    except zlib.error:
        pass  # Blender says what is wrong
    return total


def _zstd_size(file: BinaryIO) -> int:
    """Bytes that its frames unpack to at most: as their blocks' heads have it, nothing is unpacked."""
    total = 0
    while len(start := file.read(4)) == 4 and total <= MAX_BYTES:
        magic = int.from_bytes(start, "little")
        if magic & 0xFFFFFFF0 == _ZSTD_SKIPPED:
            file.seek(int.from_bytes(file.read(4), "little"), 1)
            continue
        flags = file.read(1)
        if magic != _ZSTD or not flags:
            break
        single = flags[0] >> 5 & 1
        sizes = (single, 2, 4, 8)[flags[0] >> 6]  # bytes that tell the frame's size
        file.seek((1 - single) + (0, 1, 2, 4)[flags[0] & 3] + sizes, 1)
        while len(head := file.read(3)) == 3:
            block = int.from_bytes(head, "little")
            kind, size = block >> 1 & 3, block >> 3
            total += _ZSTD_BLOCK if kind == 2 else size  # packed, or as they are, or one byte many times
            file.seek(1 if kind == 1 else size, 1)
            if block & 1 or total > MAX_BYTES:
                break
        file.seek(4 * (flags[0] >> 2 & 1), 1)  # checksum
    return total
