# SPDX-License-Identifier: GPL-3.0-or-later
"""What is to be scored: pairs, and the options that all of them share."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from ..blender.files.asset_path import split_spec
from ..blender.materials.image_headers import DEFAULT_LIMITS
from ..blender.materials.types import Reading
from ..comparison.judge import Judge
from ..comparison.pair import PairOptions
from ..report.records import PairScore, pair_record


@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """How all pairs of a run are scored.

    Attributes:
        pair: of every pair, before a row's own settings.
        reading: of all assets, textures of their own aside.
        explain: in words, too. screen_size: at which size on screen the distorted may be shown, too.
        report: folder of the report, for pictures; "" makes none. judge: which reading they show. They change no score.
    """

    pair: PairOptions = PairOptions()
    reading: Reading = Reading()
    explain: bool = False
    screen_size: bool = False
    report: str = ""
    judge: Judge = Judge.FMQM

    def pair_of(self, row: Row) -> PairOptions:
        """The options of a row's pair."""
        return replace(self.pair, settings=replace(self.pair.settings, **dict(row.settings)))

    def as_dict(self) -> dict[str, Any]:
        """Plain values under the names of the command line's flags; which files may be named changes no score."""
        pair, reading = self.pair, self.reading
        extra: dict[str, Any] = {"attribution": pair.attribution, "explain": self.explain, "both": pair.both}
        extra["screen_size"] = self.screen_size
        extra["bake"] = reading.bake if reading.stand_in or reading.bake != Reading.bake else None
        for name, value, default in (
            ("max_image_side", reading.limits.side, DEFAULT_LIMITS.side),
            ("max_image_bytes", reading.limits.decoded, DEFAULT_LIMITS.decoded),
        ):
            extra[name] = None if value == default else value
        extra |= {"frame": reading.frame, "include": ", ".join(reading.include) or None}
        extra["exclude"] = ", ".join(reading.exclude) or None
        given = {name: value for name, value in extra.items() if value is not None and value is not False}
        return pair.as_dict() | given

    def made_by(self, versions: Mapping[str, str]) -> dict[str, str]:
        """What travels with each record, and is compared where it arrives: the code, and a digest of all options."""
        text = json.dumps(self.as_dict(), sort_keys=True)
        return {**versions, "settings": hashlib.blake2b(text.encode(), digest_size=8).hexdigest()}


@dataclass(frozen=True)
class Row:
    """A pair to score.

    Attributes:
        id: its name in the outputs, unique in a run.
        reference, distorted: as the user named them; a path, or "file.blend:Object name".
        ref_texture, texture: images that replace the base color of the whole; "" leaves it.
        fail_under: its own threshold, in [0, 1]; None takes the run's.
        settings: names and values that differ from the run's.
        folder: what relative paths are relative to; "" is the working directory.
        level: of detail, where the row was made of a chain; or of the distortion.
        kind: of distortion; "" where unknown.
    """

    id: str
    reference: str
    distorted: str
    ref_texture: str = ""
    texture: str = ""
    fail_under: float | None = None
    settings: tuple[tuple[str, Any], ...] = ()
    folder: str = ""
    level: int | None = None
    kind: str = ""

    def path(self, name: str) -> str:
        """Where a named file is, from the working directory; "" stays ""."""
        return os.path.join(self.folder, name) if name else ""

    def files(self) -> list[str]:
        """Where the assets and textures are that it names, from the working directory; "" for no texture."""
        assets = [split_spec(self.path(name))[0] for name in (self.reference, self.distorted)]
        return [*assets, self.path(self.ref_texture), self.path(self.texture)]

    def record_fields(self) -> dict[str, Any]:
        """What a record has of it, as plain values for JSON."""
        own = {name: str(value) if value == float("inf") else value for name, value in self.settings}
        textures = {"ref_texture": self.ref_texture or None, "texture": self.texture or None}
        kind = {"kind": self.kind} if self.kind else {}
        names = {"id": self.id, "reference": self.reference, "distorted": self.distorted, "level": self.level}
        return names | kind | textures | {"settings": own}

    def failed(self, why: str) -> dict[str, Any]:
        """The record of a row that was not scored."""
        return pair_record(PairScore(self.reference, self.distorted, error=why)) | self.record_fields()

    @property
    def preparation_key(self) -> tuple[Any, ...]:
        """Pairs that are equal in it share the preparation of their reference."""
        return (self.path(self.reference), self.path(self.ref_texture), self.settings)


@dataclass(frozen=True)
class Task:
    """A row that waits to be scored, and the key of its record in the journal."""

    key: str
    row: Row

    def as_dict(self) -> dict[str, Any]:
        return {"key": self.key, "row": asdict(self.row)}


def task_of(plain: dict[str, Any]) -> Task:
    """The inverse of Task.as_dict, after a way through JSON."""
    row = plain["row"]
    return Task(plain["key"], Row(**row | {"settings": tuple((name, value) for name, value in row["settings"])}))


def group_by_reference(tasks: Iterable[Task]) -> list[list[Task]]:
    """By what they prepare, in the order in which that first comes."""
    groups: dict[tuple[Any, ...], list[Task]] = {}
    for task in tasks:
        groups.setdefault(task.row.preparation_key, []).append(task)
    return list(groups.values())
