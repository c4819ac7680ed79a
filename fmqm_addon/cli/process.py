# SPDX-License-Identifier: GPL-3.0-or-later
"""The process that a script runs in: a bpy that imports, a standard output of its own."""

from __future__ import annotations

import atexit
import contextlib
import importlib
import os
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn, TextIO

from ..batch.interrupt import INTERRUPTED, defer_interrupts, handle_signals, interrupted, kill_if_unresponsive
from ..batch.workers import WORKER
from ..folders import TEMPORARY_PLACES, keep_folder, remove_all
from ..metric.errors import FMQMError

OK, FAILED, WRONG_ARGUMENTS = 0, 1, 2  # exit codes, and INTERRUPTED
_exit_code = FAILED  # of this process; as long as none is known, it has failed
SYSTEM_PACKAGES = "libx11-6 libxrender1 libxxf86vm1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1 libegl1"


def prepare_bpy() -> None:
    """Imports bpy into the process of a script: a stop ends it in any case, and nothing of it stays behind for long.

    Raises:
        FMQMError: as require_bpy; or there is no place for temporary files.
    """
    alone = WORKER not in os.environ  # a worker's parent sees to what it leaves, and that it ends
    if alone:
        kill_if_unresponsive()
    if "bpy" not in sys.modules:
        atexit.register(_end)  # before Blender's own, which runs first then
        if alone:
            _use_temporary_folder()
    require_bpy()


def _use_temporary_folder() -> None:
    """Lets all temporary files of this process, Blender's too, go to a folder that a later run sweeps if we crash."""
    try:
        folder = str(keep_folder())
    except OSError as error:
        raise FMQMError(f"there is no place for temporary files ({error.strerror or error}); set TMPDIR") from error
    os.environ |= dict.fromkeys(TEMPORARY_PLACES, folder)
    tempfile.tempdir = folder


def _end() -> NoReturn:
    """Ends the process once Blender has freed what it holds, before the destructors of its libraries.

    One of the bpy of 4.5 waits for a thread of its own, and that for ever once an image was written.
    """
    remove_all()
    for stream in (sys.stdout, sys.stderr):
        _flush(stream)
    os._exit(_exit_code)


def require_bpy() -> None:
    """Imports bpy.

    Raises:
        FMQMError: it cannot be imported; the text says what to install.
    """
    try:
        with defer_interrupts():  # Blender's scripts start with it, and go on without what was interrupted
            importlib.import_module("bpy")
    except ModuleNotFoundError as error:
        raise FMQMError(
            "this Python has no bpy: pip install 'fmqm[blender]' with Python 3.11 or 3.13 (in a checkout run `make "
            "demo` once and use .venv/bin/python), or run under Blender: blender -b -q --python scripts/score.py -- ..."
        ) from error
    except ImportError as error:
        raise FMQMError(
            f"bpy lacks a system library ({error}); on Debian or Ubuntu: apt-get install {SYSTEM_PACKAGES}"
        ) from error


def blender_version() -> str:
    """Blender's version, such as 4.5.15, without importing bpy where its package has it.

    Raises:
        FMQMError: there is no bpy.
    """
    if "bpy" not in sys.modules:
        for folder in map(Path, sys.path):  # importlib.metadata would take longer to import than all of ours
            for found in folder.glob("bpy-*.dist-info"):
                return found.name.removeprefix("bpy-").removesuffix(".dist-info")
    require_bpy()
    return ".".join(map(str, sys.modules["bpy"].app.version))


def run_script(
    main: Callable[[Sequence[str], TextIO], int], script: str, argv: Sequence[str] | None = None
) -> NoReturn:
    """Ends the process with the exit code of main, which gets arguments and standard output.

    Args:
        script: its __file__, or its name.
        argv: its arguments; None takes those of the process. Under Blender, whose name sys.argv[0] is then, they
            follow --.
    """
    if argv is None:
        argv = sys.argv[1:]
        if os.path.basename(sys.argv[0]) != os.path.basename(script):
            argv = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    _open_streams()
    handle_signals()
    out = reserve_stdout()
    try:
        os.getcwd()
        code = main(argv, out)
        if interrupted():
            code = INTERRUPTED
    except KeyboardInterrupt:
        code = INTERRUPTED
    except SystemExit as end:  # from the parser of arguments
        code = end.code if isinstance(end.code, int) else FAILED
    except Exception as error:
        code = FAILED
        with contextlib.suppress(OSError):
            if isinstance(error, OSError) and not _has_working_folder():
                sys.stderr.write(f"{os.path.basename(script)}: the working folder is gone; change to another\n")
            else:
                traceback.print_exc()  # Blender would do the same, go on and end with 0
    finally:
        _flush(out)
        _flush(sys.stderr)
    global _exit_code
    _exit_code = code
    sys.exit(code)


def machine_memory() -> int | None:
    """Bytes of memory that this machine has, or lends to this group of processes; None where it is unknown."""
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


def _has_working_folder() -> bool:
    try:
        return bool(os.getcwd())
    except OSError:
        return False


def _flush(stream: TextIO) -> None:
    """Prints what is left, if anybody reads it; else Python would complain of it when it ends."""
    try:
        stream.flush()
    except (OSError, ValueError):
        with contextlib.suppress(OSError, ValueError):
            _redirect_to_null(stream.fileno())


def _open_streams() -> None:
    """Streams that were closed lead nowhere: no file shall get their numbers, which C code prints to."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(number)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115


def _redirect_to_null(number: int) -> None:
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, number)
    os.close(null)


def reserve_stdout() -> TextIO:
    """Standard output for this script alone.

    Importers print to it from C, some of it only when the process ends: from here on that goes nowhere.
    """
    with contextlib.suppress(OSError):
        sys.stdout.flush()
    out = open(os.dup(1), "w", encoding="utf-8", errors="backslashreplace", newline="")  # noqa: SIM115
    _redirect_to_null(1)
    return out
