# SPDX-License-Identifier: GPL-3.0-or-later
"""Stopping a script: Ctrl-C and a build server's stop end it within seconds, whatever it is at."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

from ..folders import remove_all

INTERRUPTED = 130  # exit code
_GRACE = 3.0  # seconds that a process has to end by itself once it was told to stop
_IMPATIENT = 0.5  # and once it was told twice


@dataclass
class _Stops:
    """Handlers of signals run between two lines of the same thread: plain values do."""

    wait: bool = False
    came: bool = False


_stops = _Stops()
_bell: list[socket.socket] = []  # where each stop leaves a byte, and the end to which it is written


def stop_on_signals() -> None:
    """Makes a build server's stop the same as Ctrl-C, also under Blender, which sets its own handlers.

    An importer in C may not come back to Python for minutes, and until then no handler of Python's runs. A thread then
    ends the process, with the exit code and without the folders that it would have ended with.
    """
    if not _bell:
        _bell.extend(socket.socketpair())
        _bell[1].setblocking(False)
        threading.Thread(target=_end_if_busy, args=(_bell[0],), daemon=True).start()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    signal.set_wakeup_fd(_bell[1].fileno(), warn_on_full_buffer=False)


def kill_if_deaf() -> None:
    """Sees to it that a stop ends this process even while C code lets no thread run, such as one that builds a tree.

    A process of its own waits for that, and ends with this one. Folders that stay behind then are swept by a later run.
    """
    if not _bell or sys.platform == "win32":
        return  # there is nothing to be told, or a closed window ends it
    command = [sys.executable, "-I", "-S", "-c", _KILL, str(os.getpid()), str(2 * _GRACE)]
    nowhere = subprocess.DEVNULL
    with contextlib.suppress(OSError):
        subprocess.Popen(command, stdin=_bell[0].fileno(), stdout=nowhere, stderr=nowhere, start_new_session=True)


_KILL = """
import os, signal, socket, sys, time
parent, grace = int(sys.argv[1]), float(sys.argv[2])
if socket.socket(fileno=0).recv(1, socket.MSG_PEEK):
    end = time.monotonic() + grace
    while os.getppid() == parent and time.monotonic() < end:
        time.sleep(0.1)
    if os.getppid() == parent:
        os.kill(parent, signal.SIGKILL)
"""


@contextlib.contextmanager
def stops_wait() -> Iterator[None]:
    """Holds a stop back where it would be lost or do harm: Python that Blender runs while it opens a file swallows it.

    Raises:
        KeyboardInterrupt: at the end, if there was one, whatever else went wrong meanwhile.
    """
    _stops.wait = True
    try:
        yield
    finally:
        _stops.wait = False
        if _stops.came:
            raise KeyboardInterrupt


def stopped() -> bool:
    """Whether this process was told to stop; Blender's importers in Python make an error of their own of that."""
    return _stops.came


def _stop(number: int, frame: object) -> None:
    _stops.came = True
    if not _stops.wait:
        raise KeyboardInterrupt


def _end_if_busy(bell: socket.socket) -> None:
    """Waits for a stop, then for the second or its time. The bytes are left to kill_if_deaf."""
    bell.recv(1, socket.MSG_PEEK)
    end = time.monotonic() + _GRACE
    while time.monotonic() < end:
        if len(bell.recv(2, socket.MSG_PEEK)) == 2:
            end = min(end, time.monotonic() + _IMPATIENT)
        time.sleep(_IMPATIENT / 10)
    _remove_blenders_folder()
    remove_all()
    os._exit(INTERRUPTED)


def _remove_blenders_folder() -> None:
    """Of temporary files: Blender makes it before any script runs, and now has no more chance to remove it."""
    blender = getattr(sys.modules.get("bpy"), "app", None)
    folder = getattr(blender, "tempdir", "").rstrip("/\\")
    if re.fullmatch(r"blender_\w{6}", os.path.basename(folder)):  # it may be all of /tmp where it could not be made
        shutil.rmtree(folder, ignore_errors=True)
