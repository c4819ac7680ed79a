# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures on a pair's card: both meshes and the heat map from one or two sides, and the worst patches."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from ...comparison.judge import Judge
from ..numbers import score_text
from ..words import LABELS, LOD, ORIGINAL
from .fragments import ramp, text, zoomed
from .histogram import legend
from .kept import LOSS

Record = Mapping[str, Any]


def views(name: str, pictures: Record) -> str:
    """Three pictures on one camera for each view; the worst patches that can be seen are marked on the heat maps."""
    of_views = pictures["views"]
    return "".join(
        f'<section class="view"><h4>{_title(view["name"], len(of_views), bool(pictures["worst"]))}</h4>'
        f'<div class="views" style="--ratio:{_ratio(view["size"]):.4f}">'
        f"{_figures(name, pictures, view, number)}</div></section>"
        for number, view in enumerate(of_views)
    )


def _title(view: str, count: int, is_loss: bool) -> str:
    if view == LOSS:
        return "From the side of the loss"
    front = "From the front (-Y)"
    return f"{front}, which shows about as much of the loss as any side" if count == 1 and is_loss else front


def _ratio(size: Sequence[object]) -> float:
    """Width by height; 1 where a record, which may be a stranger's, has no such numbers."""
    width, height = size
    return width / height if isinstance(width, int) and isinstance(height, int) and height > 0 else 1.0


def _figures(name: str, pictures: Record, view: Record, number: int) -> str:
    marks = "".join(
        f'<span class="mark" style="left:{100 * at[0]:.1f}%;top:{100 * at[1]:.1f}%">{rank}</span>'
        for rank, worst in enumerate(pictures["worst"], 1)
        if (at := worst["at"][number]) is not None
    )
    label, size = LABELS[Judge(pictures["judge"]).column], tuple(view["size"])
    low, high = pictures["range"]
    figures = (
        (zoomed(view["reference"], f"{ORIGINAL} of {name}", size), ORIGINAL, ""),
        (zoomed(view["distorted"], f"{LOD} {name}", size), LOD, ""),
        (
            zoomed(view["heat"], f"{ORIGINAL} colored by the {label} of {name}", size) + marks,
            "Heat Map",
            legend(low, high, label, ramp(), pictures["has_gaps"]),
        ),
    )
    return "".join(
        f'<figure><div class="picture">{picture}</div><figcaption><b>{title}</b>{caption}</figcaption></figure>'
        for picture, title, caption in figures
    )


def close_ups(worst: Sequence[Record], judge: Judge) -> str:
    """The worst patches of both, side by side, with where they are and what is lowest there."""
    if not worst:
        return '<section><h4>Worst places</h4><p class="note">None: every patch is like the original\'s.</p></section>'
    label = LABELS[judge.column]
    figures = "".join(
        f'<figure><div class="picture two">{zoomed(each["reference"], f"Worst place {rank}, {ORIGINAL}")}'
        f"{zoomed(each['distorted'], f'Worst place {rank}, {LOD}')}</div>"
        f'<figcaption><b><span class="rank">{rank}</span> {_place(each)}</b><br>'
        f'<span class="number">{label} {score_text(each[judge.column], places=3)}; lowest: '
        f"{escape(str(LABELS.get(each['blame'], each['blame'])))} {score_text(each['value'], places=3)}</span>"
        "</figcaption></figure>"
        for rank, each in enumerate(worst, 1)
    )
    return (
        f'<section><h4>Worst places: {ORIGINAL} left, {LOD} right</h4><div class="close-ups">{figures}</div></section>'
    )


def _place(worst: Record) -> str:
    place = escape(worst["place"][:1].upper() + worst["place"][1:])
    return f"{place}, {text(worst['object'])}" if worst["object"] else place
