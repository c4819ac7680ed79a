# SPDX-License-Identifier: GPL-3.0-or-later
"""Colors at a grid of places: the surface's own there, enough of them, and found again as a graphics card does it."""

from __future__ import annotations

import numpy as np
import pytest

from fmqm_addon.comparison.normals import corner_normals
from fmqm_addon.metric.stepper import finish
from fmqm_addon.metric.surface import Surface
from fmqm_addon.report.visual.mesh_colors import MeshColors, sampling_colors
from tests.metric.meshes import grid, sphere, surface, texture


def look_up(found: MeshColors, triangle: int, weights: np.ndarray) -> np.ndarray:
    """(3,) in [0, 255]: what lies at a place, as blender/display/sampled_mesh.py looks it up."""
    cells = int(found.cells[triangle])

    def at(i: int, j: int) -> np.ndarray:
        return found.colors[found.first[triangle] + j * (cells + 1) - j * (j - 1) // 2 + i].astype(float)

    x, y = weights[1] * cells, weights[2] * cells
    i = min(int(x), cells - 1)
    j = min(int(y), cells - 1 - i)
    x, y = x - i, y - j
    if x + y <= 1 or i + j + 1 >= cells:
        return at(i, j) * (1 - x - y) + at(i + 1, j) * x + at(i, j + 1) * y
    return at(i + 1, j + 1) * (x + y - 1) + at(i, j + 1) * (1 - x) + at(i + 1, j) * (1 - y)


@pytest.fixture(scope="module")
def ball() -> Surface:
    return surface(sphere(), (texture(),))


def test_between_the_places_colors_are_as_near_as_the_grid_is_fine(ball: Surface) -> None:
    random = np.random.default_rng(0)
    weights, triangles = random.dirichlet(np.ones(3), 300), random.integers(0, len(ball.triangles), 300)
    truth = ball.color_at(triangles, weights) * 255
    errors = []
    for places in (1000, 20_000, 200_000):
        found = finish(sampling_colors(ball, places))
        assert places / 2 < len(found.colors) <= places
        shown = [look_up(found, *each) for each in zip(triangles.tolist(), weights, strict=True)]
        errors.append(np.abs(np.array(shown) - truth).mean())
    assert errors[0] > 4 * errors[1] and errors[2] < 1


def test_places_are_where_they_are_said_to_be(ball: Surface) -> None:
    found = finish(sampling_colors(ball, 4000))
    cells = int(found.cells[5])
    for i, j in ((0, 0), (cells, 0), (0, cells), (1, 2)):
        weights = np.array([[cells - i - j, i, j]]) / cells
        assert look_up(found, 5, weights[0]) == pytest.approx(ball.color_at(np.array([5]), weights)[0] * 255, abs=0.51)
    assert found.normals.reshape(-1, 3, 3) == pytest.approx(corner_normals(ball), abs=1e-6)
    assert found.positions.reshape(-1, 3, 3) == pytest.approx(ball.vertices[ball.triangles], abs=1e-6)


def test_every_triangle_has_its_corners_however_few_places_there_are() -> None:
    flat = surface(grid(20, 20), (texture(),))
    found = finish(sampling_colors(flat, 10))
    assert (found.cells == 1).all() and len(found.colors) == 3 * len(flat.triangles)
