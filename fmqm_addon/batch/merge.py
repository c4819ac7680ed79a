# SPDX-License-Identifier: GPL-3.0-or-later
"""Joining the JSON outputs of shards."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..metric.errors import FileError
from ..report.criteria import ANYTHING, FIELDS, Criteria
from ..report.record_check import checked_json, is_settings, record_fault
from .journal import Journal, differences
from .progress_log import Log
from .rows import Row

_REQUIRED = ("settings", *FIELDS)  # what a record of an output has besides
_MADE_BY = ("fmqm_version", "fmqm_code", "blender_version")


class Merged:
    """The records of several JSON outputs, by id.

    Args:
        rows: give the order, and which there should be. None takes what the parts have: in the order of the whole,
            where they know which shards they are.
        log: gets a line for ids that are there twice (the first counts), missing, or not among the rows.
        criteria: what it does not say stays as the parts have it; a row's own threshold wins.

    Attributes:
        settings, versions: as json_parts wants them.

    Raises:
        FileError: a part is not such an output, or was scored at other settings or by another version, or there are
            no rows and a shard is missing.
    """

    def __init__(
        self, paths: Sequence[str], rows: Sequence[Row] | None, log: Log, criteria: Criteria = ANYTHING
    ) -> None:
        self._journal = Journal()
        self._criteria = criteria
        self._rows = {row.id: row for row in rows or ()}
        self._ids: list[str] = []
        self._others: dict[str, str] = {}  # why a record of this id is not that of its row
        places: dict[str, int] = {}  # in the whole, by id
        shards: set[tuple[int, int]] = set()
        first: dict[str, Any] = {}
        for path in paths:
            part = _read(path)
            first = first or part
            if difference := differences(part, first, _MADE_BY):
                raise FileError(
                    f"{path}: made by {difference} in {paths[0]}; scores do not compare, score one of them anew"
                )
            if part["settings"] != first["settings"]:
                raise FileError(f"{path}: its settings differ from those in {paths[0]}; scores do not compare")
            number, count = part.get("shard") or (0, 0)
            shards.add((number, count))
            for index, record in enumerate(part["pairs"]):
                places.setdefault(record["id"], number + index * count)
                self._add(record, path, log)
        self.settings: dict[str, Any] = first["settings"]
        self.versions = {name: first[name] for name in _MADE_BY}
        if rows is not None:
            for row in rows:
                if row.id not in self._journal:
                    log.say(self._gap(row))
            self._ids = [row.id for row in rows]
        elif len({count for _, count in shards}) == 1:
            missing = {(number, count) for _, count in shards for number in range(1, count + 1)} - shards
            if missing:
                names = ", ".join(f"{number}/{count}" for number, count in sorted(missing))
                raise FileError(f"--merge: shard {names} is missing; add it, or give the --manifest to go without")
            self._ids.sort(key=places.__getitem__)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for name in self._ids:
            row = self._rows.get(name)
            own = None if row is None else row.fail_under
            if name in self._journal:
                yield self._journal.record(name) | self._criteria.given_fields(own)
            elif row is not None:
                yield row.failed(self._gap(row)) | self._criteria.record_fields(own)

    def _gap(self, row: Row) -> str:
        """Why there is no record."""
        return f"{row.id}: {self._others.get(row.id, 'none of the merged parts has it')}"

    def _add(self, record: dict[str, Any], path: str, log: Log) -> None:
        name = record["id"]
        if name in self._journal:
            log.say(f"{path}: {name} is there twice; the first counts")
        elif self._rows and name not in self._rows:
            log.say(f"{path}: {name} is not in the manifest; it is left out")
        elif name in self._rows and (difference := _difference(record, self._rows[name])):
            self._others[name] = f"{path} has it with {difference}; score it anew"
        else:
            self._journal.done(name, record)
            self._ids.append(name)


def _difference(record: Mapping[str, Any], row: Row) -> str:
    """What was scored otherwise than the row wants it; "" for nothing."""
    for name, wanted in row.record_fields().items():
        if (scored := record.get(name)) != wanted:
            return f"{name} {scored or 'none'} instead of {wanted or 'none'}"
    return ""


def _read(path: str) -> dict[str, Any]:
    """A part, every value of which is what it should be: whoever merges shows what others have sent."""
    try:
        with open(path, "rb") as file:
            part = checked_json(file.read())
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise FileError(f"{path}: not a JSON output of score.py ({error})") from error
    fault = _fault(part)
    if fault:
        raise FileError(f"{path}: not a JSON output of score.py, or an older one: {fault}")
    checked: dict[str, Any] = part
    return checked


def _fault(part: Any) -> str:
    """What is wrong with a part; "" for nothing."""
    if not isinstance(part, dict):
        return "it is no object"
    for name in _MADE_BY:
        if not isinstance(part.get(name), str):
            return f"{name} is missing"
    if not is_settings(part.get("settings")):
        return "settings is missing"
    if not isinstance(part.get("pairs"), list):
        return "pairs is missing"
    for index, pair in enumerate(part["pairs"], 1):
        if fault := record_fault(pair) or "".join(f"{name} is missing" for name in _REQUIRED if name not in pair):
            return f"pair {index}: {fault}"
    match part.get("shard", [1, 1]):
        case [int() as number, int() as count] if 1 <= number <= count:
            return ""
    return "shard is not such as [2, 5]"
