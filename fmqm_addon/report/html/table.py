# SPDX-License-Identifier: GPL-3.0-or-later
"""All pairs in one table, which is sorted by its heads; the page's script filters and sorts the tiles by it, too."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from html import escape
from typing import Any

from ..numbers import MISSING
from ..records import TABLE, shown_score, value_of
from ..words import LABELS
from .first_screen import flags_of, level_mark
from .fragments import bar, name_text, text
from .overview import LEVELS, Line, Overview, base_name

# Columns by the key that they are sorted by.
_COLUMNS = {"name": "LOD", **{name: LABELS[name] for name in TABLE}, "triangles": "Triangles", "texture": "Texture MB"}


def table(records: Iterable[Mapping[str, Any]], overview: Overview) -> Iterator[str]:
    """A row for each pair."""
    heads = "".join(
        f'<th scope="col" data-sort="{key}"><button type="button">{label}</button></th>'
        for key, label in _COLUMNS.items()
    )
    yield (
        '<section class="table card scroll" tabindex="0" role="region" aria-label="All pairs">'
        f'<table class="scores"><thead><tr>{heads}</tr></thead><tbody>\n'
    )
    for record, line in zip(records, overview.lines, strict=True):
        yield _row(record, line)
    yield "</tbody></table></section>\n"


def _row(record: Mapping[str, Any], line: Line) -> str:
    note = f'<span class="faint">of {name_text(base_name(line.reference))}</span>'
    if line.error is not None:
        note += '<br><span class="bad">not scored</span>'
    elif line.missed:
        note += f'<br><span class="bad">{text(line.missed)}</span>'
    elif line.level:
        note += f'<br><span class="words-level">{level_mark(line.level)}</span>'
    link = f'<a href="#pair-{line.number}" title="{escape(line.paths)}">{name_text(line.name)}</a>'
    cells = [f'<th scope="row" data-value="{escape(line.name)}">{link}<br>{note}</th>']
    for column in TABLE:
        value = value_of(record, column)
        cells.append(_cell(value, shown_score(record, column) + bar(value)))
    cells.append(_cell(line.triangles, MISSING if line.triangles is None else f"{line.triangles:,}"))
    cells.append(_cell(line.texture_mb, MISSING if line.texture_mb is None else f"{line.texture_mb:.1f}"))
    level = "" if line.level is None else f' data-level="{LEVELS.index(line.level)}"'
    return (
        f'<tr data-number="{line.number}" data-find="{escape(line.paths.casefold())}"{level} '
        f'data-flags="{" ".join(flags_of(line))}">{"".join(cells)}</tr>\n'
    )


def _cell(value: float | None, shown: str) -> str:
    """A number of the table, with what it is sorted by."""
    return f'<td class="number" data-value="{"" if value is None else escape(str(value))}">{shown}</td>'
