# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pieces of the page's HTML."""

from __future__ import annotations

from html import escape

import numpy as np

from ...metric.geometry import Floats
from ..visual.colormap import score_colors

MEGABYTE = 2**20


def bar(value: float | None) -> str:
    """Its length and its color say the value, which stands beside it as text."""
    if value is None:
        return ""
    color = css(score_colors(np.array([value]))[0])
    return f'<span class="bar"><span style="width:{100 * value:.1f}%;background:{color}"></span></span>'


def text(text: object) -> str:
    """Text from anywhere as HTML; it cannot turn the direction of what stands around it."""
    return f"<bdi>{escape(str(text))}</bdi>"


def css(color: Floats) -> str:
    """A (3,) encoded color in [0, 1] for style sheets."""
    return "#" + "".join(f"{channel:02x}" for channel in np.rint(color * 255).astype(int).tolist())
