# SPDX-License-Identifier: GPL-3.0-or-later
"""What the page must know of all pairs together before it is written: a line for each, and what is the same for all."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...comparison.impairment import IMPAIRMENTS
from ...comparison.judge import Judge
from ..causes import Facts, largest_side
from ..criteria import judge_of, shortfall
from ..explain import sentences
from ..records import value_of
from .fragments import MEGABYTE
from .size_curve import Curve

Record = Mapping[str, Any]

LEVELS = tuple(words for _, words in IMPAIRMENTS)
FIRST = 4  # pairs to look at first
_GROUPS = ("warnings", "notes", "words")  # texts that stand once where all scored pairs have them


@dataclass(frozen=True)
class Line:
    """A pair as the first screen shows it.

    Attributes:
        number: of the pair, from 1 on. name: short. paths: all it is called by, for a tooltip and for the search.
        fmqm, perceived, score: the last is the judge's; None: not scored. level: the difference in words.
        missed: by how much it misses its thresholds; "" for nothing. warnings: how many.
        triangles, texture_mb: None: not known. texture_side: pixels of its largest image; 0: not known.
        thumbnails: by kind, of KINDS. reason: why it should be looked at. sizes: None: not asked for.
    """

    number: int
    name: str
    paths: str
    reference: str
    error: str | None
    fmqm: float | None
    perceived: float | None
    score: float | None
    level: str | None
    missed: str
    warnings: int
    triangles: int | None = None
    texture_mb: float | None = None
    texture_side: int = 0
    thumbnails: Mapping[str, str] | None = None
    reason: str = ""
    sizes: Curve | None = None

    @property
    def urgency(self) -> tuple[bool, bool, float]:
        """What should be looked at first is lowest."""
        return (self.error is None, not self.missed, 1.0 if self.score is None else self.score)


@dataclass
class Chain:
    """The pairs of one reference.

    Attributes:
        name: short. path: as the user named it. triangles, texture_mb, texture_side, thumbnail: the reference's own.
    """

    name: str
    path: str
    lines: list[Line] = field(default_factory=list)
    triangles: int | None = None
    texture_mb: float | None = None
    texture_side: int = 0
    thumbnail: str | None = None


@dataclass(frozen=True)
class Overview:
    """All pairs together.

    Attributes:
        judge: of the first pair. chains: by reference, in the order in which these first come.
        common: texts that all scored pairs have, by "warnings", "notes" and "words"; none where one pair was scored.
        least: their thresholds by column, where all have the same. folder: what short names leave out.
    """

    judge: Judge
    chains: tuple[Chain, ...]
    common: Mapping[str, tuple[str, ...]]
    least: Mapping[str, float]
    folder: str | None

    @property
    def lines(self) -> list[Line]:
        """Of all pairs, in their order."""
        return sorted((line for chain in self.chains for line in chain.lines), key=lambda line: line.number)

    @property
    def first(self) -> list[Line]:
        """What should be looked at first; one stands for all that were not scored, where others stand out, too."""
        found = sorted((line for line in self.lines if line.reason), key=lambda line: line.urgency)
        failed = [line for line in found if line.error is not None]
        scored = found[len(failed) :]
        return (failed[: max(FIRST - len(scored), 1)] + scored)[:FIRST]

    def short(self, record: Record) -> dict[str, Any]:
        """A record with short names, for words about it."""
        return {**record, "distorted": pair_name(record, self.folder), "reference": base_name(record["reference"])}


def overview_of(records: Iterable[Record]) -> Overview:
    """Goes through the records twice."""
    folder = _folder_to_leave_out(records)
    chains: dict[str, Chain] = {}
    judge: Judge | None = None
    scored = 0
    times: dict[str, Counter[str]] = {group: Counter() for group in _GROUPS}
    thresholds: set[tuple[float | None, float | None]] = set()
    for number, record in enumerate(records, 1):
        judge = judge or judge_of(record)
        thresholds.add((record["fail_under"], record["fail_under_p10"]))
        chain = chains.setdefault(record["reference"], Chain(base_name(record["reference"]), record["reference"]))
        chain.lines.append(_line(number, record, pair_name(record, folder), judge))
        _note_reference(chain, record)
        if record["error"] is None:
            scored += 1
            texts = {"warnings": record["warnings"], "notes": record["notes"], "words": sentences(record)}
            for group in _GROUPS:
                times[group].update(list(dict.fromkeys(texts[group])))
    judge = judge or Judge.FMQM
    common = {
        group: tuple(text for text, count in times[group].items() if scored > 1 and count == scored)
        for group in _GROUPS
    }
    least = thresholds.pop() if len(thresholds) == 1 else (None, None)
    named = zip((judge.column, judge.p10_column), least, strict=True)
    return Overview(
        judge, tuple(chains.values()), common, {name: value for name, value in named if value is not None}, folder
    )


def pair_name(record: Record, folder: str | None) -> str:
    """Short: the pair's id, or where that is the path of what was scored, the last parts of it."""
    path = str(record["distorted"])
    if record["id"] != path:
        return str(record["id"])
    if folder is None:
        return base_name(path)
    return os.path.relpath(path, folder) if folder else path


def base_name(path: str) -> str:
    """The last part of a path."""
    return Path(path).name or path


def _line(number: int, record: Record, name: str, judge: Judge) -> Line:
    pictures = record.get("pictures")
    paths = dict.fromkeys((record["id"], record["distorted"], record["reference"]))
    missed = shortfall(record)
    return Line(
        number=number,
        name=name,
        paths=" | ".join(paths),
        reference=record["reference"],
        error=record["error"],
        fmqm=record["FMQM"],
        perceived=value_of(record, "perceived"),
        score=value_of(record, judge.column),
        level=record["impairment"],
        missed=missed,
        warnings=len(record["warnings"]),
        triangles=record.get("triangles") if pictures is None else pictures["triangles"][1],
        texture_mb=_megabytes(record.get("texture_bytes") if pictures is None else pictures["texture_bytes"][1]),
        texture_side=largest_side(Facts(record).distorted),
        thumbnails=None if pictures is None else pictures["thumbnails"],
        reason=_reason(record, missed),
        sizes=None if record.get("screen_size") is None else Curve.of(record["screen_size"]),
    )


def _reason(record: Record, missed: str) -> str:
    """Why a pair should be looked at; "" for no reason."""
    if record["error"] is not None:
        return f"Not scored: {record['error']}"
    parts = [missed] if missed else []
    if record["impairment"] not in (None, LEVELS[0]):
        parts.append(record["impairment"] if parts else record["impairment"].capitalize())
        pictures = record.get("pictures")
        if pictures and pictures["worst"]:
            worst = pictures["worst"][0]
            of = f", on {worst['object']}" if worst["object"] else ""
            parts.append(f"worst: {worst['blame']} at the {worst['place']}{of}")
    if record["warnings"]:
        count = len(record["warnings"])
        parts.append("1 warning" if count == 1 else f"{count} warnings")
    return "; ".join(parts)


def _note_reference(chain: Chain, record: Record) -> None:
    """What a pair tells of its reference, once."""
    pictures = record.get("pictures")
    if pictures and chain.triangles is None:
        chain.triangles, chain.texture_mb = pictures["triangles"][0], _megabytes(pictures["texture_bytes"][0])
        chain.thumbnail = pictures["thumbnails"]["reference"]
        chain.texture_side = largest_side(Facts(record).reference)


def _megabytes(count: int | None) -> float | None:
    return None if count is None else count / MEGABYTE


def _folder_to_leave_out(records: Iterable[Record]) -> str | None:
    """Of the names that are paths, where their last parts do not tell them apart: the folder that all are in."""
    names: set[str] = set()
    folder = None
    alike = False
    for path in (record["distorted"] for record in records if record["id"] == record["distorted"]):
        name, where = base_name(path), os.path.dirname(path)
        alike = alike or name in names
        names.add(name)
        try:
            folder = where if folder is None else os.path.commonpath([folder, where])
        except ValueError:  # relative and absolute ones, or two drives
            folder = ""
    return folder if alike else None
