# SPDX-License-Identifier: GPL-3.0-or-later
"""Interrupts: Ctrl-C and a termination signal end a script within seconds, whatever it is doing."""

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
_GRACE = 3.0  # seconds that a process has to end by itself after a signal
_GRACE_SECOND = 0.5  # and after a second one


@dataclass
class _State:
    """Handlers of signals run between two lines of the same thread: plain values do."""

    wait: bool = False
    came: bool = False


_state = _State()
_wakeup: list[socket.socket] = []  # where each stop leaves a byte, and the end to which it is written


def handle_signals() -> None:
    """Makes a build server's stop the same as Ctrl-C, also under Blender, which sets its own handlers.

    An importer in C may not come back to Python for minutes, and until then no handler of Python's runs. A thread then
    ends the process, with the exit code and without the folders that it would have ended with.
    """
    if not _wakeup:
        _wakeup.extend(socket.socketpair())
        _wakeup[1].setblocking(False)
        threading.Thread(target=_exit_if_busy, args=(_wakeup[0],), daemon=True).start()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    signal.set_wakeup_fd(_wakeup[1].fileno(), warn_on_full_buffer=False)


def kill_if_unresponsive() -> None:
    """Sees to it that a stop ends this process even while C code lets no thread run, such as one that builds a tree.

    A process of its own waits for that, and ends with this one. Folders that stay behind then are swept by a later run.
    """
    if not _wakeup or sys.platform == "win32":
        return  # no signals are handled here, or a closed window ends it
    command = [sys.executable, "-I", "-S", "-c", _KILL, str(os.getpid()), str(2 * _GRACE)]
    null = subprocess.DEVNULL
    with contextlib.suppress(OSError):
        subprocess.Popen(command, stdin=_wakeup[0].fileno(), stdout=null, stderr=null, start_new_session=True)


_KILL = """
import os, signal, socket, sys, time
parent, grace = int(sys.argv[1]), float(sys.argv[2])
if socket.socket(fileno=0).recv(1, socket.MSG_PEEK):
    for _ in range(round(grace / 0.1)):  # counted: where all stands still for a while, it does for the parent too
        if os.getppid() != parent:
            break
        time.sleep(0.1)
    if os.getppid() == parent:
        os.kill(parent, signal.SIGKILL)
"""


@contextlib.contextmanager
def defer_interrupts() -> Iterator[None]:
    """Holds a stop back where it would be lost or do harm: Python that Blender runs while it opens a file swallows it.

    Raises:
        KeyboardInterrupt: at the end, if there was one, whatever else went wrong meanwhile.
    """
    _state.wait = True
    try:
        yield
    finally:
        _state.wait = False
        if _state.came:
            raise KeyboardInterrupt


def interrupted() -> bool:
    """Whether an interrupt has come; Blender's importers in Python make an error of their own of that."""
    return _state.came


def _stop(number: int, frame: object) -> None:
    _state.came = True
    if not _state.wait:
        raise KeyboardInterrupt


def _exit_if_busy(bell: socket.socket) -> None:
    """Waits for a stop, then for the second or its time. The bytes are left to kill_if_unresponsive."""
    bell.recv(1, socket.MSG_PEEK)
    end = time.monotonic() + _GRACE
    while time.monotonic() < end:
        if len(bell.recv(2, socket.MSG_PEEK)) == 2:
            end = min(end, time.monotonic() + _GRACE_SECOND)
        time.sleep(_GRACE_SECOND / 10)
    _remove_blenders_folder()
    remove_all()
    os._exit(INTERRUPTED)


def _remove_blenders_folder() -> None:
    """Of temporary files: Blender makes it before any script runs, and now has no more chance to remove it."""
    blender = getattr(sys.modules.get("bpy"), "app", None)
    folder = getattr(blender, "tempdir", "").rstrip("/\\")
    if re.fullmatch(r"blender_\w{6}", os.path.basename(folder)):  # it may be all of /tmp where it could not be made
        shutil.rmtree(folder, ignore_errors=True)
