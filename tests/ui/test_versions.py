# SPDX-License-Identifier: GPL-3.0-or-later
"""LOD Chain and Decimate to Quality: what they make, the rows they fill, and what is left where they end early."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon import ui
from fmqm_addon.blender.materials.color_images import color_images, give_smaller, remove_made
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.decimate import DECIMATE
from fmqm_addon.blender.scene.lod_names import lod_of_name, without_level_0
from fmqm_addon.blender.scene.target import target_of
from fmqm_addon.blender.scene.versions import finding_versions
from fmqm_addon.comparison.decimation import DecimationGoal
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.settings import Settings
from fmqm_addon.ui import session
from fmqm_addon.ui.properties.rows import row_scores
from fmqm_addon.ui.properties.scene import FMQMScene
from tests.blender import scenes

TINY = Settings(samples=3200, patches=50, color_units=20)


@pytest.fixture(autouse=True)
def addon(empty_session: None) -> Iterator[None]:
    ui.register()
    yield
    ui.unregister()


@pytest.fixture
def fmqm() -> FMQMScene:
    made = bpy.context.scene.fmqm
    made.settings.samples, made.settings.patches, made.settings.color_units = 3200, 50, 20
    return made


@pytest.fixture
def rock(tmp_path: Path) -> bpy.types.Object:
    """A textured monkey that holds a cube."""
    skin = scenes.textured(scenes.write_png(tmp_path / "skin.png", scenes.noise(64)), "Skin")
    handle = scenes.cube("Handle", materials=[skin])
    rock = scenes.monkey("Rock", [skin])
    handle.parent, handle.scale, handle.location = rock, (0.2, 0.2, 1), (0, 0, 1)
    bpy.context.view_layer.update()
    return rock


def numbers(fmqm: FMQMScene) -> dict[str, dict[str, float]]:
    found = {}
    for row in fmqm.rows:
        scores = row_scores(row)
        assert scores is not None, row.error
        found[row.name] = scores
    return found


def of_looks() -> set[tuple[str, str]]:
    """Data-blocks but for objects."""
    kinds = ("meshes", "materials", "images", "node_groups")
    return {(kind, name) for kind, name in scenes.blocks() if kind in kinds}


def test_a_chain_scores_what_its_rows_say(fmqm: FMQMScene, rock: bpy.types.Object) -> None:
    fmqm.chain.levels, fmqm.chain.qualities[:2], fmqm.chain.name_original = 2, (0.8, 0.65), True
    fmqm.rows.add().reference_name, fmqm.rows[0].reference_kind, fmqm.rows[0].name = "Rock", "OBJECT", "Other"
    fmqm.rows[0].kind = "OBJECT"
    before = scenes.blocks()
    assert bpy.ops.fmqm.lod_chain() == {"FINISHED"}
    made = {name for kind, name in scenes.blocks() - before}
    assert made == {"Rock_LOD0", "Rock_LOD1", "Rock_LOD2", "Handle_LOD1", "Handle_LOD2"}, "no mesh and no image"
    assert fmqm.reference == rock and rock.name == "Rock_LOD0" and not rock.modifiers
    lods = [bpy.data.objects[f"Rock_LOD{level}"] for level in (1, 2)]
    assert [item.object for item in fmqm.compared] == lods
    assert fmqm.rows[0].reference_name == "Rock_LOD0", "earlier rows go on meaning it"
    assert all(lod.hide_get() and lod.modifiers[DECIMATE].ratio < 1 and lod.data == rock.data for lod in lods)
    assert (
        lods[0].children[0].name == "Handle_LOD1" and lods[0].children[0].matrix_world == rock.children[0].matrix_world
    )
    fmqm.rows.remove(0)
    said = numbers(fmqm)
    assert said["Rock_LOD1"]["FMQM"] >= 0.8 > said["Rock_LOD2"]["FMQM"] >= 0.65
    assert all(session.get(row.uid) is not None for row in fmqm.rows), "with what heat maps are drawn from"
    told = {row.name: (row.warnings, row.notes, row.trust, row.parts, row.triangles, row.settings) for row in fmqm.rows}
    marks = [row.fingerprint for row in fmqm.rows]
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    assert numbers(fmqm) == said, "to the last bit"
    again = {
        row.name: (row.warnings, row.notes, row.trust, row.parts, row.triangles, row.settings) for row in fmqm.rows
    }
    assert again == told and [row.fingerprint for row in fmqm.rows] == marks


def test_a_chain_by_the_other_judge_goes_on_from_lod0(fmqm: FMQMScene) -> None:
    bpy.context.view_layer.objects.active = scenes.monkey("Bust_LOD0")
    fmqm.judge, fmqm.chain.levels, fmqm.chain.qualities[0] = "PERCEIVED", 1, 0.8
    assert bpy.ops.fmqm.lod_chain() == {"FINISHED"}
    assert numbers(fmqm)["Bust_LOD1"]["perceived"] >= 0.8
    with pytest.raises(RuntimeError, match="Bust_LOD1: there is such an object; delete or rename it first"):
        bpy.ops.fmqm.lod_chain()
    fmqm.chain.levels, fmqm.chain.qualities[1] = 2, 0.8
    with pytest.raises(RuntimeError, match="LOD2 is to score 0.8 and LOD1 0.8; let them fall"):
        bpy.ops.fmqm.lod_chain()
    bpy.context.view_layer.objects.active, fmqm.chain.levels = bpy.data.objects["Bust_LOD1"], 1
    with pytest.raises(RuntimeError, match="Bust_LOD1: by its name it is a level"):
        bpy.ops.fmqm.lod_chain()


def test_names_of_levels() -> None:
    for name, base in (
        ("Rock", "Rock"), ("Rock_LOD0", "Rock"), ("LOD0_Rock", "Rock"), ("Rock_LOD0.001", "Rock.001"),
        ("Rock_LOD0_low", "Rock_low"), ("Rock_LOD1", "Rock_LOD1"), ("LOD0", "LOD0"),
    ):  # fmt: skip
        assert without_level_0(name) == base
    told = lod_of_name(without_level_0("Rock_LOD0.001") + "_LOD2")
    assert told is not None and (told.stem, told.level) == ("rock.001", 2)


def test_what_was_deleted_does_not_take_the_names(fmqm: FMQMScene) -> None:
    """A deleted object stays in the file as long as a list points at it."""
    bust, old = scenes.monkey("Bust"), scenes.cube("Bust_LOD1")
    fmqm.compared.add().object = old
    bpy.context.scene.collection.objects.unlink(old)
    bpy.context.view_layer.objects.active = bust
    fmqm.chain.levels, fmqm.chain.qualities[0] = 1, 0.6
    assert bpy.ops.fmqm.lod_chain() == {"FINISHED"}
    assert [item.object.name for item in fmqm.compared] == ["Bust_LOD1"]
    assert bpy.data.objects["Bust_LOD1"].users_scene


def test_decimating_fills_a_row_and_shrinks_textures_on_materials_of_its_own(
    fmqm: FMQMScene, rock: bpy.types.Object
) -> None:
    skin, image = rock.active_material, bpy.data.images["skin.png"]
    fmqm.decimate.target, fmqm.decimate.textures, fmqm.decimate.texture_target = 0.8, True, 0.7
    before = of_looks()
    assert bpy.ops.fmqm.decimate() == {"FINISHED"}
    copy = bpy.context.active_object
    (small,) = color_images([copy])
    side = small.size[0]
    assert side < 64 and image.size[0] == 64 and not image.is_dirty
    assert of_looks() - before == {("materials", f"Skin {side}"), ("images", f"skin {side}.png")}
    assert rock.data.materials[0] == skin and rock.material_slots[0].material == skin
    assert copy.material_slots[0].material == copy.children[0].material_slots[0].material, "one copy for all of it"
    assert small.packed_file is not None and small.filepath == f"//skin {side}.png", (
        "it can be unpacked beside skin.png"
    )
    assert f"textures of {side}" in fmqm.decimate.path.splitlines()[fmqm.decimate.found]
    (row,) = fmqm.rows
    assert fmqm.reference == rock and (row.reference_name, row.name) == ("Rock", "Rock FMQM 0.80")
    said = numbers(fmqm)
    assert said[copy.name]["FMQM"] >= 0.7
    assert bpy.ops.fmqm.measure() == {"FINISHED"} and numbers(fmqm) == said
    bpy.context.view_layer.objects.active = rock
    fmqm.decimate.textures = False
    assert bpy.ops.fmqm.decimate() == {"FINISHED"}
    names = [item.object.name for item in fmqm.compared]
    assert names == ["Rock FMQM 0.80", "Rock FMQM 0.80.001"], "to those that are in the list already"


def test_textures_that_miss_their_target_stay(fmqm: FMQMScene, rock: bpy.types.Object) -> None:
    rock.children[0].parent = None
    fmqm.decimate.target, fmqm.decimate.textures, fmqm.decimate.texture_target = 0.7, True, 0.99
    before = of_looks()
    assert bpy.ops.fmqm.decimate() == {"FINISHED"} and of_looks() == before
    assert numbers(fmqm)["Rock FMQM 0.70"]["FMQM"] >= 0.7


def test_there_must_be_a_texture(fmqm: FMQMScene) -> None:
    scenes.monkey("Bust")
    fmqm.decimate.textures = True
    with pytest.raises(RuntimeError, match="Bust: no material has a color image"):
        bpy.ops.fmqm.decimate()


@pytest.mark.parametrize("steps", [3, 40, 400])
def test_ending_early_leaves_nothing(rock: bpy.types.Object, steps: int) -> None:
    before = scenes.blocks()
    goal = DecimationGoal((0.8,), texture_target=0.6, texture_sizes=(64, 32, 16, 8))
    stepper = finding_versions(target_of(rock), "Rock", ("_LOD1",), goal, PairOptions(settings=TINY), Reading())
    for _ in range(steps):
        assert stepper.step()
    stepper.cancel()
    assert scenes.blocks() == before and rock.name == "Rock"


def test_painted_images_and_those_in_groups_get_smaller_too() -> None:
    """A copy of an image that is not saved is a blank one."""
    painted = bpy.data.images.new("Painted", 8, 8)
    painted.pixels.foreach_set(np.full(8 * 8 * 4, 0.4, np.float32))
    group = bpy.data.node_groups.new("Skins", "ShaderNodeTree")
    group.nodes.new("ShaderNodeTexImage").image = painted
    material = scenes.material("Skin")
    material.node_tree.nodes.new("ShaderNodeGroup").node_tree = group
    cube = scenes.cube(materials=[material])
    before = scenes.blocks()
    made = give_smaller([cube], 4)
    (small,) = color_images([cube])
    assert tuple(small.size) == (4, 4) and np.allclose(small.pixels[:3], 0.4, atol=1 / 255)
    assert group.nodes[0].image == painted and cube.data.materials[0] == material
    assert {name for _, name in scenes.blocks() - before} == {"Skins 4", "Skin 4", "Painted 4.png"}
    remove_made(made)
    assert scenes.blocks() == before
    assert give_smaller([cube], 8) == give_smaller([cube], None) == []
