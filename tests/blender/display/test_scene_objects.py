# SPDX-License-Identifier: GPL-3.0-or-later
"""What is put into the scene: points, surfaces, and that nothing of it stays or piles up."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.display import scene_objects
from fmqm_addon.metric.colorspace import decode_srgb
from tests.blender import scenes

POSITIONS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]])
UP = np.array([[0.0, 0, 1]] * 3)
MOVED = np.array([[2.0, 0, 0, 5], [0, 2, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]])


def cloud(size: float = 0.1) -> bpy.types.Object:
    return scene_objects.build_cloud(bpy.context.scene, scene_objects.CLOUD, "FMQM Cloud", POSITIONS, UP, MOVED, size)


def vertices(object_: bpy.types.Object) -> np.ndarray:
    values = np.empty(3 * len(object_.data.vertices), np.float32)
    object_.data.vertices.foreach_get("co", values)
    return values.reshape(-1, 3)


def colors(object_: bpy.types.Object) -> np.ndarray:
    values = np.empty(4 * len(object_.data.vertices), np.float32)
    object_.data.attributes[scene_objects.COLOR].data.foreach_get("color", values)
    return values.reshape(-1, 4)


def test_points_are_closed_and_face_outwards() -> None:
    made = cloud()
    mesh = made.data
    assert (len(mesh.vertices), len(mesh.polygons), len(mesh.edges)) == (12, 12, 18)
    assert not mesh.validate()
    corners = vertices(made).reshape(-1, 4, 3)
    assert corners.mean(axis=1) == pytest.approx(POSITIONS, abs=1e-6)
    assert np.linalg.norm(corners - POSITIONS[:, None], axis=2) == pytest.approx(0.1)
    for face in mesh.polygons:
        middle = POSITIONS[face.index // 4]
        a, b, c = (np.array(mesh.vertices[v].co) for v in face.vertices)
        assert np.cross(b - a, c - a) @ (np.array(face.center) - middle) > 0
    assert np.array(mesh.corner_normals[0].vector) == pytest.approx([0, 0, 1], abs=1e-3)  # as the surface's
    bpy.context.view_layer.update()
    assert np.array(made.matrix_world) == pytest.approx(MOVED)


def test_colors_are_linear_and_one_a_point() -> None:
    made = cloud()
    wanted = np.array([[1.0, 0.5, 0], [0, 0, 0], [0.2, 0.4, 0.8]])
    scene_objects.recolor(made, wanted)
    assert colors(made)[:, :3] == pytest.approx(np.repeat(decode_srgb(wanted), 4, axis=0), abs=1e-6)
    assert colors(made)[0, 1] == pytest.approx(0.2140, abs=1e-4)
    assert (colors(made)[:, 3] == 1).all()
    with pytest.raises(ValueError, match="5 colors do not fit the 12 vertices"):
        scene_objects.recolor(made, np.zeros((5, 3)))


def test_a_second_one_replaces_the_first() -> None:
    first = cloud()
    before = scenes.blocks()
    assert cloud(0.5) == first and scenes.blocks() == before
    first.name = "My Own Name"  # tags, not names, say what is ours
    cloud()
    assert len(scenes.blocks()) == len(before)


def test_clear_takes_only_what_is_ours() -> None:
    mine = scenes.cube("FMQM Cloud", materials=[scenes.material("FMQM Color")])
    bpy.data.collections.new("FMQM").use_fake_user = True
    before = scenes.blocks()
    assert not scene_objects.anything()
    made = cloud()
    assert made != mine and scene_objects.anything()
    bpy.context.scene.collection.objects.link(made.copy())  # Shift D
    triangles = np.array([[0, 1, 2]])
    scene_objects.build_surface(bpy.context.scene, scene_objects.PAINTED, "FMQM Painted", POSITIONS, triangles, MOVED)
    assert scene_objects.clear() > 0
    assert scenes.blocks() == before
    assert not scene_objects.anything()
