# SPDX-License-Identifier: GPL-3.0-or-later
"""The first screen: what came out, what to look at first, what to filter and sort by, and each reference's chain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from ..numbers import score_text
from ..visual.colormap import score_colors
from ..words import LABELS, LOD
from .chain_curve import Level, curve_svg
from .fragments import bar, count_text, css, image, name_text, sentence, text
from .overview import LEVELS, Chain, Line, Overview
from .size_curve import chain_sizes

SORTS = {
    "number": "Order Given", "name": "Name", "FMQM": "FMQM", "perceived": "Perceived", "triangles": "Triangles",
    "texture": "Texture",
}  # fmt: skip
SHOWS = {"lod": "LODs", "heat": "Heat Maps", "table": "Table"}
_OWN_RANGE = "Each heat map has a range of its own: it shows where that LOD is worst, not which LOD is."
# Filters besides LEVELS, by what a row's flags hold.
FLAGS = {"low": "Below Threshold", "warned": "With Warnings", "failed": "Not Scored"}


def masthead(overview: Overview) -> str:
    """The title, and the run in a sentence or two."""
    lines, chains = overview.lines, overview.chains
    of = name_text(chains[0].name) if len(chains) == 1 else count_text(len(chains), "original")
    scored = [line for line in lines if line.score is not None]
    said = []
    if scored:
        lowest = min(scored, key=lambda line: line.score or 0.0)
        label = LABELS[overview.judge.column]
        said.append(
            f"Lowest {label} <b class=number>{score_text(lowest.score)}</b>: {_link(lowest)}."
            if len(lines) > 1
            else f"{label} <b class=number>{score_text(lowest.score)}</b>."
        )
    low = sum(bool(line.missed) for line in lines)
    if low:
        said.append(f'<strong class="bad">{low:,} below the threshold.</strong>')
    if len(scored) < len(lines):
        said.append(f'<strong class="bad">{len(lines) - len(scored):,} not scored.</strong>')
    if scored:
        said.append('<span class="faint">1 is the same as the original.</span>')
    return (
        f'<header class="masthead"><p class="kicker">FMQM report</p><h1>{count_text(len(lines), LOD)} of {of}</h1>'
        f'<p class="lead">{" ".join(said)}</p></header>\n'
    )


def look_first(overview: Overview) -> str:
    """The pairs that are worst off, each with why."""
    first = overview.first
    if len(overview.lines) < 2:
        return ""
    if not first:
        return '<p class="note">Nothing stands out: no LOD can be told from its original.</p>\n'
    items = "".join(
        f'<li><a href="#pair-{line.number}" title="{escape(line.paths)}">{_thumbnail(line, "heat")}'
        f"<span><b>{name_text(line.name)}</b><span>{sentence(line.reason)}</span></span></a></li>"
        for line in first
    )
    return (
        f'<section aria-labelledby="first"><h2 id="first">Look at first</h2><ol class="first">{items}</ol></section>\n'
    )


def toolbar(overview: Overview) -> str:
    """Search, filters, the order, and what is shown; the page's script answers to them."""
    lines = overview.lines
    levels = Counter(line.level for line in lines)
    flags = Counter(flag for line in lines for flag in flags_of(line))
    chips = [("all", "All", len(lines))]
    chips += [(f"level-{row}", words.split(",")[0].capitalize(), levels[words]) for row, words in enumerate(LEVELS)]
    chips += [(name, label, flags[name]) for name, label in FLAGS.items()]
    buttons = "".join(
        f'<button type="button" data-filter="{name}" aria-pressed="{str(name == "all").lower()}">'
        f'{label} <span class="number">{count:,}</span></button>'
        for name, label, count in chips
        if count
    )
    orders = "".join(f'<option value="{name}">{label}</option>' for name, label in SORTS.items())
    shows = "".join(
        f'<button type="button" data-show="{name}" aria-pressed="{str(name == "lod").lower()}">{label}</button>'
        for name, label in SHOWS.items()
    )
    return (
        f'<div class="toolbar" role="search" aria-label="Pairs"{" hidden" if len(lines) == 1 else ""}>'
        '<label class="find"><span class="hidden-label">Search names and paths</span>'
        '<input type="search" placeholder="Search" autocomplete="off" spellcheck="false"></label>'
        '<p class="found faint number" role="status"></p>'
        f'<label class="order"><span>Sort by</span> <select>{orders}</select></label>'
        '<button type="button" class="turn" aria-pressed="false" title="Turn the order around">'
        '<span aria-hidden="true">↑</span><span class="hidden-label">Descending</span></button>'
        f'<div class="shows" role="group" aria-label="Show">{shows}</div>'
        f'<div class="chips" role="group" aria-label="Filter">{buttons}</div></div>\n'
    )


def flags_of(line: Line) -> list[str]:
    """Of FLAGS, those that are true of a pair."""
    truths = {"low": bool(line.missed), "warned": bool(line.warnings), "failed": line.error is not None}
    return [name for name, is_true in truths.items() if is_true]


def common_facts(overview: Overview) -> str:
    """What all scored pairs have in common, once."""
    parts = [
        f"<li>{sentence(said)}</li>" for group in ("warnings", "words", "notes") for said in overview.common[group]
    ]
    if overview.least:
        least = " and ".join(
            f"{LABELS.get(name, name.replace('_', ' '))} {value:g}" for name, value in overview.least.items()
        )
        parts.insert(0, f"<li>Threshold: at least {least}.</li>")
    if not parts:
        return ""
    return f'<section class="common"><h2>True of every pair</h2><ul>{"".join(parts)}</ul></section>\n'


def chains(overview: Overview) -> Iterator[str]:
    """Each reference beside its levels, with the curves."""
    if len(overview.lines) > 1:
        yield f'<p class="of-heat note">{_OWN_RANGE}</p>\n'
    yield '<div class="chains">\n'
    for number, chain in enumerate(overview.chains, 1):
        yield _chain(number, chain, overview)
    yield "</div>\n"


def _chain(number: int, chain: Chain, overview: Overview) -> str:
    tiles = "".join(_tile(line, chain, overview) for line in chain.lines)
    picture = image(chain.thumbnail, "") if chain.thumbnail else '<span class="none">no picture</span>'
    costs = _costs(chain.triangles, None, chain.texture_mb, chain.texture_side)
    original = (
        f'<div class="original" title="{escape(chain.path)}"><div class="thumb">{picture}</div>'
        f'<h2 id="chain-{number}">{name_text(chain.name)}</h2><p class="faint">Original<br>{costs}</p></div>'
    )
    curves = _curves(chain, overview)
    return (
        f'<section class="chain card{" has-curves" if curves else ""}" aria-labelledby="chain-{number}">'
        f'<div class="strip">{original}<ol class="levels">{tiles}</ol>{curves}</div></section>\n'
    )


def _tile(line: Line, chain: Chain, overview: Overview) -> str:
    name = f'<span class="name">{name_text(line.name)}</span>'
    kinds = {"distorted": "of-lod", "heat": "of-heat", "reference": "of-original"}
    pictures = "".join(_thumbnail(line, kind, shown) for kind, shown in kinds.items())
    link = (
        f'<a class="tile" href="#pair-{line.number}" aria-expanded="false" title="{escape(line.paths)}">'
        f'<span class="thumb">{pictures}</span>{name}</a>'
    )
    if line.error is not None:
        return (
            f'<li class="level" data-number="{line.number}">{link}<p class="bad short">{sentence(line.error)}</p></li>'
        )
    scores = "".join(
        f'<dt>{LABELS[column]}</dt><dd>{bar(value)}</dd><dd class="number">{score_text(value)}</dd>'
        for column, value in (("FMQM", line.fmqm), ("perceived", line.perceived))
    )
    badges = f'<p class="bad">{text(line.missed)}</p>' if line.missed else ""
    if line.warnings:
        badges += f'<p class="warned">{count_text(line.warnings, "warning")}</p>'
    return (
        f'<li class="level" data-number="{line.number}">{link}<dl class="scores-short">{scores}</dl>'
        f'<p class="words-level">{level_mark(line.level)}</p>'
        f'<p class="faint">{_costs(line.triangles, chain.triangles, line.texture_mb, line.texture_side)}</p>'
        f"{badges}</li>"
    )


def level_mark(level: str | None) -> str:
    """A level in words, with a dot whose color goes from good to bad."""
    if level is None:
        return ""
    color = css(score_colors(np.array([1 - LEVELS.index(level) / (len(LEVELS) - 1)]))[0])
    return f'<span class="dot" style="background:{color}"></span>{escape(level)}'


def _costs(triangles: int | None, whole: int | None, megabytes: float | None, side: int) -> str:
    share = f" ({100 * triangles / whole:.3g}\u00a0%)" if triangles is not None and whole else ""
    lines = [] if triangles is None else [f"{triangles:,} triangles{share}"]
    if megabytes:
        pixels = f"{side:,} px, " if side else ""
        size = f"{megabytes:.3g} MB" if megabytes >= 1 else f"{1024 * megabytes:.3g} KB"
        lines.append(f"{pixels}{size} of textures")
    elif megabytes == 0:
        lines.append("no textures")
    return f'<span class="number">{"<br>".join(lines)}</span>'


def _curves(chain: Chain, overview: Overview) -> str:
    """The judge's score over triangles and over texture memory, and the sizes on screen, where several were compared
    with one reference."""
    known = [line for line in chain.lines if line.score is not None and line.triangles is not None]
    drawn = _sizes(chain)
    if len(known) >= 2 and chain.triangles is not None:
        label = LABELS[overview.judge.column]
        drawn = f"{_curve(chain, known, 'triangles', label)}{_curve(chain, known, 'texture MB', label)}{drawn}"
    return f'<div class="curves">{drawn}</div>' if drawn else ""


def _sizes(chain: Chain) -> str:
    """From which size on screen on each level may be shown; "" for fewer than two."""
    sized = sorted(chain.lines, key=lambda line: (-(line.triangles or 0), -(line.texture_mb or 0)))
    levels = [(line.name, line.sizes) for line in sized if line.sizes is not None]
    return chain_sizes(levels) if len(levels) > 1 else ""


def _curve(chain: Chain, lines: Sequence[Line], cost: str, label: str) -> str:
    def of(thing: Line | Chain) -> float:
        found = thing.triangles if cost == "triangles" else thing.texture_mb
        return 0.0 if found is None else float(found)

    own, costs = of(chain), [of(line) for line in lines]
    different = {own, *costs}
    if len(different) == 1:
        return f'<p class="note">All levels have the same: {own:,.4g} {cost}.</p>'
    if min(different) <= 0:
        return f'<p class="note">Not every level has a texture: there is no curve against {cost}.</p>'
    levels = [Level(line.name, value, line.score or 0.0) for line, value in zip(lines, costs, strict=True)]
    drawn = curve_svg([Level(chain.name, own, 1.0, is_reference=True), *levels], cost, label)
    return f"<figure><figcaption>{label} against {cost}</figcaption>{drawn}</figure>"


def _thumbnail(line: Line, kind: str, name: str = "") -> str:
    if line.thumbnails is None:
        why = "not scored" if line.error is not None else "no picture"
        return f'<span class="none {name}">{why}</span>'
    return image(line.thumbnails[kind], "", name)


def _link(line: Line) -> str:
    return f'<a href="#pair-{line.number}" title="{escape(line.paths)}">{name_text(line.name)}</a>'
