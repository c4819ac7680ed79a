# SPDX-License-Identifier: GPL-3.0-or-later
"""The two surfaces (docs/metric.md): welding, leaving out, the frame, colors."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.metric import surface as surface_module
from fmqm_addon.metric.errors import FMQMError, MeshError
from fmqm_addon.metric.geometry import Floats, Ints, triangle_areas, triangle_normals
from fmqm_addon.metric.surface import MeshArrays, prepare_surface, weld
from fmqm_addon.metric.texture import PlainColor, Texture

from .meshes import TETRAHEDRON, TRIANGLE, cube, materials, mesh_arrays, moved, surface
from .oracles import NaiveQuery, first_of_each, heron, weld_with_dict

seeds = st.integers(0, 2**32 - 1)
few_values = st.sampled_from([-1.0, -0.0, 0.0, 5e-324, 1.0, 1 + 2**-52, 1e9])
points = st.lists(st.tuples(few_values, few_values, few_values), min_size=1, max_size=30)


def plain(positions: Floats, triangles: Ints, name: str = "thing") -> MeshArrays:
    return MeshArrays(
        name,
        positions,
        triangles,
        np.zeros((len(triangles), 3, 2)),
        np.zeros(len(triangles), int),
        (PlainColor((1, 1, 1)),),
    )


@given(points)
def test_weld_is_a_dict_of_positions(rows: list[tuple[float, float, float]]) -> None:
    """-0 and 0 are equal, neighbors in float64 are not; the first of equals keeps its place."""
    positions = np.array(rows)
    triangles = np.random.default_rng(len(rows)).integers(0, len(rows), (7, 3))
    welded, which = weld(positions, triangles)
    expected, expected_triangles = weld_with_dict(positions, triangles)
    assert [tuple(row) for row in welded.tolist()] == expected
    assert which.tolist() == expected_triangles


@given(st.lists(st.tuples(*[st.integers(0, 4)] * 3), min_size=1, max_size=40))
def test_repeated_triangles_are_found_in_any_corner_order(rows: list[tuple[int, int, int]]) -> None:
    triangles = np.array(rows)
    corner_rows = [frozenset(row) for row in rows]
    if all(len(row) == 3 for row in corner_rows):
        assert surface_module._is_first(triangles).tolist() == first_of_each(triangles)


@pytest.mark.parametrize("mix", [np.zeros_like, lambda bits: bits % np.uint64(3)], ids=["one hash", "three hashes"])
def test_rows_with_one_hash_stay_different(monkeypatch: pytest.MonkeyPatch, mix: Callable[[Any], Any]) -> None:
    """Hashes only save time: with useless ones the outcome is the same."""
    monkeypatch.setattr(surface_module, "_mix", mix)
    triangles = np.array([[0, 1, 2], [0, 1, 3], [2, 0, 1], [4, 5, 6], [3, 1, 0], [4, 6, 7]])
    assert surface_module._is_first(triangles).tolist() == [True, True, False, True, False, True]
    positions = np.array([[0, 0, 1.0], [1, 0, 0], [0, 0, 1.0], [0, 1, 0]])
    welded, which = weld(positions, np.array([[0, 1, 2], [2, 1, 3]]))
    assert welded.tolist() == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    assert which.tolist() == [[0, 1, 0], [0, 1, 2]]


def test_what_cannot_be_measured_is_left_out_and_counted() -> None:
    positions = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [np.nan, 0, 0], [0, np.inf, 0], [2, 0, 0], [-0.0, 0, 0], [5, 5, 5]]
    )
    triangles = np.array(
        [
            [0, 1, 2],
            [0, 1, 4],  # nan
            [5, 1, 2],  # inf
            [0, 1, 6],  # on one line
            [0, 7, 3],  # 7 is 0 with another sign
            [2, 7, 1],  # the first triangle again
            [0, 0, 1],
            [0, 1, 3],
        ]
    )
    prepared = prepare_surface(plain(positions, triangles), NaiveQuery)
    assert prepared.source.tolist() == [0, 7]
    assert len(prepared.vertices) == 4, "unused vertices are not part of the surface"
    assert [re.findall(r"\d+", warning) for warning in (*prepared.warnings, *prepared.notes)] == [
        ["2", "8"],
        ["3", "8"],
        ["1", "8"],
    ]
    assert (
        all(text.startswith("thing: ") for text in (*prepared.warnings, *prepared.notes))
        and len(prepared.warnings) == 1
    )
    corners = prepared.frame.leave(prepared.vertices)[prepared.triangles]
    np.testing.assert_allclose(corners, positions[triangles[[0, 7]]], atol=1e-15)


def test_corner_uvs_and_materials_follow_their_triangles() -> None:
    positions, triangles = TETRAHEDRON
    triangles = np.concatenate([[[0, 0, 1]], triangles])
    uv = np.arange(30.0).reshape(5, 3, 2)
    mesh = MeshArrays("m", positions, triangles, uv, np.array([9, 0, 1, 0, 1]), (PlainColor((0, 0, 0)),) * 2)
    prepared = prepare_surface(mesh, NaiveQuery)
    assert np.array_equal(prepared.corners, uv[1:])
    assert prepared.material.tolist() == [0, 1, 0, 1]


def test_seam_vertices_are_one_vertex() -> None:
    """An importer's split seams change neither topology nor the number of vertices."""
    positions, triangles = cube(2)
    split = plain(positions[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3))
    prepared = prepare_surface(split, NaiveQuery)
    assert len(prepared.vertices) == len(positions)
    assert len(prepared.triangles) == len(triangles)


@pytest.mark.parametrize(
    ("positions", "triangles", "says"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int), "no faces"),
        (np.ones((4, 3)), np.zeros((0, 3), int), "no faces"),
        (np.full((3, 3), np.nan), np.array([[0, 1, 2]]), "not finite"),
        (np.array([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]]), np.array([[0, 1, 2], [0, 2, 1]]), "not finite"),
        (np.zeros((3, 3)), np.array([[0, 1, 2]]), "zero area"),
        (np.array([[0, 0, 0], [1, 1, 1], [2, 2, 2.0]]), np.array([[0, 1, 2]]), "zero area"),
        (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 1], [2, 2, 2]]), "zero area"),
        (np.array([[0, 0, 0], [1, 0, 0], [np.nan, 1, 0.0]]), np.array([[0, 1, 1], [0, 1, 2]]), "zero area"),
    ],
)
def test_nothing_to_measure_is_an_error_that_names_the_mesh(positions: Floats, triangles: Ints, says: str) -> None:
    with pytest.raises(MeshError, match=f"^thing: .*{says}") as caught:
        prepare_surface(plain(positions, triangles), NaiveQuery)
    assert isinstance(caught.value, FMQMError)


@given(seeds, st.integers(-9, 9), st.floats(0, 5))
def test_flat_is_judged_relative_to_what_positions_carry(seed: int, exponent: int, away: float) -> None:
    """Points on a line, rounded far from the origin, are flat; a triangle a thousandth as high is not."""
    rng = np.random.default_rng(seed)
    start, along, up = rng.normal(size=(3, 3))
    up -= along * (up @ along) / (along @ along)
    up /= np.linalg.norm(up)
    scale, shift = 10.0**exponent, rng.normal(size=3) * 10.0**away
    line = np.array([start, start + along, start + 0.3 * along])
    high = line + np.array([[0], [0], [1e-3]]) * up
    with pytest.raises(MeshError, match="zero area"):
        prepare_surface(plain((line + shift) * scale, np.array([[0, 1, 2]])), NaiveQuery)
    assert len(prepare_surface(plain((high + shift) * scale, np.array([[0, 1, 2]])), NaiveQuery).triangles) == 1


@pytest.mark.parametrize("scale", [1e-9, 1e-5, 1.0, 1e5, 1e9])
def test_the_frame_is_the_references_box(scale: float) -> None:
    """Center 0, diagonal 1, and back again; the distorted surface keeps its place beside the reference."""
    shape = mesh_arrays(cube(2))
    shift = np.array([10.0, -20.0, 30.0]) * scale
    reference = prepare_surface(moved(shape, scale, shift), NaiveQuery)
    assert np.linalg.norm(np.ptp(reference.vertices, axis=0)) == pytest.approx(1, rel=1e-12)
    np.testing.assert_allclose(reference.vertices.max(axis=0), -reference.vertices.min(axis=0), rtol=1e-9)
    np.testing.assert_allclose(
        reference.frame.leave(reference.vertices), shape.positions * scale + shift, rtol=1e-13, atol=0
    )
    beside = prepare_surface(moved(shape, 2 * scale, shift), NaiveQuery, reference.frame)
    assert beside.frame is reference.frame
    assert np.linalg.norm(np.ptp(beside.vertices, axis=0)) == pytest.approx(2, rel=1e-12)


@pytest.mark.parametrize("whole_mesh", [True, False], ids=["a distorted mesh", "one triangle of the reference"])
def test_what_collapses_in_the_frame_is_left_out(whole_mesh: bool) -> None:
    """Near the origin float64 tells positions apart that the frame's coordinates cannot."""
    positions, triangles = TETRAHEDRON
    dust = positions * 1e-18
    if whole_mesh:
        frame = surface(TETRAHEDRON).frame
        with pytest.raises(MeshError, match="zero area"):
            prepare_surface(plain(dust, triangles), NaiveQuery, frame)
    else:
        mesh = plain(np.concatenate([positions, dust[1:]]), np.concatenate([triangles, [[0, 4, 5]]]))
        prepared = prepare_surface(mesh, NaiveQuery)
        assert (triangle_areas(prepared.vertices, prepared.triangles) > 0).all()


@given(seeds)
def test_areas_and_normals(seed: int) -> None:
    corners = np.random.default_rng(seed).normal(size=(5, 3, 3))
    vertices, triangles = corners.reshape(-1, 3), np.arange(15).reshape(5, 3)
    expected = np.array([heron(a, b, c) for a, b, c in corners])
    np.testing.assert_allclose(triangle_areas(vertices, triangles), expected, rtol=1e-9)
    for normal, (a, b, c) in zip(triangle_normals(vertices, triangles), corners, strict=True):
        assert np.linalg.norm(normal) == pytest.approx(1)
        assert abs(normal @ (b - a)) + abs(normal @ (c - a)) == pytest.approx(0, abs=1e-12)
        assert np.linalg.det([normal, b - a, c - a]) > 0, "counter-clockwise seen from outside"


def test_normals_of_the_closed_meshes_point_outward() -> None:
    for positions, triangles in (TETRAHEDRON, cube(1), cube(3)):
        outward = positions[triangles].mean(axis=1) - positions.mean(axis=0)
        assert ((triangle_normals(positions, triangles) * outward).sum(axis=1) > 0).all()


def test_color_at_looks_up_each_triangles_own_material() -> None:
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    colors = materials(PlainColor((0.1, 0.2, 0.3)), Texture(pixels, interpolation="closest"), PlainColor((1, 0, 1)))
    uv = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (4, 1, 1))
    positions, triangles = TETRAHEDRON
    prepared = prepare_surface(MeshArrays("m", positions, triangles, uv, np.array([0, 1, 1, 2]), colors), NaiveQuery)
    place = np.array([[0.5, 0.25, 0.25], [0.5, 0.25, 0.25], [0.2, 0.1, 0.7], [1, 0, 0], [0.2, 0.7, 0.1]])
    expected = np.array([[0.1, 0.2, 0.3], [0, 0, 1], [1, 0, 0], [1, 0, 1], [1, 1, 1]])
    np.testing.assert_allclose(prepared.color_at(np.array([0, 1, 2, 3, 1]), place), expected)


def test_uv_is_interpolated_with_barycentric_coordinates() -> None:
    """Equation (5): the weighted mean of the corners' coordinates."""
    ramp = np.linspace(0, 1, 11, dtype=np.float32)[None, :, None] * np.ones((1, 1, 3), np.float32)
    prepared = surface(TRIANGLE, (Texture(ramp, "extend"),))
    corner_u = prepared.corners[0, :, 0]
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], 20)
    expected = ((weights @ corner_u) * 11 - 0.5).clip(0, 10) / 10
    np.testing.assert_allclose(prepared.color_at(np.zeros(20, int), weights)[:, 0], expected, atol=1e-6)


def test_uvs_that_are_not_finite_are_taken_as_0() -> None:
    positions, triangles = TETRAHEDRON
    mesh = plain(positions, triangles)
    mesh.corners[0, 1] = np.nan, 0.5
    mesh.corners[2, 0] = 0.25, -np.inf
    prepared = prepare_surface(mesh, NaiveQuery)
    assert prepared.corners[0, 1].tolist() == [0, 0.5] and prepared.corners[2, 0].tolist() == [0.25, 0]
    assert any("2 triangles have UVs or colors that are not finite" in warning for warning in prepared.warnings)
