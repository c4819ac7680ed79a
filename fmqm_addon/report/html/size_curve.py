# SPDX-License-Identifier: GPL-3.0-or-later
"""How much renders of a pair differ over their size on screen, as a drawing (SVG) in the page's colors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from html import escape
from typing import Any

from ..records import SIZES, size_notes, size_text

WIDTH, HEIGHT = 460, 230
LEFT, RIGHT, TOP, BOTTOM = 44, 16, 14, 44  # margins
MOST = 4.0  # D at the upper end; what differs more ends there
TICKS = (0.25, 0.5, 1.0, 2.0, 4.0)


def size_panel(found: Mapping[str, Any] | None) -> str:
    """The two switch sizes in words, and the curve of D (strict); "" where none were asked for.

    Args:
        found: as screen_size.records.size_record has it.
    """
    if found is None:
        return ""
    words = " ".join(
        [*(f"{kind.capitalize()}: {size_text(found, kind)} px." for kind in SIZES.values()), *size_notes(found)]
    )
    return (
        f"<div><h4>Size on screen</h4>{_curve_svg(found)}"
        f'<p class="note">D is 1 where renders differ as much as a hard switch may. {escape(words)}</p></div>'
    )


def _curve_svg(found: Mapping[str, Any]) -> str:
    points = [(each["size"], each["D_strict"]) for each in found["curve"]]
    low, high = math.log(points[0][0]), math.log(max(points[-1][0], 2 * points[0][0]))

    def x(size: float) -> float:
        share = (math.log(max(size, 1e-9)) - low) / (high - low)
        return LEFT + (WIDTH - LEFT - RIGHT) * min(max(share, 0), 1)

    def y(difference: float) -> float:
        share = math.log(min(max(difference, TICKS[0]), MOST) / TICKS[0]) / math.log(MOST / TICKS[0])
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * share

    said = "; ".join(f"{size:g} px: {difference:.2f}" for size, difference in points)
    parts = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="D against size on screen. {said}">']
    for tick in TICKS:
        parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(tick):.1f}" y2="{y(tick):.1f}"/>')
        parts.append(f'<text x="{LEFT - 8}" y="{y(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for size, _ in points:
        parts.append(f'<text x="{x(size):.1f}" y="{HEIGHT - 24}" text-anchor="middle">{size:g}</text>')
    parts.append(f'<text x="{WIDTH - RIGHT}" y="{HEIGHT - 6}" text-anchor="end">pixels of the box diagonal</text>')
    line = " ".join(f"{x(size):.1f},{y(difference):.1f}" for size, difference in points)
    parts.append(f'<polyline class="line" points="{line}"/>')
    switch = found["strict"]["pixels"]
    at = y(1.0) if not found["strict"]["bound"] else y(points[-1][1] if switch > points[0][0] else points[0][1])
    title = f"<title>{escape(size_text(found, 'strict'))} px</title>"
    parts.append(f'<circle cx="{x(switch):.1f}" cy="{at:.1f}" r="5">{title}</circle>')
    return "".join(parts) + "</svg>"
