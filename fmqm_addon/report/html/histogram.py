# SPDX-License-Identifier: GPL-3.0-or-later
"""How the scores of a pair's patches are spread, as a drawing (SVG) in the colors of the heat map."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from ..numbers import score_text
from ..visual.colormap import score_colors
from ..visual.heat_map import round_ticks
from ..visual.layers import number_text
from .fragments import css

WIDTH, HEIGHT = 460, 170
LEFT, RIGHT, TOP, BOTTOM = 10, 10, 22, 26  # margins
LETTER, NARROW = 0.021, 0.037  # width of a tick's letter, in the drawing's and in a narrow legend's


def histogram_svg(counts: Sequence[int], low: float, high: float, mean: float, label: str) -> str:
    """Bars from low to high, with a mark at the mean.

    Args:
        counts: of the patches, in equal parts from low to high; the first has those below, too. label: of the scores.
    """
    most, total = max(*counts, 1), sum(counts)
    step = (WIDTH - LEFT - RIGHT) / len(counts)
    colors = score_colors((np.arange(len(counts)) + 0.5) / len(counts))
    base = HEIGHT - BOTTOM
    said = f"How {label} is spread over {total:,} patches from {low:g} to {high:g}; mean {score_text(mean)}"
    parts = [f'<svg class="histogram" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(said)}">']
    for row, count in enumerate(counts):
        height = (base - TOP) * count / most
        if count:
            parts.append(
                f'<rect x="{LEFT + row * step:.1f}" y="{base - height:.1f}" width="{step - 1:.1f}" '
                f'height="{height:.1f}" fill="{css(colors[row])}"><title>{count:,} patches</title></rect>'
            )
    parts.append(f'<line class="axis" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{base}" y2="{base}"/>')

    def x(value: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * min(max((value - low) / (high - low), 0.0), 1.0)

    for place, tick in _ticks(low, high, LETTER):
        anchor = "start" if place < 0.02 else "end" if place > 0.98 else "middle"
        parts.append(
            f'<text x="{x(low + place * (high - low)):.1f}" y="{HEIGHT - 8}" text-anchor="{anchor}">{tick}</text>'
        )
    at = x(mean)
    parts.append(f'<line class="mean" x1="{at:.1f}" x2="{at:.1f}" y1="{TOP - 4}" y2="{base}"/>')
    anchor = "start" if at < WIDTH / 2 else "end"
    shift = 5 if anchor == "start" else -5
    parts.append(
        f'<text class="level" x="{at + shift:.1f}" y="{TOP - 8}" text-anchor="{anchor}">mean {score_text(mean)}</text>'
    )
    return "".join(parts) + "</svg>"


def _ticks(low: float, high: float, letter: float) -> list[tuple[float, str]]:
    """Places in [0, 1] and texts of round numbers, whose letters are so wide."""
    numbers = round_ticks(low, high)
    write = number_text(numbers[1] - numbers[0] if len(numbers) > 1 else high - low)
    # What is lower than the lower end has its color, and its bar.
    ticks = [
        ((number - low) / (high - low), f"≤ {write(number)}" if number == low > 0 else write(number))
        for number in numbers
    ]
    # Both ends stand, and between them what runs into neither.
    reach = [_extent(place, letter * len(text)) for place, text in ticks]
    kept = [
        (reach[0][1] < left and right < reach[-1][0]) or k in (0, len(ticks) - 1)
        for k, (left, right) in enumerate(reach)
    ]
    return [tick for tick, is_kept in zip(ticks, kept, strict=True) if is_kept]


def _extent(place: float, width: float) -> tuple[float, float]:
    """From where to where a tick reaches; at an end it reaches inwards."""
    left = place if place < 0.02 else 1 - width if place > 0.98 else place - width / 2
    return left, left + width


def legend(low: float, high: float, label: str, ramp: str, has_gaps: bool) -> str:
    """The colors of a heat map, with the scores at round places."""
    ticks = "".join(f'<span style="left:{100 * place:.1f}%">{tick}</span>' for place, tick in _ticks(low, high, NARROW))
    gap = '<span class="gap">pale: not measured</span>' if has_gaps else ""
    return (
        f'<span class="legend"><span>{label}</span><span class="scale">{ramp}'
        f'<span class="ticks number">{ticks}</span></span>{gap}</span>'
    )
