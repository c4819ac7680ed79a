# SPDX-License-Identifier: GPL-3.0-or-later
"""Records to sentences: what is said, and what is not. Needs no bpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fmqm_addon.report.explain import explain, place_name


def record(fmqm: float, features: tuple[float, float, float, float], **more: Any) -> dict[str, Any]:
    names = ("geoSSIM", "geoGraSSIM", "colorSSIM", "colorGraSSIM")
    plain = {"reference": "a.glb", "distorted": "b.glb", "stderr": None, "patches": 250, "warnings": [], "error": None}
    return {**plain, "FMQM": fmqm, **dict(zip(names, features, strict=True)), **more}


def attribution(mostly: str, how: str = "materials") -> dict[str, Any]:
    return {"geometry_loss": 0.2, "texture_loss": 0.2, "how": how, "mostly": mostly, "phrase": ""}


def located(worst_tenth: float | None, *places: str) -> dict[str, Any]:
    worst = [{"place": place, "FMQM": 0.5} for place in places]
    return {"below_mean": 0.4, "worst_tenth": worst_tenth, "worst": worst}


ALL_LOW = (0.8, 0.9, 0.7, 0.5)
TEXTURE_LOW = (1.0, 1.0, 0.7, 0.4)
GEOMETRY_LOW = (0.8, 0.97, 1.0, 1.0)
SEED = "Differences below a hundredth say nothing: other random samples would make as much."

CASES = [
    (record(1.0, (1.0,) * 4), "b.glb cannot be told from a.glb (FMQM 1.00)."),
    (record(0.9997, (1.0,) * 4), "b.glb cannot be told from a.glb (FMQM 0.9997)."),
    (
        record(0.73, TEXTURE_LOW),
        "b.glb looks visibly different from a.glb (FMQM 0.73). The geometry is nearly as it was; edges in the texture "
        f"are weaker or softer, or have moved. {SEED}",
    ),
    (
        record(0.73, TEXTURE_LOW, attribution=attribution("geometry")),
        "b.glb looks visibly different from a.glb (FMQM 0.73). The surface is nearly as it was, but the texture does "
        f"not lie on it as before: edges in the texture are weaker or softer, or have moved. {SEED}",
    ),
    (
        record(0.94, GEOMETRY_LOW),
        "b.glb looks much like a.glb (FMQM 0.94). The color is nearly as it was; the surface has moved, shrunk or lost "
        f"its bumps. {SEED}",
    ),
    (
        record(0.6, ALL_LOW),
        "b.glb looks very different from a.glb (FMQM 0.60). It is the geometry: the surface has moved, shrunk or lost "
        f"its bumps. The colors suffer from that, from a change of their own, or from both. {SEED}",
    ),
    (
        record(0.6, (0.95, 0.8, 0.7, 0.8), attribution=attribution("both", "nearest points")),
        "b.glb looks very different from a.glb (FMQM 0.60). Geometry and texture share the loss: the surface is bent "
        "or faceted; the colors have shifted or are blurred. That is a rough guess, since the two are not unwrapped "
        f"alike. {SEED}",
    ),
]


@pytest.mark.parametrize("given, text", CASES)
def test_paragraphs(given: dict[str, Any], text: str) -> None:
    assert explain(given) == text


@pytest.mark.parametrize(
    "more, sentence",
    [
        ({"attribution": attribution("geometry")}, "Most of the loss is the geometry: the surface has moved"),
        ({"attribution": attribution("texture")}, "Most of the loss is the texture: edges in the texture"),
        ({"attribution": attribution("nothing")}, "It is not clear whose the loss is"),
        ({"where": located(0.7, "top", "top", "left side")}, "A tenth of the surface has most of the loss, at the top "
         "and left side."),
        ({"where": located(0.15, "top", "back", "middle")}, "The loss is spread over the whole surface; it is greatest "
         "at the top, back and middle."),
        ({"where": located(0.5, "top")}, "has about half of the loss, at the top."),
        ({"stderr": {"FMQM": 0.001}}, "Other random samples give the same score within a hundredth."),
        ({"stderr": {"FMQM": 0.02}}, "Other random samples move the score by about 0.04."),
        ({"patches": 40}, "This was a quick look at 40 patches."),
        ({"warnings": ["b.glb: it is loose"]}, "Before believing it: b.glb: it is loose."),
        ({"warnings": ["first", "second", "third"]}, "Before believing it: first (and 2 more warnings)."),
        ({"trust": {"pair": {"covered": {"value": 0.5, "unit": ""}}}}, "Much of the reference was not looked at."),
    ],
)  # fmt: skip
def test_a_fact_has_its_sentence_and_no_other_record_has_it(more: dict[str, Any], sentence: str) -> None:
    assert sentence in explain(record(0.6, ALL_LOW, **more))
    assert sentence not in explain(record(0.6, ALL_LOW, where=located(0.3, "front")))


def test_what_failed_and_what_is_the_same_has_no_place_of_its_loss() -> None:
    failed = record(0.0, (0.0,) * 4, error="b.glb: no such file") | {"FMQM": None}
    assert explain(failed) == "Not scored: b.glb: no such file."
    assert "loss" not in explain(
        record(1.0, (1.0,) * 4, where=located(None, "middle"), attribution=attribution("both"))
    )


@pytest.mark.parametrize(
    "position, name",
    [
        ((0.0, 0.0, 0.0), "middle"),
        ((-0.9, -0.9, 0.9), "upper left front"),
        ((0.9, 0.9, -0.9), "lower right back"),
        ((0.0, 0.0, 0.9), "top"),
        ((-0.9, 0.0, 0.0), "left side"),
        ((0.0, 0.9, 0.0), "back"),
        ((0.0, 0.9, -0.9), "lower back"),
    ],
)
def test_places_are_thirds_of_the_box_seen_from_the_front(position: tuple[float, float, float], name: str) -> None:
    assert place_name(np.array(position), np.full(3, -1.0), np.ones(3)) == name


def test_a_flat_box_has_no_third_across() -> None:
    assert place_name(np.array([0.9, 0.0, 0.0]), np.array([-1.0, 0, -1]), np.array([1.0, 0, 1])) == "right side"
