# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer of screen sizes against rays through Blender's tree, and the normals that it gets from Blender."""

from __future__ import annotations

from pathlib import Path

import bmesh
import bpy
import numpy as np
import pytest

from fmqm_addon import api
from fmqm_addon.blender.files.load import load_asset
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays
from fmqm_addon.comparison.candidates import moved
from fmqm_addon.comparison.normals import corner_normals
from fmqm_addon.metric.errors import SettingsError
from fmqm_addon.metric.geometry import closest_on_triangles
from fmqm_addon.metric.surface import prepare_surface
from fmqm_addon.screen_size.definition import SMOOTH_ANGLE
from fmqm_addon.screen_size.mipmaps import Mipmaps
from fmqm_addon.screen_size.rasterize import rasterize
from fmqm_addon.screen_size.render import image_side
from fmqm_addon.screen_size.views import camera_axes, fibonacci_directions
from tests.blender import scenes

SIZE = 160


@pytest.mark.parametrize("model", ["spot/spot.obj", "egyptian_cat/egyptian_cat.obj", "low_poly_tree/low_poly_tree.obj"])
def test_pixels_show_what_rays_hit(shared_data: Path, model: str) -> None:
    """Silhouettes within a pixel; within them 99 % of the pixels have the ray's color within 2/255."""
    surface = prepare_surface(load_asset(str(shared_data / "objpng" / model)).world(), BVHQuery)
    surface = Mipmaps().for_scale(surface, SIZE)
    side = image_side(SIZE)
    row, column = np.divmod(np.arange(side * side), side)
    for direction in fibonacci_directions(6)[:3]:
        axes = camera_axes(direction)
        seen = rasterize(surface.vertices, surface.triangles, axes, SIZE, side)
        x, y = (column + 0.5 - side / 2) / SIZE, (side / 2 - row - 0.5) / SIZE
        origins = x[:, None] * axes[0] + y[:, None] * axes[1] + 2 * axes[2]
        hit, far = surface.query.first_hit(origins, np.broadcast_to(-axes[2], origins.shape))
        here = np.zeros(side * side, bool)
        here[seen.pixels] = True
        assert not (edge_of(here, side) < (here ^ (hit >= 0))).any(), "they differ on the silhouette only"
        both = np.flatnonzero(here & (hit >= 0))
        place = origins[both] - far[both, None] * axes[2]
        corners = (surface.vertices[surface.triangles[hit[both], k]] for k in range(3))
        _, barycentric = closest_on_triangles(place, *corners)
        rays = surface.color_at(hit[both], barycentric)
        row_of = np.searchsorted(seen.pixels, both)
        ours = surface.color_at(seen.triangles[row_of], seen.barycentric[row_of])
        assert np.mean(np.abs(rays - ours).max(axis=1) <= 2 / 255) >= 0.99


def edge_of(mask: np.ndarray, side: int) -> np.ndarray:
    """Pixels with one beside them that is not as they are."""
    square = np.pad(mask.reshape(side, side), 1)
    shifted = [square[1 + i : side + 1 + i, 1 + j : side + 1 + j] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    return (np.any(shifted, axis=0) & ~np.all(shifted, axis=0)).ravel()


WITH_NORMALS = Reading(normals=True)


def test_normals_are_read_where_they_are_asked_for_and_the_mesh_has_some() -> None:
    cube = scenes.cube()
    assert mesh_arrays([cube], "cube").normals is None
    assert mesh_arrays([cube], "cube", WITH_NORMALS).normals is None, "flat all over"
    cube.data.shade_smooth()
    found = mesh_arrays([cube], "cube", WITH_NORMALS)
    corners = found.positions[found.triangles]
    assert np.allclose(found.normals, corners / np.linalg.norm(corners, axis=2, keepdims=True), atol=1e-4)
    assert mesh_arrays([cube], "cube").normals is None
    cube.data.normals_split_custom_set([(0.0, 0.0, 1.0)] * len(cube.data.loops))
    assert np.allclose(mesh_arrays([cube], "cube", WITH_NORMALS).normals, [0, 0, 1], atol=1e-3)


def test_normals_turn_with_their_mesh_and_flat_parts_have_none() -> None:
    smooth, flat = scenes.cube("smooth"), scenes.cube("flat")
    smooth.data.shade_smooth()
    smooth.scale, smooth.rotation_euler = (1, 2, 4), (0.3, 0.2, 1.0)
    bpy.context.view_layer.update()
    found = mesh_arrays([smooth, flat], "both", WITH_NORMALS)
    assert (np.linalg.norm(found.normals, axis=2) > 0).sum() == 36
    matrix = np.array(smooth.matrix_world)
    own = mesh_arrays([smooth], "smooth", WITH_NORMALS, matrix)
    wanted = own.normals @ np.linalg.inv(matrix[:3, :3])
    got = found.normals[:12] if found.normals[:12].any() else found.normals[12:]
    assert np.allclose(got / np.linalg.norm(got, axis=2, keepdims=True), unit(wanted), atol=1e-5)
    assert np.allclose(unit(moved(own, matrix).normals), unit(wanted), atol=1e-5)


def test_a_mesh_without_normals_looks_as_blender_shades_it_smooth_by_the_same_angle() -> None:
    """Or a LOD that was saved smooth would differ from an original that was saved without normals, though it be it."""
    monkey = scenes.monkey()
    monkey.matrix_world.identity()  # angles are the mesh's own, unstretched
    shape = bmesh.new()
    shape.from_mesh(monkey.data)
    bmesh.ops.triangulate(shape, faces=shape.faces)
    shape.to_mesh(monkey.data)
    shape.free()
    plain = mesh_arrays([monkey], "monkey", WITH_NORMALS)
    monkey.data.shade_smooth()
    monkey.data.set_sharp_from_angle(angle=np.radians(SMOOTH_ANGLE))
    shaded = mesh_arrays([monkey], "monkey", WITH_NORMALS)
    ours, blenders = (corner_normals(prepare_surface(each, BVHQuery), SMOOTH_ANGLE) for each in (plain, shaded))
    assert plain.normals is None and shaded.normals is not None
    assert np.abs(ours - blenders).max() < 1e-3


def unit(normals: np.ndarray) -> np.ndarray:
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


def test_objects_of_the_scene_have_sizes_too() -> None:
    """By the Python API: a copy, one that is decimated, one without faces."""
    original, copy, coarse, empty = (scenes.monkey(name) for name in ("original", "copy", "coarse", "empty"))
    coarse.modifiers.new("Decimate", "DECIMATE").ratio = 0.1
    empty.data.clear_geometry()
    before = scenes.blocks()
    found = api.screen_sizes(original, [copy, coarse, empty])
    assert scenes.blocks() == before
    same, worse, none = found.lods
    assert same.size is not None and same.size.strict.bound == "at least"
    assert worse.size is not None and worse.size.strict.pixels < 128 and worse.triangles < same.triangles
    assert none.size is None and "no faces" in str(none.error)
    assert found.extent.diagonal > found.extent.side > found.extent.radius
    with pytest.raises(SettingsError):
        api.screen_sizes(original, copy, views=5)
