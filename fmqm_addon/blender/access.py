# SPDX-License-Identifier: GPL-3.0-or-later
"""What a file may have Blender read: regular files always, and of strangers' files only what lies beside them."""

from __future__ import annotations

import glob
import os
import re
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from urllib.parse import unquote

from ..metric.errors import FileError, OutsideError

_SYSTEM = ("/proc", "/sys", "/dev")  # what lies there passes for files, and is memory, terminals, other processes
_MEMORY = "/dev/shm"
_DRIVE = re.compile(r"[A-Za-z]:(?=/)")  # which Blender leaves out elsewhere than on Windows
_TILE = re.compile(r"<(?:UDIM|UVTILE)>|#+")
_MOST_INSIDE = 10_000  # entries of a folder that is named as a whole


@dataclass(frozen=True)
class Access:
    """Which files an asset may name.

    Attributes:
        confined: only those in the asset's own folder, and below.
        root: a folder that is allowed beside it; "" is none.
    """

    confined: bool = False
    root: str = ""


ANYWHERE = Access()


def check_asset(path: str, access: Access = ANYWHERE) -> None:
    """Refuses an asset that is no regular file, or a link that leads out of its folder where that is confined.

    Raises:
        FileError: it is. OutsideError: it does.
    """
    if why := _why_special(os.path.realpath(path)):
        raise FileError(f"{path}: {why}")
    if access.confined and not _is_inside(os.path.realpath(path), _roots(path, access)):
        raise OutsideError(
            f"{path}: it is a link to {os.path.realpath(path)}, outside of its folder; copy the file there"
        )


def check_named(asset: str, names: Iterable[str], folder: str, access: Access = ANYWHERE) -> None:
    """Refuses what must not be opened for an asset, links followed to where they lead.

    Args:
        asset: path of the file that the user named.
        names: as the asset has them: relative to the folder, absolute, percent-encoded, with a drive, as a URI.

    Raises:
        FileError: a name leads to something that is neither a regular file nor a folder, or is the system's.
        OutsideError: it leads out of where the access is confined to, whether there is something or not.
    """
    roots = _roots(asset, access)
    for name in dict.fromkeys(names):
        for path in _places(name, folder):
            real = os.path.realpath(path)
            if access.confined and not _is_inside(real, roots):
                raise OutsideError(
                    f"{asset}: it names {name}, which is outside of {' and '.join(roots)}; copy the file beside the "
                    "asset, and let the asset name it there"
                )
            if why := _why_special(real):
                raise FileError(f"{asset}: it names {path}; {why}")


def check_folder(asset: str, name: str, folder: str, access: Access = ANYWHERE) -> None:
    """As check_named, for a folder whose files Blender reads, and for these.

    Raises:
        FileError, OutsideError: as there.
    """
    check_named(asset, [name], folder, access)
    for path in _places(name, folder):
        found = (os.path.join(inner, each) for inner, _, files in os.walk(path) for each in files)
        check_named(asset, islice(found, _MOST_INSIDE), folder, access)


def _roots(asset: str, access: Access) -> list[str]:
    own = os.path.realpath(os.path.dirname(asset) or ".")
    return [own, os.path.realpath(access.root)] if access.root else [own]


def _is_inside(real: str, roots: Iterable[str]) -> bool:
    return any(real == root or real.startswith(root.rstrip(os.sep) + os.sep) for root in roots)


def _places(name: str, folder: str) -> Iterator[str]:
    """Where a name may lead, as some importer or other reads it; of numbered files each that is there."""
    for text in dict.fromkeys((name, unquote(name))):
        plain = re.sub(r"^file:(?://(?:localhost(?=/))?)?", "", text, flags=re.IGNORECASE).partition("\0")[0]
        slashed = plain.replace("\\", "/")
        for each in dict.fromkeys((plain, slashed, _DRIVE.sub("", slashed, count=1))):
            path = os.path.normpath(os.path.join(folder, each))
            # A folder that a link replaces is left by .. at the link's end: normpath alone would leave it at its start.
            yield path
            if ".." in each:
                yield os.path.join(folder, each)
            if _TILE.search(each):
                yield from islice(glob.glob(_TILE.sub("*", glob.escape(path))), _MOST_INSIDE)


def _why_special(real: str) -> str:
    """Why something must not be opened; "" where it may, or nothing is there."""
    try:
        mode = os.stat(real).st_mode
    except (OSError, ValueError):
        mode = stat.S_IFREG
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        return "a file is wanted, not a pipe or a device"
    if _is_inside(real, _SYSTEM) and not _is_inside(real, [_MEMORY]):
        return "a file is wanted, and the system's own are none"
    return ""
