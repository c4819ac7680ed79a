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
from ..metric.settings import Settings
from ..report.records import PairScore, pair_record


@dataclass(frozen=True)
class Options:
    """How all pairs of a run are scored.

    Attributes:
        settings: of the metric, before a row's own. repeats: seeds. space, match_scale: as comparison.alignment.align.
        attribution: whose loss it is, too. explain: in words, too.
        report: folder of the report, for pictures; "" makes none. It changes no score.
        both: the other direction, too.
        bake, max_image_side, max_image_bytes: as the flags; None where they are not given.
        untrusted, asset_root: as the flags; "" where there is none. They change no score.
    """

    settings: Settings
    repeats: int = 1
    space: str = "auto"
    match_scale: bool = False
    attribution: bool = False
    explain: bool = False
    report: str = ""
    both: bool = False
    bake: int | None = None
    max_image_side: int | None = None
    max_image_bytes: int | None = None
    untrusted: bool = False
    asset_root: str = ""

    def settings_of(self, row: Row) -> Settings:
        return replace(self.settings, **dict(row.settings))

    def as_dict(self) -> dict[str, Any]:
        """Plain values under the names of the command line's flags."""
        rest = {"repeats": self.repeats, "space": self.space, "match_scale": self.match_scale}
        extra = {name: True for name in ("attribution", "explain", "both") if getattr(self, name)}
        reading = ("bake", "max_image_side", "max_image_bytes")
        extra |= {name: getattr(self, name) for name in reading if getattr(self, name) is not None}
        return self.settings.as_dict() | rest | extra

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
    """

    id: str
    reference: str
    distorted: str
    ref_texture: str = ""
    texture: str = ""
    fail_under: float | None = None
    settings: tuple[tuple[str, Any], ...] = ()
    folder: str = ""

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
        return {"id": self.id, "reference": self.reference, "distorted": self.distorted, **textures, "settings": own}

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
