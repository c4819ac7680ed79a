# SPDX-License-Identifier: GPL-3.0-or-later
"""A pair's record in plain words: what got worse, where, and how sure that is. From its numbers and facts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..comparison.color_shift import JUST_NOTICEABLE
from ..comparison.doubts import LEAST_COVERED
from ..comparison.impairment import IMPAIRMENTS, capped_by, impairment_of
from ..comparison.places import place_name
from ..metric.evaluation import Result
from ..metric.perceived import PERCEIVED_COLUMNS
from ..metric.surface import Surface
from .causes import Facts, causes
from .numbers import PLACES, score_text

SEED_NOISE = 0.01  # FMQM of other seeds differs by less than this
PERCEIVED_NOISE = 0.002  # and perceived by less than this
FEW_PATCHES = 100  # a score of fewer is a quick look
_FOOTNOTE = (
    f"Levels: {', '.join(f'{words} (perceived from {least:g} on)' for least, words in IMPAIRMENTS[:-1])}, "
    f"{IMPAIRMENTS[-1][1]}; "
    "they were fitted on human scores of one model, an orientation, and facts that perceived does not see lower them. "
    f"Other random samples move FMQM by up to {SEED_NOISE:g} and perceived by up to {PERCEIVED_NOISE:g}: smaller "
    "differences say nothing."
)

_GEOMETRY = {
    "shape": "the surface has moved, shrunk or lost its bumps",
    "facing": "the surface is bent or faceted, so that light falls on it differently",
}
_COLOR = {
    "color": "the colors are paler, blurred or not where they were",
    "detail": "edges in the texture are softer, or have moved",
}
_SHIFTED = "the colors have shifted"
_SMALL = 0.01  # a feature's loss that is not worth a word
_TENTH = 0.1  # of the patches
_SPREAD = 0.2  # the worst tenth of the patches has less than this of the loss: it is everywhere
_SHARES = ((0.9, "nearly all"), (0.6, "most"), (0.45, "about half"), (0.28, "about a third"), (0.0, "about a quarter"))
_WORST = 3  # patches whose places are named
_PERCEIVED = PERCEIVED_COLUMNS.index("perceived")


def footnote(records: Iterable[Mapping[str, Any]]) -> str:
    """What is the same for every pair, to stand once."""
    few = {record["patches"] for record in records if record["patches"] is not None and record["patches"] < FEW_PATCHES}
    quick = f" A score of {min(few)} patches is a quick look." if few else ""
    return f"{_FOOTNOTE}{quick}"


def where(reference: Surface, result: Result) -> dict[str, Any]:
    """The record's "where": how the loss of perceived lies on the reference.

    Returns:
        below_mean: share of patches whose perceived is below the mean. worst_tenth: share of all loss that the worst
        tenth of the patches has; None where nothing is lost. worst: the worst patches' "place" in the reference's box,
        in words, and "perceived".
    """
    perceived = result.patch_perceived[:, _PERCEIVED]
    loss = np.maximum(1 - perceived, 0)
    order = np.argsort(perceived, kind="stable")
    tenth = order[: max(1, round(_TENTH * len(perceived)))]
    low, high = reference.vertices.min(axis=0), reference.vertices.max(axis=0)
    total = float(loss.sum())
    return {
        "below_mean": float(np.mean(perceived < perceived.mean())),
        "worst_tenth": float(loss[tenth].sum()) / total if total > 0 else None,
        "worst": [
            {"place": place_name(result.patch_centers[row], low, high), "perceived": float(perceived[row])}
            for row in order[:_WORST]
        ],
    }


def explain(record: Mapping[str, Any]) -> str:
    """One paragraph about a pair.

    Args:
        record: as report.records.pair_record has it; "where" and "attribution" are used where they are there.
    """
    if record["error"] is not None:
        return f"Not scored: {record['error']}."
    return " ".join([*sentences(record), *_doubt(record)])


def sentences(record: Mapping[str, Any]) -> list[str]:
    """What explain() says of a scored pair, its warnings aside."""
    found = [*_judgement(record), _place(record), *_sureness(record, Facts(record))]
    return [sentence for sentence in found if sentence]


def verdict(record: Mapping[str, Any]) -> str:
    """How much a scored pair differs, by what, and why, as far as that is known."""
    return " ".join(sentence for sentence in _judgement(record) if sentence)


def _judgement(record: Mapping[str, Any]) -> list[str]:
    facts = Facts(record)
    return [_verdict(record, facts), _worse(record, facts), *causes(record["perceived"], facts)]


def _verdict(record: Mapping[str, Any], facts: Facts) -> str:
    score, names = record["perceived"]["score"], (record["distorted"], record["reference"])
    caps = capped_by(score, facts.pair)
    but = f", but {_joined(caps)}" if caps else ""
    level = impairment_of(score, facts.pair)
    if level != IMPAIRMENTS[0][1]:
        return f"{names[0]} differs from {names[1]}: {level} (perceived {_short(score)}{but})."
    if record["warnings"]:
        return f"What differs between {names[0]} and {names[1]} is {level} (perceived {_short(score)})."
    return f"{names[0]} cannot be told from {names[1]} (perceived {_short(score)})."


def _worse(record: Mapping[str, Any], facts: Facts) -> str:
    """By the lowest feature, and by what the loss is attributed to, where that is known; moved geometry alone lowers
    the color features too."""
    features = record["perceived"]
    geometry, color = _worst(features, _GEOMETRY), _worst(features, _COLOR)
    if color == _COLOR["color"] and (facts.pair.get("color_shift") or 0) >= JUST_NOTICEABLE:
        color = _SHIFTED
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
        is_geometry = min(features[name] for name in _GEOMETRY) <= min(features[name] for name in _COLOR)
        most, less = (geometry, color) if is_geometry else (color, geometry)
        return f"Above all {most}; besides, {less}."
    rough = ""
    if attribution["how"] == "nearest points":
        rough = " That is a rough guess, since the two are not unwrapped alike."
    return {
        "geometry": f"Most of the loss is the geometry: {geometry}, and the colors with it.{rough}",
        "texture": f"Most of the loss is the texture: {color}.{rough}",
        "both": f"Geometry and texture share the loss: {geometry}; {color}.{rough}",
        "nothing": f"It is not clear whose the loss is: {geometry}; {color}.{rough}",
    }[attribution["mostly"]]


def _worst(values: Mapping[str, float], features: Mapping[str, str]) -> str:
    """What the lowest of the features means; "" where all are as good as 1."""
    name = min(features, key=lambda name: values[name])
    return features[name] if values[name] < 1 - _SMALL else ""


def _place(record: Mapping[str, Any]) -> str:
    found = record.get("where")
    if found is None or found["worst_tenth"] is None or record["perceived"]["score"] >= 1 - _SMALL:
        return ""
    places = _joined(list(dict.fromkeys(patch["place"] for patch in found["worst"])))
    if found["worst_tenth"] < _SPREAD:
        return f"The loss is spread over the whole surface; it is greatest at the {places}."
    share = next(words for least, words in _SHARES if found["worst_tenth"] >= least)
    return f"A tenth of the surface has {share} of the loss, at the {places}."


def _sureness(record: Mapping[str, Any], facts: Facts) -> Iterator[str]:
    stderr = record["perceived"]["stderr"]
    if stderr is not None and 2 * stderr["score"] > PERCEIVED_NOISE:
        yield f"Other random samples move perceived by about {2 * stderr['score']:.2g}."
    if record["patches"] >= FEW_PATCHES and (facts.pair.get("covered") or 1) < LEAST_COVERED:
        yield "Much of the original was not looked at."


def _doubt(record: Mapping[str, Any]) -> Iterator[str]:
    if record["warnings"]:
        others = len(record["warnings"]) - 1
        more = f" (and {others} more {'warning' if others == 1 else 'warnings'})" if others else ""
        yield f"Before believing it: {record['warnings'][0]}{more}."


def _short(number: float) -> str:
    """Two places, or as many as tell it from 1."""
    return score_text(number, places=2 if number == 1 or number < 0.995 else PLACES)


def _joined(words: Sequence[str]) -> str:
    return " and ".join(words) if len(words) < 3 else f"{', '.join(words[:-1])} and {words[-1]}"
