# SPDX-License-Identifier: GPL-3.0-or-later
"""BVHQuery against plain numpy over all triangles."""

from __future__ import annotations

import numpy as np
import pytest

from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.metric.geometry import closest_on_triangles
from fmqm_addon.metric.queries import count_crossings
from fmqm_addon.metric.surface import MeshArrays, prepare_surface
from tests.blender import scenes

N = 200
FLOAT32 = 1e-6  # what a tree of float32 in a box of diagonal 1 can tell apart


@pytest.fixture(params=[1, 40], ids=["one triangle", "soup"])
def soup(request: pytest.FixtureRequest) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles at random in a box of diagonal 1."""
    rng = np.random.default_rng(request.param)
    return (rng.random((3 * request.param, 3)) - 0.5) / np.sqrt(3), rng.permutation(3 * request.param).reshape(-1, 3)


def points_near(rng: np.random.Generator) -> np.ndarray:
    return (rng.random((N, 3)) - 0.5) * 1.5


def distances(vertices: np.ndarray, triangles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(points, triangles) exact distances."""
    a, b, c = (np.tile(vertices[triangles[:, k]], (len(points), 1)) for k in range(3))
    repeated = np.repeat(points, len(triangles), axis=0)
    nearest, _ = closest_on_triangles(repeated, a, b, c)
    return np.linalg.norm(repeated - nearest, axis=1).reshape(len(points), -1)


@pytest.mark.parametrize("factor", [None, 1.0001, 1.0, 0.5, 0.0], ids=str)
def test_nearest_is_the_least_of_all_distances(soup: tuple[np.ndarray, np.ndarray], factor: float | None) -> None:
    """Also under bounds that rounding, or a mistake, made too small: bounds speed up, they never decide."""
    points = points_near(np.random.default_rng(3))
    every = distances(*soup, points)
    bounds = None if factor is None else every.min(axis=1) * factor
    found = BVHQuery(*soup).nearest(points, bounds)
    assert found.dtype == np.int64 and found.shape == (N,)
    assert every[np.arange(N), found] == pytest.approx(every.min(axis=1), abs=FLOAT32)


def hits(vertices: np.ndarray, triangles: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(triangles,) distance to where the ray meets each, inf where it does not (Moeller and Trumbore)."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    p = np.cross(direction, c - a)
    determinant = ((b - a) * p).sum(axis=1)
    u = ((origin - a) * p).sum(axis=1) / determinant
    q = np.cross(origin - a, b - a)
    v = (q @ direction) / determinant
    distance = ((c - a) * q).sum(axis=1) / determinant
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0), distance, np.inf)


def rays(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    direction = rng.normal(size=(N, 3))
    return points_near(rng), direction / np.linalg.norm(direction, axis=1, keepdims=True)


def test_first_hit_is_the_nearest_crossing(soup: tuple[np.ndarray, np.ndarray]) -> None:
    origins, directions = rays(np.random.default_rng(4))
    triangle, distance = BVHQuery(*soup).first_hit(origins, directions)
    every = np.array([hits(*soup, o, d) for o, d in zip(origins, directions, strict=True)])
    nearest = every.min(axis=1)
    assert ((triangle >= 0) == np.isfinite(nearest)).all() and (triangle >= 0).any() and (triangle < 0).any()
    assert (distance[triangle < 0] == np.inf).all()
    hit = triangle >= 0
    assert distance[hit] == pytest.approx(nearest[hit], abs=FLOAT32)
    assert every[hit, triangle[hit]] == pytest.approx(nearest[hit], abs=FLOAT32)


def test_crossings_are_all_counted(soup: tuple[np.ndarray, np.ndarray]) -> None:
    vertices, triangles = soup
    flat = np.zeros((len(triangles), 3, 2))
    surface = prepare_surface(
        MeshArrays("soup", vertices, triangles, flat, np.zeros(len(triangles), np.int64), ()), BVHQuery
    )
    origins, directions = rays(np.random.default_rng(5))
    wanted = [
        np.isfinite(hits(surface.vertices, surface.triangles, o, d)).sum()
        for o, d in zip(origins, directions, strict=True)
    ]
    assert count_crossings(surface, origins, directions).tolist() == wanted


def test_nothing_stays_in_the_session(soup: tuple[np.ndarray, np.ndarray]) -> None:
    before = scenes.blocks()
    query = BVHQuery(*soup)
    assert scenes.blocks() == before
    scenes.clear()  # the tree outlives the session that it was built in
    assert query.nearest(soup[0][:1], None).shape == (1,)
