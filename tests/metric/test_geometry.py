# SPDX-License-Identifier: GPL-3.0-or-later
"""Points and triangles against exact arithmetic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from fmqm_addon.metric.geometry import (
    Floats,
    closest_on_triangles,
    cross,
    dot,
    first_of_each,
    lengths,
    morton_order,
    weighted,
)

from .oracles import NaiveQuery, exact_distance, squared_distances

seeds = st.integers(0, 2**32 - 1)


def check_closest(point: Floats, corners: Floats, excess: float) -> None:
    """The point found is on the triangle, and no point of the triangle is nearer by more than the excess."""
    found, weights = (x[0] for x in closest_on_triangles(point[None], *(row[None] for row in corners)))
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(1, abs=4e-16)
    np.testing.assert_allclose(found, weights @ corners, rtol=0, atol=4e-16 * np.abs(corners).max())
    assert np.linalg.norm(found - point) == pytest.approx(exact_distance(point, *corners), rel=1e-14, abs=excess)


def sliver(rng: np.random.Generator, height: float) -> Floats:
    """A cap, a needle or a small triangle of about that height, in a box of size 1, corners in any order."""
    a, b = rng.uniform(-0.5, 0.5, (2, 3))
    c = {
        0: a + (b - a) * rng.random() + rng.normal(size=3) * height,
        1: b + rng.normal(size=3) * height,
        2: rng.uniform(-0.5, 0.5, 3),
    }[int(rng.integers(3))]
    return rng.permutation(np.array([a, b, c]))


@given(seeds, st.floats(0, 7), st.booleans())
def test_closest_point_is_the_nearest_of_the_triangle(seed: int, exponent: float, above: bool) -> None:
    rng = np.random.default_rng(seed)
    corners = sliver(rng, 10**-exponent)
    point = rng.uniform(-0.5, 0.5, 3)
    if above:  # where the plane's foot is inside the triangle
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        point = rng.dirichlet([1, 1, 1]) @ corners + normal / np.linalg.norm(normal) * rng.normal(0, 0.1)
    check_closest(point, corners, 1e-11)


def test_closest_point_of_the_thinnest_slivers() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        a, b = rng.uniform(-0.5, 0.5, (2, 3))
        c = b + rng.normal(size=3) * 1e-11
        along = (b - a) / np.linalg.norm(b - a)
        normal = np.cross(along, c - a)
        normal -= normal @ along * along
        corners = np.array([a, b, c])
        check_closest(rng.dirichlet([1, 1, 1]) @ corners + normal / np.linalg.norm(normal) * 1e-6, corners, 1e-9)


@given(seeds, st.sampled_from([1e-9, 1e-3, 1e3, 1e9]))
def test_closest_point_knows_no_unit(seed: int, scale: float) -> None:
    rng = np.random.default_rng(seed)
    corners = sliver(rng, 0.01)
    check_closest(rng.uniform(-2, 2, 3) * scale, corners * scale, 1e-11 * scale)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.5, 0.5, 7), (0.5, 0.5, 0)),  # face
        ((1, -3, 1), (1, 0, 0)),  # edge
        ((-1, -1, 0), (0, 0, 0)),  # corner
        ((9, 0, 0), (4, 0, 0)),  # corner in the plane
        ((2, 2, -1), (2, 2, 0)),  # just on the long edge
        ((4, 4, 2), (2, 2, 0)),  # beyond the long edge
    ],
)
def test_closest_point_by_hand(point: tuple[float, ...], expected: tuple[float, ...]) -> None:
    corners = np.array([[0, 0, 0], [4, 0, 0], [0, 4, 0]], float)
    found, _ = closest_on_triangles(np.array([point], float), *(corner[None] for corner in corners))
    assert found[0].tolist() == pytest.approx(expected, abs=1e-15)


@given(seeds)
def test_the_naive_query_agrees_with_exact_arithmetic(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = np.array([sliver(rng, 0.05) for _ in range(4)])
    points = rng.uniform(-1, 1, (3, 3))
    squared = squared_distances(points, *corners.transpose(1, 0, 2))
    exact = [[exact_distance(p, *triangle) for triangle in corners] for p in points]
    np.testing.assert_allclose(np.sqrt(squared), exact, rtol=0, atol=1e-7)
    query = NaiveQuery(corners.reshape(-1, 3), np.arange(12).reshape(4, 3))
    assert query.nearest(points, None).tolist() == np.argmin(exact, axis=1).tolist()


def test_the_naive_query_takes_the_first_of_two_walls() -> None:
    corners = np.array([[0, 0, 2], [9, 0, 2], [0, 9, 2], [0, 0, 1], [9, 0, 1], [0, 9, 1]], float)
    query = NaiveQuery(corners, np.arange(6).reshape(2, 3))
    up, origins = np.array([[0, 0, 1.0]] * 3), np.array([[1, 1, 0], [1, 1, 1.5], [1, 1, 3]])
    triangle, distance = query.first_hit(origins, up)
    assert triangle.tolist() == [1, 0, -1]
    assert distance.tolist() == [1, 0.5, np.inf]


@given(seeds, st.integers(1, 300), st.sampled_from(["cloud", "plane", "line", "repeated", "one place"]))
@example(0, 1, "cloud")
def test_morton_order_is_a_permutation(seed: int, count: int, kind: str) -> None:
    points = np.random.default_rng(seed).normal(0, 10.0 ** (seed % 19 - 9), (count, 3))
    if kind == "plane":
        points[:, 2] = 3
    elif kind == "line":
        points[:, 1:] = -1
    elif kind == "repeated":
        points = points[np.arange(count) // 5]
    elif kind == "one place":
        points[:] = points[0]
    assert sorted(morton_order(points).tolist()) == list(range(count))


def test_morton_order_is_the_z_curve() -> None:
    """The cells of a 4 x 4 x 4 grid come by their interleaved bits, x lowest."""
    cells = np.array([(x, y, z) for x in range(4) for y in range(4) for z in range(4)])
    codes = [
        sum((int(cell[axis]) >> bit & 1) << (3 * bit + axis) for bit in range(2) for axis in range(3)) for cell in cells
    ]
    assert morton_order(cells * 1.0).tolist() == np.argsort(codes).tolist()


@given(seeds)
def test_cross_and_dot_are_numpys(seed: int) -> None:
    a, b = np.random.default_rng(seed).normal(size=(2, 5, 3))
    np.testing.assert_allclose(cross(a, b), np.cross(a, b), rtol=1e-15)
    np.testing.assert_allclose(dot(a, b), (a * b).sum(axis=1), rtol=1e-13, atol=1e-15)


@given(seeds, st.integers(1, 40), st.integers(2, 5))
def test_rows_of_memory_change_no_digit(seed: int, count: int, width: int) -> None:
    """What goes along the axes has, to the last bit, what numpy's own functions have."""
    rng = np.random.default_rng(seed)
    weights, rows = rng.random((count, 3)), rng.normal(size=(3, count, width))
    by_einsum = np.einsum("nk,nkc->nc", weights, np.stack(list(rows), axis=1))
    assert np.array_equal(weighted(weights, *rows), by_einsum)
    for vectors in (rng.normal(size=(count, 3)), np.asfortranarray(rng.normal(size=(count, 3)))):
        assert np.array_equal(lengths(vectors), np.linalg.norm(vectors, axis=1))
        assert np.array_equal(cross(vectors, weights), np.cross(vectors, weights))


@given(st.lists(st.integers(0, 5), max_size=30))
def test_first_of_each(values: list[int]) -> None:
    ascending = np.array(sorted(values), np.int64)
    assert first_of_each(ascending).tolist() == [sorted(values).index(value) for value in sorted(set(values))]


@given(seeds, st.integers(1, 300), st.sampled_from([1, 3, 1000]))
def test_points_of_one_cell_keep_their_order(seed: int, count: int, cells: int) -> None:
    points = np.random.default_rng(seed).integers(0, cells, (count, 3)) / cells
    order = morton_order(points)
    assert sorted(order.tolist()) == list(range(count))
    groups: dict[tuple[float, ...], list[int]] = {}
    for index in order.tolist():
        groups.setdefault(tuple(points[index]), []).append(index)
    if cells < 1000:  # then a cell of the curve holds one place only
        assert all(group == sorted(group) for group in groups.values())
