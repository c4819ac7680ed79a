# SPDX-License-Identifier: GPL-3.0-or-later
"""Text that must fit into little room."""

from __future__ import annotations

from collections.abc import Callable


def shorten(text: str, fits: Callable[[str], bool]) -> str:
    """The text, or its two ends with dots between that fit."""
    if fits(text):
        return text
    kept = len(text) - 1
    while kept > 2 and not fits(f"{text[: kept - kept // 2]}...{text[-(kept // 2) :]}"):
        kept -= 1
    return f"{text[: kept - kept // 2]}...{text[-(kept // 2) :]}"
