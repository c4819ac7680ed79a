# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels: the right way up, as the file holds them, at no more memory than needed, with nothing left behind or lost."""

from __future__ import annotations

import os
from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.materials.image_files import image_digest, image_facts, image_path, tile_path, tile_place
from fmqm_addon.blender.materials.image_headers import ImageLimits
from fmqm_addon.blender.materials.images import TextureCache, load_texture, read_pixels
from fmqm_addon.blender.materials.read_material import read_look
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays
from fmqm_addon.metric.errors import FileError, ImageSizeError, MeshError
from fmqm_addon.metric.surface import prepare_surface
from tests.blender import scenes

from .test_read_material import break_image, loaded


def test_top_row_of_the_file_is_at_v_near_1(tmp_path: Path) -> None:
    """From the PNG's rows to the color at a place on the surface."""
    pixels = np.zeros((2, 4, 3), np.uint8)
    pixels[0, 0], pixels[0, 3], pixels[1, 0], pixels[1, 3] = (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0)
    path = scenes.write_png(tmp_path / "corners.png", pixels)
    assert np.array_equal(load_texture(str(path)).pixels, pixels)
    material = scenes.textured(path)
    material.node_tree.nodes["Image Texture"].interpolation = "Closest"
    surface = prepare_surface(mesh_arrays([scenes.square(materials=[material])], "asset"), BVHQuery)
    corners = surface.frame.leave(surface.vertices)[surface.triangles].reshape(-1, 3)
    triangle = np.repeat(np.arange(len(surface.triangles)), 3)
    # a little inside the corner of the image, where the corner pixel is alone
    inward = 0.9 * np.tile(np.eye(3), (len(surface.triangles), 1)) + 0.1 / 3
    shown = surface.color_at(triangle, inward)
    wanted = {(0, 1): (1, 0, 0), (1, 1): (0, 1, 0), (0, 0): (0, 0, 1), (1, 0): (1, 1, 0)}
    for (x, y, _), color in zip(np.round(corners, 6).tolist(), shown, strict=True):
        assert color == pytest.approx(wanted[x, y])


def test_eight_bit_images_keep_their_values(tmp_path: Path) -> None:
    """All 256 of them, whatever color space Blender takes them to be in; only Non-Color is linear light."""
    ramp = np.repeat(np.arange(256, dtype=np.uint8).reshape(16, 16, 1), 3, axis=2)
    image = loaded(tmp_path, ramp)
    for space, linear in (("sRGB", False), ("Non-Color", True)):
        image.colorspace_settings.name = space
        pixels = read_pixels(image)
        assert np.array_equal(pixels.values, ramp) and pixels.linear == linear and not pixels.unusual


def test_alpha_multiplies_as_cycles_does_by_mode(tmp_path: Path) -> None:
    values = np.array([[[200, 100, 51, 128], [255, 7, 1, 0]]], np.uint8)
    image = loaded(tmp_path, values)
    image.alpha_mode = "CHANNEL_PACKED"
    assert np.array_equal(read_pixels(image).values, values)
    image.alpha_mode = "NONE"
    assert np.array_equal(read_pixels(image).values, values[:, :, :3])
    image.alpha_mode = "STRAIGHT"
    pixels = read_pixels(image)
    assert pixels.associated and pixels.values.tolist() == [[[100, 50, 25, 128], [0, 0, 0, 0]]]


def test_sixteen_bit_png_is_encoded(tmp_path: Path) -> None:
    """Blender holds it as linear floats; the file's own encoded values must come back."""
    values = np.random.default_rng(0).integers(0, 65536, (8, 8, 3)).astype(np.uint16)
    values[0, 0], values[0, 1] = 0, 65535
    image = loaded(tmp_path, values)
    pixels = read_pixels(image)
    assert image.is_float and pixels.values.dtype == np.float32 and not pixels.linear
    assert pixels.values[:, :, :3] == pytest.approx(values / 65535, abs=2e-4)


def test_float_image_is_linear_light(tmp_path: Path) -> None:
    """Of an EXR the values as they are, also what no screen shows."""
    linear = [0.0, 0.18, 1.0, -1.0, 7.0]
    rows = np.repeat(np.array(linear, np.float32)[None, :, None], 3, axis=2)
    image = bpy.data.images.load(str(scenes.write_exr(tmp_path / "light.exr", rows)))
    pixels = read_pixels(image)
    assert pixels.linear and pixels.values[0, :, :3].tolist() == rows[0].tolist()


def test_pixels_that_are_not_finite_are_made_so() -> None:
    image = bpy.data.images.new("light", 2, 1, float_buffer=True)
    image.pixels.foreach_set(np.array([np.nan, np.inf, -np.inf, 1, 0.5, 0.5, 0.5, 1], np.float32))
    assert read_pixels(image).values[0, :, :3].tolist() == [[0, 1e6, -1e6], [0.5] * 3]


def test_packed_image_needs_no_file(tmp_path: Path) -> None:
    pixels = scenes.noise()
    image = loaded(tmp_path, pixels)
    image.use_fake_user = True
    image.pack()
    (tmp_path / "image.png").unlink()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "packed.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "packed.blend"))
    assert np.array_equal(read_pixels(bpy.data.images["image.png"]).values, pixels)


def test_image_made_in_blender() -> None:
    image = bpy.data.images.new("generated", 4, 2)
    image.generated_color = (1.0, 0.5, 0.0, 1.0)
    values = read_pixels(image).values
    assert values.shape == (2, 4, 3)
    assert (values == values[0, 0]).all() and values[0, 0, 0] == 255 and values[0, 0, 2] == 0


def test_only_what_was_decoded_for_this_is_given_back(tmp_path: Path) -> None:
    """Freeing a painted image would erase the painting; one that was loaded stays so."""
    image = loaded(tmp_path, scenes.noise())
    read_pixels(image)
    assert not image.has_data
    assert image.pixels[0] >= 0 and image.has_data
    read_pixels(image)
    assert image.has_data
    image.pixels.foreach_set(np.zeros(16 * 16 * 4, np.float32))
    assert image.is_dirty and not read_pixels(image).values[:, :, :3].any()
    assert not np.array(image.pixels)[:3].any()


@pytest.mark.skipif(os.sep == "\\", reason="on Windows these are the separators")
def test_paths_written_on_windows(tmp_path: Path) -> None:
    path = scenes.write_png(tmp_path / "image.png", scenes.noise())
    image = bpy.data.images.load(str(path))
    image.filepath = f"{tmp_path}/.\\image.png"
    assert image_path(image) == str(path) and image_digest(image)


def test_the_same_content_is_kept_once_for_all_assets(tmp_path: Path) -> None:
    """As long as somebody holds it; read in another way, it is something else."""
    path = scenes.write_png(tmp_path / "image.png", scenes.noise())
    copy = tmp_path / "copy.png"
    copy.write_bytes(path.read_bytes())
    limits = ImageLimits()
    first = TextureCache().pixels(bpy.data.images.load(str(path)), limits)
    image = bpy.data.images.load(str(copy))
    second = TextureCache().pixels(image, limits)
    assert first is not None and second is not None and second.values is first.values and not image.has_data
    image.colorspace_settings.name = "Non-Color"
    linear = TextureCache().pixels(image, limits)
    assert linear is not None and linear.linear and not second.linear
    with pytest.raises(MeshError):
        TextureCache().pixels(bpy.data.images.load(str(path)), ImageLimits(side=8))
    del first, second, linear
    copy.write_bytes(scenes.write_png(path, scenes.noise(seed=1)).read_bytes())
    image.reload()
    changed = TextureCache().pixels(image, limits)
    assert changed is not None and np.array_equal(changed.values, scenes.noise(seed=1))


def test_digest_is_of_the_content(tmp_path: Path) -> None:
    one, other = loaded(tmp_path, scenes.noise(), "a.png"), loaded(tmp_path, scenes.noise(), "b.png")
    assert image_digest(one) == image_digest(other) != ""
    assert image_digest(loaded(tmp_path, scenes.noise(seed=1), "c.png")) != image_digest(one)
    other.pack()
    (tmp_path / "b.png").unlink()
    assert image_digest(one) == image_digest(other)
    one.pixels.foreach_set(np.ones(16 * 16 * 4, np.float32))
    assert image_digest(one) != image_digest(other)


def test_huge_images_are_refused_before_they_are_decoded(tmp_path: Path) -> None:
    """On disk, packed and generated; exactly at the limit is fine."""
    path = scenes.write_png(tmp_path / "wide.png", np.zeros((2, 40, 3), np.uint8))
    material = scenes.textured(path)
    image = material.node_tree.nodes["Image Texture"].image
    for limits, word in (
        (ImageLimits(side=39), "the 39 a side"),
        (ImageLimits(decoded=319), "the 319 that are allowed"),
    ):
        with pytest.raises(ImageSizeError) as caught:
            read_look(material, TextureCache(), Reading(limits=limits))
        text = str(caught.value)
        assert str(path) in text and "40 x 2" in text and word in text and not image.has_data
    assert read_pixels(image, ImageLimits(side=40, decoded=320)) is not None
    with pytest.raises(MeshError, match="wide.png"):
        load_texture(str(path), ImageLimits(side=39))
    image.pack()
    with pytest.raises(MeshError, match="40 x 2"):
        read_pixels(image, ImageLimits(side=39))
    with pytest.raises(MeshError, match="generated.*40 x 2"):
        read_pixels(bpy.data.images.new("generated", 40, 2), ImageLimits(side=39))
    deep = loaded(tmp_path, np.zeros((2, 40, 3), np.uint16), "deep.png")
    with pytest.raises(MeshError, match="1280 bytes"):
        read_pixels(deep, ImageLimits(decoded=1279))


def test_a_header_that_lies_is_refused(tmp_path: Path) -> None:
    path = scenes.write_png(tmp_path / "bomb.png", scenes.noise())
    whole = bytearray(path.read_bytes())
    whole[16:24] = (97293039).to_bytes(4, "big") + (1048810005).to_bytes(4, "big")
    path.write_bytes(whole)
    with pytest.raises(MeshError, match="97293039 x 1048810005"):
        read_look(scenes.textured(path), TextureCache(), Reading())


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_pipe_in_place_of_an_image_is_refused(tmp_path: Path) -> None:
    image = loaded(tmp_path, scenes.noise())
    os.remove(tmp_path / "image.png")
    os.mkfifo(tmp_path / "image.png")
    assert image_facts(image, "base color", "").width == 0
    with pytest.raises(MeshError, match=r"image\.png: the image is a pipe or a device"):
        read_pixels(image)


@pytest.mark.skipif(not os.path.exists("/proc/self/mem"), reason="this system has no file that fails")
def test_file_that_fails_while_it_is_read(tmp_path: Path) -> None:
    (tmp_path / "image.png").symlink_to("/proc/self/mem")
    image = bpy.data.images.load(str(tmp_path / "image.png"))
    with pytest.raises(MeshError, match=r"image\.png: the image cannot be read \("):
        image_digest(image)


@pytest.mark.skipif(bpy.app.version >= (5, 2), reason="this Blender survives it")
def test_image_at_which_blender_crashes_is_refused(tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    path = tmp_path / "image.jp2"
    pillow.new("L", (24, 20)).save(path)
    image = bpy.data.images.load(str(path))  # which would crash later
    pillow.new("LA", (24, 20)).save(path)
    with pytest.raises(MeshError, match=r"image\.jp2: Blender before 5\.2 crashes"):
        read_pixels(image)
    with pytest.raises(FileError, match=r"image\.jp2: Blender before 5\.2 crashes"):
        load_texture(str(path))


def test_image_that_was_not_decoded_is_told(tmp_path: Path) -> None:
    """Blender shows a TIFF of a compression that it lacks as black."""
    pillow = pytest.importorskip("PIL.Image")
    path = tmp_path / "image.tif"
    pillow.fromarray(scenes.noise()).save(path)
    assert not mesh_arrays([scenes.square(materials=[scenes.textured(path)])], "asset").warnings
    data = path.read_bytes()
    plain, lzma = ((259).to_bytes(2, "little") + b"\3\0\1\0\0\0" + code.to_bytes(2, "little") for code in (1, 34925))
    assert plain in data
    path.write_bytes(data.replace(plain, lzma))
    (warning,) = mesh_arrays([scenes.square(materials=[scenes.textured(path)])], "asset").warnings
    assert f"{path} is black all over" in warning
    (warning,) = mesh_arrays([scenes.square()], "asset", Reading(texture=load_texture(str(path)))).warnings
    assert "the image that is given is black all over" in warning


def test_sequence_is_baked_at_the_scenes_frame(tmp_path: Path) -> None:
    for number in (1, 2):
        scenes.write_png(tmp_path / f"s_{number}.png", np.full((4, 4, 3), 100 * number, np.uint8))
    material = scenes.textured(tmp_path / "s_1.png")
    node = material.node_tree.nodes["Image Texture"]
    node.image.source = "SEQUENCE"
    node.image_user.frame_duration, node.image_user.use_auto_refresh = 2, True
    bpy.context.scene.frame_set(2)
    arrays = mesh_arrays([scenes.square(materials=[material])], "asset", Reading(bake=32))
    (note,) = arrays.notes
    assert "shows a sequence; baked" in note and not arrays.warnings
    seen = arrays.materials[0].color.lookup(arrays.corners[0].astype(float))
    assert seen == pytest.approx(np.full_like(seen, 200 / 255), abs=1.5 / 255)
    (tmp_path / "s_1.png").unlink()
    with pytest.raises(MeshError, match=r"s_1\.png: the base-color image is missing"):
        mesh_arrays([scenes.square(materials=[material])], "asset")


@pytest.mark.parametrize(("number", "place"), [(1001, (0, 0)), (1002, (1, 0)), (1010, (9, 0)), (1011, (0, 1))])
def test_tile_numbers(number: int, place: tuple[int, int]) -> None:
    assert tile_place(number) == place


def tiled(folder: Path, pattern: str = "t.<UDIM>.png", first: str = "t.1001.png") -> bpy.types.Material:
    material = scenes.textured(folder / first)
    image = material.node_tree.nodes["Image Texture"].image
    image.source = "TILED"
    image.filepath = str(folder / pattern)
    image.tiles.new(1002)
    return material


def test_tiles_are_read_by_both_patterns_and_leave_nothing(tmp_path: Path) -> None:
    for number, names in enumerate((("t.1001.png", "t.1002.png"), ("t.u1_v1.png", "t.u2_v1.png"))):
        files = [scenes.write_png(tmp_path / name, scenes.noise(seed=number + k)) for k, name in enumerate(names)]
        material = tiled(tmp_path, "t.<UDIM>.png" if number == 0 else "t.<UVTILE>.png", names[0])
        image = material.node_tree.nodes["Image Texture"].image
        assert [tile_path(image, tile.number) for tile in image.tiles] == [str(file) for file in files]
        before = scenes.blocks()
        look = read_look(material, TextureCache(), Reading())
        assert scenes.blocks() == before and not look.warnings
        tiles = dict(look.material.color.light.tiles)
        for k in (0, 1):
            assert np.array_equal(tiles[k, 0].pixels, scenes.noise(seed=number + k))


def test_missing_tile_is_named_and_magenta(tmp_path: Path) -> None:
    scenes.write_png(tmp_path / "t.1001.png", scenes.noise())
    look = read_look(tiled(tmp_path), TextureCache(), Reading())
    assert len(look.warnings) == 1 and str(tmp_path / "t.1002.png") in look.warnings[0]
    assert look.material.color.lookup(np.array([[1.5, 0.5]]))[0] == pytest.approx([1, 0, 1])


def test_set_of_which_no_tile_is_there_is_an_error(tmp_path: Path) -> None:
    path = scenes.write_png(tmp_path / "t.1001.png", scenes.noise())
    material = tiled(tmp_path)
    path.unlink()
    with pytest.raises(MeshError, match="UDIM.*missing"):
        read_look(material, TextureCache(), Reading())


def test_real_set_of_tiles(shared_data: Path) -> None:
    """Twelve places on one quad, the seventh file absent."""
    bpy.ops.wm.open_mainfile(filepath=str(shared_data / "hostile" / "udim" / "plane_udim.blend"))
    material = next(object_ for object_ in bpy.data.objects if object_.type == "MESH").data.materials[0]
    look = read_look(material, TextureCache(), Reading())
    places = [place for place, _ in look.material.color.light.tiles]
    assert (5, 0) in places and (6, 0) not in places and (0, 1) in places


@pytest.mark.parametrize("how", ["missing", "truncated", "empty", "text", "folder"])
def test_given_texture_that_cannot_be_read(tmp_path: Path, how: str) -> None:
    path = tmp_path / "given.png"
    if how == "folder":
        path.mkdir()
    else:
        break_image(path, how)
    before = scenes.blocks()
    with pytest.raises(FileError) as caught:
        load_texture(str(path))
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)
    assert scenes.blocks() == before


def test_given_texture_leaves_nothing_behind(tmp_path: Path) -> None:
    pixels = scenes.noise()
    path = scenes.write_png(tmp_path / "given.png", pixels)
    own = bpy.data.images.load(str(path))  # the user's, of the same file
    before = scenes.blocks()
    texture = load_texture(str(path))
    assert np.array_equal(texture.pixels, pixels) and texture.extension == "repeat"
    assert scenes.blocks() == before and np.array_equal(read_pixels(own).values, pixels)
