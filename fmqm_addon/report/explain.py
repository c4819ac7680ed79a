# SPDX-License-Identifier: GPL-3.0-or-later
"""A pair's record in plain words: what got worse, where, and how sure that is. From the numbers alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..metric.evaluation import COLUMNS, Result
from ..metric.geometry import Floats
from ..metric.surface import Surface

SEED_NOISE = 0.01  # FMQM of other seeds differs by less than this
FEW_PATCHES = 100  # a score of fewer is a quick look

# From which FMQM on. The words are ours: the paper has no such bands.
_VERDICTS = (
    (0.9995, "cannot be told from"),
    (0.95, "looks almost like"),
    (0.85, "looks much like"),
    (0.7, "looks visibly different from"),
    (0.0, "looks very different from"),
)
_GEOMETRY = {
    "geoSSIM": "the surface has moved, shrunk or lost its bumps",
    "geoGraSSIM": "the surface is bent or faceted",
}
_COLOR = {
    "colorSSIM": "the colors have shifted or are blurred",
    "colorGraSSIM": "edges in the texture are weaker or softer, or have moved",
}
_SMALL = 0.01  # a feature's loss that is not worth a word
_AXES = (("left", "right"), ("front", "back"), ("lower", "upper"))  # x, y, z; Blender's front view looks along y
_ORDER = (2, 0, 1)  # "upper left front"
_ALONE = {"left": "left side", "right": "right side", "lower": "bottom", "upper": "top"}
_TENTH = 0.1  # of the patches
_SPREAD = 0.2  # the worst tenth of the patches has less than this of the loss: it is everywhere
_SHARES = ((0.9, "nearly all"), (0.6, "most"), (0.45, "about half"), (0.28, "about a third"), (0.0, "about a quarter"))
_WORST = 3  # patches whose places are named


def where(reference: Surface, result: Result) -> dict[str, Any]:
    """The record's "where": how the loss lies on the reference.

    Returns:
        below_mean: share of patches whose FMQM is below the mean. worst_tenth: share of all loss that the worst tenth
        of the patches has; None where nothing is lost. worst: the worst patches' "place" in the reference's box, in
        words, and "FMQM".
    """
    fmqm = result.patch_scores[:, COLUMNS.index("FMQM")]
    loss = np.maximum(1 - fmqm, 0)
    order = np.argsort(fmqm, kind="stable")
    tenth = order[: max(1, round(_TENTH * len(fmqm)))]
    low, high = reference.vertices.min(axis=0), reference.vertices.max(axis=0)
    total = float(loss.sum())
    return {
        "below_mean": float(np.mean(fmqm < fmqm.mean())),
        "worst_tenth": float(loss[tenth].sum()) / total if total > 0 else None,
        "worst": [
            {"place": place_name(result.patch_centers[row], low, high), "FMQM": float(fmqm[row])}
            for row in order[:_WORST]
        ],
    }


def place_name(position: Floats, low: Floats, high: Floats) -> str:
    """A position in a box by thirds, such as "upper left front"; "middle" in the middle of all."""
    words = []
    for axis in _ORDER:
        size = high[axis] - low[axis]
        share = (position[axis] - low[axis]) / size if size > 0 else 0.5
        if not 1 / 3 <= share <= 2 / 3:
            words.append(_AXES[axis][int(share > 0.5)])
    if len(words) == 1:
        return _ALONE.get(words[0], words[0])
    return " ".join(words) or "middle"


def explain(record: Mapping[str, Any]) -> str:
    """One paragraph about a pair.

    Args:
        record: as report.records.pair_record has it; "where" and "attribution" are used where they are there.
    """
    if record["error"] is not None:
        return f"Not scored: {record['error']}."
    parts = [_verdict(record), _worse(record), _place(record), _sureness(record)]
    return " ".join(part for part in parts if part)


def _verdict(record: Mapping[str, Any]) -> str:
    fmqm = record["FMQM"]
    verdict = next(words for least, words in _VERDICTS if fmqm >= least)
    return f"{record['distorted']} {verdict} {record['reference']} (FMQM {_short(fmqm)})."


def _worse(record: Mapping[str, Any]) -> str:
    """By what the loss is attributed to, where that is known; moved geometry alone lowers the color features too."""
    geometry, color = _worst(record, _GEOMETRY), _worst(record, _COLOR)
    attribution = record.get("attribution")
    if not geometry and not color:
        return ""
    if not geometry and attribution is not None and attribution["mostly"] == "geometry":
        return f"The surface is nearly as it was, but the texture does not lie on it as before: {color}."
    if not geometry:
        return f"The geometry is nearly as it was; {color}."
    if not color:
        return f"The color is nearly as it was; {geometry}."
    if attribution is None:
        return f"It is the geometry: {geometry}. The colors suffer from that, from a change of their own, or from both."
    if attribution["how"] == "nearest points":
        rough = " That is a rough guess, since the two are not unwrapped alike."
    else:
        rough = ""
    return {
        "geometry": f"Most of the loss is the geometry: {geometry}, and the colors with it.{rough}",
        "texture": f"Most of the loss is the texture: {color}.{rough}",
        "both": f"Geometry and texture share the loss: {geometry}; {color}.{rough}",
        "nothing": f"It is not clear whose the loss is: {geometry}; {color}.{rough}",
    }[attribution["mostly"]]


def _worst(record: Mapping[str, Any], features: Mapping[str, str]) -> str:
    """What the lowest of the features means; "" where all are as good as 1."""
    name = min(features, key=lambda name: record[name])
    return features[name] if record[name] < 1 - _SMALL else ""


def _place(record: Mapping[str, Any]) -> str:
    found = record.get("where")
    if found is None or found["worst_tenth"] is None or record["FMQM"] >= 1 - _SMALL:
        return ""
    places = _joined(list(dict.fromkeys(patch["place"] for patch in found["worst"])))
    if found["worst_tenth"] < _SPREAD:
        return f"The loss is spread over the whole surface; it is greatest at the {places}."
    share = next(words for least, words in _SHARES if found["worst_tenth"] >= least)
    return f"A tenth of the surface has {share} of the loss, at the {places}."


def _sureness(record: Mapping[str, Any]) -> str:
    sentences = []
    stderr = record["stderr"]
    if stderr is not None and stderr["FMQM"] < SEED_NOISE / 2:
        sentences.append("Other random samples give the same score within a hundredth.")
    elif stderr is not None:
        sentences.append(f"Other random samples move the score by about {_short(2 * stderr['FMQM'])}.")
    elif record["FMQM"] < 1 - _SMALL:
        sentences.append("Differences below a hundredth say nothing: other random samples would make as much.")
    if record["patches"] < FEW_PATCHES:
        sentences.append(f"This was a quick look at {record['patches']} patches.")
    covered = _fact(record, "covered")
    if covered is not None and covered < 0.6:
        sentences.append("Much of the reference was not looked at.")
    if record["warnings"]:
        others = len(record["warnings"]) - 1
        more = f" (and {others} more {'warning' if others == 1 else 'warnings'})" if others else ""
        sentences.append(f"Before believing it: {record['warnings'][0]}{more}.")
    return " ".join(sentences)


def _fact(record: Mapping[str, Any], name: str) -> float | None:
    """Of the pair in the trust report, where that is there and knows it."""
    trust = record.get("trust")
    item = None if trust is None else trust["pair"].get(name)
    return None if item is None else item["value"]


def _short(number: float) -> str:
    """Two places, or as many as tell it from 1."""
    return f"{number:.2f}" if number == 1 or number < 0.995 else f"{min(number, 0.9999):.4f}"


def _joined(words: Sequence[str]) -> str:
    return " and ".join(words) if len(words) < 3 else f"{', '.join(words[:-1])} and {words[-1]}"
