# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that a script runs in: a bpy that imports, a standard output of its own."""

from __future__ import annotations

import contextlib
import importlib
import importlib.metadata
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn, TextIO

from ..metric.errors import FMQMError

OK, FAILED, WRONG_ARGUMENTS, INTERRUPTED = 0, 1, 2, 130  # exit codes
SYSTEM_PACKAGES = "libx11-6 libxrender1 libxxf86vm1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1 libegl1"


def require_bpy() -> None:
    """Imports bpy.

    Raises:
        FMQMError: it cannot be imported; the text says what to install.
    """
    try:
        importlib.import_module("bpy")
    except ModuleNotFoundError as error:
        raise FMQMError(
            "this Python has no bpy: run `make demo` once and use .venv/bin/python, or run under Blender itself: "
            "blender -b -q --python scripts/score.py -- ..."
        ) from error
    except ImportError as error:
        raise FMQMError(
            f"bpy lacks a system library ({error}); on Debian or Ubuntu: apt-get install {SYSTEM_PACKAGES}"
        ) from error


def blender_version() -> str:
    """Blender's version, such as 4.5.15, without importing bpy where its package tells.

    Raises:
        FMQMError: there is no bpy.
    """
    if "bpy" not in sys.modules:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            return importlib.metadata.version("bpy")
    require_bpy()
    return ".".join(map(str, sys.modules["bpy"].app.version))


def stop_on_signals() -> None:
    """Makes a build server's stop the same as Ctrl-C, also under Blender, which sets its own handlers."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)


@contextlib.contextmanager
def stops_wait() -> Iterator[None]:
    """Holds a stop back where it would be lost or do harm: Python that Blender runs while it opens a file swallows it.

    A second stop is not held back.

    Raises:
        KeyboardInterrupt: at the end, if there was one.
    """
    _stops.wait = True
    try:
        yield
    finally:
        _stops.wait = False
    if _stops.came:
        raise KeyboardInterrupt


@dataclass
class _Stops:
    """Handlers of signals run between two lines of the same thread: plain values do."""

    wait: bool = False
    came: bool = False


_stops = _Stops()


def _stop(number: int, frame: object) -> None:
    waits = _stops.wait and not _stops.came
    _stops.came = True
    if not waits:
        raise KeyboardInterrupt


def run_script(main: Callable[[Sequence[str], TextIO], int], script: str) -> NoReturn:
    """Ends the process with the exit code of main, which gets arguments and standard output.

    Args:
        script: its __file__. Under Blender, whose name argv[0] is then, the arguments follow --.
    """
    argv = sys.argv[1:]
    if os.path.basename(sys.argv[0]) != os.path.basename(script):
        argv = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    stop_on_signals()
    try:
        code = main(argv, take_stdout())
    except KeyboardInterrupt:
        code = INTERRUPTED
    except Exception:
        traceback.print_exc()  # Blender would do the same, go on and end with 0
        code = FAILED
    sys.exit(code)


def machine_memory() -> int | None:
    """Bytes of memory that this machine has, or lends to this group of processes; None where it does not tell."""
    try:
        found = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None
    for path in ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes"):
        try:
            found = min(found, int(Path(path).read_text(encoding="ascii")))
        except (OSError, ValueError):
            continue
    return found


def take_stdout() -> TextIO:
    """Standard output for this script alone.

    Importers print to it from C, some of it only when the process ends: from here on that goes nowhere.
    """
    sys.stdout.flush()
    out = open(os.dup(1), "w", encoding="utf-8", errors="backslashreplace", newline="")  # noqa: SIM115
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.close(nowhere)
    return out
