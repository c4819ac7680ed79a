# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings: every option of the metric and of how two objects are compared."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from ...comparison.pair import PairOptions
from ...metric.settings import (
    FAST_SCORED_PATCHES,
    MIN_SAMPLES_PER_PATCH,
    SETTING_NAMES,
    Settings,
    info_of,
)

INT_LIMIT = 2**31 - 1  # of an IntProperty
_SMALLEST, _LARGEST = 1e-6, 10**6  # of numbers that must be above 0, and of those without a limit
CUSTOM = "CUSTOM"


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


def _about(name: str, owner: type = Settings, /, **more: Any) -> dict[str, Any]:
    """What a property shares with the flag of the same name: default, limits, text.

    Args:
        more: what is of the property alone, or differs.
    """
    info = info_of(owner, name)
    about: dict[str, Any] = {
        "name": name.replace("_", " ").title(),
        "description": info.text[0].upper() + info.text[1:],
        "default": getattr(owner, name),
    }
    if info.kind in (int, float):
        most = info.kind(_LARGEST if info.maximum is None else info.maximum)
        about |= {"min": _SMALLEST if info.above else info.minimum, "max": min(most, INT_LIMIT)}
    if owner is Settings:
        about["update"] = _value_changed
    return about | more


class FMQMSettings(bpy.types.PropertyGroup):
    """Every setting of the metric and every option of a pair."""

    preset: EnumProperty(
        name="Preset",
        description="Values of all settings at once. Compare scores only at equal settings",
        items=[
            ("PAPER", "Full", "The paper's values: the score to report"),
            ("FAST", "Quick", f"A quick look: {FAST_SCORED_PATCHES} patches, spread evenly, at full density"),
            (CUSTOM, "Custom", "Values of your own"),
        ],
        default="PAPER",
        update=_preset_chosen,
    )
    samples: IntProperty(**_about("samples", min=MIN_SAMPLES_PER_PATCH), soft_max=1_000_000, step=10_000)
    patches: IntProperty(**_about("patches"), soft_max=2_000)
    score_all: BoolProperty(
        name="Score All Patches",
        description="Score every patch. Otherwise only the first ones, which are spread evenly",
        default=True, update=_value_changed,
    )  # fmt: skip
    scored_patches: IntProperty(**_about("scored_patches", default=FAST_SCORED_PATCHES), soft_max=2_000)
    sigma: FloatProperty(**_about("sigma"), soft_max=0.5, step=1, precision=3)
    radius: FloatProperty(**_about("radius"), soft_max=1.0, step=1, precision=3)
    radius_whole: BoolProperty(
        name="Whole Patch for Colors",
        description="Compare colors over the whole patch instead of within the radius",
        default=False, update=_value_changed,
    )  # fmt: skip
    gradient_radius: FloatProperty(**_about("gradient_radius"), soft_max=1.0, step=1, precision=3)
    gradient_whole: BoolProperty(
        name="Whole Patch for Gradients",
        description="Look for the steepest color change over the whole patch instead of within the gradient radius",
        default=False, update=_value_changed,
    )  # fmt: skip
    normal_threshold: FloatProperty(**_about("normal_threshold"), step=1, precision=3)
    tangent_threshold: FloatProperty(**_about("tangent_threshold"), step=1, precision=3)
    color_units: IntProperty(**_about("color_units"), soft_max=1_000)
    centers: EnumProperty(
        **_about("centers"),
        items=[
            ("fps", "Farthest Points", "Spread evenly over the surface"),
            ("random", "Random", "Drawn at random, by the seed"),
        ],
    )
    color_space: EnumProperty(
        **_about("color_space"),
        items=[("rgb", "RGB", "sRGB, as in the paper"), ("lab", "Lab", "CIE L*a*b*, with lightness weighted 6:1:1")],
    )
    pooling: EnumProperty(
        **_about("pooling"),
        items=[
            ("geometric", "Geometric", "As in the paper: one bad feature pulls the score down"),
            ("arithmetic", "Arithmetic", "The plain mean of the four"),
        ],
    )
    seed: IntProperty(**_about("seed", update=None))
    repeats: IntProperty(**_about("repeats", PairOptions, max=1_000), soft_max=10)
    space: EnumProperty(
        name="Space",
        description="Where the objects are compared",
        items=[
            ("AUTO", "Auto", "Where they stand, unless they overlap far better side by side or without transforms"),
            ("WORLD", "World", "Where they stand in the scene"),
            ("LOCAL", "Local", "Without their transforms: each moved onto the original by its own origin and axes"),
        ],
        default=PairOptions.space.upper(),
    )
    match_scale: BoolProperty(**_about("match_scale", PairOptions))
    align: EnumProperty(
        name="Refine",
        description="What refines the placement",
        items=[
            ("NONE", "Nothing", "Each stands where Space has put it"),
            ("ICP", "Closest Points", "Rigidly onto the original's nearest points: for scans a little askew"),
        ],
        default=PairOptions.align.upper(),
    )
    both: BoolProperty(**_about("both", PairOptions, name="Both Directions"))
    attribution: BoolProperty(**_about("attribution", PairOptions))
    include: StringProperty(
        name="Include",
        description="Only objects with such names, or in empties or collections with them: patterns, as *_body, "
        "separated by commas. Empty for all",
    )
    exclude: StringProperty(
        name="Exclude",
        description="Leave out objects with such names, or in empties or collections with them: patterns, as "
        "*_helper, separated by commas",
    )


# In the order in which operator presets save them; space and seed are the scene's, not a preset's.
PRESET_PROPERTIES = tuple(
    name
    for name in FMQMSettings.__annotations__
    if name not in {"preset", "seed", "space", "match_scale", "align", "both", "attribution", "include", "exclude"}
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
assert {space.upper() for space in info_of(PairOptions, "space").choices} == {"AUTO", "WORLD", "LOCAL"}


def patterns_of(text: str) -> tuple[str, ...]:
    """The patterns of names in a text, which commas separate."""
    return tuple(filter(None, map(str.strip, text.split(","))))


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


def pair_options(settings: FMQMSettings) -> PairOptions:
    """All that is asked about pairs.

    Raises:
        SettingsError: as metric_settings.
    """
    return PairOptions(
        settings=metric_settings(settings),
        repeats=settings.repeats,
        space=settings.space.lower(),
        match_scale=settings.match_scale,
        align=settings.align.lower(),
        both=settings.both,
        attribution=settings.attribution,
    )


CLASSES = (FMQMSettings,)
