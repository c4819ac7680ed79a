# SPDX-License-Identifier: GPL-3.0-or-later
"""How much renders of a pair differ over their size on screen, as a drawing (SVG) in the page's colors; and all levels
of a chain in one, with the sizes at which they take over from each other."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from ..labels import shorten
from ..records import SIZES, size_notes, size_text

WIDTH, HEIGHT = 460, 230
LEFT, RIGHT, TOP, BOTTOM = 44, 16, 14, 44  # margins
MOST = 4.0  # D at the upper end; what differs more ends there
TICKS = (0.25, 0.5, 1.0, 2.0, 4.0)
BAND = 24  # how high the band is that says which level is shown
LETTER = 7.5  # about how wide a letter is


@dataclass(frozen=True)
class Curve:
    """D of one level, strict.

    Attributes:
        points: (size, D), from the smallest size on. pixels, bound: of its hard switch. said: that, as people read it.
    """

    points: tuple[tuple[float, float], ...]
    pixels: float
    bound: str
    said: str

    @classmethod
    def of(cls, found: Mapping[str, Any]) -> Curve:
        """Of what screen_size.records.size_record has."""
        points = tuple((each["size"], each["D_strict"]) for each in found["curve"])
        return cls(points, found["strict"]["pixels"], found["strict"]["bound"], f"{size_text(found, 'strict')} px")


@dataclass(frozen=True)
class Shown:
    """A level of a chain in its place.

    Attributes:
        name: what of the level's name is its own. start, end: the sizes in pixels between which it is shown; equal: at
            none.
    """

    name: str
    start: float
    end: float


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
    curve = Curve.of(found)
    said = "; ".join(f"{size:g} px: {difference:.2f}" for size, difference in curve.points)
    drawn = _Drawing([curve], HEIGHT).svg(f"D against size on screen. {said}", [True])
    return (
        f"<div><h4>Size on screen</h4>{drawn}"
        f'<p class="note">D is 1 where renders differ as much as a hard switch may. {escape(words)}</p></div>'
    )


def chain_sizes(levels: Sequence[tuple[str, Curve]]) -> str:
    """The curves of a chain's levels in one drawing, and under them which level is shown at which size.

    Args:
        levels: their names and curves, at least one, from fine to coarse.
    """
    drawing = _Drawing([curve for _, curve in levels], HEIGHT + BAND, BAND)
    places = shown_levels(levels)
    placed = [place.start < place.end for place in places]
    said = "; ".join(f"{name}: {curve.said}" for name, curve in levels)
    label = f"D against size on screen, and which level may be shown. {said}"
    useless = [name for (name, _), has_place in zip(levels, placed, strict=True) if not has_place]
    words = "The band says which level may be shown at which size, for a hard switch."
    if useless:
        words += f" No place: {', '.join(useless)}."
    return (
        f"<figure><figcaption>D against size on screen</figcaption>{drawing.svg(label, placed, places)}"
        f'<p class="note">{escape(words)}</p></figure>'
    )


def shown_levels(levels: Sequence[tuple[str, Curve]]) -> list[Shown]:
    """Between which sizes each is shown: up to its switch, and down to the largest of the coarser ones' switches.

    Args:
        levels: from fine to coarse, as the result.
    """
    places: list[Shown] = []
    largest = 0.0
    names = _own_parts([name for name, _ in levels])
    for name, (_, curve) in zip(names[::-1], reversed(levels), strict=True):
        end = largest if curve.bound == "below" else max(largest, curve.pixels)
        places.append(Shown(name, largest, end))
        largest = end
    return places[::-1]


def _own_parts(names: Sequence[str]) -> list[str]:
    """Names without what all of them begin and end with, up to where a word of it ends."""
    if len(names) < 2:
        return list(names)
    begin = re.match(r"(?:.*[^0-9A-Za-z])?", os.path.commonprefix(names))
    end = re.match(r"(?:.*[^0-9A-Za-z])?", os.path.commonprefix([name[::-1] for name in names]))
    first, last = (0 if found is None else found.end() for found in (begin, end))
    own = [name[first : len(name) - last] for name in names]
    return own if all(own) else list(names)


def _cut(name: str, letters: int) -> str:
    """So much of a name as there is room for; "" where that says nothing."""
    short = shorten(name, lambda text: len(text) <= letters)
    return short if len(short) <= letters else ""


class _Drawing:
    """Curves on logarithmic axes, from the smallest to the largest size that any of them has.

    Args:
        height: of the whole, of which band are left free under the axes.
    """

    def __init__(self, curves: Sequence[Curve], height: int, band: int = 0) -> None:
        self._curves = curves
        self._height, self._bottom = height, height - BOTTOM - band
        self._sizes = sorted({size for curve in curves for size, _ in curve.points})
        self._low = math.log(self._sizes[0])
        self._high = math.log(max(self._sizes[-1], 2 * self._sizes[0]))

    def svg(self, label: str, placed: Sequence[bool], places: Sequence[Shown] = ()) -> str:
        """The drawing.

        Args:
            label: what it shows, in words. placed: which of the levels have a place. places: of the band.
        """
        parts = [f'<svg viewBox="0 0 {WIDTH} {self._height}" role="img" aria-label="{escape(label)}">']
        for tick in TICKS:
            y = self._y(tick)
            parts.append(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}"/>')
            parts.append(f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
        for size in self._sizes:
            parts.append(f'<text x="{self._x(size):.1f}" y="{self._height - 24}" text-anchor="middle">{size:g}</text>')
        parts.append(
            f'<text x="{WIDTH - RIGHT}" y="{self._height - 6}" text-anchor="end">pixels of the box diagonal</text>'
        )
        parts += self._band(places)
        for curve, has_place in zip(self._curves, placed, strict=True):
            line = " ".join(f"{self._x(size):.1f},{self._y(difference):.1f}" for size, difference in curve.points)
            parts.append(f'<polyline class="{"line" if has_place else "line without"}" points="{line}"/>')
        parts += [self._mark(curve) for curve in self._curves]
        return "".join(parts) + "</svg>"

    def _mark(self, curve: Curve) -> str:
        """Where a level's switch is."""
        ends = curve.points[0 if curve.bound == "below" else -1]
        y = self._y(ends[1] if curve.bound else 1.0)
        return (
            f'<circle cx="{self._x(curve.pixels):.1f}" cy="{y:.1f}" r="5"><title>{escape(curve.said)}</title></circle>'
        )

    def _band(self, places: Sequence[Shown]) -> list[str]:
        """Which level is shown at which size, with lines down from where they switch."""
        parts = []
        last = max((place.end for place in places), default=0.0)
        everything = [*places[::-1], Shown("Original", last, math.exp(self._high))] if places else []
        for number, place in enumerate(place for place in everything if place.start < place.end):
            left, right = self._x(place.start), self._x(place.end)
            if right - left < 1:
                continue  # beyond what was looked at
            kind = "shown" if number % 2 else "shown other"
            top, middle = self._bottom + 4, (left + right) / 2
            parts.append(
                f'<rect class="{kind}" x="{left:.1f}" y="{top}" width="{right - left:.1f}" height="{BAND - 4}">'
                f"<title>{escape(place.name)}</title></rect>"
            )
            name = _cut(place.name, int((right - left - 4) / LETTER))
            if name:
                parts.append(
                    f'<text class="level" x="{middle:.1f}" y="{top + 14}" text-anchor="middle">{escape(name)}</text>'
                )
            if right < WIDTH - RIGHT - 1:
                parts.append(
                    f'<line class="drop" x1="{right:.1f}" x2="{right:.1f}" y1="{self._y(1):.1f}" y2="{self._bottom}"/>'
                )
        return parts

    def _x(self, size: float) -> float:
        share = (math.log(max(size, 1e-9)) - self._low) / (self._high - self._low)
        return LEFT + (WIDTH - LEFT - RIGHT) * min(max(share, 0), 1)

    def _y(self, difference: float) -> float:
        share = math.log(min(max(difference, TICKS[0]), MOST) / TICKS[0]) / math.log(MOST / TICKS[0])
        return self._bottom - (self._bottom - TOP) * share
