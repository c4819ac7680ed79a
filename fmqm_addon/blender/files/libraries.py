# SPDX-License-Identifier: GPL-3.0-or-later
"""Which libraries a .blend file links, read from its blocks without loading it."""

from __future__ import annotations

import gzip
import io
import re
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO, cast

_MAGIC = re.compile(rb"BLENDER(?:([-_])([vV])\d\d\d|17-01)")
_LARGEST = 2**20  # bytes of a library's block, and 64 times as many of the description of all
_TEXT = re.compile(rb"[^\0]+")


def library_names(path: str) -> list[str]:
    """The paths of libraries as the file has them; // stands for its own folder.

    Raises:
        ImportError: it is compressed in a way that this Python does not know.
        ValueError: it is no such file, or broken.
    """
    with open(path, "rb") as file:
        try:
            with _plain(file) as plain:
                return list(_names(plain))
        except (OSError, EOFError, struct.error, IndexError, KeyError) as error:
            raise ValueError(f"no .blend file, or broken ({error})") from error


def _plain(file: BinaryIO) -> BinaryIO:
    """The file, decompressed as it is read."""
    magic = file.read(4)
    file.seek(0)
    if magic[:2] == b"\x1f\x8b":
        return cast(BinaryIO, gzip.open(file))
    if magic == b"\x28\xb5\x2f\xfd" or magic[1:] == b"\x2a\x4d\x18":  # a frame, or one to be skipped
        import zstandard  # Blender brings it along

        return cast(BinaryIO, io.BufferedReader(cast(Any, _Frames(zstandard, file)), 2**20))
    return file


class _Frames(io.RawIOBase):
    """The frames of a Zstandard file, one after the other; what cannot be read of them is a ValueError."""

    def __init__(self, zstandard: Any, file: BinaryIO) -> None:
        self._error = zstandard.ZstdError
        self._reader = zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        try:
            return int(self._reader.readinto(buffer))
        except self._error as error:
            raise ValueError(str(error)) from error


def _names(file: BinaryIO) -> Iterator[str]:
    """Blocks of code LI are libraries; where in them the path stands is told by the block DNA1."""
    found = _MAGIC.match(file.read(12))
    if found is None:
        raise ValueError("it does not begin as one")
    order = ">" if found[2] == b"V" else "<"
    large = found[1] is None
    if large:
        file.read(5)
    pointer = 4 if found[1] == b"_" else 8
    layout = order + ("4sIQQQ" if large else "4sIIII" if pointer == 4 else "4sIQII")
    libraries: list[tuple[int, bytes]] = []
    description = b""
    while True:
        code, *numbers = struct.unpack(layout, file.read(struct.calcsize(layout)))
        number, length = (numbers[0], numbers[2]) if large else (numbers[2], numbers[0])
        if code == b"ENDB":
            break
        if code == b"DNA1" and not description:
            description = file.read(min(length, 64 * _LARGEST))
        elif code == b"LI\0\0":
            if length > _LARGEST:
                raise ValueError("a library without end")
            libraries.append((number, file.read(length)))
        else:
            _skip(file, length)
    if not libraries:
        return
    members = _members(description, order, pointer)
    for number, block in libraries:
        for offset, size in members[number]:
            text = _TEXT.match(block[offset : offset + size])
            if text:
                yield text[0].decode("utf-8", "surrogateescape")


def _skip(file: BinaryIO, length: int) -> None:
    while length > 0:
        read = len(file.read(min(length, 2**20)))
        if not read:
            raise EOFError
        length -= read


def _members(data: bytes, order: str, pointer: int) -> dict[int, list[tuple[int, int]]]:
    """Offset and length of the paths in the structs called Library, by their number.

    The description holds the names of members, those of types, the types' lengths, and for each struct its type and its
    members' types and names.
    """
    at = 8  # SDNANAME

    def number(layout: str) -> int:
        nonlocal at
        value = int(struct.unpack_from(order + layout, data, at)[0])
        at += struct.calcsize(layout)
        return value

    def texts() -> list[bytes]:
        nonlocal at
        count = number("I")
        found = []
        for _ in range(count):
            end = data.index(b"\0", at)
            found.append(data[at:end])
            at = end + 1
        at = -(-at // 4) * 4 + 4  # aligned, and past the next mark
        return found

    names = texts()
    types = texts()
    lengths = [number("H") for _ in types]
    at = -(-at // 4) * 4 + 4
    found: dict[int, list[tuple[int, int]]] = {}
    for index in range(number("I")):
        kind, count = number("H"), number("H")
        offset = 0
        for _ in range(count):
            type_, name = number("H"), names[number("H")]
            dimensions = [int(each) for each in re.findall(rb"\[(\d+)\]", name)]
            size = pointer if name[:1] in (b"*", b"(") else lengths[type_]
            for each in dimensions:
                size *= each
            # The second is absolute, and not read; both were called otherwise before they were made of one kind.
            if types[kind] == b"Library" and name.partition(b"[")[0] == b"name" and types[type_] == b"char":
                found.setdefault(index, []).append((offset, size))
            offset += size
    return found
