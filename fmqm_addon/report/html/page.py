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

from ...comparison.judge import Judge
from ..atomic_files import write_parts
from ..criteria import judge_of, shortfall
from ..explain import footnote
from ..numbers import MISSING, score_text, value_text
from ..records import TABLE, shown_score, value_of
from .chain_curve import Level, curve_svg
from .fragments import MEGABYTE, bar, text
from .pair_card import pair_card
from .viewer.files import write_programs
from .viewer.markup import viewer_script, viewer_style

PAGE = "index.html"
# Only what lies beside the page is loaded; only its own script runs, and what that loads, whatever a name might hold.
POLICY = """default-src 'none'; base-uri 'none'; form-action 'none'; img-src 'self' file: data:;
style-src 'unsafe-inline'; script-src 'sha256-{}' 'strict-dynamic'"""

_TABLE = (
    '<section class="card scroll" tabindex="0" role="region" aria-label="All pairs"><table class="scores"><thead><tr>'
    + "".join(
        f'<th scope="col"><button type="button">{name}</button></th>'
        for name in ("Pair", *TABLE, "Triangles", "Texture MB")
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
    if any(record.get("viewer") for record in records):
        write_programs(folder)
    write_parts(os.path.join(folder, PAGE), page_parts(records, settings, versions))


def page_parts(records: Iterable[Record], settings: Mapping[str, Any], versions: Mapping[str, str]) -> Iterator[str]:
    """The text of the page; the arguments are those of write_page."""
    beside = Path(__file__).parent
    # All that stands between the tags, as the digest wants.
    script = (beside / "page.js").read_text(encoding="utf-8") + viewer_script()
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
{(beside / "page.css").read_text(encoding="utf-8")}{viewer_style()}</style>
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
            chain = overview.chains.pop(reference, [])
            yield f"<h2>{text(reference)}</h2>\n{_curves(reference, chain, overview.judge)}"
        yield pair_card(number, record, _name(record, folder))
    yield f"""{_settings(settings, versions)}<p class="note">{escape(footnote(records))}</p>
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
        judge: of the first pair; scores are its. pairs: how many. scored: of these. lowest: score and name.
        chains: the scored pairs of each reference.
    """

    judge: Judge = Judge.FMQM
    pairs: int = 0
    scored: int = 0
    lowest: tuple[float, str] = (1.0, "")
    chains: dict[str, list[_Cost]] = field(default_factory=dict)


def _overview(records: Iterable[Record], folder: str | None) -> _Overview:
    all_pairs = _Overview()
    for record in records:
        chain = all_pairs.chains.setdefault(record["reference"], [])
        if not all_pairs.pairs:
            all_pairs.judge = judge_of(record)
        all_pairs.pairs += 1
        value, name = value_of(record, all_pairs.judge.column), _name(record, folder)
        if value is None:
            continue
        all_pairs.scored += 1
        if value < all_pairs.lowest[0]:
            all_pairs.lowest = (value, name)
        pictures = record.get("pictures")
        if pictures:
            own, size = (count / MEGABYTE for count in pictures["texture_bytes"])
            chain.append(_Cost(name, value, tuple(pictures["triangles"]), (own, size)))
    return all_pairs


def _summary(overview: _Overview) -> str:
    said = f"{_count(overview.pairs, 'pair')}, {_count(len(overview.chains), 'reference')}."
    lowest, name = overview.lowest
    if name:
        said += f" Lowest {overview.judge.column}: {score_text(lowest)}, {text(name)}."
    if overview.scored < overview.pairs:
        said += f' <strong class="bad">{overview.pairs - overview.scored} not scored.</strong>'
    return said + " 1 is the same as the reference; compare scores only at equal settings."


def _row(number: int, record: Record, folder: str | None) -> str:
    note = f'<span class="faint">of {text(_base_name(record["reference"]))}</span>'
    if record["error"]:
        note = '<span class="bad">not scored</span>'
    elif missed := shortfall(record):
        note = f'<span class="bad">{missed}</span>'
    name = _name(record, folder)
    cells = [f'<th scope="row" data-value="{escape(name)}"><a href="#pair-{number}">{text(name)}</a><br>{note}</th>']
    cells += [
        _cell(value_of(record, column), shown_score(record, column) + bar(value_of(record, column))) for column in TABLE
    ]
    pictures = record.get("pictures")
    triangles, size = (pictures["triangles"][1], pictures["texture_bytes"][1]) if pictures else (None, None)
    cells.append(_cell(triangles, MISSING if triangles is None else f"{triangles:,}"))
    cells.append(_cell(size, MISSING if size is None else f"{size / MEGABYTE:.1f}"))
    return f"<tr>{''.join(cells)}</tr>\n"


def _cell(value: float | None, shown: str) -> str:
    """A number of the table, with what it is sorted by."""
    return f'<td class="number" data-value="{"" if value is None else escape(str(value))}">{shown}</td>'


def _curves(reference: str, chain: Sequence[_Cost], judge: Judge) -> str:
    """The judge's score over triangles and over texture memory, where several were compared with one reference."""
    if len(chain) < 2:
        return ""
    name = _base_name(reference)
    triangles = _curve(name, chain, [each.triangles for each in chain], "triangles", judge)
    texture = _curve(name, chain, [each.texture_mb for each in chain], "texture MB", judge)
    return f'<div class="card curves">{triangles}{texture}</div>\n'


def _curve(reference: str, chain: Sequence[_Cost], costs: Sequence[tuple[float, float]], of: str, judge: Judge) -> str:
    """The costs are those of reference and distorted, for each pair of the chain."""
    own = costs[0][0]
    different = {own, *(cost for _, cost in costs)}
    if len(different) == 1:
        drawn = f'<p class="note">All levels have the same: {own:,.4g} {of}.</p>'
    elif min(different) <= 0:
        drawn = f'<p class="note">Not every level has a texture: there is no curve against {of}.</p>'
    else:
        levels = [Level(each.name, cost, each.score) for each, (_, cost) in zip(chain, costs, strict=True)]
        drawn = curve_svg([Level(reference, own, 1.0, is_reference=True), *levels], of, judge.column)
    return f"<div><h4>{judge.column} against {of}</h4>{drawn}</div>"


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "<br>".join(f"{text(name)}: {text(value_text(part))}" for name, part in value.items()) or "none"
    return text(value_text(value))


def _settings(settings: Mapping[str, Any], versions: Mapping[str, str]) -> str:
    rows = "".join(f"<div><dt>{_words(name)}</dt><dd>{_value(value)}</dd></div>" for name, value in settings.items())
    made = ", ".join(f"{_words(name)} {text(value)}" for name, value in versions.items())
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


def _words(name: str) -> str:
    return escape(name.replace("_", " "))


def _count(number: int, of: str) -> str:
    return f"{number:,} {of}" if number == 1 else f"{number:,} {of}s"
