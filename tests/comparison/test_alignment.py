# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a compared mesh is put: Auto's choice, factors between units, and the way back to the world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmqm_addon.comparison.alignment import APART, AssetMesh, align, location_counts, misfit, moved, unit_factor
from fmqm_addon.metric.errors import MeshError
from fmqm_addon.metric.surface import MeshArrays
from fmqm_addon.metric.texture import PlainColor

TURN = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])  # a quarter about Z


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0, scale: float = 1.0) -> np.ndarray:
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def asset(origin: np.ndarray, scale: float = 1.0, shift: float = 0.0, name: str = "lod") -> AssetMesh:
    """A tetrahedron unlike along all axes."""
    positions = scale * np.array([(0, 0, 0), (1.0, 0, 0), (0, 2.0, 0), (0, 0, 0.5)]) + shift
    triangles = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])
    grey = PlainColor((0.5, 0.5, 0.5))
    return AssetMesh(MeshArrays(name, positions, triangles, np.zeros((4, 3, 2)), np.zeros(4, int), (grey,)), origin)


@pytest.mark.parametrize(
    ("reference", "compared", "expected"),
    [
        (at(), at(), "world"),
        (at(1, 2, 3), at(1, 2, 3), "world"),
        (at(), at(5), "location"),  # set side by side
        (at(1, 2, 3) @ TURN, at(7, 2, 3) @ TURN, "location"),
        (at(), at(5) @ TURN, "local"),  # turned by an importer
        (at(), at(0, 0, 0, 100), "local"),
        (at(), at(0.005), "world"),  # a hair beside it: it stands in its place
        (at(4, 4, 4), at(4.05, 4, 4), "location"),
    ],
)
def test_auto(reference: np.ndarray, compared: np.ndarray, expected: str) -> None:
    alignment = align(asset(reference), asset(compared))
    assert alignment.space == expected
    assert alignment.misfit < APART
    assert bool(alignment.notes) == (expected != "world")
    assert not alignment.warnings


def test_auto_stays_in_the_world_without_a_far_better_fit() -> None:
    alignment = align(asset(at()), asset(at(0.5), shift=0.2))
    assert alignment.space == "world" and not alignment.notes
    assert "differ by" in alignment.warnings[0]


def turned(degrees: float) -> np.ndarray:
    """(4, 4) about X."""
    sine, cosine = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    return np.array([(1, 0, 0, 0), (0, cosine, -sine, 0), (0, sine, cosine, 0), (0, 0, 0, 1)])


def applied(placed: AssetMesh, matrix: np.ndarray, name: str = "lod") -> AssetMesh:
    """The same place in the world of another shape, as files that apply a turn have it."""
    return AssetMesh(replace(moved(placed.mesh, matrix), name=name), placed.origin)


@pytest.mark.parametrize("degrees", [90, -90, 180])
@pytest.mark.parametrize("matrix", [at(), at(1, 2, 3)], ids=["at the origin", "elsewhere"])
def test_auto_turns_about_x(degrees: int, matrix: np.ndarray) -> None:
    """The file applied a turn that the reference's has not."""
    reference = asset(matrix)
    whole = AssetMesh(reference.world(), at())
    alignment = align(reference, applied(whole, turned(-degrees)))
    assert (alignment.space, alignment.turn) == ("world", f"{degrees} degrees about X")
    np.testing.assert_allclose(alignment.mesh.positions, reference.world().positions, atol=1e-12)
    assert f"turned by {degrees} degrees about X" in alignment.label
    assert alignment.notes == (
        f"lod: compared turned by {degrees} degrees about X, since it fits the original far better so",
    )
    assert not alignment.warnings and location_counts(alignment.label)


def test_auto_turns_what_stands_beside() -> None:
    """Its origin was moved after the import."""
    reference = asset(at(1, 2, 3))
    alignment = align(reference, applied(asset(at(7, 8, 9)), turned(90)))
    assert (alignment.space, alignment.turn) == ("location", "-90 degrees about X")
    np.testing.assert_allclose(alignment.mesh.positions, reference.world().positions, atol=1e-12)
    assert not location_counts(alignment.label)


@pytest.mark.parametrize("degrees", [90, -90])
def test_upside_down_has_the_same_box(degrees: int) -> None:
    """Symmetric boxes: only where the surface lies in them tells 90 degrees from -90."""
    corners = [(x, y, z) for x in (-1.0, 1) for y in (-1.0, 1) for z in (-3.0, 3)]
    positions = np.array([*corners, (0, 0.5, 2), (0.4, 0.1, 2), (0, 0, 2.9)])
    triangles = np.array([(0, 3, 5), (1, 2, 7), (4, 6, 1), (8, 9, 10)])
    mesh = replace(asset(at()).mesh, positions=positions, triangles=triangles)
    reference = AssetMesh(mesh, at())
    alignment = align(reference, applied(reference, turned(-degrees)))
    assert alignment.turn == f"{degrees} degrees about X"
    np.testing.assert_allclose(alignment.mesh.positions, positions, atol=1e-12)


@pytest.mark.parametrize("degrees", [90, 180, 45])
def test_a_turn_that_the_boxes_do_not_show_stays(degrees: int) -> None:
    """A cube, and what no quarter turn mends."""
    corners = np.array([(x, y, z) for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])
    mesh = replace(asset(at()).mesh, positions=corners, triangles=np.array([(0, 3, 5), (1, 2, 7), (4, 6, 1)]))
    reference = AssetMesh(mesh, at())
    alignment = align(reference, applied(reference, turned(degrees)))
    assert (alignment.space, alignment.turn) == ("world", "")


@pytest.mark.parametrize("space", ["world", "local"])
def test_only_auto_turns(space: str) -> None:
    assert align(asset(at()), applied(asset(at()), turned(90)), space).turn == ""


def test_a_turn_and_other_units() -> None:
    reference = asset(at())
    alignment = align(reference, applied(asset(at(), scale=100), turned(90)), match_scale=True)
    assert alignment.label == "world, turned by -90 degrees about X, size / 100"
    np.testing.assert_allclose(alignment.mesh.positions, reference.mesh.positions, atol=1e-12)
    there = alignment.mesh.positions @ alignment.to_world[:3, :3].T
    np.testing.assert_allclose(there, applied(asset(at(), scale=100), turned(90)).mesh.positions, atol=1e-9)


@pytest.mark.parametrize("space", ["auto", "world", "local"])
def test_what_stands_in_its_place_keeps_its_bits(space: str) -> None:
    origin = at(0.1, 0.7, -3.3) @ TURN
    reference, compared = asset(origin), asset(origin.copy())
    alignment = align(reference, compared, space)
    assert np.array_equal(alignment.mesh.positions, reference.world().positions)
    assert np.array_equal(alignment.to_world, np.eye(4))


@pytest.mark.parametrize("origin", [at(3.3, 0.1), at(3, 0, 1) @ TURN])
def test_what_is_moved_onto_the_reference_gets_its_bits(origin: np.ndarray) -> None:
    reference = asset(at(0.1, 0.2, 0.3))
    assert np.array_equal(align(reference, asset(origin)).mesh.positions, reference.world().positions)


@pytest.mark.parametrize("space", ["auto", "world", "local"])
@pytest.mark.parametrize("match_scale", [False, True])
@pytest.mark.parametrize("origin", [at(), at(5, 1), at(5) @ TURN, at(0, 1, 0, 100)])
def test_to_world_leads_back(space: str, match_scale: bool, origin: np.ndarray) -> None:
    compared = asset(origin)
    alignment = align(asset(at(1)), compared, space, match_scale)
    there = alignment.mesh.positions @ alignment.to_world[:3, :3].T + alignment.to_world[:3, 3]
    np.testing.assert_allclose(there, compared.world().positions, atol=1e-9)


@pytest.mark.parametrize("factor", [100.0, 1000.0, 2.54, 0.01, 0.3048, 1 / 25.4])
def test_factors_between_units(factor: float) -> None:
    reference, compared = asset(at(2, 3)), asset(at(2, 3), scale=factor)
    warned = align(reference, compared)
    assert "Match Scale" in warned.warnings[0]
    text = f"{factor:.6g} times as large" if factor > 1 else f"{1 / factor:.6g} times as small"
    assert text in warned.warnings[0]
    matched = align(reference, compared, match_scale=True)
    assert matched.factor == pytest.approx(factor)
    assert not matched.warnings
    assert f"divided by {factor:.6g}" in matched.notes[0]
    np.testing.assert_allclose(matched.mesh.positions, reference.world().positions, atol=1e-12)


def test_units_in_the_world_scale_the_location_too() -> None:
    matched = align(asset(at(2, 3)), asset(at(200, 300), scale=100), "world", match_scale=True)
    assert matched.factor == 100
    assert matched.misfit < 1e-12


@pytest.mark.parametrize("scale", [1.0, 1.005, 0.5, 1.37, 7.0])
def test_other_sizes_are_not_matched(scale: float) -> None:
    alignment = align(asset(at()), asset(at(), scale=scale), match_scale=True)
    assert alignment.factor == 1


def test_a_factor_has_the_shape_too() -> None:
    target = np.array([(0.0, 0, 0), (1, 1, 1)])
    assert unit_factor(10 * target, target) == 10
    assert unit_factor(np.array([(0.0, 0, 0), (17.3, 1, 1)]), target) == 1


def test_boxes_look_at_faces_and_finite_coordinates_only() -> None:
    reference, compared = asset(at()), asset(at())
    positions = np.concatenate([compared.mesh.positions, [(100.0, 0, 0)]])
    stray = AssetMesh(replace(compared.mesh, positions=positions), at())
    assert align(reference, stray).misfit == 0
    broken = positions.copy()
    broken[0] = np.nan
    assert np.isfinite(align(reference, AssetMesh(replace(stray.mesh, positions=broken), at())).misfit)


def test_misfit_is_in_diagonals_of_the_target() -> None:
    target = np.array([(0.0, 0, 0), (3, 4, 0)])
    assert misfit(target + [1, 0, 0], target) == pytest.approx(0.2)
    assert misfit(target, np.zeros((2, 3))) == 0


def test_zero_scale_that_must_be_undone() -> None:
    with pytest.raises(MeshError, match="scale of zero"):
        align(asset(at(scale=0.0)), asset(at()), "local")


def test_moving_counts_only_in_the_world() -> None:
    reference = asset(at())
    assert location_counts(align(reference, asset(at())).label)
    assert location_counts(align(reference, asset(at(), scale=100), match_scale=True).label)
    assert not location_counts(align(reference, asset(at(5))).label)
    assert not location_counts(align(reference, asset(at(5) @ TURN)).label)
