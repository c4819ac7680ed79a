# SPDX-License-Identifier: GPL-3.0-or-later
"""Where triangles lie on baked images: apart from one another, whatever their number and sizes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmqm_addon.blender.baking import atlas
from fmqm_addon.blender.baking.atlas import Layout, new_layout, own_layout
from fmqm_addon.metric.errors import MeshError
from fmqm_addon.metric.texture import Texture

QUAD = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)


def inside(triangle: np.ndarray, side: int) -> np.ndarray:
    """(side, side) bool: the naive answer to which pixel centers a triangle (3, 2) holds, its edges included."""
    center = (np.arange(side) + 0.5) / side
    point = np.stack(np.meshgrid(center, center), axis=2)
    turns = []
    for k in range(3):
        a, b = triangle[k], triangle[(k + 1) % 3]
        turns.append((b[0] - a[0]) * (point[..., 1] - a[1]) - (b[1] - a[1]) * (point[..., 0] - a[0]))
    turns = np.array(turns)
    return (turns >= 0).all(axis=0) | (turns <= 0).all(axis=0)


@st.composite
def faces(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Loose quads and triangles of sizes from 1e-3 to 1: vertices, triangles, places, quads as new_layout wants."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    quads, others = draw(st.integers(0, 12)), draw(st.integers(0, 25))
    size = 10.0 ** rng.uniform(-3, 0, quads + others)
    vertices, triangles, place, quad = [], [], [], []
    for polygon, each in enumerate(size):
        corners = [(0, 1, 2), (0, 2, 3)] if rng.random() < 0.5 else [(0, 1, 3), (1, 2, 3)]
        for corner in corners if polygon < quads else [(0, 1, 2)]:
            triangles.append(np.array(corner) + 4 * polygon)
            place.append(corner)
            quad.append(polygon if polygon < quads else -1)
        vertices.append(np.column_stack([QUAD * each * rng.uniform(0.1, 1, 2), np.zeros(4)]))
    shape = (-1, 3)
    return (
        np.concatenate(vertices or [np.zeros((0, 3))]),
        np.array(triangles, int).reshape(shape),
        np.array(place, int).reshape(shape),
        np.array(quad, int),
    )


def drawn(made: Layout, colors: np.ndarray) -> np.ndarray:
    """(side, side, 3) what a baker makes of triangles that have one color each; two at one pixel: a failure."""
    pixels = np.zeros((made.side, made.side, 3), np.float32)
    owner = np.full((made.side, made.side), -1)
    for index, triangle in enumerate(made.drawn.astype(float)):
        here = inside(triangle, made.side)
        assert here.any()
        assert (colors[owner[here & (owner >= 0)]] == colors[index]).all(), "pixel of two faces"
        owner[here], pixels[here] = index, colors[index]
    return pixels


@settings(max_examples=40)
@given(faces(), st.sampled_from([1, 8, 16, 60, 128]))
def test_no_lookup_reads_another_face(made: tuple[np.ndarray, ...], size: int) -> None:
    vertices, triangles, place, quad = made
    rng = np.random.default_rng(0)
    polygon = np.where(quad >= 0, quad, np.arange(len(quad)) + 100)
    colors = rng.random((200, 3)).astype(np.float32)[polygon]
    found = new_layout(vertices, triangles, place, quad, size)
    assert found.side >= size and found.side & (found.side - 1) == 0
    pixels = drawn(found, colors)
    found.fill(pixels)
    texture = Texture(pixels[::-1], extension="extend")
    places = np.concatenate([np.eye(3), rng.dirichlet((0.4, 0.4, 0.4), 40)])
    for index, corners in enumerate(found.corners):
        seen = texture.lookup(places @ corners.astype(float))
        assert np.abs(seen - colors[index]).max() < 1e-4


def test_large_faces_get_large_squares() -> None:
    small = QUAD * 0.1
    vertices = np.concatenate([np.column_stack([q, np.zeros(4)]) for q in (QUAD, small, small, small)])
    triangles = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * k for k in range(4)])
    found = new_layout(vertices, triangles, triangles % 4, np.repeat(np.arange(4), 2), 64)
    width = np.ptp(found.corners[:, :, 0], axis=1) * found.side
    assert width[:2] == pytest.approx(31) and (width[2:] <= 31).all()


def test_linear_colors_come_back_everywhere() -> None:
    """One triangle whose color is its barycentric coordinates, drawn at pixel centers."""
    one = np.array([(0, 1, 2)])
    found = new_layout(np.eye(3), one, one, np.array([-1]), 16)
    center = (np.arange(16) + 0.5) / 16
    point = np.stack([*np.meshgrid(center, center), np.ones((16, 16))], axis=2)
    corners = np.column_stack([found.drawn[0].astype(float), np.ones(3)])
    pixels = np.where(inside(found.drawn[0].astype(float), 16)[..., None], point @ np.linalg.inv(corners), 0)
    found.fill(pixels)
    places = np.random.default_rng(0).dirichlet((0.5, 0.5, 0.5), 500)
    seen = Texture(pixels[::-1].astype(np.float32), extension="extend").lookup(places @ found.corners[0].astype(float))
    assert seen == pytest.approx(places, abs=0.002)


def test_image_grows_with_the_faces_and_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    count = 5000
    triangles = np.arange(3 * count).reshape(-1, 3)
    vertices = np.random.default_rng(0).random((3 * count, 3))
    alone = np.full(count, -1)
    assert new_layout(vertices, triangles, triangles % 3, alone, 64).side == 256  # 2500 pairs of 4 x 4 pixels
    monkeypatch.setattr(atlas, "LARGEST", 128)
    tight = new_layout(vertices, triangles, triangles % 3, alone, 64)
    assert tight.side == 128 and len(np.unique(tight.corners[:, 0], axis=0)) == count
    monkeypatch.setattr(atlas, "LARGEST", 64)
    with pytest.raises(MeshError, match="2500 faces"):
        new_layout(vertices, triangles, triangles % 3, alone, 64)


@pytest.mark.parametrize(
    "vertices", [np.zeros((3, 3)), np.eye(3) * 1e38, np.eye(3) * 1e-200], ids=["point", "far", "tiny"]
)
def test_odd_sizes(vertices: np.ndarray) -> None:
    one = np.array([(0, 1, 2)])
    found = new_layout(vertices, one, one, np.array([-1]), 16)
    assert found.side == 16 and ((found.corners >= 0) & (found.corners <= 1)).all()


def grid_map(count: int, low: float = 0.0, high: float = 1.0) -> np.ndarray:
    """(2 count^2, 3, 2) float32: a grid of triangles that fills a square."""
    line = np.linspace(low, high, count + 1)
    corner = np.stack(np.meshgrid(line, line), axis=2)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    pairs = np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)])
    return pairs.reshape(-1, 3, 2).astype(np.float32)


@pytest.mark.parametrize(("count", "high"), [(1, 1.0), (3, 1.0), (8, 1.000001), (50, 0.6)])
def test_own_map_that_serves(count: int, high: float) -> None:
    uv = grid_map(count, 0.0, high)
    found = own_layout(uv, np.ones(len(uv)), 128)
    assert found is not None and found.own and np.array_equal(found.corners, uv)


def overlapping() -> np.ndarray:
    uv = grid_map(4)
    uv[3] = uv[20]
    return uv


@pytest.mark.parametrize(
    ("uv", "areas"),
    [
        (overlapping(), np.ones(32)),
        (grid_map(4, 0, 1.1), np.ones(32)),
        (grid_map(4, -0.1, 1), np.ones(32)),
        (grid_map(4, 0, 0.2), np.ones(32)),
        (np.zeros((32, 3, 2), np.float32), np.ones(32)),
        (np.full((32, 3, 2), np.nan, np.float32), np.ones(32)),
        (grid_map(4), np.where(np.arange(32) == 5, 1e3, 1.0)),
    ],
    ids=["overlap", "above 1", "below 0", "tiny", "point", "nan", "large face in a small place"],
)
def test_own_map_that_does_not(uv: np.ndarray, areas: np.ndarray) -> None:
    assert own_layout(uv, areas, 128) is None


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_covered_pixels_are_counted(seed: int, count: int) -> None:
    """Random triangles have no pixel center on an edge: the naive count is exact."""
    uv = np.random.default_rng(seed).random((count, 3, 2)).astype(np.float32)
    naive = sum(inside(triangle.astype(float), 32).astype(int) for triangle in uv)
    assert np.array_equal(atlas._covered(uv, 32)[:, :32], naive)
