# SPDX-License-Identifier: GPL-3.0-or-later
"""Scores of pairs as JSON, CSV and a table."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..metric.errors import one_line
from ..metric.score import COLUMNS
from ..metric.spatial import Floats
from .trust import Report, trust_text

SHOWN = ("FMQM", *(name for name in COLUMNS if name != "FMQM"))  # the score first, then its features
STAGES = ("load", "prepare", "fields", "features", "total")
REVERSE = "reverse "  # before the names of the other direction's columns
_LONE = re.compile("[\ud800-\udfff]")
_INDEX = {name: COLUMNS.index(name) for name in SHOWN}


@dataclass(frozen=True)
class PairScore:
    """One pair's outcome.

    Attributes:
        reference, distorted: as the user named them.
        scores, stderr: (5,) in the order of metric.score.COLUMNS; None where there are none.
        seconds: by STAGES; what several pairs share is counted in the first.
        error: why there are no scores.
        space: where the two were compared, as blender.space.Placement.label has it.
        reverse: (5,) scores of the other direction, the distorted mesh as the reference; None: not asked for.
        trust: as report.trust.trust_dict has it.
    """

    reference: str
    distorted: str
    scores: Floats | None = None
    stderr: Floats | None = None
    patches: int | None = None
    samples: int | None = None
    seconds: dict[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    error: str | None = None
    space: str | None = None
    reverse: Floats | None = None
    trust: Report | None = None

    @property
    def fmqm(self) -> float | None:
        return None if self.scores is None else float(self.scores[_INDEX["FMQM"]])


def json_text(pairs: Sequence[PairScore], settings: dict[str, Any], versions: dict[str, str]) -> str:
    document = {**versions, "settings": settings, "pairs": [_pair_dict(pair) for pair in pairs]}
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    # Bytes of names that are not UTF-8 are half a character in Python, which strict JSON has not.
    return _LONE.sub(lambda found: rf"\\u{ord(found[0]):x}", text)


def csv_text(pairs: Sequence[PairScore]) -> str:
    """Numbers at full precision with a decimal point, whatever the locale; fields that failed are empty.

    The other direction's columns are there, at the end, where it was measured.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    both = _both(pairs)
    writer.writerow(
        ["reference", "distorted", *SHOWN, "error", *(f"{REVERSE}{name}" for name in SHOWN if both)],
    )
    for pair in pairs:
        row = [pair.reference, pair.distorted, *_cells(pair.scores), pair.error or ""]
        writer.writerow(row + _cells(pair.reverse) if both else row)
    return out.getvalue()


def table_text(pairs: Sequence[PairScore]) -> str:
    """An aligned table, one row a pair; the other direction's FMQM is the last column, where it was measured."""
    both = _both(pairs)
    rows = [["distorted", *SHOWN, *([f"{REVERSE}FMQM"] if both else [])]]
    for pair in pairs:
        if pair.scores is None:
            rows.append([one_line(pair.distorted), *["-"] * (len(rows[0]) - 1)])
            continue
        cells = []
        for name in SHOWN:
            cell = f"{pair.scores[_INDEX[name]]:.4f}"
            cells.append(cell if pair.stderr is None else f"{cell} ±{pair.stderr[_INDEX[name]]:.4f}")
        if both:
            cells.append("-" if pair.reverse is None else f"{pair.reverse[_INDEX['FMQM']]:.4f}")
        rows.append([one_line(pair.distorted), *cells])
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines) + "\n"


def trust_tables(pairs: Sequence[PairScore]) -> str:
    """The trust report of each pair that has one, under its name."""
    return "".join(
        f"\n{one_line(f'{pair.distorted} against {pair.reference}')}\n{trust_text(pair.trust)}"
        for pair in pairs
        if pair.trust
    )


def _both(pairs: Sequence[PairScore]) -> bool:
    return any(pair.reverse is not None for pair in pairs)


def _cells(values: Floats | None) -> list[str]:
    return ["" if value is None else repr(value) for value in _columns(values).values()]


def _pair_dict(pair: PairScore) -> dict[str, Any]:
    return {
        "reference": pair.reference,
        "distorted": pair.distorted,
        **_columns(pair.scores),
        "stderr": None if pair.stderr is None else _columns(pair.stderr),
        "patches": pair.patches,
        "samples": pair.samples,
        "space": pair.space,
        "seconds": {stage: pair.seconds.get(stage, 0.0) for stage in STAGES},
        "warnings": list(pair.warnings),
        "error": pair.error,
        "reverse": None if pair.reverse is None else _columns(pair.reverse),
        "trust": pair.trust,
    }


def _columns(values: Floats | None) -> dict[str, float | None]:
    if values is None:
        return dict.fromkeys(SHOWN)
    numbers = np.asarray(values, np.float64).tolist()
    return {name: numbers[_INDEX[name]] for name in SHOWN}
