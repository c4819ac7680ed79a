# SPDX-License-Identifier: GPL-3.0-or-later
"""Joining the JSON outputs of shards."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import Any

from ..metric.errors import FileError
from ..report.pair import PairScore, pair_record
from .journal import Journal
from .log import Log
from .rows import Row

_KEYS = {*pair_record(PairScore("", "")), "fail_under"}
_SHARED = ("fmqm_version", "blender_version", "settings")  # what all parts must agree on


class Merged:
    """The records of several JSON outputs, by id.

    Args:
        rows: give the order, and which there should be; None takes the parts as they are.
        log: is told of ids that are there twice (the first counts), missing, or not among the rows.
        fail_under: of pairs whose row has none; None leaves those of the parts.

    Attributes:
        settings, versions: as json_parts wants them.

    Raises:
        FileError: a part is not such an output, or was scored at other settings or by another version.
    """

    def __init__(
        self, paths: Sequence[str], rows: Sequence[Row] | None, log: Log, fail_under: float | None = None
    ) -> None:
        self._journal = Journal()
        self._fail_under = fail_under
        self._rows = {row.id: row for row in rows or ()}
        self._ids: list[str] = []
        first: dict[str, Any] = {}
        for path in paths:
            part = _read(path)
            first = first or part
            for name in _SHARED:
                if part[name] != first[name]:
                    raise FileError(f"{path}: its {name} differ from those in {paths[0]}; scores do not compare")
            for record in part["pairs"]:
                self._add(record, path, log)
        self.settings: dict[str, Any] = first["settings"]
        self.versions = {name: first[name] for name in _SHARED[:2]}
        if rows is not None:
            missing = [row.id for row in rows if row.id not in self._journal]
            for name in missing:
                log.say(f"{name}: none of the parts has it")
            self._ids = [row.id for row in rows]

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for name in self._ids:
            row = self._rows.get(name)
            limit = self._fail_under if row is None or row.fail_under is None else row.fail_under
            if name in self._journal:
                record = self._journal.record(name)
                yield record if limit is None else record | {"fail_under": limit}
            elif row is not None:
                gap = PairScore(row.reference, row.distorted, error=f"{name}: none of the merged parts has it")
                yield pair_record(gap) | {"id": name, "settings": dict(row.settings), "fail_under": limit}

    def _add(self, record: dict[str, Any], path: str, log: Log) -> None:
        name = record["id"]
        if name in self._journal:
            log.say(f"{path}: {name} is there twice; the first counts")
        elif self._rows and name not in self._rows:
            log.say(f"{path}: {name} is not in the manifest; it is left out")
        else:
            self._journal.done(name, record)
            self._ids.append(name)


def _read(path: str) -> dict[str, Any]:
    try:
        with open(path, encoding="utf-8") as file:
            part = json.load(file)
        wanted = {*_SHARED, "pairs"} <= set(part) and all(set(pair) >= _KEYS for pair in part["pairs"])
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, TypeError, RecursionError):
        wanted = False
    if not wanted:
        raise FileError(f"{path}: not a JSON output of score.py; those of --shard are wanted")
    return part
