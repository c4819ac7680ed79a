# SPDX-License-Identifier: GPL-3.0-or-later
"""Signs that come from a neighbor instead of a ray, against a ray for each sample and against winding numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.metric.fields import Fields, evaluate_fields
from fmqm_addon.metric.geometry import Floats, Ints, morton_order
from fmqm_addon.metric.signs import followers
from fmqm_addon.metric.stepper import finish
from fmqm_addon.metric.surface import Surface, is_closed

from .meshes import TETRAHEDRON, cube, grid, icosahedron, sphere, surface
from .oracles import NaiveQuery, winding_number


class EveryRay(NaiveQuery):
    """Each sample has a ray of its own."""

    every_ray = True


class Counting(NaiveQuery):
    """Counts the rays that begin at samples."""

    def __init__(self, vertices: Floats, triangles: Ints) -> None:
        super().__init__(vertices, triangles)
        self.rays = 0

    def first_hit(self, origins: Floats, directions: Floats) -> tuple[Ints, Floats]:
        self.rays += len(origins)
        return super().first_hit(origins, directions)


def fields_at(shape: Surface, points: Floats) -> Fields:
    return finish(evaluate_fields(shape, points, morton_order(points)))


def samples(shape: Surface, count: int, seed: int, spread: float = 0.02) -> Floats:
    rng = np.random.default_rng(seed)
    corners = shape.vertices[shape.triangles[rng.integers(0, len(shape.triangles), count)]]
    return np.einsum("nk,nkc->nc", rng.dirichlet([1, 1, 1], count), corners) + rng.normal(0, spread, (count, 3))


def nested(shells: int) -> tuple[Floats, Ints]:
    positions, triangles = cube(2)
    parts = [((positions - 0.5) * (1 + 0.05 * k), triangles + len(positions) * k) for k in range(shells)]
    return np.concatenate([p for p, _ in parts]), np.concatenate([t for _, t in parts])


def four_at_an_edge() -> tuple[Floats, Ints]:
    """Two tetrahedra that share an edge and nothing else: four faces meet there."""
    positions = np.array([[0, 0, 0], [0, 0, 1], [1, 0.2, 0.5], [1, -0.2, 0.5], [-1, 0.3, 0.5], [-1, -0.2, 0.4]])
    one = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    return positions, np.concatenate([one, np.where(one > 1, one + 2, one)])


CLOSED = {
    "tetrahedron": TETRAHEDRON,
    "cube": cube(3),
    "icosahedron": icosahedron(),
    "sphere": sphere(),
    "shells": nested(4),
    "four faces at an edge": four_at_an_edge(),
}


@pytest.mark.parametrize("name", sorted(CLOSED))
@pytest.mark.parametrize("displaced", [0.0, 0.15])
def test_signs_are_those_of_every_ray(name: str, displaced: float) -> None:
    """Displaced, the meshes also cut themselves."""
    positions, triangles = CLOSED[name]
    positions = positions + np.random.default_rng(1).normal(0, displaced, positions.shape)
    shape = surface((positions, triangles))
    points = samples(shape, 1500, 2)
    every = fields_at(replace(shape, query=EveryRay(shape.vertices, shape.triangles)), points)
    counting = Counting(shape.vertices, shape.triangles)
    fewer = fields_at(replace(shape, query=counting), points)
    for attribute in ("sdf", "nearest", "triangle", "ncf"):
        assert np.array_equal(getattr(every, attribute), getattr(fewer, attribute))
    for n in range(0, len(points), 50):
        assert (fewer.sdf[n] < 0) == (round(winding_number(points[n], shape.vertices, shape.triangles)) % 2 == 1)


def test_most_samples_need_no_ray() -> None:
    shape = surface(sphere())
    points = samples(shape, 4000, 3, spread=0.05)
    found = fields_at(shape, points)
    order = morton_order(points)
    leader = finish(followers(points[order], np.abs(found.sdf[order])))
    assert np.count_nonzero(leader == np.arange(len(leader))) < 0.5 * len(leader)
    assert np.array_equal(found.sdf[order] < 0, found.sdf[order][leader] < 0)


def test_samples_on_the_surface_lead_and_follow_nobody() -> None:
    """Nor do samples so near to it that float32 may have taken them to the other side."""
    points = np.zeros((20, 3))
    points[:, 0] = np.arange(20) * 1e-9
    assert finish(followers(points, np.full(20, 1e-7))).tolist() == list(range(20))
    assert finish(followers(points, np.full(20, 1e-3))).tolist() == [0] * 20  # at one place, almost


@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_an_edge_with_an_odd_number_of_faces_opens_a_mesh(seed: int, dropped: int) -> None:
    rng = np.random.default_rng(seed)
    _, triangles = CLOSED[sorted(CLOSED)[seed % len(CLOSED)]]
    assert is_closed(triangles[rng.permutation(len(triangles))])
    if dropped < len(triangles):
        assert not is_closed(np.delete(triangles, rng.choice(len(triangles), dropped, replace=False), axis=0))


def test_a_closed_part_of_an_open_mesh_does_not_count() -> None:
    """A ray of each sample, although the tetrahedron alone would need fewer."""
    positions, triangles = grid(2, 2)
    both = np.concatenate([positions, TETRAHEDRON[0] + 3]), np.concatenate([triangles, TETRAHEDRON[1] + len(positions)])
    shape = surface(both)
    counting = Counting(shape.vertices, shape.triangles)
    points = samples(shape, 300, 4)
    fields_at(replace(shape, query=counting), points)
    assert counting.rays >= 300
