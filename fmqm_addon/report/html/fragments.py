# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pieces of the page's HTML."""

from __future__ import annotations

import re
from html import escape
from urllib.parse import quote

import numpy as np

from ...metric.geometry import Floats
from ..visual.colormap import score_colors

MEGABYTE = 2**20
_STOPS = 9  # colors of a ramp
_JOINTS, _BREAK = re.compile(r"[_:/\\-]+(?=.)"), r"\g<0><wbr>"


def bar(value: float | None) -> str:
    """Its length and its color say the value, which stands beside it as text."""
    if value is None:
        return ""
    color = css(score_colors(np.array([value]))[0])
    return f'<span class="bar"><span style="width:{100 * value:.1f}%;background:{color}"></span></span>'


def text(text: object) -> str:
    """Text from anywhere as HTML; it cannot turn the direction of what stands around it."""
    return f"<bdi>{escape(str(text))}</bdi>"


def sentence(said: object) -> str:
    """English words as HTML; they run from left to right, whatever name they begin with."""
    return f'<bdi dir="ltr">{escape(str(said))}</bdi>'


def name_text(name: str) -> str:
    """A name as HTML, as text() has it, that may go on in a new line behind what joins its parts."""
    return f"<bdi>{_JOINTS.sub(_BREAK, escape(name))}</bdi>"


def css(color: Floats) -> str:
    """A (3,) encoded color in [0, 1] for style sheets."""
    return "#" + "".join(f"{channel:02x}" for channel in np.rint(color * 255).astype(int).tolist())


def ramp() -> str:
    """The colors of scores, from the lowest to the highest."""
    stops = ",".join(css(color) for color in score_colors(np.linspace(0, 1, _STOPS)))
    return f'<span class="ramp" style="background:linear-gradient(90deg,{stops})"></span>'


def image(path: str, alt: str, name: str = "", size: tuple[object, object] | None = None) -> str:
    """A picture, loaded when it comes into view.

    Args:
        path: relative to the page, with / in between. name: its class. size: width and height in pixels.
    """
    sized = "" if size is None else f' width="{escape(str(size[0]))}" height="{escape(str(size[1]))}"'
    of = f' class="{name}"' if name else ""
    return f'<img{of} src="{escape(quote(path))}" alt="{escape(alt)}"{sized} loading="lazy" decoding="async">'


def zoomed(path: str, alt: str, size: tuple[object, object] | None = None) -> str:
    """A picture that opens large; without a script, as a file."""
    return f'<a class="zoom" href="{escape(quote(path))}">{image(path, alt, size=size)}</a>'


def count_text(number: int, of: str) -> str:
    """A number of things, in words."""
    return f"{number:,} {of}" if number == 1 else f"{number:,} {of}s"


def folded(title: str, content: str) -> str:
    """What is there for who wants to know more."""
    return f"<details><summary>{title}</summary>{content}</details>"


def scrolled(label: str, content: str) -> str:
    """What may be wider than a phone."""
    return f'<div class="scroll" tabindex="0" role="region" aria-label="{label}">{content}</div>'
