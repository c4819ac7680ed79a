# SPDX-License-Identifier: GPL-3.0-or-later
"""The trust report: each fact against a hand count or a naive one, and which of them become warnings."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.comparison.distances import apart, spread_points
from fmqm_addon.comparison.doubts import ADDED, FLIPPED
from fmqm_addon.comparison.surface_facts import edge_counts, overlapping_share, surface_facts
from fmqm_addon.comparison.trust import Trust, assessing, covered_share, differing_maps
from fmqm_addon.metric.evaluation import Evaluation, Result
from fmqm_addon.metric.geometry import Floats, Ints, triangle_areas
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.stepper import finish
from fmqm_addon.metric.surface import MeshArrays, Surface, join_meshes, prepare_surface
from fmqm_addon.metric.texture import ImageFacts, Material, PlainColor
from fmqm_addon.report.trust_table import trust_dict, trust_lines, trust_text
from tests.metric.meshes import SMALL, TRIANGLE, cube, grid, mesh_arrays, moved, shaken, sphere, surface, texture
from tests.metric.oracles import NaiveQuery, squared_distances

SQUARE = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float64)  # two triangles' UVs
GREY = PlainColor((0.5, 0.5, 0.5))


def assess(
    reference: MeshArrays, distorted: MeshArrays, settings: Settings = SMALL
) -> tuple[Trust, Result, Surface, Surface]:
    ref = prepare_surface(reference, NaiveQuery)
    evaluation = Evaluation(ref, settings)
    evaluation.prepare().run()
    dist = prepare_surface(distorted, NaiveQuery, ref.frame)
    result = evaluation.compare(dist).run()
    return finish(assessing(ref, dist, result, finish(surface_facts(ref)))), result, ref, dist


def values(facts: tuple[object, ...]) -> dict[str, object]:
    return {fact.name: fact.value for fact in facts}  # type: ignore[attr-defined]


def turned(mesh: MeshArrays, faces: Ints | slice = slice(None)) -> MeshArrays:
    """Some of its faces look the other way."""
    triangles, corners = np.array(mesh.triangles), np.array(mesh.corners)
    triangles[faces], corners[faces] = triangles[faces][:, ::-1], corners[faces][:, ::-1]
    return replace(mesh, triangles=triangles, corners=corners)


def turn(edge: Floats, to: Floats) -> Floats:
    """Positive where (N, 2) points lie to the left of an edge."""
    return np.asarray(edge[0] * to[:, 1] - edge[1] * to[:, 0])


@given(st.lists(st.sets(st.integers(0, 6), min_size=3, max_size=3), min_size=1, max_size=30))
def test_edges_are_counted_like_a_counter_does(rows: list[set[int]]) -> None:
    triangles = np.array([sorted(row) for row in rows])
    faces = Counter(frozenset(edge) for a, b, c in triangles.tolist() for edge in ((a, b), (b, c), (c, a)))
    expected = (sum(n == 1 for n in faces.values()), sum(n > 2 for n in faces.values()))
    assert edge_counts(triangles) == expected


def test_watertight_is_told_from_open_and_from_non_manifold() -> None:
    _, plane = grid(3, 2)
    assert edge_counts(plane) == (10, 0)
    assert edge_counts(np.concatenate([plane, [[0, 1, 99]]])) == (11, 0)  # edge 0-1 was open, now two others are
    for shape, tight in ((cube(2), True), (grid(2, 2), False)):
        facts = values(finish(surface_facts(surface(shape))))
        assert facts["watertight"] is tight and facts["triangles"] == facts["triangles_used"] == len(shape[1])


def test_what_was_left_out_and_welded_is_counted() -> None:
    mesh = mesh_arrays(cube())
    exploded = replace(mesh, positions=mesh.positions[mesh.triangles.ravel()], triangles=np.arange(36).reshape(-1, 3))
    positions = np.concatenate([exploded.positions, [[np.nan, 0, 0]]])
    triangles = np.concatenate([exploded.triangles, exploded.triangles[:2], [[0, 0, 1]], [[0, 1, 36]]])
    strange = replace(
        exploded,
        positions=positions,
        triangles=triangles,
        corners=np.zeros((len(triangles), 3, 2)),
        material=np.zeros(len(triangles), int),
    )
    facts = values(finish(surface_facts(prepare_surface(strange, NaiveQuery))))
    assert (facts["triangles"], facts["triangles_used"], facts["vertices_welded"]) == (16, 12, 36 - 8)
    assert [facts[f"triangles_{why}"] for why in ("not_finite", "flat", "repeated")] == [1, 1, 2]


@pytest.mark.parametrize(
    ("uv", "layers", "expected"),
    [
        (SQUARE / 2, [0, 0], 0.0),
        (np.concatenate([SQUARE / 2, SQUARE / 2 + [0.5, 0]]), [0] * 4, 0.0),  # side by side
        (np.concatenate([SQUARE / 2, SQUARE / 2]), [0] * 4, 1.0),
        (np.concatenate([SQUARE / 2, SQUARE / 2]), [0, 0, 1, 1], 0.0),  # of two materials
        (np.concatenate([SQUARE / 2, SQUARE / 2 + [0.25, 0]]), [0] * 4, 1 / 3),
        (np.concatenate([SQUARE / 2, SQUARE / 2 + [1.25, -3]]), [0] * 4, 1 / 3),  # in another tile
        (np.concatenate([SQUARE / 2, SQUARE[:, ::-1] / 2]), [0] * 4, 1.0),  # mirrored
        (SQUARE * [2, 1], [0, 0], 1.0),  # a texture that repeats
        (SQUARE * 0, [0, 0], None),
        (SQUARE * [1, 0], [0, 0], None),
        (SQUARE * 1e6, [0, 0], None),
        (np.empty((0, 3, 2)), [], None),
    ],
)
def test_overlapping_texture_area(uv: Floats, layers: list[int], expected: float | None) -> None:
    found = finish(overlapping_share(uv, np.array(layers, int)))
    assert found == (None if expected is None else pytest.approx(expected, abs=0.005))


@given(st.integers(0, 2**32 - 1))
def test_overlapping_is_what_random_points_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    uv = rng.random((5, 3, 2)) * 1.4 - 0.2
    points = rng.random((20_000, 2))
    covered = np.zeros(len(points), int)
    for triangle in uv:
        a, b, c = triangle
        for shift in np.ndindex(4, 4):
            p = points + np.array(shift) - 2
            sides = [np.sign(turn(end - start, p - start)) for start, end in ((a, b), (b, c), (c, a))]
            covered += (sides[0] == sides[1]) & (sides[1] == sides[2])
    expected = (covered > 1).sum() / max((covered > 0).sum(), 1)
    assert finish(overlapping_share(uv, np.zeros(5, int))) == pytest.approx(expected, abs=0.05)


def test_texture_coordinates_outside_and_missing_are_shares_of_the_area() -> None:
    mesh = mesh_arrays(grid(4, 1), (texture(),))
    uv = np.tile(SQUARE[:1] / 2, (8, 1, 1))
    uv[0] = 0  # a triangle without coordinates
    uv[1, 2] = (1.5, 0.5)
    uv[2] = [[0, 0], [1, 0], [1 + 1e-7, 1]]  # on the edge, up to float32
    textured = (replace(mesh.materials[0], uv=0),)
    facts = values(finish(surface_facts(prepare_surface(replace(mesh, corners=uv, materials=textured), NaiveQuery))))
    assert (facts["uv_missing"], facts["uv_outside"]) == pytest.approx((1 / 8, 1 / 8))
    plain = finish(surface_facts(prepare_surface(mesh, NaiveQuery)))
    assert all(fact.value is None and fact.why for fact in plain if fact.name.startswith("uv_"))


def test_channels_of_coordinates_may_stand_anywhere_in_the_corners() -> None:
    mesh = mesh_arrays(grid(2, 1))
    corners = np.concatenate([np.full((4, 3, 4), 7.0), np.tile(SQUARE, (2, 1, 1)) * [[[0.5, 1]]]], axis=2)
    material = Material("shifted", GREY, uv=4)
    facts = values(
        finish(surface_facts(prepare_surface(replace(mesh, corners=corners, materials=(material,)), NaiveQuery)))
    )
    assert facts["uv_outside"] == 0 and facts["uv_overlapping"] == 1


def test_spread_points_are_even_over_the_area_and_on_the_surface() -> None:
    shape = surface(cube(2))
    points = spread_points(shape, 6000, seed=3)
    corners = (shape.vertices[shape.triangles[:, k]] for k in range(3))
    squared = squared_distances(points, *corners)
    assert squared.min(axis=1).max() < 1e-20
    area = triangle_areas(shape.vertices, shape.triangles)
    share = np.bincount(squared.argmin(axis=1), minlength=len(area)) / len(points)
    assert share == pytest.approx(area / area.sum(), abs=0.003)


def test_covered_area_counts_each_triangle_once() -> None:
    _, result, *_ = assess(mesh_arrays(sphere()), mesh_arrays(sphere()), replace(SMALL, patches=10, scored_patches=2))
    faces = set(result.patches[0].faces.tolist()) | set(result.patches[1].faces.tolist())
    areas = result.patch_mesh.areas
    assert covered_share(result) == pytest.approx(sum(areas[face] for face in faces) / areas.sum())


def test_clean_closed_meshes_give_no_doubt_and_no_warning() -> None:
    ball = mesh_arrays(sphere())
    for other in (ball, shaken(ball, 0.01)):
        trust, *_ = assess(ball, other)
        for facts in (trust.reference, trust.distorted):
            assert values(facts)["sign_in_doubt"] == 0
        pair = values(trust.pair)
        assert (pair["flipped"], pair["added"], pair["sign_in_doubt_and_different"]) == (0, 0, 0)
        assert not trust.warnings


def test_flipped_faces_are_seen_although_the_score_is_not_changed() -> None:
    ball = mesh_arrays(sphere())
    trust, result, *_ = assess(ball, turned(ball))
    assert list(result.scores) == [1.0] * 5
    assert values(trust.pair)["flipped"] == 1
    assert values(trust.distorted)["sign_in_doubt"] == 1  # inside out
    assert "100 %" in trust.warnings[0] and "look the other way" in trust.warnings[0]

    trust, result, ref, _ = assess(ball, turned(ball, np.arange(0, 80, 8)))
    expected = np.isin(ref.source[result.ref.triangle], np.arange(0, 80, 8)).mean()
    assert values(trust.pair)["flipped"] == pytest.approx(expected) and expected > FLIPPED
    # As long as signs agree, the doubt does no harm and is a fact, not a warning.
    assert values(trust.pair)["sign_in_doubt_and_different"] == 0 and len(trust.warnings) == 1


def test_a_hole_makes_signs_doubtful_where_they_change_the_score() -> None:
    ball = mesh_arrays(cube(3))
    kept = np.arange(len(ball.triangles)) >= 18  # one of the six sides is gone
    opened = replace(ball, triangles=ball.triangles[kept], corners=ball.corners[kept], material=ball.material[kept])
    trust, *_ = assess(ball, opened)
    assert values(trust.distorted)["watertight"] is False
    assert values(trust.pair)["sign_in_doubt_and_different"] > 0.01
    assert any("shape is unsure" in text for text in (*trust.warnings, *trust.notes))
    assert "open edges instead of 0" in trust.warnings[0]
    itself, *_ = assess(opened, opened)  # the same doubt on both sides
    assert values(itself.reference)["sign_in_doubt"] > 0.01 and not itself.warnings


def test_added_geometry_is_seen_by_its_share_of_the_area() -> None:
    ball = mesh_arrays(sphere())
    junk = moved(mesh_arrays(cube()), 0.3, np.array([4.0, 0, 0]))
    both = join_meshes([ball, junk], "with junk")
    trust, _, ref, dist = assess(ball, both)
    areas = triangle_areas(dist.vertices, dist.triangles)
    expected = areas[dist.source >= 80].sum() / areas.sum()
    assert values(trust.pair)["added"] == pytest.approx(expected, abs=1e-3) and expected > ADDED
    assert any("cannot see" in warning and "Both Directions" in warning for warning in trust.warnings)
    assert finish(apart(ref, ref, 1e-6, seed=0, count=500)).beyond == 0


@given(st.floats(0.02, 0.2), st.booleans())
def test_added_is_what_lies_beyond_the_reach(height: float, above: bool) -> None:
    """A plane above another, within the reach or beyond it."""
    plane = mesh_arrays(grid(3, 3))
    ref = prepare_surface(plane, NaiveQuery)
    lifted = prepare_surface(moved(plane, 1.0, np.array([0, 0, height])), NaiveQuery, ref.frame)
    reach = height / ref.frame.scale * (0.99 if above else 1.01)
    assert finish(apart(lifted, ref, reach, seed=1, count=200)).beyond == (1 if above else 0)


class Opacity:
    """A quarter everywhere."""

    def opacity(self, values: Floats) -> Floats:
        return np.full(len(values), 0.25)


def test_samples_by_material_and_see_through() -> None:
    mesh = mesh_arrays(sphere(), (GREY, GREY))
    glass = replace(mesh, materials=(replace(mesh.materials[0], alpha=Opacity()), Material("", GREY)))
    trust, result, _, dist = assess(mesh, glass)
    share = float((dist.material[result.dist.triangle] == 0).mean())
    facts = values(trust.distorted)
    assert facts["samples_by_material"] == pytest.approx({"material 0": share, "(no material)": 1 - share})
    assert facts["see_through"] == share and values(trust.reference)["see_through"] == 0


def test_magenta_of_missing_images() -> None:
    """Only on materials that have images: others may be magenta on purpose."""
    magenta = PlainColor((1.0, 0.0, 1.0))
    mesh = mesh_arrays(sphere(), (magenta,))
    named = replace(mesh, materials=(replace(mesh.materials[0], images=(image("base color", "", missing=True),)),))
    trust, *_ = assess(mesh, named)
    assert values(trust.distorted)["magenta"] == 1 and values(trust.reference)["magenta"] == 0
    assert [text for text in trust.warnings if "magenta" in text] == [
        "mesh: 100 % of the samples on it are magenta, as Blender shows images and UDIM tiles that are missing; "
        "repair its images"
    ]


def image(role: str, digest: str, missing: bool = False) -> ImageFacts:
    return ImageFacts(role, f"{role}.png", f"maps/{role}.png", 4, 2, "Non-Color", missing, digest)


def test_maps_that_the_metric_does_not_see_are_compared_by_role_and_content() -> None:
    def with_images(*images: ImageFacts) -> Surface:
        mesh = mesh_arrays(cube())
        return prepare_surface(replace(mesh, materials=(replace(mesh.materials[0], images=images),)), NaiveQuery)

    one = with_images(image("base color", "a"), image("Normal", "n"), image("Roughness", "r"))
    other = with_images(image("base color", "b"), image("Normal", "m"), image("Roughness", "r"), image("Metallic", "k"))
    assert differing_maps(one, one) == []
    assert differing_maps(one, other) == ["Metallic", "Normal"]
    images = values(finish(surface_facts(one)))["images"]
    assert images[1] == {  # type: ignore[index]
        "role": "Normal", "name": "Normal.png", "path": "maps/Normal.png", "width": 4, "height": 2,
        "color_space": "Non-Color", "missing": False,
    }  # fmt: skip


def test_missing_coordinates_are_a_warning() -> None:
    mesh = mesh_arrays(sphere(), (texture(),))
    bare = replace(mesh, corners=mesh.corners * 0, materials=(replace(mesh.materials[0], uv=0),))
    trust, *_ = assess(mesh, bare)
    assert sum("100 % of its textured area has no texture coordinates" in text for text in trust.warnings) == 1


def test_little_coverage_is_a_warning_unless_few_patches_were_asked_for() -> None:
    """Crumbs in a row take nearly all centers; their patches all go on with the same side of the ball."""
    ball = mesh_arrays(sphere())
    crumbs = [moved(mesh_arrays(TRIANGLE), 1e-3, np.array([20.0 + 5 * k, 0, 0])) for k in range(12)]
    litter = join_meshes([ball, *crumbs], "litter")
    trust, *_ = assess(litter, litter)
    assert values(trust.pair)["covered"] < 0.6  # type: ignore[operator]
    assert len(trust.warnings) == 1 and "the patches cover" in trust.warnings[0]
    few, *_ = assess(ball, ball, replace(SMALL, scored_patches=1))
    assert values(few.pair)["covered"] < 0.6 and not few.warnings  # type: ignore[operator]


def test_report_says_every_fact_with_a_unit_or_why_it_is_not_known() -> None:
    trust, *_ = assess(mesh_arrays(sphere()), mesh_arrays(cube(2)))
    report = trust_dict(trust)
    assert list(report) == ["reference", "distorted", "pair"] and list(report["reference"]) == list(report["distorted"])
    items = [item for group in report.values() for item in group.values()]
    assert all(item["unit"] and (item["value"] is not None or item["why"]) for item in items)
    assert json.loads(json.dumps(report, allow_nan=False)) == report


def test_report_as_a_table_is_aligned_and_shares_are_percents() -> None:
    ball = mesh_arrays(sphere())
    report = trust_dict(assess(ball, turned(ball))[0])
    lines = {line.label: line for line in trust_lines(report)}
    assert lines["sign in doubt"].values == ("0 %", "100 %") and lines["sign in doubt"].unit == "of samples"
    assert lines["watertight"].values == ("yes", "yes") and lines["UV outside"].values == ("?", "?")
    assert lines["samples by material, LOD"].values == ("material 0 100 %",)
    rows = trust_text(report).splitlines()
    column = rows[0].index("LOD") + len("LOD")
    assert rows[1].startswith("triangles") and rows[1][:column].endswith(" 80")
    assert len(rows) == len(lines) + 1
