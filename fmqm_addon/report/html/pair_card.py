# SPDX-License-Identifier: GPL-3.0-or-later
"""A pair's section of the page: its score, words, pictures and features, and how far to trust it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any
from urllib.parse import quote

import numpy as np

from ...comparison.judge import Judge
from ..criteria import judge_of, shortfall
from ..numbers import score_text
from ..parts_table import part_cells, worst_first
from ..records import PERCEIVED, SHOWN, shown_score, value_of
from ..trust_table import Report, trust_lines
from ..visual.colormap import NO_PATCH, score_colors
from .fragments import MEGABYTE, bar, css, text
from .size_curve import size_panel
from .viewer.markup import viewer_markup

Record = Mapping[str, Any]


def pair_card(number: int, record: Record, name: str) -> str:
    """The section of a record.

    Args:
        number: of the pair, from 1 on. name: short, for people.
    """
    path, judge = record["distorted"], judge_of(record)
    whole_path = "" if name == path else f'<p class="faint">{text(path)}</p>'
    parts = [
        f'<div class="title"><div><h3>{text(name)}</h3>{whole_path}</div>'
        f'<p class="score"><span class="faint">{judge.column}</span> {shown_score(record, judge.column)}'
        f"{_impairment(record)}</p></div>",
        f'<p class="bad">Too low: {missed}.</p>' if (missed := shortfall(record)) else "",
    ]
    if record["error"]:
        parts.append(f'<p class="bad">Not scored: {text(record["error"])}</p>')
    if record.get("explanation") and not record["error"]:
        parts.append(f'<p class="words">{text(record["explanation"])}</p>')
    if record["warnings"]:
        items = "".join(f"<li>{text(warning)}</li>" for warning in record["warnings"])
        parts.append(f'<ul class="warnings" aria-label="Warnings">{items}</ul>')
    if pictures := record.get("pictures"):
        parts.append(_views(name, pictures))
        parts.append(viewer_markup(record.get("viewer"), name))
    if record["FMQM"] is not None:
        close_ups = _close_ups(pictures["worst"], Judge(pictures["judge"])) if pictures else ""
        parts.append(
            f'<div class="panels"><div><h4>FMQM and its features</h4>{_numbers(record, SHOWN)}'
            f"{_attribution(record.get('attribution'))}"
            f"<h4>Perceived and its features</h4>{_numbers(record, PERCEIVED)}</div>{close_ups}</div>"
        )
    if sizes := size_panel(record.get("screen_size")):
        parts.append(f'<div class="curves">{sizes}</div>')
    if record["parts"]:
        parts.append(_parts(record["parts"]))
    if record["notes"]:
        items = "".join(f"<li>{text(note)}</li>" for note in record["notes"])
        parts.append(f"<details><summary>Notes</summary><ul>{items}</ul></details>")
    if record.get("trust"):
        parts.append(_trust(record["trust"]))
    return f'<article class="card" id="pair-{number}">{"".join(parts)}</article>\n'


def _impairment(record: Record) -> str:
    return f'<br><span class="faint">{escape(record["impairment"])}</span>' if record["impairment"] else ""


def _numbers(record: Record, columns: Iterable[str]) -> str:
    rows = "".join(
        f"<dt>{name.replace('_', ' ')}</dt><dd>{bar(value_of(record, name))}</dd>"
        f'<dd class="number">{shown_score(record, name)}</dd>'
        for name in columns
    )
    return f'<dl class="features">{rows}</dl>'


def _attribution(attribution: Record | None) -> str:
    if attribution is None:
        return ""
    return (
        f'<p class="note">{escape(attribution["phrase"][:1].upper() + attribution["phrase"][1:])}: '
        f"{score_text(attribution['geometry_loss'], places=3)} of FMQM with the geometry alone distorted, "
        f"{score_text(attribution['texture_loss'], places=3)} with the texture alone.</p>"
    )


def _views(name: str, pictures: Record) -> str:
    """The three pictures on one camera; the worst patches that can be seen there are marked on the last."""
    marks = "".join(
        f'<span class="mark" style="left:{100 * worst["at"][0]:.1f}%;top:{100 * worst["at"][1]:.1f}%">{rank}</span>'
        for rank, worst in enumerate(pictures["worst"], 1)
        if worst["at"] is not None
    )
    costs = [
        f"{triangles:,} triangles, {size / MEGABYTE:.1f} MB of textures"
        for triangles, size in zip(pictures["triangles"], pictures["texture_bytes"], strict=True)
    ]
    size, judge = tuple(pictures["size"]), Judge(pictures["judge"])
    figures = (
        (_image(pictures["reference"], f"Reference of {name}", size), "Reference", costs[0]),
        (_image(pictures["distorted"], f"Distorted: {name}", size), "Distorted", costs[1]),
        (_image(pictures["heat"], f"Reference colored by the {judge.column} of {name}", size) + marks, "Heat map", ""),
    )
    return '<div class="views">' + "".join(
        f'<figure><div class="picture">{picture}</div><figcaption><strong>{title}</strong> {caption}'
        f"{_legend(judge, pictures['has_gaps']) if title == 'Heat map' else ''}</figcaption></figure>"
        for picture, title, caption in figures
    ) + "</div>"  # fmt: skip


def _legend(judge: Judge, has_gaps: bool) -> str:
    stops = ",".join(css(color) for color in score_colors(np.linspace(0, 1, 9)))
    gap = f'<span class="gap" style="background:{css(np.array(NO_PATCH))}"></span>no patch' if has_gaps else ""
    ramp = f'<span class="ramp" style="background:linear-gradient(90deg,{stops})"></span>'
    return f'<span class="legend">{judge.column} 0{ramp}1 {gap}</span>'


def _close_ups(worst: Sequence[Record], judge: Judge) -> str:
    if not worst:
        return '<div><h4>Worst patches</h4><p class="note">None: every patch is like the reference\'s.</p></div>'
    figures = "".join(
        f'<figure><div class="picture two">{_image(each["reference"], f"Worst patch {rank}, reference")}'
        f"{_image(each['distorted'], f'Worst patch {rank}, distorted')}</div>"
        f"<figcaption><strong>{rank}</strong> {judge.column} {score_text(each[judge.column], places=3)}; "
        f"{escape(each['blame'])} {score_text(each['value'], places=3)}</figcaption></figure>"
        for rank, each in enumerate(worst, 1)
    )
    return (
        f"<div><h4>Worst patches: reference, distorted; their {judge.column} and lowest feature of perceived</h4>"
        f'<div class="close-ups">{figures}</div></div>'
    )


def _image(path: str, alt: str, size: tuple[int, int] | None = None) -> str:
    sized = "" if size is None else ' width="{}" height="{}"'.format(*(escape(str(side)) for side in size))
    return f'<img src="{escape(quote(path))}" alt="{escape(alt)}"{sized} loading="lazy">'


def _parts(parts: Sequence[Record]) -> str:
    """Each part's scores; those that are gone first."""
    rows = []
    for part in worst_first(parts):
        kind, name, *numbers, gone = part_cells(part)
        cells = "".join(f'<td class="number">{escape(number)}</td>' for number in numbers)
        note = f' <span class="bad">{gone}</span>' if gone else ""
        rows.append(f'<tr><th scope="row">{text(name)}{note}</th><td>{escape(kind)}</td>{cells}</tr>')
    return (
        f'<details><summary>Parts ({len(parts)})</summary><div class="scroll" tabindex="0" role="region" '
        'aria-label="Parts"><table><thead><tr><th scope="col">Part</th><th scope="col">Kind</th>'
        '<th scope="col">Triangles</th><th scope="col">Area</th><th scope="col">FMQM</th>'
        f'<th scope="col">Perceived</th></tr></thead><tbody>{"".join(rows)}</tbody></table></div></details>'
    )


def _trust(trust: Report) -> str:
    """The facts behind a score: those of both meshes side by side, then those of the pair."""
    rows = []
    for line in trust_lines(trust):
        first = f"<td>{text(line.values[0])}</td>" if len(line.values) > 1 else ""
        last = f"<td>{text(line.values[-1])}</td>" if first else f'<td colspan="2">{text(line.values[0])}</td>'
        rows.append(
            f'<tr><th scope="row">{text(line.label)}</th>{first}{last}<td class="faint">{text(line.unit)}</td></tr>'
        )
    return (
        '<details><summary>How far to trust this score</summary><div class="scroll" tabindex="0" role="region" '
        'aria-label="Trust report"><table><thead><tr><td></td><th scope="col">Reference</th>'
        f'<th scope="col">Distorted</th><th scope="col">Unit</th></tr></thead><tbody>{"".join(rows)}</tbody></table>'
        "</div></details>"
    )
