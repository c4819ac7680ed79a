# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of numbers by id: what score.py wrote, and what people said."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..batch.table_files import read_rows
from ..metric.errors import SettingsError
from ..report.records import PERCEIVED, value_of

_IDS = ("id", "name", "stimulus", "pvs", "distorted", "file")
_OPINIONS = ("mos", "dmos", "score")
_KINDS = ("kind", "distortion", "type")
_REFERENCES = ("reference", "model", "source", "ref")


@dataclass(frozen=True)
class ScoreTable:
    """What a program measured.

    Attributes:
        ids: names of the pairs, all different.
        columns: numbers by name, each (n,); NaN where there is none.
        references: of each pair, or empty.
    """

    ids: tuple[str, ...]
    columns: dict[str, NDArray[np.float64]]
    references: tuple[str, ...]


@dataclass(frozen=True)
class OpinionTable:
    """What people said.

    Attributes:
        ids: names of what they saw. opinions: their mean scores, (n,), all finite.
        kinds, references: of each, or empty where the table does not tell.
    """

    ids: tuple[str, ...]
    opinions: NDArray[np.float64]
    kinds: tuple[str, ...] = ()
    references: tuple[str, ...] = ()


def read_scores(path: str) -> ScoreTable:
    """The numeric columns of a CSV or JSON that score.py wrote, or of one like it; those without any number left out.

    Raises:
        FileError: it cannot be read, or is no such table. SettingsError: two rows have one id.
    """
    rows = [_flat(row) for row in read_rows(path)]
    ids = _column(path, rows, _IDS, "an id")
    names = dict.fromkeys(name for row in rows for name in row if name != ids)
    columns = {name: np.array([_number(row.get(name)) for row in rows]) for name in names}
    reference = next((name for name in names if name.lower() in _REFERENCES), None)
    return ScoreTable(
        _unique(path, [_text(row.get(ids)) for row in rows]),
        {name: values for name, values in columns.items() if np.isfinite(values).any()},
        () if reference is None else tuple(_text(row.get(reference)) for row in rows),
    )


def read_opinions(path: str, id_column: str = "", opinion_column: str = "") -> OpinionTable:
    """A table of mean opinion scores.

    Args:
        id_column, opinion_column: their names; "" looks for those that are common.

    Raises:
        FileError: it cannot be read. SettingsError: a column is missing, an id stands twice, or a score is no number.
    """
    rows = read_rows(path)
    ids = _column(path, rows, (id_column,) if id_column else _IDS, "an id", "--id-column")
    opinion = _column(path, rows, (opinion_column,) if opinion_column else _OPINIONS, "a human score", "--mos-column")
    values = np.array([_number(row.get(opinion)) for row in rows])
    if not np.isfinite(values).all():
        bad = rows[int(np.flatnonzero(~np.isfinite(values))[0])]
        raise SettingsError(f"{path}: {opinion} of {bad.get(ids)} is {bad.get(opinion) or 'empty'}; a number is wanted")
    names = {name.lower(): name for name in rows[0]}

    def texts(known: Sequence[str]) -> tuple[str, ...]:
        name = next((names[each] for each in known if each in names and names[each] != ids), None)
        return () if name is None else tuple(_text(row.get(name)) for row in rows)

    return OpinionTable(_unique(path, [_text(row.get(ids)) for row in rows]), values, texts(_KINDS), texts(_REFERENCES))


def joined(scores: ScoreTable, opinions: OpinionTable) -> list[tuple[int, int]]:
    """Pairs of rows (of scores, of opinions) that mean the same: by id, else by the name of the file that an id is."""
    of_score = {name: index for index, name in enumerate(scores.ids)}
    stems = _stems(scores.ids)
    stem_count = Counter(PurePath(name.replace("\\", "/")).name for name in opinions.ids)
    pairs = []
    for index, name in enumerate(opinions.ids):
        found = of_score.get(name)
        if found is None and stem_count[PurePath(name.replace("\\", "/")).name] == 1:
            last = PurePath(name.replace("\\", "/"))
            found = stems.get(last.name, stems.get(last.stem))
        if found is not None:
            pairs.append((found, index))
    return pairs


def _stems(ids: Iterable[str]) -> dict[str, int]:
    """Rows by the file's name without folder and ending, where only one has it."""
    names = [PurePath(name.replace("\\", "/")).stem for name in ids]
    count = Counter(names)
    return {name: index for index, name in enumerate(names) if count[name] == 1}


def _flat(record: dict[str, Any]) -> dict[str, Any]:
    """A record under the names that its CSV has."""
    perceived = record.get("perceived")
    plain = {name: value for name, value in record.items() if not isinstance(value, (dict, list))}
    if isinstance(perceived, dict):
        plain |= {name: value_of(record, name) for name in PERCEIVED}
    return plain


def _column(path: str, rows: list[dict[str, Any]], known: Sequence[str], what: str, flag: str = "") -> str:
    names = {name.lower(): name for name in rows[0]}
    found = next((names[each.lower()] for each in known if each.lower() in names), None)
    if found is None:
        hint = f"; say {flag} NAME" if flag else ""
        raise SettingsError(
            f"{path}: no column for {what} ({' or '.join(known)} is wanted, there are {', '.join(rows[0])}){hint}"
        )
    return found


def _number(value: Any) -> float:
    """NaN for what is none."""
    if isinstance(value, bool) or value is None:
        return np.nan
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        return np.nan
    return number if np.isfinite(number) else np.nan


def _text(value: Any) -> str:
    """A name; without the quote that score.py puts before what a spreadsheet would take for a formula."""
    text = "" if value is None else str(value)
    return text[1:] if text[:1] == "'" and text[1:2] in tuple("=+-@\t\r") else text


def _unique(path: str, names: Sequence[str]) -> tuple[str, ...]:
    name, count = Counter(names).most_common(1)[0]
    if count > 1:
        raise SettingsError(f"{path}: {name or 'a row without id'} stands there {count} times; ids must differ")
    return tuple(names)
