# SPDX-License-Identifier: GPL-3.0-or-later
"""The files that an asset names, checked before an importer opens them."""

from __future__ import annotations

import json
import mmap
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy

from ...metric.errors import FileError, OutsideError
from ..access import ANYWHERE, Access, check_named
from .libraries import library_names
from .preflight_layers import check_text

_CONTINUED = re.compile(rb"\\[ \t\r]*\n")
_LIBRARY = re.compile(rb"(?:^|\n)[ \t]*mtllib[ \t]+((?:\\[ \t\r]*\n|[^\n])*)")
_MAP = re.compile(rb"(?:^|\n)[ \t]*(?:map_\w+|bump|norm|refl|disp|decal)[ \t]+([^\n]*)", re.IGNORECASE)
_MAP_OPTION = re.compile(rb"-\w+(?:[ \t]+(?:on|off|[-+.\deE]+|sphere|cube_\w+|[rgbmlz](?=[ \t])))*[ \t]+")
# A property of a node of an FBX file: binary as S, length, bytes; text in quotes.
_FBX_BINARY = re.compile(rb"(Relative)?[Ff]ile[Nn]ameS(.{4})", re.DOTALL)
_FBX_TEXT = re.compile(rb'\b(Relative)?[Ff]ile[Nn]ame:[ \t]*"([^"\n]*)"')
_LONGEST = 4096  # bytes of a path
_USD = (".usd", ".usda", ".usdc", ".usdz")


def check_names(path: str, access: Access = ANYWHERE) -> None:
    """Refuses an asset that names what its importer must not open; see access.check_named.

    Raises:
        FileError: a name leads to a pipe, a device or the system's own.
        OutsideError: or out of where access is confined to.
    """
    check = _CHECKS.get(Path(path).suffix.lower())
    if check is not None:
        check(path, access)


def _check_obj(path: str, access: Access) -> None:
    """Blender reads FILE.mtl whether it is named or not, and images beside the material file too."""
    folder = os.path.dirname(path)
    own = f"{Path(path).stem}.mtl"
    libraries = list(dict.fromkeys([own, *_material_files(path)]))
    check_named(path, libraries, folder, access)
    for name in libraries:
        library = os.path.join(folder, name)
        if not os.path.isfile(library) or not os.access(library, os.R_OK):
            continue
        text = _CONTINUED.sub(b" ", Path(library).read_bytes())
        names = [os.fsdecode(each) for found in _MAP.findall(text) for each in _map_names(found)]
        check_named(path, names, os.path.dirname(library), access)


def _material_files(path: str) -> Iterator[str]:
    with open(path, "rb") as file:
        if not os.fstat(file.fileno()).st_size:
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
            for found in _LIBRARY.finditer(text):
                name = _CONTINUED.sub(b" ", found[1]).strip()
                yield from dict.fromkeys((os.fsdecode(name.strip(b'"')), os.fsdecode(name)))


def _map_names(rest: bytes) -> Iterator[bytes]:
    """What may be the path in the rest of a line: after its options, and its last word."""
    rest = rest.strip()
    if not rest:
        return
    yield rest.split()[-1].strip(b'"')
    while match := _MAP_OPTION.match(rest):
        rest = rest[match.end() :]
    yield rest.strip(b'"')


def _check_gltf(path: str, access: Access) -> None:
    names = (name for name in _uris(gltf_document(path)) if not name.startswith("data:"))
    check_named(path, names, os.path.dirname(path), access)


def gltf_document(path: str) -> Any:
    """The JSON of a glTF file of either kind; None where there is none, which the importer judges."""
    with open(path, "rb") as file:
        head = file.read(20)
        binary = head.startswith(b"glTF")
        data = file.read(int.from_bytes(head[12:16], "little")) if binary else head + file.read()
    try:
        return json.loads(data.decode("utf-8-sig", "surrogateescape"))
    except (ValueError, RecursionError):
        return None


def _uris(document: Any) -> Iterator[str]:
    """Every text that is called uri, at whatever depth: extensions have their own."""
    waiting = [document]
    while waiting:
        each = waiting.pop()
        if isinstance(each, dict):
            if isinstance(each.get("uri"), str):
                yield each["uri"]
            waiting += each.values()
        elif isinstance(each, list):
            waiting += each


def _check_fbx(path: str, access: Access) -> None:
    """Absolute names tell where a file was made, and count only where something is: Blender goes on to the relative
    one, and to the file's own folder."""
    folder = os.path.dirname(path)
    for is_relative, name in dict.fromkeys(_fbx_names(path)):
        last = re.split(r"[\\/]", name)[-1]
        check_named(path, [last], folder, access)
        text = name.replace("\\", "/")
        is_absolute = text.startswith("/") or re.match(r"[A-Za-z]:/", text) is not None
        if not is_absolute and is_relative or os.path.exists(re.sub(r"^[A-Za-z]:(?=/)", "", text)):
            check_named(path, [name], folder, access)


def _fbx_names(path: str) -> Iterator[tuple[bool, str]]:
    with open(path, "rb") as file:
        data = file.read()
    if not data.startswith(b"Kaydara FBX Binary"):
        yield from ((bool(found[1]), os.fsdecode(found[2])) for found in _FBX_TEXT.finditer(data))
        return
    for found in _FBX_BINARY.finditer(data):
        length = int.from_bytes(found[2], "little")
        if 0 < length <= _LONGEST:
            yield bool(found[1]), os.fsdecode(data[found.end() : found.end() + length])


def _check_usd(path: str, access: Access) -> None:
    """Layer by layer, each before it is opened."""
    try:
        bpy.utils.expose_bundled_modules()
        from pxr import Tf, UsdUtils
    except ImportError as error:
        if access.confined:
            raise FileError(
                f"{path}: this Blender cannot tell what a USD file names, and so opens none of strangers; "
                "convert the file, for example to .glb"
            ) from error
        return
    waiting, seen = [path], set[str]()
    while waiting:
        layer = waiting.pop()
        if os.path.realpath(layer) in seen or not os.path.isfile(layer):
            continue
        seen.add(os.path.realpath(layer))
        check_text(layer)
        try:
            names = [name for names in UsdUtils.ExtractExternalReferences(layer) for name in names]
        except Tf.ErrorException:
            continue  # the importer says what is wrong
        if access.confined and (odd := next((name for name in names if "`" in name or "${" in name), "")):
            raise OutsideError(f"{path}: it names {odd}, an expression; name the file itself")
        check_named(path, (name.partition("[")[0] for name in names), os.path.dirname(layer), access)
        waiting += [
            os.path.join(os.path.dirname(layer), re.sub("^file:(//)?", "", name))
            for name in names
            if Path(name).suffix.lower() in _USD
        ]


def _check_blend(path: str, access: Access) -> None:
    """Blender opens libraries, and theirs, while it loads; all else is named once it has: see session."""
    waiting, seen = [path], set[str]()
    while waiting:
        file = waiting.pop()
        if os.path.realpath(file) in seen or not os.path.isfile(file):
            continue
        seen.add(os.path.realpath(file))
        try:
            names = library_names(file)
        except (ImportError, ValueError) as error:
            if access.confined and isinstance(error, ImportError):
                raise FileError(
                    f"{path}: this Python cannot look into compressed files; save it without compression"
                ) from error
            if access.confined:
                raise FileError(f"{path}: what it links cannot be told ({error}); save it again") from error
            continue  # Blender says what is wrong
        folder = os.path.dirname(file)
        names = [name.removeprefix("//") for name in names]
        check_named(path, names, folder, access)
        # Names of libraries' libraries are relative to the file that is opened, or to the library itself.
        waiting += [
            os.path.join(each, name.replace("\\", "/")) for name in names for each in {folder, os.path.dirname(path)}
        ]


_CHECKS: dict[str, Callable[[str, Access], None]] = {
    ".obj": _check_obj,
    ".glb": _check_gltf,
    ".gltf": _check_gltf,
    ".fbx": _check_fbx,
    ".blend": _check_blend,
    **dict.fromkeys(_USD, _check_usd),
}
