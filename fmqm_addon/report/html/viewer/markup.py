# SPDX-License-Identifier: GPL-3.0-or-later
"""What the page holds of the viewer: a button for each pair, style, and the script that loads the rest on demand."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from html import escape
from pathlib import Path

import numpy as np

from ...visual.colormap import score_colors
from ..fragments import css

_STOPS = 33  # colors of the ramp


def viewer_markup(viewer: Mapping[str, str] | None, name: str) -> str:
    """A pair's place for the viewer, closed; "" for a pair without one.

    Args:
        viewer: a record's "viewer". name: of the pair, for people.
    """
    if viewer is None:
        return ""
    paths = " ".join(f'data-{key}="{escape(viewer[key])}"' for key in ("reference", "level"))
    return (
        f'<section class="viewer" aria-label="3D view of {escape(name)}" {paths}>'
        '<button type="button" class="viewer-open">Turn It Around</button>'
        '<p class="viewer-said" role="status"></p></section>'
    )


def viewer_style() -> str:
    """The style sheet, to stand behind the page's own."""
    return (Path(__file__).parent / "viewer.css").read_text(encoding="utf-8")


@cache
def viewer_script() -> str:
    """What stands in a script element of the page; it loads the viewer's files when a pair is opened."""
    ramp = [css(color) for color in score_colors(np.linspace(0, 1, _STOPS))]
    text = (Path(__file__).parent / "loader.js").read_text(encoding="utf-8")
    return text.replace('"RAMP"', json.dumps(ramp), 1)
