# SPDX-License-Identifier: GPL-3.0-or-later
"""Scores of pairs as JSON, CSV and a table."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from typing import Any, NamedTuple

from ..comparison.impairment import impairment_of
from ..comparison.measurement import Readings
from ..metric.errors import one_line
from ..metric.evaluation import COLUMNS, Scores
from ..metric.perceived import Perceived
from .numbers import MISSING, score_text
from .trust_table import Report, trust_text

SHOWN = ("FMQM", *(name for name in COLUMNS if name != "FMQM"))  # the score first, then its features
# Columns of the second reading, and what they are called in a record's "perceived".
PERCEIVED = {"perceived": "score", **{name: name for name in Perceived._fields[1:-1]}, "perceived_p10": "p10"}
TABLE = (*SHOWN, "perceived")
STAGES = ("load", "prepare", "fields", "features", "total")
BESIDE = ("triangles", "triangle_share", "texture_bytes", "level", "notes", "warnings")  # columns after the scores
SEPARATOR = " | "  # of notes and warnings in one cell
SIZES = {"screen_size_strict": "strict", "screen_size_fade": "fade"}  # columns, where sizes were asked for
REVERSE = "reverse "  # before the names of the other direction's columns
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "\uff1d", "\uff0b", "\uff0d", "\uff20")  # the last are wide ones
_QUOTED = re.compile('[,"\r\n]')  # readers end a line at either of the last two
_LONE = re.compile("[\ud800-\udfff]")


class Costs(NamedTuple):
    """What the distorted asset costs: its triangles, their share of the reference's, bytes of its color images."""

    triangles: int
    triangle_share: float
    texture_bytes: int


@dataclass(frozen=True)
class PairScore:
    """One pair's outcome.

    Attributes:
        reference, distorted: as the user named them.
        readings: None where there are none.
        seconds: by STAGES; what several pairs share is counted in the first.
        warnings: why a score should not be believed as it stands. notes: what was done that misleads nobody.
        error: why there are no scores. level: of detail, where that is known. costs: None where there are no scores.
        space: where the two were compared, as comparison.alignment.Alignment.label has it.
        reverse: readings of the other direction, the distorted mesh as the reference; None: not asked for.
        trust: as report.trust_table.trust_dict has it. parts: as comparison.parts.Part.as_dict has each.
        findings: what else was asked for, by its key in the record: where, attribution, pictures, screen_size.
    """

    reference: str
    distorted: str
    readings: Readings | None = None
    patches: int | None = None
    samples: int | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    error: str | None = None
    level: int | None = None
    costs: Costs | None = None
    space: str | None = None
    reverse: Readings | None = None
    trust: Report | None = None
    parts: tuple[dict[str, Any], ...] = ()
    findings: dict[str, Any] = field(default_factory=dict)


def json_text(pairs: Sequence[PairScore], settings: dict[str, Any], versions: dict[str, str]) -> str:
    """The JSON document of pairs; as json_parts."""
    return "".join(json_parts(map(pair_record, pairs), settings, versions))


def csv_text(pairs: Sequence[PairScore]) -> str:
    """The CSV of pairs; as csv_parts."""
    return "".join(csv_parts([pair_record(pair) for pair in pairs]))


def table_text(pairs: Sequence[PairScore]) -> str:
    """The table of pairs; as table_parts."""
    return "".join(table_parts([pair_record(pair) for pair in pairs]))


def json_parts(
    records: Iterable[Mapping[str, Any]], settings: Mapping[str, Any], versions: Mapping[str, Any]
) -> Iterator[str]:
    """The text of a document, record after record: however many there are, one is in memory."""
    head = _json({**versions, "settings": settings, "pairs": []})
    yield head.removesuffix("]\n}")
    separator = "\n"
    for record in records:
        yield separator + textwrap.indent(_json(record), "    ")
        separator = ",\n"
    yield "]\n}\n" if separator == "\n" else "\n  ]\n}\n"


def _json(value: Any) -> str:
    text = json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
    # Bytes of names that are not UTF-8 are half a character in Python, which strict JSON has not.
    return _LONE.sub(lambda found: rf"\\u{ord(found[0]):x}", text)


def csv_parts(records: Iterable[Mapping[str, Any]], raw: bool = False) -> Iterator[str]:
    """Numbers at full precision with a decimal point, whatever the locale; fields that failed are empty.

    Kinds of distortion, sizes on screen and the other direction's columns are there, at the end, where they are known.
    Goes through the records four times.

    Args:
        raw: texts as they are. Else one that a spreadsheet would take for a formula comes after a single quote.
    """
    names, numbers = ("id", "reference", "distorted"), (*SHOWN, *PERCEIVED)
    turned = numbers if _any_reverse(records) else ()
    sizes = SIZES if _any_size(records) else {}
    kinds = ("kind",) if any("kind" in record for record in records) else ()
    yield _csv_line((*names, *numbers, "error", *BESIDE, *kinds, *sizes, *(f"{REVERSE}{name}" for name in turned)))
    for record in records:
        values = [record[name] for name in names] + [value_of(record, name) for name in numbers] + [record["error"]]
        values += [_joined(record[name]) for name in BESIDE] + [record.get(name) for name in kinds]
        found = record.get("screen_size")
        values += [None if found is None else found[kind]["pixels"] for kind in sizes.values()]
        reverse = record["reverse"] or _UNREAD
        yield _csv_line(values + [value_of(reverse, name) for name in turned], raw)


def table_parts(records: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """An aligned table, one row a record; goes through the records four times.

    Sizes on screen and the other direction's FMQM are the last columns, where they were measured.
    """
    both, sized = _any_reverse(records), _any_size(records)
    header = ("id", *TABLE, *(SIZES if sized else ()), *([f"{REVERSE}FMQM"] if both else []))
    widths = [len(name) for name in header]
    for record in records:
        widths = [max(width, len(cell)) for width, cell in zip(widths, _cells(record, both, sized), strict=True)]
    for cells in chain([header], (_cells(record, both, sized) for record in records)):
        aligned = (cell.rjust(width) for cell, width in zip(cells[1:], widths[1:], strict=True))
        yield "  ".join((cells[0].ljust(widths[0]), *aligned)).rstrip() + "\n"


def trust_parts(records: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """The trust report of each record that has one, under its name."""
    for record in records:
        if record["trust"]:
            names = one_line(f"{record['id']} against {record['reference']}")
            yield f"\n{names}\n{trust_text(record['trust'])}"


def note_parts(records: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """The notes of all records, each once."""
    notes = dict.fromkeys(note for record in records for note in record["notes"])
    yield from (f"\n{one_line(f'note: {note}')}" for note in notes)
    if notes:
        yield "\n"


def pair_record(pair: PairScore) -> dict[str, Any]:
    """A pair as plain values for JSON, by which all outputs are made; its id is the name of what was scored."""
    return {
        "id": pair.distorted,
        "reference": pair.reference,
        "distorted": pair.distorted,
        **(_UNREAD if pair.readings is None else _read(pair.readings)),
        "stderr": None if pair.readings is None or pair.readings.stderr is None else _columns(pair.readings.stderr),
        "fmqm_p10": None if pair.readings is None else pair.readings.fmqm_p10,
        "patches": pair.patches,
        "samples": pair.samples,
        "space": pair.space,
        "seconds": {stage: pair.seconds.get(stage, 0.0) for stage in STAGES},
        "warnings": list(pair.warnings),
        "notes": list(pair.notes),
        "error": pair.error,
        "level": pair.level,
        **(dict.fromkeys(Costs._fields) if pair.costs is None else pair.costs._asdict()),
        "reverse": None if pair.reverse is None else _read(pair.reverse),
        "impairment": None if pair.readings is None else _impairment(pair.readings, pair.trust),
        "trust": pair.trust,
        "parts": list(pair.parts),
        **pair.findings,
    }


def _impairment(readings: Readings, trust: Report | None) -> str:
    facts = {} if trust is None else {name: item["value"] for name, item in trust["pair"].items()}
    return impairment_of(readings.perceived.score, facts)


def value_of(record: Mapping[str, Any], column: str) -> float | None:
    """A number of a record, or of its other direction: one of SHOWN, of PERCEIVED, or fmqm_p10; None: no scores."""
    found: float | None = record["perceived"][PERCEIVED[column]] if column in PERCEIVED else record[column]
    return found


def shown_score(record: Mapping[str, Any], column: str) -> str:
    """A number of a record as people read it, with its standard error where that is known."""
    stderr, name = record["stderr"], column
    if column in PERCEIVED:
        stderr, name = record["perceived"]["stderr"], PERCEIVED[column]
    return score_text(value_of(record, column), None if stderr is None else stderr[name])


def _any_reverse(records: Iterable[Mapping[str, Any]]) -> bool:
    return any(record["reverse"] is not None for record in records)


def _any_size(records: Iterable[Mapping[str, Any]]) -> bool:
    return any(record.get("screen_size") is not None for record in records)


def _cells(record: Mapping[str, Any], both: bool, sized: bool) -> tuple[str, ...]:
    reverse = record["reverse"]
    turned = [score_text(reverse and reverse["FMQM"])] if both else []
    sizes = [size_text(record.get("screen_size"), kind) for kind in SIZES.values()] if sized else []
    return (one_line(record["id"]), *(shown_score(record, name) for name in TABLE), *sizes, *turned)


def size_text(found: Mapping[str, Any] | None, kind: str) -> str:
    """A size on screen of a record, as people read it: strict or fade."""
    return MISSING if found is None else f"{found[kind]['bound']} {found[kind]['pixels']:.0f}".strip()


def size_notes(found: Mapping[str, Any]) -> list[str]:
    """What should be known of the renders that sizes are from, in sentences."""
    return [f"{note[0].upper()}{note[1:]}." for note in found.get("notes", []) if note]


def _csv_line(values: Iterable[str | float | None], raw: bool = False) -> str:
    return ",".join(_csv_cell(value, raw) for value in values) + "\n"


def _csv_cell(value: str | float | None, raw: bool) -> str:
    """As OWASP advises: a text that begins a formula follows a single quote, and is quoted. Numbers are numbers."""
    if not isinstance(value, str):
        return "" if value is None else repr(value)
    is_formula = not raw and value.startswith(_FORMULA)
    text = f"'{value}" if is_formula else value
    return '"' + text.replace('"', '""') + '"' if is_formula or _QUOTED.search(text) else text


def _joined(value: Any) -> Any:
    return SEPARATOR.join(value) if isinstance(value, list) else value


def _columns(values: Scores) -> dict[str, float]:
    return {name: getattr(values, name) for name in SHOWN}


def _read(readings: Readings) -> dict[str, Any]:
    """The numbers of both readings."""
    stderr = readings.perceived_stderr
    perceived = {**readings.perceived._asdict(), "stderr": None if stderr is None else stderr._asdict()}
    return {**_columns(readings.scores), "perceived": perceived}


_UNREAD: dict[str, Any] = {
    **dict.fromkeys(SHOWN),
    "perceived": dict.fromkeys((*Perceived._fields, "stderr")),
}  # of a pair without scores
RECORD_KEYS = frozenset(pair_record(PairScore("", "")))  # what each record has
