# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's importers leave out of files without a word."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

import bpy

_PLY_HEADER = 1 << 16  # bytes in which texture names are looked for
_FACES = re.compile(rb"^element +face +(\d+)", re.MULTILINE)
_TEXTURE = re.compile(rb"^comment +TextureFile +(.+?)\s*$", re.MULTILINE | re.IGNORECASE)
_NAMED = 2  # of many
_LONGEST = 2**18  # bytes of a line that Blender reads before 5.2; all that follows is left out
_LONG = re.compile(rb"\n[^\n]{%d}" % _LONGEST)
_CONTINUED = re.compile(rb"\\[ \t\r]*\n")
_COLOR = re.compile(rb"\n((?:kd|map_kd|map_ka)[ \t][^\n]*)", re.IGNORECASE)
_PLAIN = re.compile(rb"Kd(?:[ \t]+[-+.\deE]+(?!\S)){3}")  # as Blender reads it
_COLORED = re.compile(rb"\nv(?:[ \t]++[^\s#]++){6}")  # a vertex with a position and a color


def left_out(path: str, colors: bool = True) -> tuple[str, ...]:
    """What the file that the session was just filled with names or holds, and Blender has not.

    The file's text is read once more, in a small part of the import's time.

    Args:
        colors: whether the file's own colors and images count.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".blend":
        return tuple(_of_blend())
    if suffix == ".obj":
        return tuple(_of_obj(path, colors))
    if suffix == ".stl":
        return tuple(_faces_left_out(_facets(path)))
    return tuple(_of_ply(path, colors)) if suffix == ".ply" else ()


def _of_blend() -> Iterable[str]:
    for library in bpy.data.libraries:
        names = [block.name for block in library.users_id if block.is_missing]
        if names:
            more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
            why = "is missing" if library.is_missing else "does not hold them"
            where = os.path.normpath(bpy.path.abspath(library.filepath))
            yield f"links {', '.join(names[:_NAMED])}{more} from {where}, which {why}"


def _of_obj(path: str, colors: bool) -> Iterable[str]:
    text = _lines(path)
    yield from _faces_left_out(text.count(b"\nf ") + text.count(b"\nf\t"), text)
    if not colors:
        return
    if not any(len(mesh.color_attributes) for mesh in bpy.data.meshes) and _COLORED.search(text):
        yield "its vertex colors were left out by Blender's importer, since not all vertices have one"
    libraries = [os.fsdecode(name.strip(b'"')) for name in _names(text, b"mtllib")]
    own = f"{Path(path).stem}.mtl"  # which Blender reads whether it is named or not
    present = {name: os.path.join(os.path.dirname(path), name) for name in (*libraries, own)}
    present = {name: found for name, found in present.items() if os.path.isfile(found) and os.access(found, os.R_OK)}
    missing = [name for name in libraries if name not in present]
    for name in missing[:_NAMED]:
        yield f"names the material file {name}, which is missing or cannot be read"
    texts = [_lines(each) for each in present.values()]
    known = {name for each in texts for name in _names(each, b"newmtl")}
    used = _used_materials(text)
    unknown = [name.decode("utf-8", "replace") for name in used if name not in known and not missing]
    if unknown:
        yield f"no material file describes {', '.join(unknown[:_NAMED])}, which it uses; Blender's default is taken"
    unread = [line for each in texts for line in _unread_colors(each, set(used))]
    if unread:
        yield f"its material file says {', '.join(unread[:_NAMED])}, which Blender does not read as a color"


def _faces_left_out(faces: int, text: bytes = b"") -> Iterable[str]:
    imported = sum(len(mesh.polygons) for mesh in bpy.data.meshes)
    if imported < faces:
        gave_up = bpy.app.version < (5, 2) and _LONG.search(text)
        why = f"which reads no lines of {_LONGEST:,} bytes" if gave_up else "as broken or repeated"
        yield f"{faces - imported} of {faces} faces were left out by Blender's importer, {why}"


def _lines(path: str) -> bytes:
    """The text of a file, with a break before each line and nothing before its first word."""
    text = b"\n" + Path(path).read_bytes()
    if b"\\" in text:
        text = _CONTINUED.sub(b" ", text)
    return re.sub(rb"\n[ \t]+", b"\n", text) if b"\n " in text or b"\n\t" in text else text


def _names(text: bytes, keyword: bytes) -> list[bytes]:
    """What follows the keyword where a line begins with it, each once."""
    found = re.findall(rb"\n" + keyword + rb"[ \t]+([^\n]*)", text)
    return list(dict.fromkeys(name.strip() for name in found))


def _used_materials(text: bytes) -> list[bytes]:
    """The names of the materials that faces follow, each once."""
    found = list(re.finditer(rb"\nusemtl[ \t]+([^\n]*)", text))
    ends = [*(each.start() for each in found), len(text)][1:]
    used = [
        each[1].strip()
        for each, end in zip(found, ends, strict=True)
        if any(text.find(face, each.end(), end) >= 0 for face in (b"\nf ", b"\nf\t"))
    ]
    return list(dict.fromkeys(filter(None, used)))


def _unread_colors(library: bytes, used: set[bytes]) -> Iterable[str]:
    """What asks for colors or images in vain in a material library, where no other line gives an image."""
    for block in library.split(b"\nnewmtl")[1:]:
        lines = [line.strip() for line in _COLOR.findall(block)]
        if block.partition(b"\n")[0].strip() not in used or any(line.startswith(b"map_Kd") for line in lines):
            continue
        yield from (line.decode("utf-8", "replace")[:80] for line in lines if not _PLAIN.match(line))


def _facets(path: str) -> int:
    """How many facets an STL holds, binary or text."""
    with open(path, "rb") as file:
        header = file.read(84)
        count = int.from_bytes(header[80:], "little")
        return count if os.path.getsize(path) == 84 + 50 * count else (header + file.read()).count(b"outer loop")


def _of_ply(path: str, colors: bool) -> Iterable[str]:
    with open(path, "rb") as file:
        header = file.read(_PLY_HEADER).partition(b"end_header")[0]
    yield from _faces_left_out(sum(map(int, _FACES.findall(header))))
    if not colors:
        return
    names = [name.decode("utf-8", "replace") for name in _TEXTURE.findall(header)]
    if names:
        yield f"names the image {', '.join(names[:_NAMED])}, which Blender does not read from a PLY"
