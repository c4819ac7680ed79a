# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing files whole or not at all, and to standard output."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from ..folders import own_folder, take_place
from ..metric.errors import FileError

STDOUT = "-"  # in the place of a path


@contextmanager
def replaced(path: str) -> Iterator[str]:
    """A temporary path of the same ending, whose file takes the file's place once it has been written.

    Links stay links, and a file that is replaced keeps its mode.

    Raises:
        FileError: it cannot be written; what stood there is left as it was.
    """
    check_writable(path)
    try:
        target = Path(os.path.realpath(path))
        with own_folder(target.parent) as folder:  # in it any name fits: the file's own may be as long as names can be
            temporary = folder / f"file{target.suffix}"
            yield str(temporary)
            take_place(temporary, target)
    except OSError as error:
        raise FileError(f"{path}: cannot be written ({error.strerror or error})") from error


def write_text(path: str, text: str) -> None:
    """Writes a text file as UTF-8, whole or not at all."""
    write_parts(path, [text])


def write_parts(path: str, parts: Iterable[str]) -> None:
    """Writes a text that is made meanwhile; as write_text."""
    with (
        replaced(path) as temporary,
        open(temporary, "w", encoding="utf-8", errors="backslashreplace", newline="") as file,
    ):
        file.writelines(parts)


def print_parts(stream: TextIO, parts: Iterable[str]) -> None:
    """Prints, and sees to it that it arrives. A pipe that nobody reads any more, such as that of head, is no error,
    nor is a stream that was closed before Blender started, whose number may stand for anything then.

    Raises:
        FileError: it cannot be written, as where a disk is full.
    """
    try:
        stream.writelines(parts)
        stream.flush()
    except OSError as error:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())  # what is still buffered must not fail again when the stream closes
        os.close(nowhere)
        if error.errno not in (errno.EPIPE, errno.EBADF):
            raise FileError(f"the output cannot be printed ({error.strerror or error})") from error


def check_writable(path: str) -> None:
    """Says early, before minutes of work, that an output cannot be written.

    Raises:
        FileError: its folder is missing or read-only, its name is too long, or it is a folder, a device or a pipe.
    """
    try:
        os.lstat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        raise FileError(f"{path}: cannot be written ({error.strerror or error}); name another file") from error
    folder = Path(path).parent if not os.path.islink(path) else Path(os.path.realpath(path)).parent
    if not folder.is_dir():
        raise FileError(f"{path}: the folder {folder} does not exist; make it first")
    if Path(path).is_dir():
        raise FileError(f"{path}: this is a folder; name a file")
    if os.path.exists(path) and not os.path.isfile(path):
        raise FileError(f"{path}: this is a device or a pipe; name a file (- is stdout)")
    if not os.access(folder, os.W_OK):
        raise FileError(f"{path}: the folder {folder} is read-only")
