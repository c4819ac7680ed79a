# SPDX-License-Identifier: GPL-3.0-or-later
"""The words in which results are told to people, one for each thing, in the sidebar, pages, pictures, explanations.

JSON and CSV keep their own keys.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..metric.settings import PRESETS, SETTING_NAMES, Settings

ORIGINAL, LOD = "Original", "LOD"
PRESET_LABELS = {"paper": "Full", "fast": "Quick"}
CUSTOM = "Custom"  # settings of no preset

# Columns of a result: FMQM with the paper's features, perceived with its own.
LABELS = {
    "FMQM": "FMQM",
    "geoSSIM": "geoSSIM",
    "geoGraSSIM": "geoGraSSIM",
    "colorSSIM": "colorSSIM",
    "colorGraSSIM": "colorGraSSIM",
    "perceived": "Perceived",
    "shape": "Shape",
    "facing": "Facing",
    "color": "Color",
    "detail": "Detail",
    "perceived_p10": "Worst Tenth",
}
# What an artist should know of each: what a low value looks like.
MEANINGS = {
    "FMQM": "The paper's score, 0 to 1: mean over all patches. 1 is the same as the original",
    "geoSSIM": "Shape: distances to the surface. Low where the surface has moved, shrunk or lost its bumps",
    "geoGraSSIM": (
        "Facing: directions to the surface. Low where it is bent or faceted, so that its normals point elsewhere"
    ),
    "colorSSIM": "Color: colors around a point. Low where the texture is blurred, shifted, tinted or compressed",
    "colorGraSSIM": (
        "Detail: the steepest color changes. Low where edges in the texture have moved, softened or broken up"
    ),
    "perceived": "Whether people would see it, 0 to 1: mean over all patches. 1 is the same",
    "shape": "Distances to the surface. Low where the surface has moved, shrunk or lost its bumps",
    "facing": "Directions to the surface. Low where it is bent or faceted, and shades otherwise",
    "color": "Colors around a point. Low where colors or contrasts have changed visibly",
    "detail": "Slopes of the colors. Low where the texture is blurred, moved or broken up",
    "perceived_p10": "A tenth of the patches has a perceived quality below this",
}
assert set(PRESET_LABELS) == set(PRESETS)


def plain(name: str) -> str:
    """A name from a record or a trust report as words in a sentence."""
    return name.replace("_", " ").replace("distorted", LOD).replace("reference", ORIGINAL.lower())


def preset_label(settings: Mapping[str, Any]) -> str:
    """The preset that settings, as JSON has them, are of, the seed aside; or CUSTOM."""
    for name, values in PRESETS.items():
        preset = Settings(**values).as_dict()
        if all(preset[each] == settings[each] for each in SETTING_NAMES if each != "seed"):
            return PRESET_LABELS[name]
    return CUSTOM
