# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of a pair as text for people."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from ..metric.errors import one_line
from .numbers import score_text

HEADER = ("kind", "part", "triangles", "area", "FMQM", "perceived", "")
_TEXTS = 2  # of the columns, which are aligned to the left


def part_cells(part: Mapping[str, Any]) -> tuple[str, ...]:
    """What stands under HEADER for a part, as comparison.parts.Part.as_dict has it."""
    fmqm, perceived = (score_text(part[name]) for name in ("FMQM", "perceived"))
    area = f"{100 * part['area']:.3g} %"
    gone = "gone" if part["missing"] else ""
    return (part["kind"], one_line(part["name"]), f"{part['triangles']:,}", area, fmqm, perceived, gone)


def worst_first(parts: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Parts that are gone, then the lowest perceived, then those without a patch."""
    return sorted(parts, key=lambda part: (not part["missing"], part["perceived"] is None, part["perceived"] or 0.0))


def parts_text(parts: Sequence[Mapping[str, Any]]) -> str:
    """An aligned table, worst first."""
    rows = [HEADER, *map(part_cells, worst_first(parts))]
    widths = [max(len(row[column]) for row in rows) for column in range(len(HEADER))]
    return "".join(
        "  ".join(
            cell.ljust(width) if column < _TEXTS else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        + "\n"
        for row in rows
    )


def parts_parts(records: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """The table of each record that has parts, under its name."""
    for record in records:
        if record["parts"]:
            names = one_line(f"{record['id']} against {record['reference']}")
            yield f"\nparts of {names}\n{parts_text(record['parts'])}"
