# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as people read them: in the table, on the page, in pictures and in the sidebar."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

MISSING = "-"
PLACES = 4  # of a score; random samples alone move the third


def score_text(value: float | None, stderr: float | None = None, places: int = PLACES) -> str:
    """A score, with its standard error where that is known; MISSING: there is none.

    Only 1 itself reads as 1: what would be rounded to it is written as the highest number below, such as 0.9999.
    """
    if value is None:
        return MISSING
    text = f"{value if value == 1 else min(value, 1 - 10.0**-places):.{places}f}"
    return text if stderr is None else f"{text} ± {stderr:.{places}f}"


def value_text(value: Any, is_share: bool = False) -> str:
    """A value as JSON has it; of tables and lists all values.

    Args:
        is_share: numbers with a decimal point are shares.
    """
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{100 * value:.3g} %" if is_share else f"{value:.4g}"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {value_text(part, is_share)}" for name, part in value.items()) or "none"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(value_text(part, is_share) for part in value) or "none"
    return "none" if value is None else str(value)
