# SPDX-License-Identifier: GPL-3.0-or-later
"""Records to sentences: what is said, and what is not. Needs no bpy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fmqm_addon.comparison.impairment import impairment_of
from fmqm_addon.comparison.places import place_name
from fmqm_addon.report.explain import explain, footnote


def record(perceived: float, features: tuple[float, float, float, float], **more: Any) -> dict[str, Any]:
    names = ("shape", "facing", "color", "detail")
    plain = {"reference": "a.glb", "distorted": "b.glb", "patches": 250, "warnings": [], "error": None}
    reading = {"score": perceived, **dict(zip(names, features, strict=True)), "stderr": None}
    return {**plain, "perceived": reading, **more}


def attribution(mostly: str, how: str = "materials") -> dict[str, Any]:
    return {"geometry_loss": 0.2, "texture_loss": 0.2, "how": how, "mostly": mostly, "phrase": ""}


def located(worst_tenth: float | None, *places: str) -> dict[str, Any]:
    worst = [{"place": place, "perceived": 0.5} for place in places]
    return {"below_mean": 0.4, "worst_tenth": worst_tenth, "worst": worst}


def facts(reference: dict[str, Any] | None = None, distorted: dict[str, Any] | None = None, **pair: Any) -> Any:
    """A trust report that knows these."""
    groups = {"reference": reference or {}, "distorted": distorted or {}, "pair": pair}
    return {name: {key: {"value": value, "unit": ""} for key, value in of.items()} for name, of in groups.items()}


def textured(side: int) -> dict[str, Any]:
    return {"images": [{"role": "base color", "width": side, "height": side}]}


ALL_LOW = (0.9, 0.8, 0.7, 0.5)
TEXTURE_LOW = (1.0, 1.0, 0.7, 0.4)
GEOMETRY_LOW = (0.8, 0.97, 1.0, 1.0)

CASES = [
    (record(1.0, (1.0,) * 4), "b.glb cannot be told from a.glb (perceived 1.00)."),
    (record(0.9997, (1.0,) * 4), "b.glb cannot be told from a.glb (perceived 0.9997)."),
    (
        record(0.73, TEXTURE_LOW),
        "b.glb differs from a.glb: very annoying (perceived 0.73). The geometry is nearly as it was; edges in the "
        "texture are softer, or have moved.",
    ),
    (
        record(0.73, TEXTURE_LOW, attribution=attribution("geometry")),
        "b.glb differs from a.glb: very annoying (perceived 0.73). The surface is nearly as it was, but the texture "
        "does not lie on it as before: edges in the texture are softer, or have moved.",
    ),
    (
        record(0.94, GEOMETRY_LOW),
        "b.glb differs from a.glb: slightly annoying (perceived 0.94). The color is nearly as it was; the surface has "
        "moved, shrunk or lost its bumps.",
    ),
    (
        record(0.6, ALL_LOW),
        "b.glb differs from a.glb: very annoying (perceived 0.60). Above all edges in the texture are softer, or have "
        "moved; besides, the surface is bent or faceted, so that light falls on it differently.",
    ),
    (
        record(0.6, (0.95, 0.8, 0.7, 0.8), attribution=attribution("both", "nearest points")),
        "b.glb differs from a.glb: very annoying (perceived 0.60). Geometry and texture share the loss: the surface is "
        "bent or faceted, so that light falls on it differently; the colors are paler, blurred or not where they "
        "were. That is a rough guess, since the two are not unwrapped alike.",
    ),
]


@pytest.mark.parametrize("given, text", CASES)
def test_paragraphs(given: dict[str, Any], text: str) -> None:
    assert explain(given) == text


@pytest.mark.parametrize(
    "more, sentence",
    [
        ({"attribution": attribution("geometry")}, "Most of the loss is the geometry: the surface is bent"),
        ({"attribution": attribution("texture")}, "Most of the loss is the texture: edges in the texture"),
        ({"attribution": attribution("nothing")}, "It is not clear whose the loss is"),
        ({"where": located(0.7, "top", "top", "left side")}, "A tenth of the surface has most of the loss, at the top "
         "and left side."),
        ({"where": located(0.15, "top", "back", "middle")}, "The loss is spread over the whole surface; it is greatest "
         "at the top, back and middle."),
        ({"where": located(0.5, "top")}, "has about half of the loss, at the top."),
        ({"warnings": ["b.glb: it is loose"]}, "Before believing it: b.glb: it is loose."),
        ({"warnings": ["first", "second", "third"]}, "Before believing it: first (and 2 more warnings)."),
        ({"trust": facts(covered=0.5)}, "Much of the original was not looked at."),
        ({"trust": facts(triangle_ratio=0.25)}, "With 25 % of the triangles its silhouette and shading are faceted"),
        ({"trust": facts({"open_edges": 0}, {"open_edges": 12})}, "Its shell is open, with 12 open edges"),
        ({"trust": facts(color_shift=3.0)}, "Its colors have shifted by 3.0 on average"),
        ({"trust": facts(textured(1024), textured(256))}, "Its texture is smaller, 256 pixels a side instead of 1024"),
        ({"trust": facts(same_images=False)}, "Its texture is another one"),
    ],
)  # fmt: skip
def test_a_fact_has_its_sentence_and_no_other_record_has_it(more: dict[str, Any], sentence: str) -> None:
    assert sentence in explain(record(0.6, ALL_LOW, **more))
    assert sentence not in explain(record(0.6, ALL_LOW, where=located(0.3, "front")))


def test_a_cause_is_not_named_where_another_one_is_known() -> None:
    """What is gone lowers all features, and the same images do not lie otherwise because the surface has moved."""
    gone = facts(triangle_ratio=0.5, missing_parts_count=2, same_images=True)
    assert "faceted; allow" not in explain(record(0.6, ALL_LOW, trust=gone))
    assert "UVs" not in explain(record(0.6, ALL_LOW, trust=facts(same_images=True)))
    assert "its UVs have moved" in explain(record(0.6, TEXTURE_LOW, trust=facts(same_images=True)))


@pytest.mark.parametrize(
    "known, level",
    [
        ({}, "imperceptible"),
        ({"missing_parts_count": 1}, "perceptible side by side, not annoying"),
        ({"missing": 0.02}, "perceptible side by side, not annoying"),
        ({"transparency_lost": 0.02}, "perceptible side by side, not annoying"),
        ({"maps_lost": ["Normal"]}, "perceptible side by side, not annoying"),
        ({"color_shift": 2.4}, "perceptible side by side, not annoying"),
        ({"color_shift": 2.2}, "imperceptible"),
        ({"color_shift": 10.1}, "slightly annoying"),
    ],
)
def test_facts_cap_the_level_and_the_words(known: dict[str, Any], level: str) -> None:
    assert impairment_of(1.0, known) == level and impairment_of(0.5, known) == "very annoying"
    told = explain(record(1.0, (1.0,) * 4, trust=facts(**known)))
    assert ("cannot be told from" in told) == (level == "imperceptible") and (", but " in told) == (
        level != "imperceptible"
    )


def test_what_is_warned_of_is_not_the_same() -> None:
    told = explain(record(1.0, (1.0,) * 4, warnings=["b.glb: its faces look the other way"]))
    assert "cannot be told" not in told and "is imperceptible" in told


def test_what_all_pairs_share_is_said_once() -> None:
    few = record(0.6, ALL_LOW, patches=40)
    assert "quick look" not in explain(few) and "random samples" not in explain(few)
    assert "quick look" in footnote([few]) and "quick look" not in footnote([record(0.6, ALL_LOW)])


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
