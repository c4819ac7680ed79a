# SPDX-License-Identifier: GPL-3.0-or-later
"""Scores against the cost of an asset's levels, as a drawing (SVG) that takes its colors from the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from ..labels import shorten
from ..numbers import score_text

WIDTH, HEIGHT = 460, 270
LEFT, RIGHT, TOP, BOTTOM = 44, 16, 28, 62  # margins; the lowest level's name stands above the axis' numbers
LABEL = 22  # characters of a level's name
LETTER, LINE = 8, 15  # about the size of a letter of a level's name
MARK = 5  # radius of a mark
TICKS = 3  # marks of an axis at least, where there are so many round numbers


@dataclass(frozen=True)
class Level:
    """A point of the curve.

    Attributes:
        name: of the level. cost: more than 0. score: in [0, 1]. is_reference: what the others are compared with.
    """

    name: str
    cost: float
    score: float
    is_reference: bool = False


def curve_svg(levels: Sequence[Level], cost: str, of: str) -> str:
    """Scores over costs, the costs on a logarithmic axis; each level is marked and named.

    Args:
        levels: at least one. cost: what it is, with its unit. of: what the score is called.
    """
    ordered = sorted(levels, key=lambda level: (level.cost, level.score))
    low, high = math.log(ordered[0].cost), math.log(ordered[-1].cost)
    if high - low < 1e-9:
        low, high = low - 1, high + 1
    floor = min(math.floor(min(level.score for level in levels) * 10) / 10, 0.9)
    step = next(step for step in (0.02, 0.05, 0.1, 0.2) if (1 - floor) / step <= 5.001)

    def x(value: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (math.log(value) - low) / (high - low)

    def y(score: float) -> float:
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * (score - floor) / (1 - floor)

    said = "; ".join(f"{level.name}: {_short(level.cost)} {cost}, {of} {score_text(level.score)}" for level in ordered)
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{of} against {escape(cost)}. {escape(said)}">'
    ]
    for k in range(round((1 - floor) / step) + 1):
        score = 1 - k * step
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(score):.1f}" y2="{y(score):.1f}"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y(score) + 4:.1f}" text-anchor="end">{score:.2f}</text>')
    for value in _ticks(math.exp(low), math.exp(high)):
        parts.append(f'<text x="{x(value):.1f}" y="{HEIGHT - 26}" text-anchor="middle">{_short(value)}</text>')
    parts.append(f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 8}" text-anchor="end">{escape(cost)}</text>')
    if len({level.cost for level in levels}) == len(levels):  # others are no chain
        points = " ".join(f"{x(level.cost):.1f},{y(level.score):.1f}" for level in ordered)
        parts.append(f'<polyline class="line" points="{points}"/>')
    marks = [(x(level.cost), y(level.score)) for level in ordered]
    taken = [(at - MARK, at + MARK, height - MARK, height + MARK) for at, height in marks]
    for level, (at, height) in zip(ordered, marks, strict=True):
        kind = ' class="reference"' if level.is_reference else ""
        parts.append(
            f'<circle{kind} cx="{at:.1f}" cy="{height:.1f}" r="{MARK}">'
            f"<title>{escape(level.name)}: {score_text(level.score)}</title></circle>"
        )
        name = shorten(level.name, lambda text: len(text) <= LABEL)
        for box, baseline, anchor in _places(at, height, LETTER * len(name)):
            left, right, top, bottom = box
            if (
                0 <= left
                and right <= WIDTH
                and not any(
                    left < other[1] and other[0] < right and top < other[3] and other[2] < bottom for other in taken
                )
            ):
                taken.append(box)
                end = left if anchor == "start" else right
                parts.append(
                    f'<text class="level" x="{end:.1f}" y="{baseline:.1f}" text-anchor="{anchor}">{escape(name)}</text>'
                )
                break  # else it is told where one points at the mark
    return "".join(parts) + "</svg>"


def _places(x: float, y: float, width: float) -> list[tuple[tuple[float, float, float, float], float, str]]:
    """Where the name of a mark may stand: its left, right, top and bottom, its baseline and its anchor.

    Below to the right, or above to the left: there the curve, which rises, is not.
    """
    right, left = x + 8, x - 7
    places = [
        ((right, right + width, y + 17 - LINE + 3, y + 17 + 3), y + 17, "start"),
        ((left - width, left, y - 8 - LINE + 3, y - 8 + 3), y - 8, "end"),
    ]
    return places if x < (LEFT + WIDTH - RIGHT) / 2 else places[::-1]


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers from low to high, as few as will do; both ends themselves where there are none."""
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for digits in ((1,), (1, 3), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7)):
        found = [digit * 10.0**decade for decade in decades for digit in digits]
        found = [value for value in found if low * 0.999 <= value <= high * 1.001]
        if len(found) >= TICKS:
            return found
    return [low, high] if len(found) < 2 else found


def _short(value: float) -> str:
    """Three digits, with k and M for thousands and millions."""
    for size, unit in ((1e6, "M"), (1e3, "k")):
        if value >= size * 0.9995:
            return f"{value / size:.3g}{unit}"
    return f"{value:.3g}"
