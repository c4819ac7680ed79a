# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring leaves the user's scene as it is: selection, modes, frame, engine, unsaved painting, the file's state."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.measure import measuring
from fmqm_addon.blender.scene.target import target_of
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.settings import Settings
from tests.blender import scenes


def state() -> dict[str, object]:
    """All that a user could notice."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    return {
        "scene": (scene.name, layer.name, bpy.context.workspace and bpy.context.workspace.name),
        "active": (layer.objects.active.name, bpy.context.mode, [each.mode for each in bpy.data.objects]),
        "selection": [each.name for each in bpy.context.selected_objects],
        "selected vertices": [[vertex.select for vertex in mesh.vertices] for mesh in bpy.data.meshes],
        "hidden": [(each.hide_viewport, each.hide_render, each.hide_get()) for each in scene.objects],
        "places": [np.array(each.matrix_world).tolist() for each in scene.objects],
        "users": [(block.name, block.users) for name in ("meshes", "materials", "images", "node_groups", "collections")
                  for block in getattr(bpy.data, name)],
        "layers": [(mesh.uv_layers.active.name, [each.name for each in mesh.attributes]) for mesh in bpy.data.meshes],
        "nodes": [[node.name for node in each.node_tree.nodes] for each in bpy.data.materials if each.node_tree],
        "active nodes": [getattr(each.node_tree.nodes.active, "name", "") for each in bpy.data.materials],
        "frame": (scene.frame_current, scene.frame_subframe),
        "engine": (scene.render.engine, scene.render.bake.margin, scene.render.bake.use_clear),
        "images": [(each.name, each.is_dirty, list(each.pixels)) for each in bpy.data.images],
        "blocks": scenes.blocks(),
        "undo": bpy.ops.ed.undo.poll(),
        "unsaved": bpy.data.is_dirty,
    }  # fmt: skip


@pytest.mark.parametrize("painting", [False, True], ids=["saved", "painting"])
@pytest.mark.parametrize("mode", ["OBJECT", "EDIT", "SCULPT", "VERTEX_PAINT", "WEIGHT_PAINT", "TEXTURE_PAINT"])
def test_nothing_of_the_scene_changes(mode: str, painting: bool, tmp_path: Path) -> None:
    """With an image, painted and not saved or as its file, a material to bake, a hidden object, and an instance."""
    painted = scenes.textured(scenes.write_png(tmp_path / "a.png", scenes.noise()), "Painted")
    rust = scenes.material("Rust")
    veins = rust.node_tree.nodes.new("ShaderNodeTexNoise")
    rust.node_tree.links.new(veins.outputs[1], scenes.base_color(rust))
    crate = scenes.cube("Crate", materials=[painted, rust])
    crate.data.polygons[0].material_index = 1
    crate.modifiers.new("Subdivision", "SUBSURF")
    hidden = scenes.cube("Hidden", materials=[rust])
    hidden.hide_viewport = True
    shelf = bpy.data.objects.new("Shelf", None)
    bpy.context.scene.collection.objects.link(shelf)
    library = bpy.data.collections.new("Library")
    scenes.cube("Book", collection=library, materials=[painted])
    shelf.instance_type, shelf.instance_collection = "COLLECTION", library
    scenes.square("Other").select_set(True)
    bpy.context.scene.frame_set(7)
    bpy.context.view_layer.objects.active = crate
    crate.select_set(True)
    if mode != "OBJECT":
        bpy.ops.object.mode_set(mode=mode)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    image = bpy.data.images["a.png"]
    if painting:
        image.pixels = [0.25] * (4 * image.size[0] * image.size[1])
    bpy.context.view_layer.update()
    before = state()
    assert image.is_dirty == painting
    compared = [target_of(hidden), target_of(shelf), target_of(crate, bare=True)]
    few = Settings(samples=400, patches=4)
    outcomes = measuring(target_of(crate), compared, PairOptions(settings=few), Reading(bake=32)).run()
    assert all(outcome.error is None for outcome in outcomes)
    # What the baker of 4.5 would lose, it must not be given.
    baked = not painting or bpy.app.version >= (5, 2)
    hows = {look.name: look.how for look in outcomes[0].pair_result.reference.materials}
    assert hows == {"Painted": "read", "Rust": "baked" if baked else "plain"}
    lost = "image a.png has unsaved changes, which baking would lose; save or pack it first; its plain color is taken"
    assert any(lost in warning for outcome in outcomes for warning in outcome.warnings) != baked
    after = state()
    assert {name: after[name] for name in before if after[name] != before[name]} == {}
