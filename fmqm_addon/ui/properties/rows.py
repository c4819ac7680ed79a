# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of the results, and what can be read off them."""

from __future__ import annotations

import json
from typing import Any

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from ...blender.scene.target import Target
from ...metric.evaluation import Scores
from ...metric.settings import PRESETS, SETTING_NAMES, Settings
from ...report.record_check import record_fault
from ...report.records import SHOWN, PairScore, pair_record
from ...report.trust_table import Report
from .. import stored_text

# What an artist should know of each number: label, and what a low value looks like.
EXPLAINED = {
    "FMQM": ("FMQM", "The whole score, 0 to 1: mean over all patches. 1 is the same as the reference"),
    "geoSSIM": (
        "Shape",
        "geoSSIM: distances to the surface. Low where the surface has moved, shrunk or lost its bumps",
    ),
    "geoGraSSIM": (
        "Direction",
        "geoGraSSIM: directions to the surface. Low where it is bent or faceted, so that its normals point elsewhere",
    ),
    "colorSSIM": (
        "Color",
        "colorSSIM: colors around a point. Low where the texture is blurred, shifted, tinted or compressed",
    ),
    "colorGraSSIM": (
        "Color Edges",
        "colorGraSSIM: the steepest color changes. Low where edges in the texture have moved, softened or broken up",
    ),
}
assert set(EXPLAINED) == set(SHOWN)


class FMQMRow(bpy.types.PropertyGroup):
    """One result. Scores are text, because a FloatProperty has only single precision."""

    name: StringProperty(name="Name", description="Object or collection that was compared")
    uid: StringProperty(name="Identifier", description="Key of the fields that this Blender session remembers")
    reference_name: StringProperty(name="Reference", description="What it was compared with")
    kind: StringProperty(name="Kind", description="Whether it is an object or a collection")
    reference_kind: StringProperty(name="Reference Kind", description="Whether the reference is one or the other")
    bare_reference: BoolProperty(name="Bare Reference", description="The reference was measured without modifiers")
    scores: StringProperty(name="Scores", description="The five scores in double precision, as JSON")
    stderr: StringProperty(name="Standard Errors", description="Of the scores, as JSON; empty for one seed")
    triangles: IntProperty(name="Triangles", description="Triangles of the compared object", min=0)
    share: FloatProperty(
        name="Share", description="Its triangles by those of the reference", min=0.0, subtype="PERCENTAGE"
    )
    patches: IntProperty(name="Patches", description="Patches that were scored", min=0)
    samples: IntProperty(name="Samples", description="Samples that were drawn", min=0)
    seconds: FloatProperty(name="Seconds", description="Time that the comparison took", min=0.0, unit="TIME_ABSOLUTE")
    stages: StringProperty(name="Stages", description="Seconds by stage, as JSON")
    warnings: StringProperty(name="Warnings", description="What to know before believing the score, one a line")
    error: StringProperty(name="Error", description="Why there is no score")
    space: StringProperty(name="Space", description="Where the two were compared")
    settings: StringProperty(name="Settings", description="Settings of the measurement, as JSON")
    reverse: StringProperty(name="Reverse", description="Scores of the other direction, as JSON; empty: not measured")
    attribution: StringProperty(name="Attribution", description="Whose loss it is, as JSON; empty: not measured")
    trust: StringProperty(name="Trust", description="How far to trust the scores: facts with their units, as JSON")
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


def row_scores(row: FMQMRow) -> dict[str, float] | None:
    """The five scores by the names of metric.evaluation.COLUMNS, in double precision; None for a row with an error."""
    return stored_text.read_columns(row.scores)


def row_stderr(row: FMQMRow) -> dict[str, float] | None:
    """Standard errors of the scores over the seeds; None for one seed."""
    return stored_text.read_columns(row.stderr)


def row_reverse(row: FMQMRow) -> dict[str, float] | None:
    """Scores of the other direction, the compared as the reference; None where they were not measured."""
    return stored_text.read_columns(row.reverse)


def row_attribution(row: FMQMRow) -> dict[str, Any] | None:
    """Whose loss it is, as comparison.attribution.Attribution.as_dict has it; None where that was not measured."""
    return stored_text.read_attribution(row.attribution)


def row_trust(row: FMQMRow) -> Report | None:
    """The trust report of a row; None for a row with an error."""
    return stored_text.read_trust(row.trust)


def numbers_text(values: Any) -> str:
    """Doubles as the text that row_scores reads back bit by bit."""
    return json.dumps(np.asarray(values, np.float64).tolist())


def settings_name(row: FMQMRow) -> str:
    """The preset that a row was measured with, or Custom."""
    used = _settings_that_count(row)
    if used is None:
        return "?"
    for name, values in PRESETS.items():
        preset = Settings(**values).as_dict()
        if all(preset[each] == value for each, value in used.items()):
            return name.capitalize()
    return "Custom"


def comparable(row: FMQMRow, other: FMQMRow) -> bool:
    """Whether the scores of two rows may be compared: they were measured at equal settings."""
    return row.settings == other.settings or _settings_that_count(row) == _settings_that_count(other)


def _settings_that_count(row: FMQMRow) -> dict[str, Any] | None:
    used = stored_text.read_settings(row.settings)
    return None if used is None else {name: used[name] for name in SETTING_NAMES if name != "seed"}


def is_whole(row: FMQMRow) -> bool:
    """Whether all that a row holds can be read; whoever sent the file may have written something else there."""
    readers = (
        (row.scores, stored_text.read_columns),
        (row.stderr, stored_text.read_columns),
        (row.reverse, stored_text.read_columns),
        (row.attribution, stored_text.read_attribution),
        (row.trust, stored_text.read_trust),
        (row.settings, stored_text.read_settings),
        (row.stages, stored_text.read_stages),
    )
    readable = stored_text.read_settings(row.settings) and all(read(text) is not None for text, read in readers if text)
    return bool(readable) and not record_fault(pair_record(pair_of(row)))


def pair_of(row: FMQMRow) -> PairScore:
    """A row as the reports want it."""
    reference, target = row_targets(row)
    attribution = row_attribution(row)
    return PairScore(
        reference=reference.label,
        distorted=target.label,
        scores=_scores(row_scores(row)),
        stderr=_scores(row_stderr(row)),
        patches=row.patches or None,
        samples=row.samples or None,
        seconds=stored_text.read_stages(row.stages) or {},
        warnings=tuple(row.warnings.splitlines()),
        error=row.error or None,
        space=row.space or None,
        reverse=_scores(row_reverse(row)),
        trust=row_trust(row),
        findings={} if attribution is None else {"attribution": attribution},
    )


def _scores(columns: dict[str, float] | None) -> Scores | None:
    return None if columns is None else Scores(**columns)


CLASSES = (FMQMRow,)
