# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample points (V-C): how many, where, and from which random stream."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.metric.geometry import Ints, triangle_normals
from fmqm_addon.metric.patches import Patch, PatchMesh, build_patch_mesh, choose_centers, grow_patches
from fmqm_addon.metric.sampling import PatchSamples, draw_samples, join_samples, sample_count
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.stepper import finish

from .meshes import SMALL, TETRAHEDRON, cube, grid, sphere, surface

seeds = st.integers(0, 2**32 - 1)


def patches_of(mesh: PatchMesh, settings: Settings) -> list[Patch]:
    return list(grow_patches(mesh, np.array(list(choose_centers(mesh.vertices, settings))), settings.patches))


def some_patch(area: float) -> Patch:
    return Patch(0, np.arange(1), area, 1.0, False)


@given(st.integers(1, 300), st.integers(32, 2000), st.floats(1e-6, 1))
def test_count_is_the_share_of_the_area_and_capped(patches: int, density: int, share: float) -> None:
    settings = Settings(samples=patches * density, patches=patches)
    exact, cap = share * settings.samples, 1.1 * settings.samples / patches
    assert sample_count(some_patch(share * 3), 3.0, settings) == pytest.approx(math.floor(min(exact, cap)), abs=1e-6)


@pytest.mark.parametrize(
    ("share", "count"), [(1 / 250, 800), (0.0041, 820), (0.0044, 880), (0.0043999, 879), (0.5, 880), (1 / 300, 666)]
)
def test_count_by_hand(share: float, count: int) -> None:
    """200,000 samples and 250 patches: 800 for an even share, never more than 880."""
    assert sample_count(some_patch(share * 7), 7.0, Settings()) == count


def test_a_count_reached_up_to_rounding_is_reached() -> None:
    """29 hundredths of 100 are 28.999999999999996 in float64."""
    settings = Settings(samples=100, patches=3)
    assert 0.29 * 100 < 29
    assert sample_count(some_patch(0.29), 1.0, settings) == 29


def test_every_patch_gets_samples() -> None:
    """At the least permitted density no patch is left with fewer than its even share, up to rounding."""
    for shape in (TETRAHEDRON, cube(3), grid(7, 3), sphere()):
        settings = Settings(samples=32 * 17, patches=17)
        mesh = finish(build_patch_mesh(surface(shape), 17))
        counts = [sample_count(patch, mesh.area, settings) for patch in patches_of(mesh, settings)]
        assert min(counts) >= 31
        assert max(counts) <= 35


@given(seeds, st.integers(1, 20))
def test_faces_get_floor_or_ceiling_of_their_share(seed: int, patches: int) -> None:
    """N_f = S_f / S_local N_local, by systematic resampling; and all of N_local."""
    positions, triangles = cube(3)
    positions = positions + np.random.default_rng(seed).normal(0, 0.08, positions.shape)
    mesh = finish(build_patch_mesh(surface((positions, triangles)), patches))
    settings = Settings(samples=64 * patches, patches=patches, seed=seed)
    for patch in patches_of(mesh, settings)[:3]:
        drawn = draw_samples(mesh, [patch], mesh.area, settings)[0]
        count = sample_count(patch, mesh.area, settings)
        assert len(drawn.positions) == len(drawn.offset) == len(drawn.face) == count
        expected = mesh.areas[patch.faces] / patch.area * count
        found = np.bincount(drawn.face, minlength=len(mesh.triangles))
        assert found.sum() == found[patch.faces].sum() == count
        assert (found[patch.faces] >= np.floor(expected - 1e-9)).all()
        assert (found[patch.faces] <= np.ceil(expected + 1e-9)).all()


@given(seeds)
def test_samples_stand_over_their_faces(seed: int) -> None:
    """Less its offset along the unit normal, a sample lies in its face."""
    mesh = finish(build_patch_mesh(surface(sphere()), 5))
    settings = Settings(samples=640, patches=5, seed=seed)
    patch = patches_of(mesh, settings)[seed % 5]
    drawn = draw_samples(mesh, [patch], mesh.area, settings)[0]
    corners = mesh.vertices[mesh.triangles[drawn.face]]
    foot = drawn.positions - drawn.offset[:, None] * triangle_normals(mesh.vertices, mesh.triangles[drawn.face])
    for point, triangle in zip(foot, corners, strict=True):
        weights = np.linalg.solve(triangle.T, point)  # the face's plane misses the origin
        assert weights.min() >= -1e-9
        assert weights.sum() == pytest.approx(1)


def big_draw(seed: int = 0, sigma: float = 0.05) -> tuple[PatchMesh, Patch, PatchSamples]:
    mesh = finish(build_patch_mesh(surface(TETRAHEDRON), 1))
    settings = Settings(samples=40_000, patches=1, seed=seed, sigma=sigma)
    patch = patches_of(mesh, settings)[0]
    return mesh, patch, draw_samples(mesh, [patch], mesh.area, settings)[0]


def test_offsets_are_normal_with_sigma_diagonals() -> None:
    _, patch, drawn = big_draw()
    scaled = np.sort(drawn.offset / (0.05 * patch.diagonal))
    assert scaled.mean() == pytest.approx(0, abs=0.02)
    assert scaled.std() == pytest.approx(1, abs=0.02)
    quantiles = [math.erf(x / math.sqrt(2)) / 2 + 0.5 for x in scaled[:: len(scaled) // 100]]
    np.testing.assert_allclose(quantiles, np.linspace(0, 1, len(scaled))[:: len(scaled) // 100], atol=0.015)


def test_places_in_a_face_are_uniform() -> None:
    """Barycentric coordinates of a uniform point: mean 1/3, variance 1/18; a ninth of all in each small triangle."""
    mesh, _, drawn = big_draw(sigma=0)
    largest = int(mesh.areas.argmax())
    here = drawn.positions[drawn.face == largest]
    corners = np.vstack([mesh.vertices[mesh.triangles[largest]].T, [1, 1, 1]])
    weights = np.linalg.lstsq(corners, np.vstack([here.T, np.ones(len(here))]), rcond=None)[0].T
    np.testing.assert_allclose(weights.mean(axis=0), 1 / 3, atol=0.01)
    np.testing.assert_allclose(weights.var(axis=0), 1 / 18, atol=0.002)
    for corner in range(3):
        assert (weights[:, corner] > 2 / 3).mean() == pytest.approx(1 / 9, abs=0.01)


def test_faces_get_their_share_on_average() -> None:
    """Faces of less than one sample are not forgotten, over many seeds."""
    mesh = finish(build_patch_mesh(surface(cube(6)), 1))
    settings = Settings(samples=100, patches=1)
    patch = patches_of(mesh, settings)[0]
    draws = [draw_samples(mesh, [patch], mesh.area, settings.with_seed(seed))[0].face for seed in range(400)]
    mean = np.bincount(np.concatenate(draws), minlength=len(mesh.triangles)) / len(draws)
    np.testing.assert_allclose(mean, mesh.areas / mesh.area * 100, atol=0.12)


def test_sigma_scales_the_offsets_and_nothing_else() -> None:
    _, _, once = big_draw(sigma=0.05)
    _, _, twice = big_draw(sigma=0.1)
    _, _, flat = big_draw(sigma=0)
    np.testing.assert_allclose(twice.offset, 2 * once.offset, rtol=1e-12)
    assert (flat.offset == 0).all()
    assert np.array_equal(once.face, twice.face)
    assert np.array_equal(once.units, flat.units)
    np.testing.assert_allclose(once.positions - flat.positions, (twice.positions - flat.positions) / 2, atol=1e-12)


def test_a_patchs_samples_depend_on_seed_and_center_alone() -> None:
    """Neither on the other patches nor on their order."""
    mesh = finish(build_patch_mesh(surface(cube(3)), 10))
    centers = np.array(list(choose_centers(mesh.vertices, SMALL)))

    def draw(order: Ints, settings: Settings = SMALL) -> dict[int, PatchSamples]:
        return {p.center: draw_samples(mesh, [p], mesh.area, settings)[0] for p in grow_patches(mesh, order, 10)}

    every, few = draw(centers), draw(centers[[7, 2]])
    for center in few:
        for name in ("positions", "offset", "face", "units"):
            assert np.array_equal(getattr(every[center], name), getattr(few[center], name))
    other = draw(centers, replace(SMALL, seed=1))
    assert not any(np.array_equal(every[c].offset, other[c].offset) for c in every)
    offsets = [tuple(drawn.offset[:5]) for drawn in every.values()]
    assert len(set(offsets)) == len(offsets), "each patch has its own stream"


@pytest.mark.parametrize("wanted", [1, 20, 64, 70, 500])
def test_color_units_are_drawn_without_replacement(wanted: int) -> None:
    """All samples, if the patch has fewer."""
    mesh = finish(build_patch_mesh(surface(cube(3)), 10))
    settings = replace(SMALL, color_units=wanted)
    for patch in patches_of(mesh, settings):
        drawn = draw_samples(mesh, [patch], mesh.area, settings)[0]
        units = drawn.units.tolist()
        assert len(units) == min(wanted, len(drawn.positions))
        assert units == sorted(set(units))
        assert units[0] >= 0
        assert units[-1] < len(drawn.positions)


def test_a_patch_without_samples_is_empty_and_nothing_worse() -> None:
    """The least permitted density rules it out in a run; the parts bear it."""
    mesh = finish(build_patch_mesh(surface(cube(2)), 1))
    patch = Patch(0, np.array([3, 5]), 1e-9, 0.5, False)
    drawn = draw_samples(mesh, [patch], mesh.area, Settings(samples=32, patches=1))[0]
    assert len(drawn.positions) == len(drawn.units) == 0
    full = draw_samples(mesh, [patches_of(mesh, SMALL)[0]], mesh.area, SMALL)[0]
    joined = join_samples([drawn, full, drawn])
    assert joined.start.tolist() == [0, 0, len(full.offset), len(full.offset)]
    assert set(joined.patch.tolist()) == {1}


def test_joined_samples_are_patch_after_patch() -> None:
    mesh = finish(build_patch_mesh(surface(cube(3)), 10))
    parts = [draw_samples(mesh, [patch], mesh.area, SMALL)[0] for patch in patches_of(mesh, SMALL)]
    joined = join_samples(parts)
    assert joined.patch.dtype == np.int32
    assert joined.start[-1] == len(joined.positions) == len(joined.offset) == len(joined.unit)
    for k, part in enumerate(parts):
        here = slice(joined.start[k], joined.start[k + 1])
        assert np.array_equal(joined.positions[here], part.positions)
        assert np.array_equal(joined.offset[here], part.offset)
        assert (joined.patch[here] == k).all()
        assert np.flatnonzero(joined.unit[here]).tolist() == part.units.tolist()


def test_counts_are_the_same_far_from_the_origin() -> None:
    """On a regular grid each share is a whole number; 1e5 diagonals away it is one up to 1e-7."""
    positions, triangles = grid(100, 100)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    here = surface((positions @ turn.T, triangles))
    away = surface((positions @ turn.T + 1e5 * np.sqrt(2) * 100 * np.array([0.6, 0.64, 0.48]), triangles))
    places = here.vertices[np.array(list(choose_centers(here.vertices, Settings(scored_patches=20))))]
    counts = []
    for shape in (here, away):
        mesh = finish(build_patch_mesh(shape, 250))
        centers = [int(np.linalg.norm(mesh.vertices - place, axis=1).argmin()) for place in places]
        patches = grow_patches(mesh, np.array(centers), 250)
        counts.append([sample_count(patch, mesh.area, Settings()) for patch in patches])
    assert counts[0] == counts[1]
