# SPDX-License-Identifier: GPL-3.0-or-later
"""SDF and NCF against loops over all triangles."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.metric import queries, settling
from fmqm_addon.metric.fields import Fields, evaluate_fields
from fmqm_addon.metric.geometry import Floats, Ints, morton_order, triangle_normals
from fmqm_addon.metric.queries import _coarse_to_fine, _guide, count_crossings, count_crossings_of_all, normals_at
from fmqm_addon.metric.stepper import Work
from fmqm_addon.metric.surface import MeshArrays, Surface, prepare_surface
from fmqm_addon.metric.texture import PlainColor

from .meshes import TETRAHEDRON, cube, grid, icosahedron, materials, sphere, surface, texture
from .oracles import NaiveQuery, exact_distance, texture_color, winding_number

seeds = st.integers(0, 2**32 - 1)
CLOSED = {"tetrahedron": TETRAHEDRON, "cube": cube(1), "cut cube": cube(2), "icosahedron": icosahedron()}
T = TypeVar("T")


def result_of(work: Work[T]) -> T:
    done = 0.0
    while True:
        try:
            now = next(work).done
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        assert done <= now <= 1
        done = now


def fields_at(shape: Surface, points: Floats, reach: Floats | None = None) -> Fields:
    return result_of(evaluate_fields(shape, points, morton_order(points), reach))


def displaced(name: str, seed: int, amount: float = 0.15) -> tuple[Floats, Ints]:
    positions, triangles = CLOSED[name]
    return positions + np.random.default_rng(seed).normal(0, amount, positions.shape), triangles


@given(seeds, st.sampled_from(sorted(CLOSED)), st.integers(1, 150), st.sampled_from([0.02, 0.3, 3.0]))
def test_fields_of_a_closed_mesh(seed: int, name: str, count: int, spread: float) -> None:
    """Distance, nearest point, sign and color, near and far, also where the mesh cuts itself."""
    shape = surface(displaced(name, seed), (texture(seed % 100),))
    rng = np.random.default_rng(seed)
    corners = shape.vertices[shape.triangles]
    points = corners[rng.integers(0, len(corners), count)].mean(axis=1) + rng.normal(0, spread, (count, 3))
    found = fields_at(shape, points)
    assert found.ncf.dtype == np.float32
    for n in range(0, count, 7):
        distance = min(exact_distance(points[n], *triangle) for triangle in corners)
        assert abs(found.sdf[n]) == pytest.approx(distance, abs=1e-9)
        assert np.linalg.norm(points[n] - found.nearest[n]) == pytest.approx(distance, abs=1e-9)
        inside = round(winding_number(points[n], shape.vertices, shape.triangles)) % 2 == 1
        assert (found.sdf[n] < 0) == inside
        a, b, c = corners[found.triangle[n]]
        weights = np.linalg.lstsq(np.stack([a, b, c]).T, found.nearest[n], rcond=None)[0]
        if abs(np.linalg.det(np.stack([a, b, c]))) > 1e-3:  # else the weights are not unique
            u, v = (weights / weights.sum()) @ shape.corners[found.triangle[n]]
            np.testing.assert_allclose(found.ncf[n], texture_color(shape.materials[0].color, u, v), atol=1e-5)  # type: ignore[arg-type]


@given(seeds, st.integers(1, 80))
def test_known_bounds_change_nothing(seed: int, count: int) -> None:
    """The reference knows how far its samples are at most; the naive query checks that bounds are bounds."""
    shape = surface(displaced("cut cube", seed), (texture(1), PlainColor((0.1, 0.5, 0.9))))
    points = np.random.default_rng(seed).uniform(-0.6, 0.6, (count, 3))
    own = fields_at(shape, points)
    given_bounds = fields_at(shape, points, np.abs(own.sdf))
    for name in ("nearest", "triangle", "sdf", "ncf"):
        assert np.array_equal(getattr(own, name), getattr(given_bounds, name))


@given(seeds, st.integers(2, 200))
def test_the_order_of_the_lookups_changes_nothing(seed: int, count: int) -> None:
    shape = surface(displaced("icosahedron", seed), (texture(2),))
    rng = np.random.default_rng(seed)
    points = rng.uniform(-0.6, 0.6, (count, 3))
    first = fields_at(shape, points)
    shuffled = result_of(evaluate_fields(shape, points, rng.permutation(count)))
    for name in ("nearest", "triangle", "sdf", "ncf"):
        assert np.array_equal(getattr(first, name), getattr(shuffled, name))


@pytest.mark.parametrize("count", [1, 2, 8, 9, 63, 64, 65, 129, 640])
def test_rounds_of_lookups_cover_every_point_once_and_guides_come_before(count: int) -> None:
    order = np.random.default_rng(count).permutation(count)
    rounds = _coarse_to_fine(order)
    assert sorted(np.concatenate(rounds).tolist()) == list(range(count))
    place = {int(point): k for k, point in enumerate(order)}
    known = set(rounds[0].tolist())
    for index in (1, 2):
        guides = _guide(order, index)
        assert len(guides) == len(rounds[index])
        assert set(guides.tolist()) <= known
        assert all(0 < place[p] - place[g] < 64 for p, g in zip(rounds[index].tolist(), guides.tolist(), strict=True))
        known |= set(rounds[index].tolist())


def test_more_points_than_a_batch() -> None:
    shape = surface(TETRAHEDRON)
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (9000, 3))
    whole = fields_at(shape, points)
    part = fields_at(shape, points[4000:4100])
    assert np.array_equal(whole.sdf[4000:4100], part.sdf)
    assert np.array_equal(whole.nearest[4000:4100], part.nearest)


def test_a_cube_by_hand() -> None:
    """Unit cube, in units of its diagonal: center, outside over a face, an edge and a corner, and on a face."""
    shape = surface(cube(1))
    side = 1 / np.sqrt(3)
    points = np.array([[0.1, 0.0, 0.02], [1.0, 0.05, 0.07], [1, 1, 0.03], [1, 1, 1], [side / 2, 0.1, 0.03]])
    found = fields_at(shape, points)
    half = side / 2
    expected = [0.1 - half, 1 - half, np.sqrt(2) * (1 - half), np.sqrt(3) * (1 - half), 0]
    np.testing.assert_allclose(found.sdf, expected, atol=1e-12)
    np.testing.assert_allclose(found.nearest[:2], [[half, 0, 0.02], [half, 0.05, 0.07]], atol=1e-12)


def test_on_the_surface_nearest_is_the_point_itself() -> None:
    """Where p = p_n the SDF is 0, exactly; a distance that float32 cannot see has no direction."""
    shape = surface(TETRAHEDRON)
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], 50)
    points = np.einsum("nk,nkc->nc", weights, shape.vertices[shape.triangles[np.arange(50) % 4]])
    points = np.concatenate([points, shape.vertices, points + 3e-10])
    found = fields_at(shape, points)
    assert (found.sdf == 0).all()
    assert np.array_equal(found.nearest, points)


def test_an_open_surface_has_no_inside_over_its_middle() -> None:
    shape = surface(grid(2, 2))
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (60, 3))
    found = fields_at(shape, points)
    np.testing.assert_allclose(found.sdf, np.abs(points[:, 2]), atol=1e-12)


def test_crossings_of_nested_shells() -> None:
    """Three cubes, one in another: the parity alternates from shell to shell."""
    positions, triangles = cube(1)
    shells = np.concatenate([(positions - 0.5) * scale for scale in (1, 2, 3)])
    shape = surface((shells, np.concatenate([triangles + 8 * k for k in range(3)])))
    at = np.array([0.2, 0.7, 1.2, 1.7]) / shape.frame.scale
    points = np.stack([at, 0.011 * at, 0.017 * at], axis=1)
    right = np.tile([[1.0, 0, 0]], (4, 1))
    assert count_crossings(shape, points, right).tolist() == [3, 2, 1, 0]
    assert count_crossings(shape, points, -right).tolist() == [3, 4, 5, 6]
    assert np.sign(fields_at(shape, points).sdf).tolist() == [-1, 1, -1, 1]


class HeldBack:
    """A query whose hits come back short, as rounding in float32 may do: each triangle is found repeatedly."""

    def __init__(self, short: float) -> None:
        self.short = short

    def nearest(self, points: Floats, bounds: Floats | None) -> Ints:
        raise NotImplementedError

    def first_hit(self, origins: Floats, directions: Floats) -> tuple[Ints, Floats]:
        gap = 0.5 + self.short - origins[:, 0]
        return np.where(gap > 0, 0, -1), np.maximum(gap - self.short, 0)


def test_a_triangle_found_again_counts_once() -> None:
    """A ray that rounding holds back takes longer and longer steps until it is through."""
    from dataclasses import replace

    shape = replace(surface(TETRAHEDRON), query=HeldBack(1e-3))
    right = np.tile([[1.0, 0, 0]], (3, 1))
    origins = np.array([[-1.0, 0, 0], [0, 0, 0], [1, 0, 0]])
    assert count_crossings(shape, origins, right).tolist() == [1, 1, 0]


def test_the_sphere_is_round() -> None:
    """An independent, closed form: |SDF| is within the sagitta of the distance to the sphere."""
    shape = surface(sphere())
    radius = 1 / shape.frame.scale
    directions = np.random.default_rng(0).normal(size=(100, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for r in (0.3, 1.5, 4.0):
        sdf = fields_at(shape, directions * r * radius).sdf
        assert ((sdf / radius >= r - 1 - 1e-9) & (sdf / radius <= r - 0.9)).all()


@given(seeds)
def test_ties_on_edges_do_not_depend_on_the_order_of_triangles(seed: int) -> None:
    """A ridge whose sides have different colors: what is nearest to its edge takes the side that faces it more."""
    rng = np.random.default_rng(seed)
    positions = np.array([[0, 0, 0.5], [1, 0, 0.5], [0, -1, 0], [1, -1, 0], [0, 1, 0], [1, 1, 0.0]])
    triangles = np.array([[0, 2, 1], [1, 2, 3], [0, 1, 4], [1, 5, 4]])
    colors = materials(PlainColor((1, 0, 0)), PlainColor((0, 0, 1)))
    points = rng.uniform([0.1, -0.2, 0.6], [0.9, 0.2, 0.9], (40, 3))
    order = rng.permutation(4)
    found = []
    for rows in (np.arange(4), order):
        corners = np.stack([np.roll(row, rng.integers(3)) for row in triangles[rows]])
        mesh = MeshArrays("ridge", positions, corners, np.zeros((4, 3, 2)), np.array([0, 0, 1, 1])[rows], colors)
        prepared = prepare_surface(mesh, NaiveQuery)
        found.append(fields_at(prepared, prepared.frame.enter(points)))
    np.testing.assert_array_equal(found[0].ncf, found[1].ncf)
    above = np.abs(points[:, 1]) < (points[:, 2] - 0.5) / 2 * 0.9  # nearest to the edge itself
    assert above.any()
    np.testing.assert_array_equal(found[0].ncf[above, 0] == 1, points[above, 1] < 0)


def soup(count: int, seed: int) -> tuple[Floats, Ints]:
    """Triangles across the whole unit cube."""
    return np.random.default_rng(seed).random((3 * count, 3)), np.arange(3 * count).reshape(-1, 3)


@given(seeds, st.integers(1, 60))
def test_crossings_without_a_tree(seed: int, count: int) -> None:
    shape = surface(soup(count, seed))
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = rng.normal(0, 0.3, (20, 3))
    wanted = count_crossings(shape, origins, directions)
    assert count_crossings_of_all(shape, origins, directions).tolist() == wanted.tolist()


@pytest.mark.parametrize(("count", "without_a_tree"), [(20, False), (800, True)])
def test_only_a_soup_is_tested_without_a_tree(
    monkeypatch: pytest.MonkeyPatch, count: int, without_a_tree: bool
) -> None:
    """And has the same signs, but where a ray crosses two triangles within RAY_STEP."""
    shape = surface(soup(count, seed=1))
    points = np.random.default_rng(2).uniform(-0.2, 0.2, (50, 3))
    asked: list[int] = []

    def counted(*arguments: Surface | Floats) -> Ints:
        asked.append(1)
        return count_crossings_of_all(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(queries, "count_crossings_of_all", counted)
    found = fields_at(shape, points)
    assert bool(asked) == without_a_tree
    monkeypatch.setattr(queries, "_SOUP_CROSSINGS", np.inf)
    by_tree = fields_at(shape, points)
    assert np.array_equal(np.abs(found.sdf), np.abs(by_tree.sdf))
    assert np.count_nonzero(found.sdf != by_tree.sdf) <= 2


def test_the_hub_of_a_fan_is_settled_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many triangles meet at a vertex: a few at a time, and the same ones are chosen."""
    around = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    rim = np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    k = np.arange(1, 41)
    shape = surface((np.concatenate([[[0, 0, 1]], rim]), np.stack([0 * k, k, k % 40 + 1], axis=1)), (texture(),))
    points = np.random.default_rng(0).normal(0, 0.5, (200, 3))
    whole = fields_at(shape, points)
    monkeypatch.setattr(settling, "_CANDIDATES", 1)
    parts = fields_at(shape, points)
    assert np.array_equal(whole.triangle, parts.triangle) and np.array_equal(whole.nearest, parts.nearest)


@pytest.mark.parametrize("count", [3, 500])
def test_normals_at_faces_few_or_many_times(count: int) -> None:
    """Of each face asked for, or of all faces once where fewer: the same ones."""
    shape = surface(icosahedron())
    triangle = np.random.default_rng(count).integers(0, len(shape.triangles), count)
    asked = triangle_normals(shape.vertices, shape.triangles[triangle])
    assert np.array_equal(normals_at(shape, triangle), asked)


@given(seeds, st.integers(1, 60))
def test_heights_known_before_change_nothing(seed: int, count: int) -> None:
    """A query that answers many at once is asked again close to edges, by the heights of triangles."""
    shape = surface(displaced("cut cube", seed), (texture(1),))
    points = np.random.default_rng(seed).uniform(-0.6, 0.6, (count, 3))
    triangle = shape.query.nearest(points, None)
    asked: list[int] = []

    def again(points: Floats, bounds: Floats) -> Ints:
        asked.append(len(points))
        return shape.query.nearest(points, bounds * 1.001 + 1e-6)

    found = [result_of(settling.settling(shape, points, triangle, function)) for function in (None, again)]
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other)
