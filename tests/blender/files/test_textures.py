# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of files that were made on another machine, or name them in other cases."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from fmqm_addon.blender.access import Access
from fmqm_addon.blender.files.load import load_asset
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.metric.errors import FMQMError
from tests.blender import scenes
from tests.blender.script import noise, write_png

CONFINED = Reading(access=Access(confined=True))


@pytest.fixture
def textured(tmp_path: Path) -> Path:
    """A folder with a cube in three kinds of files that name made/image.png; which lies in kept, beside the folder."""
    folder, made, kept = tmp_path / "asset", tmp_path / "asset" / "made", tmp_path / "kept"
    for each in (folder, made, kept):
        each.mkdir()
    scenes.clear()
    scenes.cube("Cube", materials=[scenes.textured(write_png(made / "image.png", noise(4)), "Skin")])
    bpy.ops.export_scene.fbx(filepath=str(folder / "cube.fbx"), path_mode="ABSOLUTE")
    bpy.ops.wm.obj_export(filepath=str(folder / "cube.obj"), path_mode="RELATIVE")
    bpy.ops.export_scene.gltf(
        filepath=str(folder / "cube.gltf"), export_format="GLTF_SEPARATE", export_texture_dir="made"
    )
    (made / "image.png").rename(kept / "image.png")
    made.rmdir()
    return folder


def place(textured: Path, where: str) -> None:
    target = textured / where
    target.parent.mkdir(exist_ok=True)
    (textured.parent / "kept" / "image.png").rename(target)


@pytest.mark.parametrize(
    "where", ["image.png", "textures/image.png", "Textures/IMAGE.PNG", "cube.fbm/image.png", "../image.png"]
)
def test_images_of_an_fbx_are_found_by_name(textured: Path, where: str) -> None:
    place(textured, where)
    mesh = load_asset(str(textured / "cube.fbx")).mesh
    if where != "image.png":  # which Blender finds itself
        assert mesh.notes == (f"cube.fbx: its image image.png is not where it says; taken is {where}",)
    assert mesh.materials[0].images[0].path == str((textured / where).resolve())


@pytest.mark.parametrize("kind", ["obj", "gltf"])
def test_names_in_other_cases_are_found(textured: Path, kind: str) -> None:
    place(textured, "MADE/Image.PNG")
    mesh = load_asset(str(textured / f"cube.{kind}")).mesh
    assert mesh.notes == (f"cube.{kind}: its image image.png is not where it says; taken is MADE/Image.PNG",)
    assert not mesh.materials[0].images[0].missing


@pytest.mark.parametrize("kind", ["obj", "gltf"])
def test_other_kinds_look_nowhere_else(textured: Path, kind: str) -> None:
    place(textured, "textures/image.png")
    with pytest.raises(FMQMError, match="missing"):
        load_asset(str(textured / f"cube.{kind}"))


def test_strangers_files_look_no_level_up(textured: Path) -> None:
    place(textured, "../image.png")
    with pytest.raises(FMQMError, match="missing"):
        load_asset(str(textured / "cube.fbx"), CONFINED)
    place_back = textured / "textures"
    place_back.mkdir()
    (textured.parent / "image.png").rename(place_back / "image.png")
    assert load_asset(str(textured / "cube.fbx"), CONFINED).mesh.notes


def test_strangers_links_are_not_followed_out(textured: Path) -> None:
    (textured / "textures").mkdir()
    (textured / "textures" / "image.png").symlink_to(textured.parent / "kept" / "image.png")
    with pytest.raises(FMQMError):
        load_asset(str(textured / "cube.fbx"), CONFINED)
    assert load_asset(str(textured / "cube.fbx")).mesh.notes


def test_the_cases_of_another_machine(shared_data: Path) -> None:
    folder = shared_data / "cases" / "fbx_textures"
    taken = {"out1/win.fbx": "spot.png", "out2/model.fbx": "textures/spot.png", "out3/model.fbx": "model.fbm/spot.png"}
    for name, where in taken.items():
        (note,) = load_asset(str(folder / name)).mesh.notes
        assert note.endswith(f"taken is {where}")
