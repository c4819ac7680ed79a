# SPDX-License-Identifier: GPL-3.0-or-later
"""What an image's file promises, read from its first bytes before anything decodes it."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from operator import add
from typing import BinaryIO


@dataclass(frozen=True)
class ImageLimits:
    """What an image may promise: pixels a side, and bytes once decoded (4 a pixel, 16 in float images)."""

    side: int = 32768
    decoded: int = 2**30


DEFAULT_LIMITS = ImageLimits()


@dataclass(frozen=True)
class Header:
    """What a file promises.

    Attributes:
        width: in pixels.
        height: in pixels.
        is_float: whether Blender decodes it to floats.
        is_grey_with_alpha: it has these two channels (told of PNG, TIFF, TGA and JPEG 2000).
        kind: of file, such as "png"; it does not count where headers are compared.
        is_cut: it has no rows, or some beyond its own end (told of packed SGI).
    """

    width: int
    height: int
    is_float: bool = False
    is_grey_with_alpha: bool = False
    kind: str = field(default="", compare=False)
    is_cut: bool = False

    @property
    def decoded(self) -> int:
        """Bytes that the decoded image takes."""
        return self.width * self.height * (16 if self.is_float else 4)


def file_header(path: str) -> Header | None:
    """The header of the file at a path; None also where it cannot be opened, or is a pipe or a device."""
    if not os.path.isfile(path):
        return None
    try:
        with open(path, "rb") as file:
            return read_header(file)
    except OSError:
        return None


def read_header(file: BinaryIO) -> Header | None:
    """The header of a seekable file at its beginning; None where it is of no known kind, broken or empty."""
    start = file.read(64)
    for magic, at, kind, read in _READERS:
        if start[at : at + len(magic)] == magic:
            return _sane(kind, read, file)
    return _sane("tga", _tga, file)  # the only kind without a magic number


def _sane(kind: str, read: Callable[[BinaryIO], Header | None], file: BinaryIO) -> Header | None:
    file.seek(0)
    try:
        found = read(file)
    except (struct.error, ValueError, OverflowError):  # it ends too early, or its numbers are no numbers
        return None
    return replace(found, kind=kind) if found is not None and found.width > 0 and found.height > 0 else None


def _unpack(layout: str, file: BinaryIO, at: int | None = None) -> tuple[int, ...]:
    if at is not None:
        file.seek(at)
    return struct.unpack(layout, file.read(struct.calcsize(layout)))


def _png(file: BinaryIO) -> Header:
    width, height, depth, kind = _unpack(">IIBB", file, 16)
    return Header(width, height, depth == 16, kind == 4)


def _jpeg(file: BinaryIO) -> Header | None:
    file.seek(2)
    while True:
        mark, kind = _unpack(">BB", file)
        while kind == 0xFF:  # padding
            (kind,) = _unpack(">B", file)
        if mark != 0xFF:
            return None
        if kind == 0x01 or 0xD0 <= kind <= 0xD8:  # these stand alone
            continue
        (length,) = _unpack(">H", file)
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            _, height, width = _unpack(">BHH", file)
            return Header(width, height)
        file.seek(max(length - 2, 0), 1)


def _webp(file: BinaryIO) -> Header | None:
    kind = file.read(16)[12:]
    if kind == b"VP8 ":
        width, height = _unpack("<HH", file, 26)
        return Header(width & 0x3FFF, height & 0x3FFF)
    if kind == b"VP8L":
        (bits,) = _unpack("<I", file, 21)
        return Header((bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1)
    if kind == b"VP8X":
        a, b, c, d, e, f = _unpack("<6B", file, 24)
        return Header((a | b << 8 | c << 16) + 1, (d | e << 8 | f << 16) + 1)
    return None


def _bmp(file: BinaryIO) -> Header:
    (size,) = _unpack("<I", file, 14)
    width, height = _unpack("<HH", file, 18) if size == 12 else _unpack("<ii", file, 18)
    return Header(width, abs(height))  # negative: rows run downwards


def _tiff(file: BinaryIO) -> Header:
    order = "<" if file.read(2) == b"II" else ">"
    (version,) = _unpack(order + "H", file)
    big = version == 43
    (directory,) = _unpack(order + ("Q" if big else "I"), file, 8 if big else 4)
    (count,) = _unpack(order + ("Q" if big else "H"), file, directory)
    values = {256: 0, 257: 0, 258: 8, 277: 1}  # width, height, bits of a sample, samples of a pixel
    for _ in range(min(count, 1000)):
        tag, kind, number = _unpack(order + ("HHQ" if big else "HHI"), file)
        field = file.read(8 if big else 4)
        if tag in values:
            values[tag] = _tiff_value(order, kind, number, field, file)
    return Header(values[256], values[257], values[258] > 8, values[277] == 2)


def _tiff_value(order: str, kind: int, number: int, field: bytes, file: BinaryIO) -> int:
    """The first of a tag's whole numbers: in the field itself, or where that points to."""
    layout = {1: "B", 3: "H", 4: "I", 16: "Q"}.get(kind)
    if layout is None:
        raise ValueError("not a whole number")
    if number * struct.calcsize(layout) <= len(field):
        return int(struct.unpack_from(order + layout, field)[0])
    here = file.tell()
    (value,) = _unpack(order + layout, file, struct.unpack(order + ("Q" if len(field) == 8 else "I"), field)[0])
    file.seek(here)
    return value


def _exr(file: BinaryIO) -> Header | None:
    file.seek(8)
    for _ in range(1000):
        name = _text(file)
        if not name:
            return None
        _text(file)  # its type
        (length,) = _unpack("<I", file)
        if name == b"dataWindow":
            left, top, right, bottom = _unpack("<4i", file)
            return Header(right - left + 1, bottom - top + 1, True)
        file.seek(length, 1)
    return None


def _text(file: BinaryIO) -> bytes:
    """Bytes up to a zero, at most 255."""
    text = b""
    while len(text) < 256:
        byte = file.read(1)
        if byte in (b"", b"\0"):
            break
        text += byte
    return text


def _hdr(file: BinaryIO) -> Header | None:
    for _ in range(1000):
        words = file.readline(1024).split()
        if len(words) == 4 and {words[0][1:], words[2][1:]} == {b"X", b"Y"}:
            first, second = int(words[1]), int(words[3])
            return Header(second, first, True) if words[0][1:] == b"Y" else Header(first, second, True)
    return None


def _psd(file: BinaryIO) -> Header:
    height, width, depth = _unpack(">IIH", file, 14)
    return Header(width, height, depth > 8)


def _dds(file: BinaryIO) -> Header:
    height, width = _unpack("<II", file, 12)
    return Header(width, height)


def _jp2(file: BinaryIO) -> Header | None:
    """The boxed kind: the image header box follows within the JP2 header box."""
    start = file.read(4096)
    at = start.find(b"ihdr")
    if at < 0:
        return None
    height, width, channels, depth = struct.unpack_from(">IIHB", start, at + 4)
    return Header(width, height, (depth & 0x7F) + 1 > 8, channels == 2)


def _j2k(file: BinaryIO) -> Header:
    """The bare stream: its SIZ segment is the first."""
    right, bottom, left, top = _unpack(">4I", file, 8)
    channels, depth = _unpack(">HB", file, 40)
    return Header(right - left, bottom - top, (depth & 0x7F) + 1 > 8, channels == 2)


def _sgi(file: BinaryIO) -> Header:
    """Two tables follow the header of a packed one: where each channel's rows begin, and their lengths."""
    packed, width, height, channels = _unpack(">BxxxHHH", file, 2)
    rows, end = height * channels, file.seek(0, 2)
    if packed != 1 or not rows or end < 512 + 8 * rows:
        return Header(width, max(height, 1), is_cut=packed == 1)  # a line of pixels may have a height of 0
    tables = _unpack(f">{2 * rows}I", file, 512)
    return Header(width, height, is_cut=any(map(end.__lt__, map(add, tables[:rows], tables[rows:]))))


def _dpx(file: BinaryIO) -> Header:
    order = ">" if file.read(1) == b"S" else "<"
    width, height = _unpack(order + "II", file, 772)
    (depth,) = _unpack("B", file, 803)
    return Header(width, height, depth > 8)


def _cineon(file: BinaryIO) -> Header:
    order = ">" if file.read(1) == b"\x80" else "<"
    width, height = _unpack(order + "II", file, 200)
    return Header(width, height, True)


def _tga(file: BinaryIO) -> Header | None:
    colors, kind = _unpack("<xBB", file)
    width, height, depth = _unpack("<HHB", file, 12)
    known = colors in (0, 1) and kind in (1, 2, 3, 9, 10, 11) and depth in (8, 15, 16, 24, 32)
    return Header(width, height, is_grey_with_alpha=kind in (3, 11) and depth == 16) if known else None


_READERS: tuple[tuple[bytes, int, str, Callable[[BinaryIO], Header | None]], ...] = (
    (b"\x89PNG\r\n\x1a\n", 0, "png", _png),
    (b"\xff\xd8\xff", 0, "jpeg", _jpeg),
    (b"WEBP", 8, "webp", _webp),
    (b"BM", 0, "bmp", _bmp),
    (b"II*\0", 0, "tiff", _tiff),
    (b"MM\0*", 0, "tiff", _tiff),
    (b"II+\0", 0, "tiff", _tiff),
    (b"MM\0+", 0, "tiff", _tiff),
    (b"\x76\x2f\x31\x01", 0, "exr", _exr),
    (b"#?", 0, "hdr", _hdr),
    (b"8BPS", 0, "psd", _psd),
    (b"DDS ", 0, "dds", _dds),
    (b"\0\0\0\x0cjP  ", 0, "jp2", _jp2),
    (b"\xff\x4f\xff\x51", 0, "jp2", _j2k),
    (b"\x01\xda", 0, "sgi", _sgi),
    (b"SDPX", 0, "dpx", _dpx),
    (b"XPDS", 0, "dpx", _dpx),
    (b"\x80\x2a\x5f\xd7", 0, "cineon", _cineon),
    (b"\xd7\x5f\x2a\x80", 0, "cineon", _cineon),
)
