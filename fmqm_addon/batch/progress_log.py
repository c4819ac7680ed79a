# SPDX-License-Identifier: GPL-3.0-or-later
"""What a run says on stderr while it works: progress, and errors as they come."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Mapping
from typing import Any

from ..metric.errors import FileError, one_line
from ..report.atomic_files import print_parts


class Log:
    """Progress as a moving line on a terminal, as a line per 10 % otherwise; errors above it.

    Args:
        program: begins each line that is not progress.
        units: of work in the whole run; pairs: how many of them are pairs.
        quiet: no progress. silent: nothing at all.
    """

    def __init__(self, program: str, units: int, pairs: int, quiet: bool = False, silent: bool = False) -> None:
        self._program = program
        self._units = max(units, 1)
        self._pairs = pairs
        self._quiet = quiet or silent
        self._silent = silent
        self._moving = sys.stderr.isatty()
        self._percent = -1
        self._began = time.monotonic()
        self.finished = 0  # pairs

    def show(self, units_done: float, text: str) -> None:
        percent = int(100 * min(units_done / self._units, 1))
        step = 1 if self._moving else 10
        if self._quiet or percent // step <= self._percent // step:
            return
        self._percent = percent
        line = f"{percent:3d} %  {one_line(text)}{self._rate()}"
        print_stderr(f"\r\x1b[K{line}" if self._moving else f"{line}\n")

    def scored(self, record: Mapping[str, Any]) -> None:
        """Counts a pair that was scored elsewhere as a unit."""
        self.finished += 1
        if record["error"] is not None:
            self.say(record["error"], record["id"])
        self.show(self.finished, f"scored {record['id']}")

    def say(self, text: str, name: str = "", kind: str = "") -> None:
        """Says it at once.

        Args:
            name: id of the pair that it is about, which is said where there are several.
            kind: comes first, such as "warning: ".
        """
        if self._pairs > 1 and name and not text.startswith(f"{name}: "):
            text = f"{name}: {text}"
        if not self._silent:
            self.end()
            print_stderr(f"{self._program}: {kind}{one_line(text)}\n")

    def note(self, text: str) -> None:
        """What is good to know, but no error."""
        if not self._quiet:
            self.say(text)

    def end(self) -> None:
        """Clears the moving line."""
        if self._moving and not self._quiet:
            print_stderr("\r\x1b[K")

    def _rate(self) -> str:
        spent = time.monotonic() - self._began
        if self._pairs < 2 or not self.finished or not spent:
            return ""
        left = spent / self.finished * (self._pairs - self.finished)
        return f"; {self.finished} of {self._pairs}, {_pace(self.finished / spent)}, {_duration(left)} left"


def print_stderr(text: str) -> None:
    """Prints to stderr."""
    with contextlib.suppress(FileError):  # the work goes on though nobody reads
        print_parts(sys.stderr, [text])


def _pace(pairs_a_second: float) -> str:
    return f"{pairs_a_second:.1f} a second" if pairs_a_second >= 1 else f"{60 * pairs_a_second:.1f} a minute"


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
