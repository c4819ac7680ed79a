# SPDX-License-Identifier: GPL-3.0-or-later
"""The impairment of a pair, the level of a difference in words, from perceived and from the facts that it does not see.

The words are those of the impairment scale of ITU-R BT.500, on which human scores were given; where they begin was
fitted on one model: an orientation.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .color_shift import JUST_NOTICEABLE

IMPAIRMENTS = (
    (0.98, "imperceptible"),
    (0.95, "perceptible side by side, not annoying"),
    (0.88, "slightly annoying"),
    (0.80, "annoying"),
    (0.0, "very annoying"),
)
_SIDE_BY_SIDE, _SLIGHTLY = 1, 2  # rows of IMPAIRMENTS that facts cap at
LARGE_COLOR_SHIFT = 10.0  # slightly annoying at best
MISSING = 0.005  # share of the reference's area that is gone; holes
TRANSPARENCY = 0.01  # share of samples that one mesh shows and the other does not


def impairment_of(perceived: float, facts: Mapping[str, Any]) -> str:
    """The level of a pair.

    Args:
        perceived: of the pair, in [0, 1]. facts: values of the pair's facts by name; those that are not known cap
            nothing.
    """
    by_score = next((row for row, (least, _) in enumerate(IMPAIRMENTS) if perceived >= least), len(IMPAIRMENTS) - 1)
    return IMPAIRMENTS[max([by_score, *(row for row, _ in _caps(facts))])][1]


def capped_by(perceived: float, facts: Mapping[str, Any]) -> list[str]:
    """The facts, in words, that put a pair lower than perceived alone would, or would if it were higher."""
    return [words for row, words in _caps(facts) if perceived >= IMPAIRMENTS[row - 1][0]]


def _caps(facts: Mapping[str, Any]) -> list[tuple[int, str]]:
    """The best row of IMPAIRMENTS that each fact allows, and the fact in words."""
    caps = []
    gone = facts.get("missing_parts_count") or 0
    if gone:
        caps.append((_SIDE_BY_SIDE, "a part is gone" if gone == 1 else f"{gone:,} parts are gone"))
    elif (facts.get("missing") or 0.0) > MISSING:
        caps.append((_SIDE_BY_SIDE, "a piece of its surface is gone"))
    shift = facts.get("color_shift") or 0.0
    if shift >= JUST_NOTICEABLE:
        row = _SLIGHTLY if shift > LARGE_COLOR_SHIFT else _SIDE_BY_SIDE
        caps.append((row, f"its colors have shifted by {shift:.1f}"))
    if max(facts.get("transparency_lost") or 0.0, facts.get("transparency_gained") or 0.0) > TRANSPARENCY:
        caps.append((_SIDE_BY_SIDE, "its transparency differs"))
    if any(facts.get(name) for name in ("maps_not_seen", "maps_lost", "maps_added")):
        caps.append((_SIDE_BY_SIDE, "other maps than the base color differ"))
    return caps
