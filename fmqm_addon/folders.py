# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders for temporary files: each of one process, which holds a lock in it and removes it when it is done.

What a process that was killed has left is removed by a later one, since nobody holds its lock any more. Nothing else
is: a folder counts as ours by its name, its owner and the text in its lock together.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

if sys.platform == "win32":
    import msvcrt

    _Held = PermissionError  # what says that another has a lock
else:
    import fcntl

    _Held = BlockingIOError

TEMPORARY_PLACES = ("TMPDIR", "TEMP", "TMP")  # of them Python and Blender take one
TEMPORARY = "tmp"  # the kind that anybody may remove once its owner has gone
_PREFIX = ".fmqm-"
_LOCK = "owner.lock"
_TEXT = b"A temporary folder of FMQM. Without a running FMQM it may be removed.\n"
_PATIENCE = 30.0  # seconds until a lock of one's own is given up; who sweeps holds it for a moment, or stands still


@dataclass
class _Owned:
    path: Path
    lock: IO[bytes]

    def remove(self) -> None:
        self.lock.close()  # first, since Windows removes no open files
        shutil.rmtree(self.path, ignore_errors=True)


_owned: list[_Owned] = []
_swept: set[tuple[str, str]] = set()


@contextlib.contextmanager
def own_folder(parent: str | Path | None = None, kind: str = TEMPORARY) -> Iterator[Path]:
    """A new folder of this process, which is gone afterwards with all that is in it.

    Args:
        parent: where it is made; None is the system's place for temporary files.
        kind: part of its name. What others of this kind have left there is removed first, if it is TEMPORARY.

    Raises:
        OSError: it cannot be made.
    """
    owned = _make(parent, kind)
    try:
        yield owned.path
    finally:
        _owned.remove(owned)
        owned.remove()


def keep_folder(parent: str | Path | None = None) -> Path:
    """As own_folder, until remove_all.

    Raises:
        OSError: it cannot be made.
    """
    return _make(parent, TEMPORARY).path


def remove_all() -> None:
    """Removes all folders that this process has made and not yet removed."""
    while _owned:
        _owned.pop().remove()


def take_place(temporary: str | Path, target: str | Path) -> None:
    """Moves a file to where it belongs; if it replaces another there, that one's mode stays.

    Raises:
        OSError: it cannot be moved.
    """
    with contextlib.suppress(FileNotFoundError):
        os.chmod(temporary, stat.S_IMODE(os.stat(target).st_mode))
    os.replace(temporary, target)


def sweep(parent: str | Path, kind: str, adopt: Callable[[Path], None] | None = None) -> None:
    """Removes the folders of a kind whose owners have gone.

    Args:
        adopt: called with each of them before.
    """
    name = re.compile(re.escape(f"{_PREFIX}{kind}-") + r"[a-z0-9_]{8}")
    found = []
    with contextlib.suppress(OSError), os.scandir(parent or ".") as entries:
        found = [Path(entry.path) for entry in entries if name.fullmatch(entry.name) and _is_own(entry)]
    for path in sorted(found):
        with contextlib.suppress(OSError), open(path / _LOCK, "rb+") as lock:
            if not _lock(lock) or lock.read(len(_TEXT) + 1) != _TEXT:
                continue
            if adopt is not None:
                adopt(path)
            _Owned(path, lock).remove()


def _make(parent: str | Path | None, kind: str) -> _Owned:
    parent = os.path.realpath(tempfile.gettempdir() if parent is None else parent)
    if kind == TEMPORARY and (parent, kind) not in _swept:
        _swept.add((parent, kind))
        sweep(parent, kind)
    path = Path(tempfile.mkdtemp(prefix=f"{_PREFIX}{kind}-", dir=parent))
    try:
        lock = open(path / _LOCK, "wb+", 0)  # noqa: SIM115
    except OSError:
        os.rmdir(path)
        raise
    end = time.monotonic() + _PATIENCE
    with contextlib.suppress(OSError):
        while not _lock(lock) and time.monotonic() < end:
            time.sleep(0.01)
    # Only now, so that nobody takes it for left; where a system has no locks, nobody gets one to remove it either.
    owned = _Owned(path, lock)
    try:
        lock.write(_TEXT)
    except OSError:
        owned.remove()
        raise
    _owned.append(owned)
    return owned


def _is_own(entry: os.DirEntry[str]) -> bool:
    """Whether it is a folder, no link to one, of this user."""
    with contextlib.suppress(OSError):
        found = entry.stat(follow_symlinks=False)
        return entry.is_dir(follow_symlinks=False) and (sys.platform == "win32" or found.st_uid == os.getuid())
    return False


def _lock(file: IO[bytes]) -> bool:
    """Takes a file's lock, which goes with the process; whether it was free.

    Raises:
        OSError: there are no locks here.
    """
    try:
        if sys.platform == "win32":
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except _Held:
        return False
    return True
