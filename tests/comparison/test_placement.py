# SPDX-License-Identifier: GPL-3.0-or-later
"""Where points on a mesh say that it belongs: turns, pivots, sizes, mirrors, and scans askew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmqm_addon.comparison.alignment import Alignment, AssetMesh, align, location_counts, moved
from fmqm_addon.comparison.placement import TURNS, fit, points_on
from fmqm_addon.metric.surface import MeshArrays, prepare_surface
from fmqm_addon.metric.texture import Material, PlainColor
from tests.metric.oracles import NaiveQuery

RGB = ((0.9, 0.1, 0.1), (0.1, 0.8, 0.2), (0.1, 0.2, 0.9), (0.8, 0.8, 0.1))
COLORS = tuple(Material("quarter", PlainColor(rgb)) for rgb in RGB)


def ball(stretch: tuple[float, float, float] = (1, 1, 1), bump: float = 0.0, colored: bool = True) -> MeshArrays:
    """A ball about the origin; a bump makes it lopsided, four colors by its quarters about Z, up and down apart."""
    rings, around = 7, 12
    polar = np.linspace(0.05, np.pi - 0.05, rings)[:, None]
    angle = np.linspace(0, 2 * np.pi, around, endpoint=False)[None]
    shape = np.stack([np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar) + 0 * angle], axis=2)
    positions = shape.reshape(-1, 3) * stretch
    lobe = np.exp(-8 * ((shape.reshape(-1, 3) - np.array([0.8, 0.5, 0.33])) ** 2).sum(axis=1))
    positions = positions * (1 + bump * lobe[:, None])
    index = np.arange(rings * around).reshape(rings, around)
    a, b = index[:-1], index[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    triangles = np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3), np.stack([a, c, d], 2).reshape(-1, 3)])
    center = positions[triangles].mean(axis=1)
    quarter = (np.arctan2(center[:, 1], center[:, 0]) // (np.pi / 2)).astype(int) % 4
    material = np.where(center[:, 2] > 0.3, quarter, (quarter + 1) % 4) if colored else 0 * quarter
    return MeshArrays("ball", positions, triangles, np.zeros((len(triangles), 3, 2)), material, COLORS)


LOPSIDED = ball((1.0, 0.7, 1.4), 0.5)


def at(turn: np.ndarray | str = "", shift: tuple[float, float, float] = (0, 0, 0), scale: float = 1.0) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = scale * (TURNS[turn] if isinstance(turn, str) else turn)
    matrix[:3, 3] = shift
    return matrix


def aligned(
    reference: MeshArrays, compared: MeshArrays, space: str = "auto", match_scale: bool = False, icp: bool = False
) -> Alignment:
    """Of two meshes in the world, as files without transforms have them."""
    surface = prepare_surface(reference, NaiveQuery)
    return align(AssetMesh(reference, np.eye(4)), AssetMesh(compared, np.eye(4)), space, match_scale, surface, icp)


def simpler(mesh: MeshArrays) -> MeshArrays:
    """An LOD: its vertices moved a little, its colors paler."""
    noise = np.random.default_rng(1).normal(0, 0.006, mesh.positions.shape)
    paler = tuple(Material("pale", PlainColor((0.9 * r + 0.03, 0.9 * g + 0.03, 0.9 * b + 0.03))) for r, g, b in RGB)
    return replace(mesh, positions=mesh.positions + noise, materials=paler)


def test_there_are_24_turns() -> None:
    assert len(TURNS) == len({matrix.tobytes() for matrix in TURNS.values()}) == 24
    for matrix in TURNS.values():
        assert np.linalg.det(matrix) == 1 and np.array_equal(matrix @ matrix.T, np.eye(3))


@pytest.mark.parametrize("turn", list(TURNS)[::2])
@pytest.mark.parametrize("shift", [(0, 0, 0), (3, -1, 0.5)], ids=["pivot kept", "pivot moved"])
def test_every_turn_is_found(turn: str, shift: tuple[float, float, float]) -> None:
    lod = simpler(LOPSIDED)
    alignment = aligned(LOPSIDED, moved(lod, at(turn, shift)))
    assert np.abs(alignment.mesh.positions - lod.positions).max() < 0.03
    assert bool(alignment.notes) == (turn != "" or any(shift)) and not alignment.warnings
    assert ("turned by" in alignment.label) == (turn != "")
    there = alignment.mesh.positions @ alignment.to_world[:3, :3].T + alignment.to_world[:3, 3]
    np.testing.assert_allclose(there, moved(lod, at(turn, shift)).positions, atol=1e-9)


def test_a_moved_pivot_is_centered() -> None:
    alignment = aligned(LOPSIDED, moved(LOPSIDED, at(shift=(0, 0, 1.4))))
    assert alignment.label == "centered" and not location_counts(alignment.label)
    np.testing.assert_allclose(alignment.mesh.positions, LOPSIDED.positions, atol=1e-12)
    assert alignment.notes == ("ball: compared with its center at the original's, since it fits far better there",)


def test_colors_tell_the_turn_of_what_is_round() -> None:
    """Half a turn about up leaves the shape and its box as they are."""
    reference = ball((1, 1, 1.5))
    alignment = aligned(reference, moved(simpler(reference), at("180 degrees about Z")))
    assert alignment.label == "world, turned by 180 degrees about Z"


@pytest.mark.parametrize("turn", ["90 degrees about Z", "180 degrees about X"])
def test_on_ties_the_world(turn: str) -> None:
    """One color, and a shape that the turn maps to itself."""
    reference = ball((1, 1, 1.5), colored=False)
    assert aligned(reference, moved(reference, at(turn))).label == "world"
    assert aligned(reference, moved(simpler(reference), at(turn))).label == "world"


@pytest.mark.parametrize("shift", [(0.05, 0, 0), (0, 0, 0.1)])
def test_a_little_beside_its_place_is_a_loss(shift: tuple[float, float, float]) -> None:
    alignment = aligned(LOPSIDED, simpler(moved(LOPSIDED, at(shift=shift))))
    assert alignment.label == "world"


def test_losses_are_no_turns() -> None:
    """Strong noise, one color for all, half of it missing: it stays where it stands."""
    rough = LOPSIDED.positions + np.random.default_rng(2).normal(0, 0.08, LOPSIDED.positions.shape)
    half = LOPSIDED.triangles[: len(LOPSIDED.triangles) // 2]
    for mesh in (
        replace(LOPSIDED, positions=rough),
        replace(LOPSIDED, material=0 * LOPSIDED.material),
        replace(
            LOPSIDED, triangles=half, corners=LOPSIDED.corners[: len(half)], material=LOPSIDED.material[: len(half)]
        ),
    ):
        assert aligned(LOPSIDED, mesh).label == "world"


@pytest.mark.parametrize("space", ["world", "local"])
def test_only_auto_looks_elsewhere(space: str) -> None:
    alignment = aligned(LOPSIDED, moved(LOPSIDED, at("180 degrees about Z", (3, 0, 0))), space)
    assert alignment.turn == "" and alignment.space == space and not alignment.notes


@pytest.mark.parametrize("scale", [0.37, 12.5])
def test_another_size_is_undone_where_that_is_asked_for(scale: float) -> None:
    normalized = moved(LOPSIDED, at("-90 degrees about Y", (0.1, 0, 2), scale))
    warned = aligned(LOPSIDED, normalized)
    assert warned.label == "world" and "--match-scale" in warned.warnings[0]
    matched = aligned(LOPSIDED, normalized, match_scale=True)
    assert matched.label == f"centered, turned by 90 degrees about Y, size / {scale:g}" and not matched.warnings
    np.testing.assert_allclose(matched.mesh.positions, LOPSIDED.positions, atol=1e-12)


@pytest.mark.parametrize("axis", range(3))
def test_a_mirror_is_warned_of_and_not_undone(axis: int) -> None:
    flip = np.eye(4)
    flip[axis, axis] = -1
    mirror = moved(LOPSIDED, flip)
    alignment = aligned(LOPSIDED, mirror)
    assert f"far better mirrored along {'XYZ'[axis]}" in alignment.warnings[0]
    assert np.linalg.det(alignment.to_world[:3, :3]) > 0


def askew(degrees: float) -> np.ndarray:
    """(3, 3) about an axis that is none of the world's."""
    x, y, z = np.array([1.0, 2.0, 2.0]) / 3
    skew, angle = np.array([(0, -z, y), (z, 0, -x), (-y, x, 0)]), np.radians(degrees)
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def test_icp_refines() -> None:
    scan = moved(LOPSIDED, at(askew(6), (0.06, -0.05, 0.02)))
    assert aligned(LOPSIDED, scan).refined is None
    alignment = aligned(LOPSIDED, scan, icp=True)
    assert alignment.label.endswith("refined") and location_counts(alignment.label)
    assert np.abs(alignment.mesh.positions - LOPSIDED.positions).max() < 0.01
    assert alignment.refined is not None and alignment.refined.degrees == pytest.approx(6, abs=0.3)
    assert alignment.refined.after < alignment.refined.before / 20
    there = alignment.mesh.positions @ alignment.to_world[:3, :3].T + alignment.to_world[:3, 3]
    np.testing.assert_allclose(there, scan.positions, atol=1e-9)
    np.testing.assert_allclose(alignment.to_world[:3, :3] @ alignment.to_world[:3, :3].T, np.eye(3), atol=1e-9)


def test_icp_leaves_what_fits() -> None:
    alignment = aligned(LOPSIDED, LOPSIDED, icp=True)
    np.testing.assert_allclose(alignment.mesh.positions, LOPSIDED.positions, atol=1e-9)


def test_points_are_spread_by_area_and_left_out_where_there_is_none() -> None:
    points = points_on(LOPSIDED, 200)
    assert points.positions.shape == points.colors.shape == (200, 3)
    again = points_on(LOPSIDED, 200)
    assert np.array_equal(points.positions, again.positions)
    surface = prepare_surface(LOPSIDED, NaiveQuery)
    here = fit(points, np.eye(4), surface)
    assert here.distance < 1e-12 and here.color < 1e-12 and here.is_fine
    empty = replace(LOPSIDED, positions=np.zeros_like(LOPSIDED.positions))
    assert len(points_on(empty, 200).positions) == 0
    broken = LOPSIDED.positions.copy()
    broken[::7] = np.nan
    assert np.isfinite(points_on(replace(LOPSIDED, positions=broken), 200).positions).all()
