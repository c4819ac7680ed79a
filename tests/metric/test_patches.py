# SPDX-License-Identifier: GPL-3.0-or-later
"""Local patches (V-B) against sets and loops."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.metric.geometry import Floats, Ints, triangle_areas, triangle_normals
from fmqm_addon.metric.patches import (
    PatchMesh,
    build_patch_mesh,
    choose_centers,
    farthest_points,
    grow_patches,
    split_edges,
)
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.stepper import finish

from .meshes import TETRAHEDRON, TRIANGLE, cube, grid, icosahedron, sphere, surface
from .oracles import farthest_points_by_loop, grow_with_sets

seeds = st.integers(0, 2**32 - 1)


def patch_mesh(vertices: Floats, triangles: Ints) -> PatchMesh:
    return PatchMesh(vertices, triangles, triangle_areas(vertices, triangles), np.arange(len(triangles)), False)


def edge_counts(triangles: Ints) -> Counter[tuple[int, int]]:
    """How often each directed edge occurs."""
    return Counter((t[k], t[(k + 1) % 3]) for t in triangles.tolist() for k in range(3))


def is_closed(triangles: Ints) -> bool:
    """Each edge once in each direction: no border, no T-junction, one orientation."""
    edges = edge_counts(triangles)
    return all(count == 1 and edges[b, a] == 1 for (a, b), count in edges.items())


# --- centers ----------------------------------------------------------------------------------------------


@given(seeds, st.integers(1, 60), st.integers(1, 60))
def test_farthest_points_of_random_points(seed: int, size: int, count: int) -> None:
    vertices = np.random.default_rng(seed).normal(size=(size, 3))
    count = min(count, size)
    assert list(farthest_points(vertices, count)) == farthest_points_by_loop(vertices, count)


@given(st.tuples(*[st.integers(1, 6)] * 3), st.integers(1, 40), seeds)
def test_farthest_points_of_regular_grids(shape: tuple[int, int, int], count: int, seed: int) -> None:
    """Many distances tie, some only up to rounding: the lowest index wins, in any order of the vertices."""
    vertices = np.stack(np.meshgrid(*(np.arange(n) * 0.1 for n in shape)), axis=-1).reshape(-1, 3)
    vertices = np.random.default_rng(seed).permutation(vertices)
    count = min(count, len(vertices))
    assert list(farthest_points(vertices, count)) == farthest_points_by_loop(vertices, count)


@pytest.mark.parametrize("size", [255, 256, 257, 512, 1100])
def test_farthest_points_beyond_one_block(size: int) -> None:
    """More vertices than share a bounding box, with and without ties."""
    rng = np.random.default_rng(size)
    lattice = np.stack(np.meshgrid(*[np.arange(11)] * 3), axis=-1).reshape(-1, 3)
    for vertices in (rng.normal(size=(size, 3)), rng.permutation(lattice)[:size] / 3):
        assert list(farthest_points(vertices, 60)) == farthest_points_by_loop(vertices, 60)


def test_almost_equal_distances_tie() -> None:
    """0.9e-5 farther is a tie, and the lower index wins; 1.2e-5 farther is not."""
    ends = np.array([[1, 0, 0], [-1, 0, 0], *[[0, y, 0] for y in np.linspace(-0.1, 0.1, 1000)]])
    tied, clear = ends.copy(), ends.copy()
    tied[1, 0], clear[1, 0] = -1 - 0.9e-5, -1 - 1.2e-5
    assert list(farthest_points(tied, 2)) == [0, 1]
    assert list(farthest_points(clear, 2)) == [1, 0]


def test_farthest_points_are_every_vertex_at_the_end() -> None:
    vertices = np.random.default_rng(0).normal(size=(30, 3))
    assert sorted(farthest_points(vertices, 30)) == list(range(30))


@pytest.mark.parametrize("centers", ["fps", "random"])
def test_fewer_centers_are_the_first_of_more(centers: str) -> None:
    vertices = np.random.default_rng(0).normal(size=(300, 3))
    every = np.array(list(choose_centers(vertices, Settings(samples=3200, patches=100, centers=centers))))
    for scored in (1, 7, 100, 500):
        settings = Settings(samples=3200, patches=100, scored_patches=scored, centers=centers)
        assert np.array_equal(np.array(list(choose_centers(vertices, settings))), every[:scored])
    assert len(set(every.tolist())) == 100


@pytest.mark.parametrize("centers", ["fps", "random"])
def test_with_fewer_vertices_than_patches_every_vertex_is_a_center(centers: str) -> None:
    vertices = np.random.default_rng(0).normal(size=(12, 3))
    chosen = np.array(list(choose_centers(vertices, Settings(samples=640, patches=20, centers=centers))))
    assert sorted(chosen.tolist()) == list(range(12))


def test_random_centers_follow_the_seed_and_farthest_ones_do_not() -> None:
    vertices = np.random.default_rng(0).normal(size=(300, 3))

    def chosen(centers: str, seed: int) -> list[int]:
        settings = Settings(samples=3200, patches=100, centers=centers, seed=seed)
        return list(choose_centers(vertices, settings))  # type: ignore[no-any-return]

    assert chosen("random", 1) == chosen("random", 1)
    assert chosen("random", 1) != chosen("random", 2)
    assert chosen("fps", 1) == chosen("fps", 2)


# --- growth -----------------------------------------------------------------------------------------------


def random_mesh(seed: int) -> tuple[Floats, Ints]:
    """Some loose parts, of any connection: open, closed, meeting in a vertex only, single triangles."""
    rng = np.random.default_rng(seed)
    parts = [grid(int(rng.integers(1, 5)), int(rng.integers(1, 5))), TETRAHEDRON, cube(2), TRIANGLE]
    vertices, triangles = np.zeros((0, 3)), np.zeros((0, 3), int)
    for k in rng.permutation(4)[: rng.integers(1, 5)]:
        positions, corners = parts[k]
        triangles = np.concatenate([triangles, corners + len(vertices)])
        vertices = np.concatenate([vertices, positions + rng.normal(0, 0.1, positions.shape) + rng.normal(0, 3, 3)])
    glue = rng.integers(0, len(vertices), 2)
    triangles = np.where(triangles == glue[0], glue[1], triangles)
    triangles = triangles[[len(set(row)) == 3 for row in triangles.tolist()]]
    used, compact = np.unique(triangles, return_inverse=True)
    return vertices[used], compact.reshape(-1, 3)


@given(seeds, st.integers(1, 12))
def test_patches_grow_by_rings_of_sets(seed: int, n_patches: int) -> None:
    mesh = patch_mesh(*random_mesh(seed))
    centers = np.random.default_rng(seed).permutation(len(mesh.vertices))[:6]
    patches = list(grow_patches(mesh, centers, n_patches))
    assert [patch.center for patch in patches] == centers.tolist()
    for patch in patches:
        faces, ran_out = grow_with_sets(mesh.vertices, mesh.triangles, mesh.areas, patch.center, n_patches)
        assert patch.faces.tolist() == sorted(faces)
        assert patch.extended == ran_out
        assert patch.area == pytest.approx(mesh.areas[list(faces)].sum())
        assert patch.area >= mesh.area / n_patches * (1 - 1e-8), "every patch has its share of the surface"
        corners = mesh.vertices[mesh.triangles[patch.faces].ravel()]
        assert patch.diagonal == pytest.approx(np.linalg.norm(np.ptp(corners, axis=0)))


def test_rings_by_hand() -> None:
    """The middle of a 10 x 10 grid: 6 triangles around a vertex, then 24, then 54."""
    vertices, triangles = grid(10, 10)
    mesh = patch_mesh(vertices, triangles)
    middle = np.array([5 * 11 + 5])
    for n_patches, faces in ((200, 6), (34, 6), (33, 24), (9, 24), (8, 54), (4, 54), (1, 200)):
        patch = next(grow_patches(mesh, middle, n_patches))
        assert (len(patch.faces), patch.extended) == (faces, False)
    assert next(grow_patches(mesh, middle, 200)).diagonal == pytest.approx(np.sqrt(8))


def test_a_target_reached_up_to_rounding_is_reached() -> None:
    """The one-ring of 6 equal triangles is just the n-th part; in any unit it takes no second ring."""
    vertices, triangles = grid(9, 10)
    for scale in (1.0, 0.1, 1 / 3, 1e-7, 7e5):
        mesh = patch_mesh(vertices * scale + scale / 7, triangles)
        patch = next(grow_patches(mesh, np.array([5 * 10 + 5]), 30))
        assert len(patch.faces) == 6


def test_a_loose_part_goes_on_with_the_nearest_triangles() -> None:
    """Triangles in a row, each its own part: nearest centroid first, in either direction, until the area is there."""
    corner, _ = TRIANGLE
    positions = np.concatenate([corner + np.array([4 * k, 0, 0]) for k in (0, 1, 2, 3.5, 5)])
    mesh = patch_mesh(positions, np.arange(15).reshape(5, 3))
    for n_patches, faces in ((5, [2]), (4, [1, 2]), (2, [1, 2, 3]), (1, [0, 1, 2, 3, 4])):
        patch = next(grow_patches(mesh, np.array([6 + 1]), n_patches))  # the right corner: 2 units from each neighbor
        near = sorted(range(5), key=lambda f: abs(positions[3 * f : 3 * f + 3, 0].mean() - positions[7, 0]))
        assert patch.faces.tolist() == sorted(near[: len(faces)])
        assert patch.extended == (n_patches < 5)


def test_patches_do_not_see_each_other() -> None:
    mesh = patch_mesh(*random_mesh(5))
    centers = np.arange(8)
    together = list(grow_patches(mesh, centers, 5))
    for k in range(8):
        alone = next(grow_patches(mesh, centers[k : k + 1], 5))
        assert np.array_equal(alone.faces, together[k].faces)


# --- low-polygon references -------------------------------------------------------------------------------


@pytest.mark.parametrize("shape", [TETRAHEDRON, cube(1), cube(2), icosahedron(), sphere()])
@pytest.mark.parametrize("n_patches", [1, 3, 20, 100])
def test_split_patches_of_closed_meshes(shape: tuple[Floats, Ints], n_patches: int) -> None:
    """Same surface, still closed, nothing above a quarter of a patch; or nothing changes at all."""
    prepared = surface(shape)
    mesh = finish(build_patch_mesh(prepared, n_patches))
    target = triangle_areas(prepared.vertices, prepared.triangles).sum() / n_patches
    if len(shape[0]) >= n_patches:
        assert not mesh.was_split
        assert mesh.vertices is prepared.vertices
        assert np.array_equal(mesh.triangles, prepared.triangles)
        return
    assert mesh.was_split
    assert mesh.areas.max() <= target / 4 * (1 + 1e-8)
    check_split(prepared.vertices, prepared.triangles, mesh.vertices, mesh.triangles, mesh.parent)
    assert is_closed(mesh.triangles)
    np.testing.assert_allclose(mesh.areas, triangle_areas(mesh.vertices, mesh.triangles))


def check_split(old_vertices: Floats, old: Ints, vertices: Floats, new: Ints, parent: Ints) -> None:
    """Each new triangle lies on its parent, turned alike; their areas add up to its."""
    np.testing.assert_allclose(
        np.bincount(parent, triangle_areas(vertices, new), len(old)), triangle_areas(old_vertices, old), rtol=1e-9
    )
    normals = triangle_normals(old_vertices, old)[parent]
    np.testing.assert_allclose(triangle_normals(vertices, new), normals, atol=1e-6)
    from_plane = np.einsum("tkc,tc->tk", vertices[new] - old_vertices[old[parent, 0]][:, None], normals)
    np.testing.assert_allclose(from_plane, 0, atol=1e-9)
    assert np.array_equal(vertices[: len(old_vertices)], old_vertices)
    assert sorted(np.unique(new).tolist()) == list(range(len(vertices))), "each vertex is used"
    assert len(np.unique(vertices, axis=0)) == len(vertices), "neighbors share their new vertices"


@given(seeds, st.sampled_from(["cube", "sphere", "grid", "tetrahedron"]))
def test_split_edges_of_any_choice(seed: int, name: str) -> None:
    """Whatever is called large: all its edges are halved, its neighbors are cut along, no T-junction."""
    shapes = {"cube": cube(2), "sphere": sphere(), "grid": grid(3, 2), "tetrahedron": TETRAHEDRON}
    rng = np.random.default_rng(seed)
    positions, triangles = shapes[name]
    positions = positions + rng.normal(0, 0.05, positions.shape)
    triangles = np.stack([np.roll(row, rng.integers(3)) for row in triangles])
    large = rng.random(len(triangles)) < rng.random()
    large[rng.integers(len(large))] = True
    vertices, new, parent = split_edges(positions, triangles, large)
    check_split(positions, triangles, vertices, new, parent)
    pieces = np.bincount(parent, minlength=len(triangles))
    assert (pieces[large] == 4).all()
    halved = {frozenset((t[k], t[(k + 1) % 3])) for t in triangles[large].tolist() for k in range(3)}
    edges = [sum(frozenset((t[k], t[(k + 1) % 3])) in halved for k in range(3)) for t in triangles.tolist()]
    assert pieces.tolist() == [1 + n for n in edges]
    assert len(vertices) == len(positions) + len(halved)
    directed = edge_counts(new)
    assert max(directed.values()) == 1
    border = {edge for edge in directed if edge[::-1] not in directed}
    if name == "grid":
        before = edge_counts(triangles)
        outer = [edge for edge in before if edge[::-1] not in before]
        assert len(border) == len(outer) + sum(frozenset(edge) in halved for edge in outer)
    else:
        assert not border


def test_an_open_triangle_is_split_until_it_makes_patches() -> None:
    prepared = surface(TRIANGLE)
    mesh = finish(build_patch_mesh(prepared, 10))
    assert mesh.was_split
    assert mesh.areas.max() <= mesh.area / 40 * (1 + 1e-9)
    assert (mesh.parent == 0).all()
    patches = list(grow_patches(mesh, np.arange(len(mesh.vertices)), 10))
    assert not any(patch.extended for patch in patches)


LARGE_AND_SMALL = (
    np.concatenate([grid(8, 8)[0], [[20, 0, 0], [30, 0, 0], [20, 10, 0]]]),
    np.concatenate([grid(8, 8)[1], [[81, 82, 83]]]),
)


def test_a_large_triangle_among_vertices_enough_stays() -> None:
    """It is larger than a patch, and there are 84 vertices for the centres: nobody looks at it more than before."""
    prepared = surface(LARGE_AND_SMALL)
    assert not finish(build_patch_mesh(prepared, 84)).was_split
    mesh = finish(build_patch_mesh(prepared, 10))
    assert mesh.vertices is prepared.vertices and mesh.triangles is prepared.triangles
    assert mesh.areas.max() > 3 * mesh.area / 10


def test_with_too_few_vertices_only_what_is_large_is_split() -> None:
    mesh = finish(build_patch_mesh(surface(LARGE_AND_SMALL), 85))
    assert mesh.was_split
    pieces = np.bincount(mesh.parent)
    assert pieces[-1] >= 0.4 * 4 * 85 and (pieces[:-1] <= 4).all()
    assert len(mesh.vertices) >= 85


@pytest.mark.parametrize("scale", [1, 0.1, 1e-6 / 3])
def test_a_vertex_for_each_patch_is_enough(scale: float) -> None:
    positions, triangles = icosahedron()
    prepared = surface((positions * scale, triangles))
    assert not finish(build_patch_mesh(prepared, 12)).was_split
    assert finish(build_patch_mesh(prepared, 13)).was_split


def test_only_used_and_welded_vertices_count() -> None:
    """Importers split vertices at seams, and files hold some that no face uses."""
    positions, triangles = icosahedron()
    split = np.concatenate([positions[triangles].reshape(-1, 3), [[9, 9, 9]]])
    prepared = surface((split, np.arange(60).reshape(-1, 3)))
    assert finish(build_patch_mesh(prepared, 13)).was_split
    assert not finish(build_patch_mesh(prepared, 12)).was_split


def test_slivers_can_be_split() -> None:
    """A triangle that is almost a line ends in small triangles all the same."""
    positions = np.array([[0, 0, 0], [1, 0.3, 0.2], [0.5, 0.15, 0.1 + 1e-9], [0.5, 0.7, 0.1]])
    mesh = finish(build_patch_mesh(surface((positions, np.array([[0, 1, 2], [0, 2, 3]]))), 20))
    assert mesh.areas.max() <= mesh.area / 80 * (1 + 1e-9)
    thin = finish(build_patch_mesh(surface((positions[:3], np.array([[0, 1, 2]]))), 20))
    assert thin.areas.max() <= thin.area / 80 * 1.01
