# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of a pair: which they are, what they score, and which are gone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.comparison.color_shift import color_shifts
from fmqm_addon.comparison.parts import LISTED, connected_parts
from fmqm_addon.comparison.trust import one_sided_maps
from fmqm_addon.metric.colorspace import srgb_to_lab
from fmqm_addon.metric.surface import MeshArrays, join_meshes, prepare_surface
from fmqm_addon.metric.texture import ImageFacts, Material, PlainColor
from tests.comparison.test_trust import assess, values
from tests.metric.meshes import cube, mesh_arrays, shaken, sphere
from tests.metric.oracles import NaiveQuery

BODY = mesh_arrays((sphere()[0] / 2, sphere()[1]))


def knob(number: int, size: float = 0.06) -> MeshArrays:
    """A small cube that stands on the ball."""
    angle = 2 * np.pi * number / 12
    vertices, triangles = cube(1)
    place = 0.5 * np.array([np.cos(angle), np.sin(angle), 0.0])
    return replace(mesh_arrays(((vertices - 0.5) * size + place * 1.1, triangles)), name=f"Knob {number}")


def device(*knobs: int) -> MeshArrays:
    return join_meshes([replace(BODY, name="Body"), *map(knob, knobs)], "device")


@given(st.lists(st.tuples(*[st.integers(0, 12)] * 3), min_size=1, max_size=15))
def test_connected_parts_are_those_of_a_flood(rows: list[tuple[int, int, int]]) -> None:
    triangles = np.array(rows)
    sets = [{*row} for row in rows]
    for _ in rows:  # until nothing grows any more
        sets = [set().union(*(other for other in sets if each & other)) for each in sets]
    expected = {tuple(sorted(each)) for each in sets}
    label = connected_parts(triangles)
    assert len(expected) == label.max() + 1
    for row, each in enumerate(sets):
        assert {*triangles[label == label[row]].ravel().tolist()} == each


def test_a_part_that_is_gone_is_named() -> None:
    trust, *_ = assess(device(0, 1, 2), device(0, 2))
    assert values(trust.pair)["missing_parts"] == ["Knob 1"]
    assert "a part of the original is gone: Knob 1" in trust.warnings[0]
    assert [part.name for part in trust.parts if part.missing and part.kind == "object"] == ["Knob 1"]
    named = [part.name for part in trust.parts if part.missing and part.kind == "connected"]
    assert len(named) == 1 and named[0].startswith("Knob 1, piece 3 of 4")


def test_one_object_is_told_piece_by_piece() -> None:
    reference, distorted = (replace(device(*knobs), objects=(), object=None) for knobs in (range(12), ()))
    trust, *_ = assess(reference, distorted)
    assert values(trust.pair)["missing_parts_count"] == 12
    assert "12 parts of the original are gone" in trust.warnings[0] and "and 9 more" in trust.warnings[0]


def test_a_part_that_is_simplified_or_moved_a_little_is_not_gone() -> None:
    trust, *_ = assess(device(0, 1), shaken(device(0, 1), 0.002))
    assert values(trust.pair)["missing_parts"] == []


def test_scores_of_parts_are_means_over_their_patches() -> None:
    trust, result, *_ = assess(device(0, 1), device(0, 1))
    assert {part.kind for part in trust.parts} == {"object", "connected", "material"}
    for kind in ("object", "connected", "material"):
        assert np.isclose(sum(part.area for part in trust.parts if part.kind == kind), 1)
    assert {part.FMQM for part in trust.parts} <= {1.0, None}
    whole = next(part for part in trust.parts if part.kind == "material")
    assert whole.FMQM is not None and whole.triangles == len(device(0, 1).triangles)


def test_of_many_parts_the_largest_are_listed_and_all_that_are_gone() -> None:
    crumbs = [
        replace(mesh_arrays((cube(1)[0] * 0.01 + [0.0, 0.02 * k, 1.0], cube(1)[1])), name=f"Crumb {k}")
        for k in range(60)
    ]
    every = join_meshes([replace(BODY, name="Body"), *crumbs], "all")
    trust, *_ = assess(every, join_meshes([replace(BODY, name="Body"), *crumbs[:-1]], "less"))
    objects = [part for part in trust.parts if part.kind == "object"]
    assert LISTED <= len(objects) <= LISTED + 1 and [part.name for part in objects if part.missing] == ["Crumb 59"]


def test_color_shift_is_the_difference_of_mean_colors() -> None:
    red, green = (0.8, 0.1, 0.1), (0.1, 0.8, 0.1)
    pair = [mesh_arrays(sphere(), (PlainColor(rgb),)) for rgb in (red, green)]
    trust, result, *_ = assess(*pair)
    lab = srgb_to_lab(np.array([red, green])) * 100
    assert np.allclose(color_shifts(result), np.linalg.norm(lab[0] - lab[1]), atol=1e-3)
    assert any("its colors differ by" in text for text in trust.warnings)


def test_maps_on_one_side_are_named() -> None:
    def image(*roles: str) -> ImageFacts:
        return ImageFacts(roles[0], "i", "i.png", 4, 4, "Non-Color", False, "d", roles)

    def of(*images: tuple[str, ImageFacts]) -> MeshArrays:
        grey = PlainColor((0.5,) * 3)
        return replace(
            mesh_arrays(cube(1), (grey,) * len(images)),
            materials=tuple(Material(name, grey, images=(each,)) for name, each in images),
        )

    full, bare, other = (
        prepare_surface(mesh, NaiveQuery)
        for mesh in (
            of(("A", image("Metallic", "Roughness"))),
            of(("A", image("base color"))),
            of(("A", image("base color")), ("B", image("Metallic", "Roughness"))),
        )
    )
    assert one_sided_maps(full, bare) == ["Metallic", "Roughness"] and one_sided_maps(bare, full) == []
    assert one_sided_maps(full, other) == ["Metallic of A", "Roughness of A"]


def test_positions_that_are_steps_are_warned_of() -> None:
    ball = mesh_arrays(sphere())
    trust, *_ = assess(ball, replace(ball, rounding=0.01))
    assert any("its positions are steps" in text for text in trust.warnings)


def test_more_triangles_than_the_reference() -> None:
    trust, *_ = assess(mesh_arrays(cube(1)), mesh_arrays(cube(3)))
    assert any("wrong order" in text for text in trust.warnings)
