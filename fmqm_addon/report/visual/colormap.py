# SPDX-License-Identifier: GPL-3.0-or-later
"""What color a number gets: perceptually even maps that color-blind people can read. Colors are encoded sRGB."""

from __future__ import annotations

from functools import cache

import numpy as np

from ...metric.colorspace import srgb_to_lab
from ...metric.geometry import Floats, Ints

NO_PATCH = (0.62, 0.63, 0.65)  # of a place that no scored patch covers

# From score 0 to score 1: bad is hot and bright, good is dark (inferno without its ends).
SCORE_COLORS = ("#f9dd4c", "#fbb418", "#f8850f", "#e65d2f", "#cb4149", "#a62c60", "#7f1e6c", "#56106e", "#280b54")

# From the surface inwards and outwards: blue and orange differ to every eye; both begin at the same white.
INSIDE_COLORS = ("#f2f0eb", "#84b5d9", "#2f74ad", "#0b3c6f")
OUTSIDE_COLORS = ("#f2f0eb", "#e8a567", "#bb5d1c", "#6b2c06")

# Okabe and Ito's, for a few kinds of things.
GREY_LIGHT, GREY_DARK, VERMILION, SKY = (0.80, 0.81, 0.83), (0.42, 0.44, 0.48), (0.84, 0.37, 0.0), (0.34, 0.71, 0.91)

_GOLDEN = 0.6180339887498949  # turns of the color wheel between neighbors in number


def score_colors(scores: Floats) -> Floats:
    """(N, 3) colors in [0, 1] of (N,) scores from 0 (hot) to 1 (dark); NO_PATCH for nan."""
    return _in_table(scores, _table(SCORE_COLORS))


def signed_colors(values: Floats) -> Floats:
    """(N, 3) colors in [0, 1] of (N,) values from -1 (blue) over 0 (white) to 1 (orange); NO_PATCH for nan."""
    colors = _in_table(values, _table(OUTSIDE_COLORS))
    inside = np.flatnonzero(values < 0)
    colors[inside] = _in_table(-values[inside], _table(INSIDE_COLORS))
    return colors


def number_colors(numbers: Ints) -> Floats:
    """(N, 3) colors in [0, 1] that tell neighbors apart; they differ in lightness as well as in hue."""
    number = np.asarray(numbers, np.int64)
    hue = number * _GOLDEN % 1.0
    saturation = 0.45 + 0.2 * (number % 2)
    value = 0.5 + 0.15 * (number % 4)
    sector = hue[:, None] * 6 + np.array([5.0, 3.0, 1.0])
    ramp = np.clip(np.minimum(sector % 6, 4 - sector % 6), 0, 1)
    colors: Floats = value[:, None] * (1 - saturation[:, None] * ramp)
    return colors


def _in_table(place: Floats, table: Floats) -> Floats:
    """(N, 3) the table's colors at places from 0 to 1."""
    known = np.clip(np.nan_to_num(place), 0, 1)
    colors: Floats = table[np.rint(known * (len(table) - 1)).astype(np.int64)]
    colors[np.isnan(place)] = NO_PATCH
    return colors


@cache
def _table(anchors_as_text: tuple[str, ...], steps: int = 256) -> Floats:
    """(steps, 3) the colors between the anchors at equal distances in CIE L*a*b*, so that equal
    differences of the number look equal."""
    anchors = np.array([[int(text[k : k + 2], 16) / 255 for k in (1, 3, 5)] for text in anchors_as_text])
    place = np.linspace(0, len(anchors) - 1, 8 * steps)
    path = np.stack([np.interp(place, np.arange(len(anchors)), channel) for channel in anchors.T], axis=1)
    walked = np.linalg.norm(np.diff(srgb_to_lab(path), axis=0), axis=1).cumsum()
    walked = np.concatenate([[0], walked])
    even = np.linspace(0, walked[-1], steps)
    return np.stack([np.interp(even, walked, channel) for channel in path.T], axis=1)
