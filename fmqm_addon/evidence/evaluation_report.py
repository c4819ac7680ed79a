# SPDX-License-Identifier: GPL-3.0-or-later
"""An evaluation as JSON, CSV, text and pictures."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from .agreement import STATISTICS, Agreement, Difference
from .evaluate import OVERALL, Evaluation
from .scatter import draw_scatter


def plain(found: Evaluation, paper: Mapping[str, float], paper_kinds: Mapping[str, float]) -> dict[str, Any]:
    """All of it as plain values for JSON; None where there is no number.

    Args:
        paper, paper_kinds: what the paper reports for the same data set, or empty.
    """
    result: dict[str, Any] = {
        "rows": found.rows,
        "unscored": list(found.unscored),
        "unjudged": list(found.unjudged),
        "metrics": {
            name: {
                grouping: {label: _agreement_record(each) for label, each in groups.items()}
                for grouping, groups in groupings.items()
            }
            for name, groupings in found.agreements.items()
        },
    }
    if found.compared is not None:
        first, second, test = found.compared
        result["compared"] = {"first": first, "second": second, **asdict(test)}
    if paper:
        result["paper"] = {"overall": dict(paper), "kind": dict(paper_kinds)}
    return result


def _agreement_record(found: Agreement) -> dict[str, Any]:
    return {
        "rows": found.rows,
        **{name: found.values.get(name) for name in STATISTICS},
        "intervals": {name: list(each) for name, each in found.intervals.items()},
        "curve": None if found.curve is None else asdict(found.curve),
        "note": found.note,
    }


def csv_rows(found: Evaluation) -> Iterator[list[str | float | int]]:
    """A header, then one row a metric and group; what has no number is empty."""
    ends = [f"{name}_{end}" for name in STATISTICS for end in ("low", "high")]
    yield ["metric", "grouping", "group", "rows", *STATISTICS, *ends, "note"]
    for name, groupings in found.agreements.items():
        for grouping, groups in groupings.items():
            for label, each in groups.items():
                values = [each.values.get(key, "") for key in STATISTICS]
                intervals = [end for key in STATISTICS for end in each.intervals.get(key, ("", ""))]
                yield [name, grouping, label, each.rows, *values, *intervals, each.note]


def text(found: Evaluation, paper: Mapping[str, float], paper_kinds: Mapping[str, float]) -> str:
    """The tables that people read; as plain."""
    rows = [["metric", "rows", *STATISTICS]]
    notes: dict[str, list[str]] = {}
    for name, groupings in found.agreements.items():
        each = groupings["overall"][OVERALL]
        rows.append([name, str(each.rows), *(_cell(each, key) for key in STATISTICS)])
        if each.note:
            notes.setdefault(each.note, []).append(name)
    if paper:
        told = [f"{paper[key]:.3f}" if key in paper else "-" for key in STATISTICS]
        rows.append(["FMQM in the paper", "", *told])
    parts = [_aligned(rows)]
    for grouping in ("kind", "reference"):
        table = _group_table(found, grouping, paper_kinds if grouping == "kind" else {})
        parts += [f"SROCC by {grouping}\n{table}"] if table else []
    if found.compared is not None:
        parts.append(_compared_text(*found.compared))
    if notes:
        parts.append("".join(f"{', '.join(names)}: {note}\n" for note, names in notes.items()))
    return "\n".join(parts)


def _group_table(found: Evaluation, grouping: str, paper: Mapping[str, float]) -> str:
    """A row a group, a column a metric that can be ranked at all."""
    shown = [
        name for name, groups in found.agreements.items() if groups["overall"][OVERALL].values and grouping in groups
    ]
    if not shown:
        return ""
    labels = list(found.agreements[shown[0]][grouping])
    rows = [[grouping, "rows", *shown, *(["the paper's FMQM"] if paper else [])]]
    for label in labels:
        cells = [found.agreements[name][grouping][label] for name in shown]
        told = [f"{each.values['SROCC']:.3f}" if "SROCC" in each.values else "-" for each in cells]
        last = [f"{paper[label]:.3f}" if label in paper else "-"] if paper else []
        rows.append([label, str(max(each.rows for each in cells)), *told, *last])
    return _aligned(rows)


def _cell(found: Agreement, key: str) -> str:
    if key not in found.values:
        return "-"
    interval = found.intervals.get(key)
    return f"{found.values[key]:.3f}" + (f" [{interval[0]:.3f}, {interval[1]:.3f}]" if interval else "")


def _compared_text(first: str, second: str, test: Difference) -> str:
    if test.note:
        return f"{first} and {second} cannot be compared: {test.note}\n"
    lines = [f"{first} minus {second}, on the same {test.rows} rows:"]
    for key, value in test.differences.items():
        line = f"  {key} {value:+.3f}"
        if key in test.intervals:
            low, high = test.intervals[key]
            line += f" [{low:+.3f}, {high:+.3f}], p = {test.chances[key]:.3f}"
        lines.append(line)
    return "\n".join(lines) + "\n"


def _aligned(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines) + "\n"


def draw_plots(folder: str, found: Evaluation) -> list[str]:
    """Writes FOLDER/metric.png for each metric that has a curve; returns what was written."""
    os.makedirs(folder, exist_ok=True)
    written = []
    for name, groups in found.agreements.items():
        each = groups["overall"][OVERALL]
        if each.curve is None:
            continue
        known = np.isfinite(found.x[name])
        kinds = [kind for kind, there in zip(found.kinds, known, strict=True) if there] if found.kinds else ()
        safe = "".join(letter if letter.isalnum() or letter in "-_." else "_" for letter in name)
        path = os.path.join(folder, f"{safe}.png")
        draw_scatter(path, name, found.x[name][known], found.opinions[known], kinds, each)
        written.append(path)
    return written
