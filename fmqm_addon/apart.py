# SPDX-License-Identifier: GPL-3.0-or-later
"""Outputs never replace what is read, nor each other, by whatever names, links and letter case their paths use."""

from __future__ import annotations

import os
from collections.abc import Hashable, Iterable

from .metric.errors import FMQMError, SettingsError


def check_apart(
    outputs: Iterable[tuple[str, str]], inputs: Iterable[str], error: type[FMQMError] = SettingsError
) -> None:
    """Refuses outputs that would replace inputs or each other.

    Args:
        outputs: of each what says where it comes from, as the flag that names it, and its path; or - for stdout.

    Raises:
        FMQMError: of the kind asked for: they do.
    """
    read = {_place(path): path for path in inputs}
    written: dict[Hashable, str] = {}
    for said, path in outputs:
        place = path if path == "-" else _place(path)
        if place in read:
            raise error(f"{said} {path}: it would replace {read[place]}, which is an input; name another file")
        if place in written:
            raise error(f"{written[place]} and {said} both write to {path}; name two files")
        written[place] = said


def _place(path: str) -> Hashable:
    """What is the same for all names of a file, there or not."""
    try:
        found = os.stat(path)
        return found.st_dev, found.st_ino
    except OSError:
        return os.path.normcase(os.path.realpath(path))
    except ValueError:  # no path on this system, which others say
        return path
