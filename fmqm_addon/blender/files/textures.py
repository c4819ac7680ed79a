# SPDX-License-Identifier: GPL-3.0-or-later
"""Images that an imported file names and that are not there, looked for where they usually are."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

import bpy

from ...metric.errors import FileError
from ..access import Access, check_named
from ..materials.image_files import image_path


def find_textures(asset: str, access: Access) -> tuple[str, ...]:
    """Gives images that are missing the files that they must mean; says so, a line each.

    Every kind of file finds names that are written in other cases. An .fbx, whose paths are those of the machine that
    made it, finds images by their names: beside it, in textures and NAME.fbm, one level up, and in textures there.
    Nothing is looked for where the access does not reach.
    """
    notes = []
    for image in bpy.data.images:
        if image.source != "FILE" or image.packed_file is not None or image.library is not None or not image.filepath:
            continue
        named = image_path(image)
        if os.path.exists(named):
            continue
        places = (*_ignoring_case(asset, named), *(_by_name(asset, named) if asset.lower().endswith(".fbx") else ()))
        for found in places:
            if os.path.isfile(found) and _may_open(asset, found, access):
                taken = os.path.relpath(found, os.path.dirname(asset) or ".")
                name = re.split(r"[\\/]", named)[-1]
                notes.append(f"its image {name} is not where it says; taken is {taken}")
                image.filepath = os.path.abspath(found)
                break
    return tuple(notes)


def _ignoring_case(asset: str, named: str) -> Iterator[str]:
    """The named path with other cases, from the asset's folder on where it is below it."""
    folder = os.path.abspath(os.path.dirname(asset) or ".")
    if not named.startswith(folder + os.sep):
        folder = os.path.dirname(named)
    found = [folder]
    for part in os.path.relpath(named, folder).split(os.sep):
        found = [each for where in found for each in _entries(where, part)]
    yield from found


def _by_name(asset: str, named: str) -> Iterator[str]:
    folder, name = os.path.abspath(os.path.dirname(asset) or "."), re.split(r"[\\/]", named)[-1]
    for above in (folder, os.path.dirname(folder)):
        yield from _entries(above, name)
        for inner in ("textures", *([f"{Path(asset).stem}.fbm"] if above == folder else [])):
            for each in _entries(above, inner):
                yield from _entries(each, name)


def _entries(folder: str, name: str) -> list[str]:
    """What a folder holds of a name, whatever its case: as it is written first."""
    try:
        names = [each for each in os.listdir(folder) if each.casefold() == name.casefold()]
    except OSError:
        return []
    return [os.path.join(folder, each) for each in sorted(names, key=lambda each: (each != name, each))]


def _may_open(asset: str, path: str, access: Access) -> bool:
    try:
        check_named(asset, [os.path.abspath(path)], os.path.dirname(asset), access)
    except FileError:  # outside of where strangers' files may look, or a device
        return False
    return True
