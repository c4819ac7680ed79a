# SPDX-License-Identifier: GPL-3.0-or-later
"""The page that people look at: every pair's score, pictures and warnings in one HTML file with pictures beside it.

It needs no network and no server. Names come from strangers' files: every text goes through html.escape.
"""

from __future__ import annotations

import base64
import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from ...metric.geometry import Floats
from ..atomic_files import write_parts
from ..records import SHOWN, below
from ..trust_table import Report, trust_lines
from ..visual.colormap import NO_PATCH, score_colors
from .chain_curve import Level, curve_svg

PAGE = "index.html"
MEGABYTE = 2**20
MISSING = "–"
# Only what lies beside the page is loaded, and only its own script runs, whatever a name might hold.
POLICY = """default-src 'none'; base-uri 'none'; form-action 'none'; img-src 'self' file: data:;
style-src 'unsafe-inline'; script-src 'sha256-{}'"""

_TABLE = (
    '<section class="card scroll" tabindex="0" role="region" aria-label="All pairs"><table class="scores"><thead><tr>'
    + "".join(
        f'<th scope="col"><button type="button">{name}</button></th>'
        for name in ("Pair", *SHOWN, "Triangles", "Texture MB")
    )
    + "</tr></thead><tbody>"
)

Record = Mapping[str, Any]


def write_page(
    folder: str, records: Iterable[Record], settings: Mapping[str, Any], versions: Mapping[str, str]
) -> None:
    """Writes index.html into the folder of a report.

    Args:
        records: the pairs as JSON has them, in their order; gone through more than once. Besides the scores each
            may hold "trust", "explanation", "attribution", and "pictures", which is what
            write_pair_pictures returned.
        settings, versions: as JSON has them.

    Raises:
        FileError: it cannot be written; what stood there is left as it was.
    """
    write_parts(os.path.join(folder, PAGE), page_parts(records, settings, versions))


def page_parts(records: Iterable[Record], settings: Mapping[str, Any], versions: Mapping[str, str]) -> Iterator[str]:
    """The text of the page; the arguments are those of write_page."""
    beside = Path(__file__).parent
    script = (beside / "page.js").read_text(encoding="utf-8")  # all that stands between the tags, as the digest wants
    policy = POLICY.format(base64.b64encode(hashlib.sha256(script.encode()).digest()).decode())
    folder = _folder_to_leave_out(records)
    overview = _overview(records, folder)
    yield f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<link rel="icon" href="data:,">
<title>FMQM report</title>
<style>
{(beside / "page.css").read_text(encoding="utf-8")}</style>
</head>
<body>
<header>
<h1>FMQM report</h1>
<p class="faint">{_summary(overview)}</p>
</header>
<main>
{_TABLE}
"""
    for number, record in enumerate(records, 1):
        yield _row(number, record, folder)
    yield "</tbody></table></section>\n"
    reference = None
    for number, record in enumerate(records, 1):
        if record["reference"] != reference:
            reference = record["reference"]
            yield f"<h2>{_text(reference)}</h2>\n{_curves(reference, overview.chains.pop(reference, []))}"
        yield _pair(number, record, folder)
    yield f"""{_settings(settings, versions)}
</main>
<script>{script}</script>
</body>
</html>
"""


@dataclass(frozen=True)
class _Cost:
    """A scored pair's points on the curves; triangles and texture_mb are those of reference and distorted."""

    name: str
    score: float
    triangles: tuple[float, float]
    texture_mb: tuple[float, float]


@dataclass
class _Overview:
    """What is known of all pairs together.

    Attributes:
        pairs: how many. scored: of these. lowest: score and name. chains: the scored pairs of each reference.
    """

    pairs: int = 0
    scored: int = 0
    lowest: tuple[float, str] = (1.0, "")
    chains: dict[str, list[_Cost]] = field(default_factory=dict)


def _overview(records: Iterable[Record], folder: str | None) -> _Overview:
    all_pairs = _Overview()
    for record in records:
        chain = all_pairs.chains.setdefault(record["reference"], [])
        all_pairs.pairs += 1
        score, name = record["FMQM"], _name(record, folder)
        if score is None:
            continue
        all_pairs.scored += 1
        if score < all_pairs.lowest[0]:
            all_pairs.lowest = (score, name)
        pictures = record.get("pictures")
        if pictures:
            own, size = (count / MEGABYTE for count in pictures["texture_bytes"])
            chain.append(_Cost(name, score, tuple(pictures["triangles"]), (own, size)))
    return all_pairs


def _summary(overview: _Overview) -> str:
    said = f"{_count(overview.pairs, 'pair')}, {_count(len(overview.chains), 'reference')}."
    score, name = overview.lowest
    if name:
        said += f" Lowest FMQM: {score:.4f}, {_text(name)}."
    if overview.scored < overview.pairs:
        said += f' <strong class="bad">{overview.pairs - overview.scored} not scored.</strong>'
    return said + " 1 is the same as the reference; compare scores only at equal settings."


def _row(number: int, record: Record, folder: str | None) -> str:
    note = f'<span class="faint">of {_text(_base_name(record["reference"]))}</span>'
    if record["error"]:
        note = '<span class="bad">not scored</span>'
    elif below(record):
        note = f'<span class="bad">below {record["fail_under"]:g}</span>'
    name = _name(record, folder)
    cells = [f'<th scope="row" data-value="{escape(name)}"><a href="#pair-{number}">{_text(name)}</a><br>{note}</th>']
    cells += [_cell(record[column], _score(record, column) + _bar(record[column])) for column in SHOWN]
    pictures = record.get("pictures")
    triangles, size = (pictures["triangles"][1], pictures["texture_bytes"][1]) if pictures else (None, None)
    cells.append(_cell(triangles, MISSING if triangles is None else f"{triangles:,}"))
    cells.append(_cell(size, MISSING if size is None else f"{size / MEGABYTE:.1f}"))
    return f"<tr>{''.join(cells)}</tr>\n"


def _cell(value: float | None, shown: str) -> str:
    """A number of the table, with what it is sorted by."""
    return f'<td class="number" data-value="{"" if value is None else escape(str(value))}">{shown}</td>'


def _score(record: Record, column: str) -> str:
    value = record[column]
    if value is None:
        return MISSING
    stderr = record["stderr"]
    return f"{value:.4f}" if stderr is None else f"{value:.4f} ± {stderr[column]:.4f}"


def _bar(value: float | None) -> str:
    """Its length and its color say the value, which stands beside it as text."""
    if value is None:
        return ""
    color = _css(score_colors(np.array([value]))[0])
    return f'<span class="bar"><span style="width:{100 * value:.1f}%;background:{color}"></span></span>'


def _curves(reference: str, chain: Sequence[_Cost]) -> str:
    """FMQM over triangles and over texture memory, where several were compared with one reference."""
    if len(chain) < 2:
        return ""
    name = _base_name(reference)
    triangles = _curve(name, chain, [each.triangles for each in chain], "triangles")
    texture = _curve(name, chain, [each.texture_mb for each in chain], "texture MB")
    return f'<div class="card curves">{triangles}{texture}</div>\n'


def _curve(reference: str, chain: Sequence[_Cost], costs: Sequence[tuple[float, float]], of: str) -> str:
    """The costs are those of reference and distorted, for each pair of the chain."""
    own = costs[0][0]
    different = {own, *(cost for _, cost in costs)}
    if len(different) == 1:
        drawn = f'<p class="note">All levels have the same: {own:,.4g} {of}.</p>'
    elif min(different) <= 0:
        drawn = f'<p class="note">Not every level has a texture: there is no curve against {of}.</p>'
    else:
        levels = [Level(each.name, cost, each.score) for each, (_, cost) in zip(chain, costs, strict=True)]
        drawn = curve_svg([Level(reference, own, 1.0, is_reference=True), *levels], of)
    return f"<div><h4>FMQM against {of}</h4>{drawn}</div>"


def _pair(number: int, record: Record, folder: str | None) -> str:
    name, path = _name(record, folder), record["distorted"]
    whole_path = "" if name == path else f'<p class="faint">{_text(path)}</p>'
    parts = [
        f'<div class="title"><div><h3>{_text(name)}</h3>{whole_path}</div>'
        f'<p class="score"><span class="faint">FMQM</span> {_score(record, "FMQM")}</p></div>',
        f'<p class="bad">Below its threshold, {record["fail_under"]:g}.</p>' if below(record) else "",
    ]
    if record["error"]:
        parts.append(f'<p class="bad">Not scored: {_text(record["error"])}</p>')
    if record.get("explanation") and not record["error"]:
        parts.append(f'<p class="words">{_text(record["explanation"])}</p>')
    if record["warnings"]:
        items = "".join(f"<li>{_text(warning)}</li>" for warning in record["warnings"])
        parts.append(f'<ul class="warnings" aria-label="Warnings">{items}</ul>')
    if pictures := record.get("pictures"):
        parts.append(_views(name, pictures))
    if record["FMQM"] is not None:
        features = "".join(
            f'<dt>{name}</dt><dd>{_bar(record[name])}</dd><dd class="number">{_score(record, name)}</dd>'
            for name in SHOWN
            if name != "FMQM"
        )
        close_ups = _close_ups(pictures["worst"]) if pictures else ""
        parts.append(
            f'<div class="panels"><div><h4>Features</h4><dl class="features">{features}</dl>'
            f"{_attribution(record.get('attribution'))}</div>{close_ups}</div>"
        )
    if record.get("trust"):
        parts.append(_trust(record["trust"]))
    return f'<article class="card" id="pair-{number}">{"".join(parts)}</article>\n'


def _attribution(attribution: Record | None) -> str:
    if attribution is None:
        return ""
    return (
        f'<p class="note">{escape(attribution["phrase"][:1].upper() + attribution["phrase"][1:])}: '
        f"{attribution['geometry_loss']:.3f} of FMQM with the geometry alone distorted, "
        f"{attribution['texture_loss']:.3f} with the texture alone.</p>"
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
    size = tuple(pictures["size"])
    figures = (
        (_image(pictures["reference"], f"Reference of {name}", size), "Reference", costs[0]),
        (_image(pictures["distorted"], f"Distorted: {name}", size), "Distorted", costs[1]),
        (_image(pictures["heat"], f"Reference colored by the FMQM of {name}", size) + marks, "Heat map", ""),
    )
    return '<div class="views">' + "".join(
        f'<figure><div class="picture">{picture}</div><figcaption><strong>{title}</strong> {caption}'
        f"{_legend(pictures['has_gaps']) if title == 'Heat map' else ''}</figcaption></figure>"
        for picture, title, caption in figures
    ) + "</div>"  # fmt: skip


def _legend(has_gaps: bool) -> str:
    stops = ",".join(_css(color) for color in score_colors(np.linspace(0, 1, 9)))
    gap = f'<span class="gap" style="background:{_css(np.array(NO_PATCH))}"></span>no patch' if has_gaps else ""
    ramp = f'<span class="ramp" style="background:linear-gradient(90deg,{stops})"></span>'
    return f'<span class="legend">FMQM 0{ramp}1 {gap}</span>'


def _close_ups(worst: Sequence[Record]) -> str:
    if not worst:
        return '<div><h4>Worst patches</h4><p class="note">None: every patch is like the reference\'s.</p></div>'
    figures = "".join(
        f'<figure><div class="picture two">{_image(each["reference"], f"Worst patch {rank}, reference")}'
        f"{_image(each['distorted'], f'Worst patch {rank}, distorted')}</div>"
        f"<figcaption><strong>{rank}</strong> FMQM {each['FMQM']:.3f}; {escape(each['blame'])} {each['value']:.3f}"
        "</figcaption></figure>"
        for rank, each in enumerate(worst, 1)
    )
    return (
        "<div><h4>Worst patches: reference, distorted; their FMQM and what lowers it most</h4>"
        f'<div class="close-ups">{figures}</div></div>'
    )


def _image(path: str, alt: str, size: tuple[int, int] | None = None) -> str:
    sized = "" if size is None else ' width="{}" height="{}"'.format(*(escape(str(side)) for side in size))
    return f'<img src="{escape(quote(path))}" alt="{escape(alt)}"{sized} loading="lazy">'


def _trust(trust: Report) -> str:
    """The facts behind a score: those of both meshes side by side, then those of the pair."""
    rows = []
    for line in trust_lines(trust):
        first = f"<td>{_text(line.values[0])}</td>" if len(line.values) > 1 else ""
        last = f"<td>{_text(line.values[-1])}</td>" if first else f'<td colspan="2">{_text(line.values[0])}</td>'
        rows.append(
            f'<tr><th scope="row">{_text(line.label)}</th>{first}{last}<td class="faint">{_text(line.unit)}</td></tr>'
        )
    return (
        '<details><summary>How far to trust this score</summary><div class="scroll" tabindex="0" role="region" '
        'aria-label="Trust report"><table><thead><tr><td></td><th scope="col">Reference</th>'
        f'<th scope="col">Distorted</th><th scope="col">Unit</th></tr></thead><tbody>{"".join(rows)}</tbody></table>'
        "</div></details>"
    )


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, int):
        return f"{value:,}"
    if isinstance(value, Mapping):
        return "<br>".join(f"{_text(name)}: {_value(part)}" for name, part in value.items()) or "none"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(_value(part) for part in value) or "none"
    return _text("none" if value is None else value)


def _settings(settings: Mapping[str, Any], versions: Mapping[str, str]) -> str:
    rows = "".join(f"<div><dt>{_words(name)}</dt><dd>{_value(value)}</dd></div>" for name, value in settings.items())
    made = ", ".join(f"{_words(name)} {_text(value)}" for name, value in versions.items())
    return (
        f'<section><h2>Settings</h2><dl class="card settings">{rows}</dl><p class="note">{made}. Texture MB: '
        "the images that colors are read from, uncompressed, four bytes a pixel.</p></section>"
    )


def _folder_to_leave_out(records: Iterable[Record]) -> str | None:
    """Of the names that are paths, where their last parts do not tell them apart: the folder that all are in."""
    names: set[str] = set()
    folder = None
    alike = False
    for path in (record["distorted"] for record in records if record["id"] == record["distorted"]):
        name, where = _base_name(path), os.path.dirname(path)
        alike = alike or name in names
        names.add(name)
        try:
            folder = where if folder is None else os.path.commonpath([folder, where])
        except ValueError:  # relative and absolute ones, or two drives
            folder = ""
    return folder if alike else None


def _name(record: Record, folder: str | None) -> str:
    """Short: the pair's id, or where that is the path of what was scored, the last parts of it."""
    path = str(record["distorted"])
    if record["id"] != path:
        return str(record["id"])
    if folder is None:
        return _base_name(path)
    return os.path.relpath(path, folder) if folder else path


def _base_name(path: str) -> str:
    return Path(path).name or path


def _text(text: object) -> str:
    """Text from anywhere as HTML; it cannot turn the direction of what stands around it."""
    return f"<bdi>{escape(str(text))}</bdi>"


def _words(name: str) -> str:
    return escape(name.replace("_", " "))


def _count(number: int, of: str) -> str:
    return f"{number:,} {of}" if number == 1 else f"{number:,} {of}s"


def _css(color: Floats) -> str:
    return "#" + "".join(f"{channel:02x}" for channel in np.rint(color * 255).astype(int).tolist())
