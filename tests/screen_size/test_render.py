# SPDX-License-Identifier: GPL-3.0-or-later
"""Views, the depth buffer, normals and smaller textures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmqm_addon.comparison.normals import corner_normals, smoothed_normals
from fmqm_addon.metric.surface import prepare_surface
from fmqm_addon.metric.texture import Material, PlainColor, Texture
from fmqm_addon.screen_size.definition import AMBIENT, BACKGROUND, HEADLIGHT, VIEW_CHOICES
from fmqm_addon.screen_size.mipmaps import Mipmaps, halved
from fmqm_addon.screen_size.rasterize import rasterize
from fmqm_addon.screen_size.render import image_side, render
from fmqm_addon.screen_size.views import camera_axes, fibonacci_directions
from tests.metric.meshes import ImageAlpha, cube, grid, mesh_arrays, sphere, surface
from tests.metric.oracles import NaiveQuery

FRONT = np.eye(3)  # right is x, up is y, the viewer stands at +z


@pytest.mark.parametrize("count", VIEW_CHOICES)
def test_views_are_spread_and_their_axes_orthonormal(count: int) -> None:
    directions = fibonacci_directions(count)
    assert np.allclose(np.linalg.norm(directions, axis=1), 1)
    assert np.linalg.norm(directions.mean(axis=0)) < 0.1
    apart = np.degrees(np.arccos(np.clip(directions @ directions.T, -1, 1)) + 9 * np.eye(count))
    assert apart.min() > 360 / np.pi / np.sqrt(count)
    for direction in (*directions, np.array([0.0, 0.0, 1.0])):
        axes = camera_axes(direction)
        assert np.allclose(axes @ axes.T, np.eye(3)) and np.allclose(axes[2], direction)
        assert np.linalg.det(axes) == pytest.approx(1)


def test_each_pixel_of_a_plane_is_covered_once_whatever_it_is_cut_into() -> None:
    """The corners lie on centers of pixels: neighbors must not both cover them, nor neither."""
    positions, triangles = grid(5, 3)
    vertices = (positions - [2.5, 1.5, 0]) * 2
    for each in range(len(triangles)):  # no pixel is covered by two
        rest = np.delete(np.arange(len(triangles)), each)
        one, others = (rasterize(vertices, triangles[rows], FRONT, 1.0, 21).pixels for rows in ([each], rest))
        assert not np.isin(one, others).any()
    seen = rasterize(vertices, triangles, FRONT, 1.0, 21)
    assert len(seen.pixels) == 10 * 6


def test_the_nearest_is_seen_at_its_place() -> None:
    """A small triangle before a large one; places are where rays hit them."""
    vertices = np.array([[-4, -4, -1], [4, -4, 1], [0, 4, 0], [-1, -1, 2], [1, -1, 2], [0, 1, 2.0]]) / 8
    seen = rasterize(vertices, np.array([[0, 1, 2], [5, 4, 3]]), FRONT, 32.0, 40)
    row, column = np.divmod(seen.pixels, 40)
    corners = vertices[np.array([[0, 1, 2], [5, 4, 3]])][seen.triangles]
    place = np.einsum("nk,nkc->nc", seen.barycentric, corners)
    assert np.allclose(place[:, 0] * 32 + 20, column + 0.5) and np.allclose(20 - place[:, 1] * 32, row + 0.5)
    assert (seen.triangles[(np.abs(place[:, 0]) < 0.01) & (np.abs(place[:, 1]) < 0.05)] == 1).all()
    assert 0 < np.count_nonzero(seen.triangles == 1) < 40


def test_a_view_from_the_edge_and_from_inside_shows_numbers_only() -> None:
    flat = surface(grid(3, 3))
    side_on = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    view = render(flat, corner_normals(flat), side_on, 64)
    assert all(np.isfinite(image).all() for image in view.images)
    far = rasterize(np.array([[-50, -50, 40], [50, -50, -40], [0, 50, 0.0]]), np.array([[0, 1, 2]]), FRONT, 8.0, 16)
    assert len(far.pixels) == 256


def test_a_sphere_is_lit_from_the_viewer_and_flat_colors_are_not() -> None:
    ball = surface(sphere(), (PlainColor((1.0, 1.0, 1.0)),))
    view = render(ball, corner_normals(ball), FRONT, 128)
    unlit, lit = view.images
    middle = image_side(128) // 2
    assert unlit[middle, middle] == pytest.approx([1, 1, 1])
    assert lit[middle, middle] == pytest.approx([AMBIENT + HEADLIGHT] * 3, abs=0.02)
    assert unlit[0, 0] == pytest.approx([BACKGROUND] * 3) and view.covered[0, 0] == 0
    inside = view.covered > 0
    assert AMBIENT <= lit[inside].min() < 0.45
    turned = replace(ball, triangles=ball.triangles[:, ::-1])  # seen from inside: two-sided
    again = render(turned, corner_normals(turned), FRONT, 128)
    assert np.allclose(again.images[1], lit, atol=1e-5)
    small, at_once = view.halved().halved(), render(ball, corner_normals(ball), FRONT, 128, 4)
    assert small.covered.shape == (36, 36) and small.images[1].mean() == pytest.approx(lit.mean(), abs=1e-5)
    assert np.abs(small.images[1] - at_once.images[1]).max() < 1e-6
    assert np.abs(small.covered - at_once.covered).max() < 1e-6


def test_what_is_less_than_half_opaque_is_not_there() -> None:
    """A square whose left third is cut out, and whose middle is nearly opaque, before one that is solid."""
    alphas = np.array([100, 200, 255], np.uint8)
    pixels = np.dstack([np.full((1, 3, 3), 255, np.uint8), alphas[None, :, None]])
    image = Texture(pixels, interpolation="closest")
    near, far = grid(3, 3), grid(3, 3)
    both = (np.concatenate([near[0] + [0, 0, 1], far[0]]), np.concatenate([near[1], far[1] + 16]))
    mesh = mesh_arrays(both)
    corners = both[0][both[1]][:, :, :2] / 3
    leaf, solid = Material("leaf", image, ImageAlpha(image)), Material("solid", PlainColor((0.0, 0.0, 0.0)))
    material = np.repeat([0, 1], 18)
    made = prepare_surface(replace(mesh, corners=corners, materials=(leaf, solid), material=material), NaiveQuery)
    view = render(made, corner_normals(made), FRONT, 128)
    row = view.images[0][image_side(128) // 2, :, 0]
    inside = row[view.covered[image_side(128) // 2] > 0]
    assert view.see_through and inside.mean() == pytest.approx(2 / 3, abs=0.02)
    assert (inside[: len(inside) // 4] == 0).all() and (inside[-len(inside) // 2 :] == 1).all()
    alone = prepare_surface(replace(mesh, corners=corners, materials=(leaf, leaf), material=material), NaiveQuery)
    cut = render(alone, corner_normals(alone), FRONT, 128)
    assert cut.covered.sum() == pytest.approx(view.covered.sum() * 2 / 3, rel=0.02)


def test_normals_are_smooth_over_blunt_edges_only() -> None:
    ball = surface(sphere())
    outward = ball.vertices[ball.triangles]
    outward = outward / np.linalg.norm(outward, axis=2, keepdims=True)
    assert (np.einsum("tkc,tkc->tk", smoothed_normals(ball), outward) > 0.99).all()
    box = surface(cube(3))
    flat = smoothed_normals(box)
    assert np.allclose(np.abs(flat).max(axis=2), 1), "edges of 90 degrees stay sharp"


def test_normals_of_some_faces_are_those_among_all() -> None:
    for shape in (sphere(), cube(3)):
        mesh, faces = surface(shape), np.array([40, 3, 17, 3])
        assert np.array_equal(corner_normals(mesh, faces=faces), corner_normals(mesh)[faces])
        own = replace(mesh, normals=np.zeros((len(mesh.triangles), 3, 3)) + [0, 0, 1])
        own.normals[3] = 0
        assert np.array_equal(corner_normals(own, faces=faces), corner_normals(own)[faces])
    assert corner_normals(mesh, faces=faces[:0]).shape == (0, 3, 3)


def test_own_normals_come_first_and_holes_in_them_are_smoothed() -> None:
    ball = surface(sphere())
    own = np.zeros((len(ball.triangles), 3, 3))
    own[: len(own) // 2] = [0, 0, 3.0]
    found = corner_normals(replace(ball, normals=own))
    assert np.allclose(found[: len(own) // 2], [0, 0, 1])
    assert np.array_equal(found[len(own) // 2 :], smoothed_normals(ball)[len(own) // 2 :])


def test_halving_keeps_light_and_plain_colors() -> None:
    random = np.random.default_rng(0)
    for shape in ((4, 6, 3), (5, 3, 4), (1, 7, 3)):
        plain = np.broadcast_to(random.integers(0, 256, (1, 1, shape[2]), np.uint8), shape)
        small = halved(plain, linear=False)
        assert small.shape == ((shape[0] + 1) // 2, (shape[1] + 1) // 2, shape[2])
        assert (small == plain[0, 0]).all()
    checker = np.zeros((2, 2, 3), np.uint8)
    checker[[0, 1], [0, 1]] = 255
    assert (halved(checker, linear=False) == 188).all(), "half of the light"
    assert halved(np.arange(4, dtype=np.float32).reshape(2, 2, 1), linear=True).item() == 1.5
    every = np.arange(256, dtype=np.uint8).reshape(16, 16, 1)
    assert (halved(np.repeat(np.repeat(every, 2, 0), 2, 1), linear=False) == every).all()


def test_the_level_is_that_of_the_surface_s_own_density() -> None:
    """A square of side 1 / sqrt(2) diagonals with an image of 512 pixels: 724 pixels a diagonal."""
    pixels = np.random.default_rng(0).integers(0, 256, (512, 512, 3), np.uint8)
    plane = surface(grid(4, 4), (Texture(pixels),))
    for size, side in ((1024, 512), (724, 512), (400, 256), (181, 128), (1, 1)):
        texture = Mipmaps().for_scale(plane, size).materials[0].color
        assert isinstance(texture, Texture) and texture.pixels.shape[0] == side
    leaf = replace(plane.materials[0], alpha=ImageAlpha(plane.materials[0].color))
    smaller = Mipmaps().for_scale(replace(plane, materials=(leaf,)), 181).materials[0]
    assert smaller.alpha.image.pixels is smaller.color.pixels, "what is cut out is seen at the same level"
