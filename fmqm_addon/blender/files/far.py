# SPDX-License-Identifier: GPL-3.0-or-later
"""Text files far from the origin, as map coordinates are, moved there before Blender reads them.

Blender keeps coordinates in single precision, about seven digits: of a place in meters on a map that leaves half a
meter. Of what a file says in text, the digits are kept by way of a copy whose vertices are near the origin; what was
taken off is added again in double precision.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...folders import own_folder
from ...metric.geometry import Floats

FAR = 100.0  # times the size of the whole
_FIRST = 200  # vertices that tell of most files that they are near
_Y_TO_Z_UP = np.array([(1.0, 0, 0), (0, 0, -1), (0, 1, 0)])  # as Blender's importer turns an .obj
_MTLLIB = re.compile(rb"[ \t]*mtllib[ \t]+(.*)", re.DOTALL)


def offset_of(path: str) -> Floats | None:
    """(3,) what to take off a text file's vertices, so that they are near the origin; None where nothing is.

    Files far away whose vertices Blender's importer would not read either are left alone.
    """
    lines = _LINES.get(Path(path).suffix.lower())
    if lines is None:
        return None
    try:
        low, high = [np.inf] * 3, [-np.inf] * 3
        with open(path, "rb") as file:
            for count, (_, words, at) in enumerate(lines(file)):
                if words is None:
                    continue
                vertex = [float(words[k]) for k in at]
                low, high = list(map(min, low, vertex)), list(map(max, high, vertex))
                if count >= _FIRST and _is_far(low, high) is False:
                    return None  # whatever follows, the whole is no nearer to the origin than it is large
    except (ValueError, IndexError, OSError):
        return None
    if not _is_far(low, high):
        return None
    lowest, highest = np.array(low), np.array(high)
    # The same of a reference and its LODs: to a grid as coarse as they are large.
    grid = 2.0 ** np.ceil(np.log2((highest - lowest).max()))
    offset: Floats = np.round((lowest + highest) / 2 / grid) * grid
    return offset


def _is_far(low: Sequence[float], high: Sequence[float]) -> bool | None:
    """Whether a box is FAR times its diagonal away; None where it has no size."""
    size = math.dist(low, high)
    if not 0 < size < math.inf:
        return None
    return max(map(abs, (*low, *high))) > FAR * size


def in_world(path: str, offset: Floats) -> Floats:
    """(3,) an offset in a file's own axes, in those that Blender's importer makes of them."""
    turned: Floats = _Y_TO_Z_UP @ offset if path.lower().endswith(".obj") else offset
    return turned


@contextlib.contextmanager
def moved_copy(path: str, offset: Floats | None) -> Iterator[str]:
    """A copy of a text file with an offset taken off its vertices, for a while; the file itself without one.

    It lies in a folder for temporary files, and names its material files where they are.

    Raises:
        OSError: there is no room for it.
    """
    if offset is None:
        yield path
        return
    with own_folder() as folder:
        copy = os.path.join(os.path.realpath(folder), os.path.basename(path))
        with open(path, "rb") as file, open(copy, "wb") as out:
            if path.lower().endswith(".obj"):
                _name_own_library(path, folder, out)
            for line, words, at in _LINES[Path(path).suffix.lower()](file):
                if words is not None:
                    for place, k in enumerate(at):
                        words[k] = repr(float(words[k]) - float(offset[place])).encode()
                    line = b" ".join(words) + b"\n"
                elif found := _MTLLIB.match(line):
                    line = b"mtllib %s\n" % _from(folder, path, os.fsdecode(found[1].strip()))
                out.write(line)
        yield copy


def _name_own_library(path: str, folder: Path, out: BinaryIO) -> None:
    """Blender reads FILE.mtl whether it is named or not, if it lies beside."""
    own = f"{Path(path).stem}.mtl"
    if os.path.exists(os.path.join(os.path.dirname(path), own)):
        out.write(b"mtllib %s\n" % _from(folder, path, own))


def _from(folder: Path, path: str, name: str) -> bytes:
    """A name beside a file, as it is named from another folder: Blender takes no absolute one there."""
    name = name.strip('"').replace("\\", "/")
    place = os.path.join(os.path.realpath(os.path.dirname(path) or "."), name)
    return os.fsencode(os.path.relpath(place, os.path.realpath(folder)))


_Line = tuple[bytes, list[bytes] | None, tuple[int, ...]]


def _obj_lines(file: BinaryIO) -> Iterator[_Line]:
    """Each line, and of a vertex its words and where its coordinates are."""
    for line in file:
        if line.lstrip()[:2] in (b"v ", b"v\t"):
            yield line, line.split(), (1, 2, 3)
        else:
            yield line, None, ()


def _ply_lines(file: BinaryIO) -> Iterator[_Line]:
    """As _obj_lines; nothing of binary files, and of those whose vertices are not the first element or have lists."""
    header, count, names = list[bytes](), 0, list[bytes]()
    element = b""
    for line in file:
        header.append(line)
        words = line.split()
        if words[:1] == [b"element"]:
            if not element:
                count = int(words[2]) if words[1] == b"vertex" else 0
            element = words[1]
        elif words[:1] == [b"property"] and element == b"vertex":
            names.append(words[-1] if words[1] != b"list" else b"list")
        if words[:1] == [b"end_header"] or len(header) > 1000:
            break
    at = tuple(names.index(each) for each in (b"x", b"y", b"z"))  # raises ValueError where one is missing
    text = any(line.split()[:2] == [b"format", b"ascii"] for line in header[:20])
    for line in header:
        yield line, None, ()
    for line in file:
        if text and count and b"list" not in names and line.strip():
            count -= 1
            yield line, line.split(), at
        else:
            yield line, None, ()


_LINES: dict[str, Callable[[BinaryIO], Iterator[_Line]]] = {".obj": _obj_lines, ".ply": _ply_lines}
