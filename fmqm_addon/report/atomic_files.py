# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing files whole or not at all, never in the place of what is read; and to standard output."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

from ..metric.errors import FileError, SettingsError

STDOUT = "-"  # in the place of a path


@contextmanager
def replaced(path: str) -> Iterator[str]:
    """A temporary path beside the file, which takes the file's place once it has been written; links stay links.

    Raises:
        FileError: it cannot be written; what stood there is left as it was.
    """
    check_writable(path)
    target = Path(os.path.realpath(path))
    temporary = ""
    try:
        handle, temporary = tempfile.mkstemp(suffix=target.suffix, prefix=f".{target.name}.", dir=target.parent)
        os.close(handle)
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, target)
    except OSError as error:
        raise FileError(f"{path}: cannot be written ({error.strerror or error})") from error
    finally:
        if temporary and os.path.exists(temporary):
            os.remove(temporary)


def write_text(path: str, text: str) -> None:
    write_parts(path, [text])


def write_parts(path: str, parts: Iterable[str]) -> None:
    """As write_text, for a text that is made while it is written."""
    with (
        replaced(path) as temporary,
        open(temporary, "w", encoding="utf-8", errors="backslashreplace", newline="") as file,
    ):
        file.writelines(parts)


def print_parts(stream: TextIO, parts: Iterable[str]) -> None:
    """Prints, and sees to it that it arrives. A pipe that nobody reads any more, such as that of head, is no error.

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
        if not isinstance(error, BrokenPipeError):
            raise FileError(f"the output cannot be printed ({error.strerror or error})") from error


def check_apart(outputs: Mapping[str, str | None], inputs: Iterable[str]) -> None:
    """Outputs must not replace inputs or each other, by whatever names and links.

    Args:
        outputs: paths by the flags that name them; STDOUT and None are no files.

    Raises:
        SettingsError: they do; the text names the flags.
    """
    places = {flag: path if path == STDOUT else _place(path) for flag, path in outputs.items() if path}
    flags: dict[str, str] = {}
    for flag, place in places.items():
        if flags.setdefault(place, flag) != flag:
            raise SettingsError(f"{flags[place]} and {flag} both write to {outputs[flag]}; name two files")
    for place in map(_place, inputs):
        if place in flags:
            raise SettingsError(f"{flags[place]} {outputs[flags[place]]}: this file is an input; name another")


def _place(path: str) -> str:
    try:
        return os.path.normcase(os.path.realpath(path))
    except ValueError:  # no path on this system, which others say
        return path


def check_writable(path: str) -> None:
    """Says early, before minutes of work, that an output cannot be written.

    Raises:
        FileError: its folder is missing or read-only, or it is a folder, a device or a pipe.
    """
    folder = Path(path).parent if not os.path.islink(path) else Path(os.path.realpath(path)).parent
    if not folder.is_dir():
        raise FileError(f"{path}: the folder {folder} does not exist; make it first")
    if Path(path).is_dir():
        raise FileError(f"{path}: this is a folder; name a file")
    if os.path.exists(path) and not os.path.isfile(path):
        raise FileError(f"{path}: this is a device or a pipe; name a file (- is stdout)")
    if not os.access(folder, os.W_OK):
        raise FileError(f"{path}: the folder {folder} is read-only")
