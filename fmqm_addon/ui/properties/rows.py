# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of the results, and what can be read off them."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from ...blender.scene.target import Target
from ...comparison.measurement import Readings
from ...metric.evaluation import Scores
from ...metric.perceived import Perceived
from ...metric.settings import SETTING_NAMES
from ...report.record_check import record_fault
from ...report.records import PERCEIVED, PairScore, pair_record
from ...report.trust_table import Report
from ...report.words import preset_label
from .. import stored_text


class FMQMRow(bpy.types.PropertyGroup):
    """One result. Scores are text, because a FloatProperty has only single precision."""

    name: StringProperty(name="Name", description="Object or collection that was compared")
    uid: StringProperty(name="Identifier", description="Key of the fields that this Blender session remembers")
    reference_name: StringProperty(name="Original", description="What it was compared with")
    kind: StringProperty(name="Kind", description="Whether it is an object or a collection")
    reference_kind: StringProperty(name="Original Kind", description="Whether the original is one or the other")
    bare_reference: BoolProperty(name="Bare Original", description="The original was measured without modifiers")
    scores: StringProperty(name="Scores", description="FMQM, perceived and their errors in double precision, as JSON")
    former: StringProperty(name="Former Scores", description="As Scores, of the measurement before; empty: none")
    triangles: IntProperty(name="Triangles", description="Triangles of the LOD", min=0)
    share: FloatProperty(
        name="Share", description="Its triangles by those of the original", min=0.0, subtype="PERCENTAGE"
    )
    patches: IntProperty(name="Patches", description="Patches that were scored", min=0)
    samples: IntProperty(name="Samples", description="Samples that were drawn", min=0)
    seconds: FloatProperty(name="Seconds", description="Time that the comparison took", min=0.0, unit="TIME_ABSOLUTE")
    stages: StringProperty(name="Stages", description="Seconds by stage, as JSON")
    warnings: StringProperty(name="Warnings", description="What to know before believing the score, one a line")
    notes: StringProperty(name="Notes", description="What was done that misleads nobody, one a line")
    error: StringProperty(name="Error", description="Why there is no score")
    space: StringProperty(name="Space", description="Where the two were compared")
    settings: StringProperty(name="Settings", description="Settings of the measurement, as JSON")
    reverse: StringProperty(name="Reverse", description="As Scores, of the other direction; empty: not measured")
    attribution: StringProperty(name="Attribution", description="Whose loss it is, as JSON; empty: not measured")
    screen_size: StringProperty(name="Screen Size", description="Where it may be shown, as JSON; empty: not measured")
    screen_extent: StringProperty(name="Extent", description="How large the original is, as JSON, for engines' numbers")
    trust: StringProperty(name="Trust", description="How far to trust the scores: facts with their units, as JSON")
    parts: StringProperty(name="Parts", description="Scores of the original's parts, as JSON")
    fingerprint: StringProperty(name="Fingerprint", description="Tells whether what was measured has changed since")


def active_row(scene: bpy.types.Scene) -> FMQMRow | None:
    """The chosen row of a scene's results."""
    rows, index = scene.fmqm.rows, scene.fmqm.row_index
    return rows[index] if 0 <= index < len(rows) else None


def row_targets(row: FMQMRow) -> tuple[Target, Target]:
    """What the row compared: the reference and the other."""
    return (
        Target(row.reference_kind, row.reference_name, row.bare_reference),
        Target(row.kind, row.name),
    )


def row_readings(row: FMQMRow) -> Readings | None:
    """Both readings, in double precision; None for a row with an error."""
    return stored_text.read_readings(row.scores)


def row_scores(row: FMQMRow) -> dict[str, float] | None:
    """All numbers of both readings by the names of report.words.LABELS; None for a row with an error."""
    readings = row_readings(row)
    return None if readings is None else _numbers(readings.scores, readings.perceived)


def row_stderr(row: FMQMRow) -> dict[str, float] | None:
    """Standard errors of row_scores over the seeds; None for one seed."""
    readings = row_readings(row)
    if readings is None or readings.stderr is None or readings.perceived_stderr is None:
        return None
    return _numbers(readings.stderr, readings.perceived_stderr)


def row_former(row: FMQMRow) -> dict[str, float] | None:
    """row_scores of the measurement before, at equal settings; None where there was none."""
    readings = stored_text.read_readings(row.former)
    return None if readings is None else _numbers(readings.scores, readings.perceived)


def row_reverse(row: FMQMRow) -> Readings | None:
    """Readings of the other direction, the compared as the reference; None where they were not measured."""
    return stored_text.read_readings(row.reverse)


def _numbers(scores: Scores, perceived: Perceived) -> dict[str, float]:
    return {**scores._asdict(), **{column: getattr(perceived, name) for column, name in PERCEIVED.items()}}


def row_attribution(row: FMQMRow) -> dict[str, Any] | None:
    """Whose loss it is, as comparison.attribution.Attribution.as_dict has it; None where that was not measured."""
    return stored_text.read_attribution(row.attribution)


def row_screen_size(row: FMQMRow) -> dict[str, Any] | None:
    """At which size on screen it may be shown, as screen_size.records.size_record has it; None: not measured."""
    return stored_text.read_screen_size(row.screen_size)


def row_trust(row: FMQMRow) -> Report | None:
    """The trust report of a row; None for a row with an error."""
    return stored_text.read_trust(row.trust)


def row_parts(row: FMQMRow) -> list[dict[str, Any]]:
    """The parts of a row, as comparison.parts.Part.as_dict has each; none for a row with an error."""
    return stored_text.read_parts(row.parts) or []


def settings_name(row: FMQMRow) -> str:
    """The preset that a row was measured with, or Custom."""
    used = stored_text.read_settings(row.settings)
    return "?" if used is None else preset_label(used)


def is_quick(row: FMQMRow) -> bool:
    """Whether only some of the patches were scored."""
    used = stored_text.read_settings(row.settings)
    return used is not None and used["scored_patches"] is not None and row.patches < used["patches"]


def comparable(row: FMQMRow, other: FMQMRow) -> bool:
    """Whether the scores of two rows may be compared: they were measured at equal settings."""
    return row.settings == other.settings or _settings_that_count(row) == _settings_that_count(other)


def _settings_that_count(row: FMQMRow) -> dict[str, Any] | None:
    used = stored_text.read_settings(row.settings)
    return None if used is None else {name: used[name] for name in SETTING_NAMES if name != "seed"}


def is_whole(row: FMQMRow) -> bool:
    """Whether all that a row holds can be read; whoever sent the file may have written something else there."""
    readers = (
        (row.scores, stored_text.read_readings),
        (row.reverse, stored_text.read_readings),
        (row.former, stored_text.read_readings),
        (row.attribution, stored_text.read_attribution),
        (row.screen_size, stored_text.read_screen_size),
        (row.screen_extent, stored_text.read_extent),
        (row.trust, stored_text.read_trust),
        (row.parts, stored_text.read_parts),
        (row.settings, stored_text.read_settings),
        (row.stages, stored_text.read_stages),
    )
    readable = stored_text.read_settings(row.settings) and all(read(text) is not None for text, read in readers if text)
    return bool(readable) and not record_fault(pair_record(pair_of(row)))


def pair_of(row: FMQMRow) -> PairScore:
    """A row as the reports want it."""
    reference, target = row_targets(row)
    extra = {"attribution": row_attribution(row), "screen_size": row_screen_size(row)}
    return PairScore(
        reference=reference.label,
        distorted=target.label,
        readings=row_readings(row),
        patches=row.patches or None,
        samples=row.samples or None,
        seconds=stored_text.read_stages(row.stages) or {},
        warnings=tuple(row.warnings.splitlines()),
        notes=tuple(row.notes.splitlines()),
        error=row.error or None,
        space=row.space or None,
        reverse=row_reverse(row),
        trust=row_trust(row),
        parts=tuple(row_parts(row)),
        findings={name: found for name, found in extra.items() if found is not None},
    )


CLASSES = (FMQMRow,)
