# SPDX-License-Identifier: GPL-3.0-or-later
"""A pair's card: its scores, words and pictures, what is worst by name, and how far to trust it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from html import escape
from typing import Any

from ...comparison.judge import Judge
from ..criteria import judge_of, shortfall
from ..explain import sentences
from ..numbers import score_text
from ..parts_table import part_cells, worst_first
from ..records import PERCEIVED, SHOWN, shown_score, value_of
from ..trust_table import Report, trust_lines
from ..words import LABELS, LOD, ORIGINAL
from .first_screen import level_mark
from .fragments import MEGABYTE, bar, folded, name_text, scrolled, sentence, text
from .histogram import histogram_svg
from .overview import Overview
from .size_curve import size_panel
from .stills import close_ups, views
from .viewer.markup import viewer_markup

Record = Mapping[str, Any]

_NAMED = ("object", "material")  # kinds of parts whose names an artist knows
_ALIKE = 0.01  # parts whose perceived differ by less than this are as good as each other


def pair_card(number: int, record: Record, overview: Overview) -> str:
    """The card of a record.

    Args:
        number: of the pair, from 1 on.
    """
    short, judge = overview.short(record), judge_of(record)
    name, pictures = short["distorted"], record.get("pictures")
    parts = [_head(number, record, name, short["reference"])]
    if missed := shortfall(record):
        parts.append(f'<p class="bad">Too low: {missed}.</p>')
    if record["error"]:
        parts.append(f'<p class="bad">Not scored: {sentence(record["error"])}</p>')
    else:
        words = _rest(sentences(short), overview.common["words"])
        parts.append(f'<p class="words">{sentence(" ".join(words))}</p>')
    if warnings := _rest(record["warnings"], overview.common["warnings"]):
        items = "".join(f"<li>{sentence(warning)}</li>" for warning in warnings)
        parts.append(f'<ul class="warnings" aria-label="Warnings">{items}</ul>')
    parts.append(viewer_markup(record.get("viewer"), name))
    if pictures:
        parts.append(views(name, pictures))
        parts.append(close_ups(pictures["worst"], judge))
    if record["FMQM"] is not None:
        parts.append(_panels(record, pictures, judge))
    if sizes := size_panel(record.get("screen_size")):
        parts.append(f'<div class="curves sizes">{sizes}</div>')
    if record["parts"]:
        parts.append(_parts(record["parts"]))
    if notes := _rest(record["notes"], overview.common["notes"]):
        parts.append(folded("Notes", f"<ul>{''.join(f'<li>{sentence(note)}</li>' for note in notes)}</ul>"))
    if record.get("trust"):
        parts.append(_trust(record["trust"]))
    return f'<article class="card pair" id="pair-{number}" aria-labelledby="name-{number}">{"".join(parts)}</article>\n'


def _rest(said: Iterable[str], common: Collection[str]) -> list[str]:
    """What is not said for all pairs together."""
    return [each for each in said if each not in common]


def _head(number: int, record: Record, name: str, reference: str) -> str:
    big = "".join(
        f'<div><dt>{LABELS[column]}</dt><dd class="number">{shown_score(record, column)}</dd></div>'
        for column in ("FMQM", "perceived")
        if value_of(record, column) is not None
    )
    against = f'<p class="faint">against <span title="{escape(record["reference"])}">{name_text(reference)}</span></p>'
    return (
        f'<div class="title"><div><h3 id="name-{number}" tabindex="-1" title="{escape(record["distorted"])}">'
        f'{name_text(name)}</h3>{against}<p class="words-level">{level_mark(record["impairment"])}</p></div>'
        f'<dl class="scores-big">{big}</dl>'
        '<button type="button" class="close" aria-label="Close" title="Close">×</button></div>'
    )


def _panels(record: Record, pictures: Record | None, judge: Judge) -> str:
    """The features of both readings, the histogram of the patches, and what both meshes cost."""
    blame = _attribution(record.get("attribution"))
    panels = [
        f"<section><h4>FMQM and its features</h4>{_numbers(record, SHOWN)}{blame}</section>",
        f"<section><h4>Perceived and its features</h4>{_numbers(record, PERCEIVED)}</section>",
    ]
    if pictures:
        mean, label = value_of(record, judge.column) or 0.0, LABELS[judge.column]
        low, high = pictures["range"]
        drawn = histogram_svg(pictures["histogram"], low, high, mean, label)
        panels.append(f"<section><h4>{label} of the patches</h4>{drawn}{_costs(pictures)}</section>")
    return f'<div class="panels">{"".join(panels)}</div>'


def _costs(pictures: Record) -> str:
    rows = "".join(
        f'<tr><th scope="row">{side}</th><td class="number">{triangles:,}</td>'
        f'<td class="number">{size / MEGABYTE:.1f}</td></tr>'
        for side, triangles, size in zip((ORIGINAL, LOD), pictures["triangles"], pictures["texture_bytes"], strict=True)
    )
    return (
        '<table class="costs"><thead><tr><td></td><th scope="col" class="number">Triangles</th>'
        f'<th scope="col" class="number">Texture MB</th></tr></thead><tbody>{rows}</tbody></table>'
    )


def _numbers(record: Record, columns: Iterable[str]) -> str:
    rows = "".join(
        f"<dt>{LABELS[name]}</dt><dd>{bar(value_of(record, name))}</dd>"
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


def _parts(parts: Sequence[Record]) -> str:
    """What is worst by name, and each part's scores; those that are gone first."""
    rows = []
    for part in worst_first(parts):
        kind, name, *numbers, gone = part_cells(part)
        cells = "".join(f'<td class="number">{escape(number)}</td>' for number in numbers)
        note = f' <span class="bad">{gone}</span>' if gone else ""
        rows.append(f'<tr><th scope="row">{text(name)}{note}</th><td>{escape(kind)}</td>{cells}</tr>')
    heads = "".join(
        f'<th scope="col" class="number">{name}</th>' for name in ("Triangles", "Area", "FMQM", "Perceived")
    )
    table = (
        f'<table><thead><tr><th scope="col">Part</th><th scope="col">Kind</th>{heads}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table>"
    )
    worst = _worst_named(parts)
    said = f'<p class="note">Worst: {worst}.</p>' if worst else ""
    return f"{said}{folded(f'Parts ({len(parts)})', scrolled('Parts', table))}"


def _worst_named(parts: Sequence[Record]) -> str:
    """The object and the material that are worst, where one is worse than others of its kind."""
    found = []
    for kind in _NAMED:
        alike = [part for part in parts if part["kind"] == kind and part["perceived"] is not None]
        values = sorted(part["perceived"] for part in alike)
        if len(values) > 1 and values[-1] - values[0] >= _ALIKE:
            worst = min(alike, key=lambda part: part["perceived"])
            found.append(f"{kind} {text(worst['name'])} ({LABELS['perceived']} {score_text(worst['perceived'])})")
    return ", ".join(found)


def _trust(trust: Report) -> str:
    """The facts behind a score: those of both meshes side by side, then those of the pair."""
    rows = []
    for line in trust_lines(trust):
        first = f"<td>{text(line.values[0])}</td>" if len(line.values) > 1 else ""
        last = f"<td>{text(line.values[-1])}</td>" if first else f'<td colspan="2">{text(line.values[0])}</td>'
        rows.append(
            f'<tr><th scope="row">{text(line.label)}</th>{first}{last}<td class="faint">{text(line.unit)}</td></tr>'
        )
    table = (
        f'<table><thead><tr><td></td><th scope="col">{ORIGINAL}</th><th scope="col">{LOD}</th>'
        f'<th scope="col">Unit</th></tr></thead><tbody>{"".join(rows)}</tbody></table>'
    )
    return folded("How far to trust this score", scrolled("Trust report", table))
