# SPDX-License-Identifier: GPL-3.0-or-later
"""What is measured is what is rendered, where viewports show something else."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import pytest

from fmqm_addon.blender.scene.fingerprint import fingerprint
from fmqm_addon.blender.scene.target import take, target_of
from tests.blender import scenes


def smooth(levels: int, render_levels: int) -> bpy.types.Object:
    """A cube that has 12 triangles, 48 or 192 with its modifier at the levels 0, 1 or 2."""
    object_ = scenes.cube()
    modifier = object_.modifiers.new("Smooth", "SUBSURF")
    modifier.levels, modifier.render_levels = levels, render_levels
    return object_


def measured(object_: bpy.types.Object) -> tuple[int, tuple[str, ...]]:
    found = take(target_of(object_)).mesh
    return len(found.triangles), found.notes


def hide(object_: bpy.types.Object) -> None:
    object_.hide_viewport = True


@pytest.mark.parametrize("then", [lambda _: None, hide])
@pytest.mark.parametrize(("levels", "render_levels", "triangles"), [(0, 2, 192), (2, 0, 12), (1, 1, 48)])
def test_levels_of_renders_count(
    levels: int, render_levels: int, triangles: int, then: Callable[[bpy.types.Object], None]
) -> None:
    object_ = smooth(levels, render_levels)
    then(object_)
    blocks = [len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.scenes)]
    found, notes = measured(object_)
    assert found == triangles
    told = [note for note in notes if "no material" not in note]
    assert bool(told) == (levels != render_levels) and all("Smooth" in note for note in told)
    modifier = object_.modifiers[0]
    assert (modifier.levels, modifier.render_levels) == (levels, render_levels)
    assert [len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.scenes)] == blocks


def test_modifiers_that_only_one_of_them_has() -> None:
    object_ = smooth(1, 1)
    object_.modifiers[0].show_viewport = False
    assert measured(object_)[0] == 48
    object_.modifiers[0].show_viewport, object_.modifiers[0].show_render = True, False
    assert measured(object_)[0] == 12
    assert fingerprint(target_of(object_), True)


def test_a_change_of_what_is_rendered_makes_a_score_stale() -> None:
    object_ = smooth(1, 1)
    before = fingerprint(target_of(object_), True)
    object_.modifiers[0].show_render = False
    assert fingerprint(target_of(object_), True) != before


def test_a_simplified_scene_limits_what_it_limits_in_renders() -> None:
    object_ = smooth(2, 2)
    scene = bpy.context.scene.render
    scene.use_simplify, scene.simplify_subdivision, scene.simplify_subdivision_render = True, 0, 1
    assert measured(object_)[0] == 48
    scene.simplify_subdivision_render = 6
    assert measured(object_)[0] == 192


def test_in_edit_mode_too() -> None:
    object_ = smooth(0, 1)
    bpy.context.view_layer.objects.active = object_
    bpy.ops.object.mode_set(mode="EDIT")
    assert measured(object_)[0] == 48


@pytest.mark.parametrize("kind", ["curve", "balls"])
def test_the_resolution_of_renders_counts(kind: str) -> None:
    """Of curves, texts and metaballs: in their data, which stays the user's."""
    if kind == "curve":
        bpy.ops.curve.primitive_bezier_circle_add()
        data = bpy.context.object.data
        data.bevel_depth, data.resolution_u, data.render_resolution_u = 0.1, 2, 8
    else:
        bpy.ops.object.metaball_add()
        data = bpy.context.object.data
        data.resolution, data.render_resolution = 0.8, 0.2
    object_ = bpy.context.object
    blocks = [len(bpy.data.curves), len(bpy.data.metaballs)]
    fine, notes = measured(object_)
    assert any("its resolution" in note for note in notes)
    if kind == "curve":
        data.render_resolution_u = 0  # the viewport's
    else:
        data.render_resolution = data.resolution
    coarse, notes = measured(object_)
    assert fine > 3 * coarse and not [note for note in notes if "its resolution" in note]
    assert [len(bpy.data.curves), len(bpy.data.metaballs)] == blocks
