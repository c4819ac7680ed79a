# SPDX-License-Identifier: GPL-3.0-or-later
"""What the add-on stores in the scene: inputs, settings, result rows."""

from __future__ import annotations

import json
import math
from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from ..blender.scene.members import is_measured
from ..comparison.alignment import SPACES
from ..metric.settings import FAST_SCORED_PATCHES, SETTING_NAMES, Settings
from ..report.trust_table import Report
from . import stored_text

SEED_LIMIT = 2**31 - 1  # of an IntProperty
CUSTOM = "CUSTOM"


def is_asset(object_: bpy.types.Object) -> bool:
    """Whether an object can be measured: it may show a surface, or it is an empty and stands for what hangs from it."""
    return object_.type == "EMPTY" or is_measured(object_)


def _can_be_picked(_: Any, object_: bpy.types.Object) -> bool:
    return is_asset(object_)


class FMQMItem(bpy.types.PropertyGroup):
    """One asset to compare: an object or a collection."""

    object: PointerProperty(
        name="Object",
        description="Mesh, curve, surface, text or metaball, or an empty, below which all counts as one object",
        type=bpy.types.Object,
        poll=_can_be_picked,
    )
    collection: PointerProperty(
        name="Collection", description="Collection whose objects count as one", type=bpy.types.Collection
    )


def kept(object_: bpy.types.Object | None) -> bpy.types.Object | None:
    """None for an object that was deleted: it stays in the file, in no scene, as long as a property points at it.

    Cheap: panels ask at each redraw.
    """
    if object_ is None or bpy.context.view_layer.objects.get(object_.name) == object_:
        return object_
    return object_ if object_.users_scene else None  # which goes through all objects


def item_target(item: FMQMItem) -> bpy.types.Object | bpy.types.Collection | None:
    """What an item stands for; None if that was deleted."""
    return kept(item.object) or item.collection


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


def _preset_chosen(settings: FMQMSettings, _: bpy.types.Context) -> None:
    if settings.preset == CUSTOM:
        return
    chosen = settings.preset
    for name, value in _PRESET_VALUES[chosen].items():
        setattr(settings, name, value)
    if settings.preset != chosen:  # values on the way to it looked like a setting of the user's own
        settings.preset = chosen


def _value_changed(settings: FMQMSettings, _: bpy.types.Context) -> None:
    if settings.preset != CUSTOM and any(
        plain(getattr(settings, name)) != value for name, value in _PRESET_VALUES[settings.preset].items()
    ):
        settings.preset = CUSTOM


class FMQMSettings(bpy.types.PropertyGroup):
    """Every option of scripts/score.py."""

    preset: EnumProperty(
        name="Preset",
        description="Values of all settings at once. Compare scores only at equal settings",
        items=[
            ("PAPER", "Paper", "The paper's values: the score to report"),
            ("FAST", "Fast", f"A quick look: {FAST_SCORED_PATCHES} patches, spread evenly, at full density"),
            (CUSTOM, "Custom", "Values of your own"),
        ],
        default="PAPER",
        update=_preset_chosen,
    )
    samples: IntProperty(
        name="Samples",
        description="Target number of points near the surface at which both meshes are compared",
        default=200_000, min=32, max=100_000_000, soft_max=1_000_000, step=10_000, update=_value_changed,
    )  # fmt: skip
    patches: IntProperty(
        name="Patches",
        description="Number of patches that the reference is divided into",
        default=250, min=1, max=1_000_000, soft_max=2_000, update=_value_changed,
    )  # fmt: skip
    score_all: BoolProperty(
        name="Score All Patches",
        description="Score every patch. Otherwise only the first ones, which are spread evenly",
        default=True, update=_value_changed,
    )  # fmt: skip
    scored_patches: IntProperty(
        name="Scored Patches",
        description="How many patches are scored, at full density",
        default=FAST_SCORED_PATCHES, min=1, max=1_000_000, soft_max=2_000, update=_value_changed,
    )  # fmt: skip
    sigma: FloatProperty(
        name="Sigma",
        description="Standard deviation of the samples' distance from the surface, in patch diagonals",
        default=0.05, min=0.0, max=1e6, soft_max=0.5, step=1, precision=3, update=_value_changed,
    )  # fmt: skip
    radius: FloatProperty(
        name="Radius",
        description="Radius of the surroundings in which colors are compared, in patch diagonals",
        default=0.125, min=1e-6, max=1e6, soft_max=1.0, step=1, precision=3, update=_value_changed,
    )  # fmt: skip
    radius_whole: BoolProperty(
        name="Whole Patch for Colors",
        description="Compare colors over the whole patch instead of within the radius",
        default=False, update=_value_changed,
    )  # fmt: skip
    gradient_radius: FloatProperty(
        name="Gradient Radius",
        description="Radius within which the steepest color change is looked for, in patch diagonals",
        default=0.125, min=1e-6, max=1e6, soft_max=1.0, step=1, precision=3, update=_value_changed,
    )  # fmt: skip
    gradient_whole: BoolProperty(
        name="Whole Patch for Gradients",
        description="Look for the steepest color change over the whole patch instead of within the gradient radius",
        default=False, update=_value_changed,
    )  # fmt: skip
    normal_threshold: FloatProperty(
        name="Normal Threshold",
        description="Absolute cosine above which a direction counts as along the normal",
        default=0.95, min=0.0, max=1.0, step=1, precision=3, update=_value_changed,
    )  # fmt: skip
    tangent_threshold: FloatProperty(
        name="Tangent Threshold",
        description="Absolute cosine below which a direction counts as in the tangent plane",
        default=0.05, min=0.0, max=1.0, step=1, precision=3, update=_value_changed,
    )  # fmt: skip
    color_units: IntProperty(
        name="Color Units",
        description="Samples of a patch whose surroundings the color features look at",
        default=100, min=1, max=1_000_000, soft_max=1_000, update=_value_changed,
    )  # fmt: skip
    centers: EnumProperty(
        name="Centers",
        description="How the patch centers are chosen",
        items=[
            ("fps", "Farthest Points", "Spread evenly over the surface"),
            ("random", "Random", "Drawn at random, by the seed"),
        ],
        update=_value_changed,
    )  # fmt: skip
    color_space: EnumProperty(
        name="Color Space",
        description="Color space of the two color features",
        items=[("rgb", "RGB", "sRGB, as in the paper"), ("lab", "Lab", "CIE L*a*b*, with lightness weighted 6:1:1")],
        update=_value_changed,
    )  # fmt: skip
    pooling: EnumProperty(
        name="Pooling",
        description="Mean of a patch's four features",
        items=[
            ("geometric", "Geometric", "As in the paper: one bad feature pulls the score down"),
            ("arithmetic", "Arithmetic", "The plain mean of the four"),
        ],
        update=_value_changed,
    )  # fmt: skip
    seed: IntProperty(
        name="Seed", description="Of all random draws: the same seed gives the same numbers", default=0, min=0,
        max=SEED_LIMIT,
    )  # fmt: skip
    repeats: IntProperty(
        name="Repeats",
        description="Measure with so many seeds. Scores become means, with their standard errors",
        default=1, min=1, max=1_000, soft_max=10,
    )  # fmt: skip
    space: EnumProperty(
        name="Space",
        description="Where the objects are compared",
        items=[
            ("AUTO", "Auto", "Where they stand, unless they overlap far better side by side or without transforms"),
            ("WORLD", "World", "Where they stand in the scene"),
            ("LOCAL", "Local", "Without their transforms: each moved onto the reference by its own origin and axes"),
        ],
        default="AUTO",
    )
    match_scale: BoolProperty(
        name="Match Scale",
        description="Undo a difference in size by a factor between units, such as 100, 1000 or 2.54",
        default=False,
    )
    both: BoolProperty(
        name="Both Directions",
        description="Score the compared as the reference too, which sees what only it has. Takes twice as long",
        default=False,
    )
    attribution: BoolProperty(
        name="Attribution",
        description="Score geometry and texture apart too: whose loss it is. Takes up to three times as long",
        default=False,
    )


# In the order in which operator presets save them; space and seed are the scene's, not a preset's.
PRESET_PROPERTIES = tuple(
    name
    for name in FMQMSettings.__annotations__
    if name not in {"preset", "seed", "space", "match_scale", "both", "attribution"}
)
_PAPER: dict[str, Any] = {
    **{name: getattr(Settings(), name) for name in SETTING_NAMES if name not in {"seed", "scored_patches"}},
    "score_all": True,
    "radius_whole": False,
    "gradient_whole": False,
}
_PRESET_VALUES: dict[str, dict[str, Any]] = {
    "PAPER": _PAPER,
    "FAST": {**_PAPER, "score_all": False, "scored_patches": FAST_SCORED_PATCHES},
}
assert {space.upper() for space in SPACES} == {"AUTO", "WORLD", "LOCAL"}


def plain(value: Any) -> Any:
    """A property's value as the user typed it: 0.05, not the single-precision 0.05000000074505806."""
    return float(str(np.float32(value))) if isinstance(value, float) else value


def metric_settings(settings: FMQMSettings) -> Settings:
    """The metric's settings, with the doubles that score.py would read from the same decimal digits.

    Raises:
        SettingsError: the values contradict one another.
    """
    values = {name: plain(getattr(settings, name)) for name in SETTING_NAMES}
    if settings.score_all:
        values["scored_patches"] = None
    if settings.radius_whole:
        values["radius"] = math.inf
    if settings.gradient_whole:
        values["gradient_radius"] = math.inf
    return Settings(**values)


CLASSES = (FMQMItem, FMQMRow, FMQMSettings)
