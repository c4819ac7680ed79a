# SPDX-License-Identifier: GPL-3.0-or-later
"""What color a surface has: the right image, the right way up, encoded for display."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.bvh import BVHQuery
from fmqm_addon.blender.material import SlotColor, TextureCache, load_texture, read_pixels, slot_color
from fmqm_addon.blender.mesh import mesh_arrays
from fmqm_addon.metric.color import PlainColor, Texture
from fmqm_addon.metric.errors import FileError, MeshError
from fmqm_addon.metric.surface import prepare_surface

from . import scenes

# Linear light and its sRGB encoding, by hand from IEC 61966-2-1.
ENCODED = {0.0: 0.0, 0.002: 0.02584, 0.0031308: 0.04045, 0.18: 0.461356, 0.5: 0.735357, 1.0: 1.0}


def look(material: bpy.types.Material | None) -> SlotColor:
    return slot_color(material, TextureCache(), "Object")


def loaded(tmp_path: Path, pixels: np.ndarray, name: str = "image.png") -> bpy.types.Image:
    return bpy.data.images.load(str(scenes.write_png(tmp_path / name, pixels)))


def test_image_that_feeds_base_color(tmp_path: Path) -> None:
    pixels = scenes.noise()
    material = scenes.material()
    scenes.image_node(material, loaded(tmp_path, scenes.noise(seed=5), "roughness.png"), link=False)
    scenes.image_node(material, loaded(tmp_path, pixels))
    seen = look(material)
    assert isinstance(seen.color, Texture) and not seen.warnings
    assert seen.color.pixels.dtype == np.uint8 and np.array_equal(seen.color.pixels, pixels)


def test_texture_of_another_socket_is_not_taken(tmp_path: Path) -> None:
    material = scenes.material(color=(0.5, 0.18, 0.002))
    node = scenes.image_node(material, loaded(tmp_path, scenes.noise()), link=False)
    shader = scenes.base_color(material).node
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Roughness"])
    assert isinstance(look(material).color, PlainColor)


@pytest.mark.parametrize(("linear", "encoded"), ENCODED.items())
def test_plain_color_is_encoded(linear: float, encoded: float) -> None:
    seen = look(scenes.material(color=(linear, 0.5, 0.0)))
    assert seen.color.rgb == pytest.approx((encoded, ENCODED[0.5], 0.0), abs=1e-5)
    assert seen.uv_map is None and not seen.warnings


def test_no_principled_shader_takes_the_viewport_color() -> None:
    material = scenes.material("Toon")
    material.node_tree.nodes.clear()
    material.diffuse_color = (0.5, 0.18, 1.0, 1.0)
    seen = look(material)
    assert seen.color.rgb == pytest.approx((ENCODED[0.5], ENCODED[0.18], 1.0), abs=1e-5)
    assert len(seen.warnings) == 1 and "Toon" in seen.warnings[0]


def test_of_two_shaders_the_one_at_the_output_counts() -> None:
    material = scenes.material(color=(0.5, 0.5, 0.5))
    other = material.node_tree.nodes.new("ShaderNodeBsdfPrincipled")
    other.inputs["Base Color"].default_value = (0.18, 0.18, 0.18, 1)
    output = material.node_tree.get_output_node("ALL")
    material.node_tree.links.new(other.outputs["BSDF"], output.inputs["Surface"])
    assert look(material).color.rgb == pytest.approx((ENCODED[0.18],) * 3, abs=1e-5)


def two_uv_maps() -> bpy.types.Object:
    """The second map is the first one turned by a half, and is active for rendering; the first for editing."""
    object_ = scenes.square()
    first = object_.data.uv_layers[0]
    second = object_.data.uv_layers.new(name="Second")
    values = np.empty(8, np.float32)
    first.uv.foreach_get("vector", values)
    second.uv.foreach_set("vector", 1 - values)
    second.active_render = True
    object_.data.uv_layers.active_index = 0
    return object_


@pytest.mark.parametrize(
    ("node", "turned"), [(None, True), ("ShaderNodeTexCoord", True), ("Second", True), ("UVMap", False)], ids=str
)
def test_uv_map_is_the_named_one_or_the_one_for_rendering(tmp_path: Path, node: str | None, turned: bool) -> None:
    object_ = two_uv_maps()
    material = scenes.material()
    image = scenes.image_node(material, loaded(tmp_path, scenes.noise()))
    if node is not None:
        is_map = node in ("UVMap", "Second")
        source = material.node_tree.nodes.new("ShaderNodeUVMap" if is_map else node)
        if is_map:
            source.uv_map = node
        material.node_tree.links.new(source.outputs["UV"], image.inputs["Vector"])
    object_.data.materials.append(material)
    arrays = mesh_arrays([object_], "asset")
    xy = arrays.positions[arrays.triangles][:, :, :2]
    assert arrays.corners == pytest.approx(1 - xy if turned else xy)
    assert not arrays.warnings


def test_slots_of_one_object_use_their_own_uv_maps(tmp_path: Path) -> None:
    image = loaded(tmp_path, scenes.noise())
    object_ = two_uv_maps()
    object_.data.uv_layers["UVMap"].active_render = True
    for name in ("UVMap", "Second"):
        material = scenes.material(name)
        source = material.node_tree.nodes.new("ShaderNodeUVMap")
        source.uv_map = name
        material.node_tree.links.new(source.outputs["UV"], scenes.image_node(material, image).inputs["Vector"])
        object_.data.materials.append(material)
    first = mesh_arrays([object_], "asset")
    object_.data.polygons[0].material_index = 1
    assert mesh_arrays([object_], "asset").corners == pytest.approx(1 - first.corners)


def test_uv_map_that_the_mesh_lacks_is_named(tmp_path: Path) -> None:
    material = scenes.material()
    source = material.node_tree.nodes.new("ShaderNodeUVMap")
    source.uv_map = "Lightmap"
    image = scenes.image_node(material, loaded(tmp_path, scenes.noise()))
    material.node_tree.links.new(source.outputs["UV"], image.inputs["Vector"])
    with pytest.raises(MeshError, match="Owner: .*no UV map named Lightmap"):
        mesh_arrays([scenes.square("Owner", materials=[material])], "asset")


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
@pytest.mark.parametrize(
    ("interpolation", "wanted"), [("Linear", "linear"), ("Closest", "closest"), ("Cubic", "linear")]
)
def test_extension_and_interpolation(tmp_path: Path, extension: str, interpolation: str, wanted: str) -> None:
    material = scenes.material()
    node = scenes.image_node(material, loaded(tmp_path, scenes.noise()))
    assert look(material).color.extension == "repeat" and look(material).color.interpolation == "linear"
    node.extension, node.interpolation = extension, interpolation
    color = look(material).color
    assert (color.extension, color.interpolation) == (extension.lower(), wanted)


def test_through_reroutes(tmp_path: Path) -> None:
    pixels = scenes.noise()
    material = scenes.material()
    tree = material.node_tree
    node = scenes.image_node(material, loaded(tmp_path, pixels), link=False)
    source = tree.nodes.new("ShaderNodeUVMap")
    source.uv_map = "Second"
    for start, end in ((node.outputs["Color"], scenes.base_color(material)), (source.outputs["UV"], node.inputs[0])):
        for _ in range(2):
            reroute = tree.nodes.new("NodeReroute")
            tree.links.new(start, reroute.inputs[0])
            start = reroute.outputs[0]
        tree.links.new(start, end)
    seen = look(material)
    assert np.array_equal(seen.color.pixels, pixels) and seen.uv_map == "Second" and not seen.warnings


def test_image_behind_another_node_is_taken_with_a_warning(tmp_path: Path) -> None:
    pixels = scenes.noise()
    material = scenes.material("Tinted")
    tree = material.node_tree
    node = scenes.image_node(material, loaded(tmp_path, pixels), link=False)
    gamma = tree.nodes.new("ShaderNodeGamma")
    tree.links.new(node.outputs["Color"], gamma.inputs["Color"])
    tree.links.new(gamma.outputs["Color"], scenes.base_color(material))
    seen = look(material)
    assert np.array_equal(seen.color.pixels, pixels)
    assert len(seen.warnings) == 1 and "Tinted" in seen.warnings[0]


def test_base_color_without_any_image_takes_the_plain_one_with_a_warning() -> None:
    material = scenes.material("Procedural", (0.5, 0.5, 0.5))
    tree = material.node_tree
    checker = tree.nodes.new("ShaderNodeTexChecker")
    tree.links.new(checker.outputs["Color"], scenes.base_color(material))
    seen = look(material)
    assert seen.color.rgb == pytest.approx((ENCODED[0.5],) * 3, abs=1e-5)
    assert len(seen.warnings) == 1 and "Procedural" in seen.warnings[0]


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


def test_eight_bit_images_keep_their_encoded_values(tmp_path: Path) -> None:
    """All 256 of them, whatever color space Blender takes them to be in."""
    ramp = np.repeat(np.arange(256, dtype=np.uint8).reshape(16, 16, 1), 3, axis=2)
    image = loaded(tmp_path, ramp)
    for space in ("sRGB", "Non-Color"):
        image.colorspace_settings.name = space
        assert np.array_equal(read_pixels(image), ramp)


def test_sixteen_bit_png_is_encoded_for_display(tmp_path: Path) -> None:
    """Blender holds it as linear floats; the file's own encoded values must come back."""
    values = np.random.default_rng(0).integers(0, 65536, (8, 8, 3)).astype(np.uint16)
    values[0, 0], values[0, 1] = 0, 65535
    image = loaded(tmp_path, values)
    assert image.is_float
    pixels = read_pixels(image)
    assert pixels.dtype == np.float32 and pixels.min() >= 0 and pixels.max() <= 1
    assert pixels == pytest.approx(values / 65535, abs=2e-4)


def test_float_image_is_encoded_for_display(tmp_path: Path) -> None:
    """An EXR holds linear light: the values by hand, and what is not in [0, 1] clipped."""
    linear = [*ENCODED, -1.0, 7.0]
    rows = np.repeat(np.array(linear, np.float32)[None, :, None], 3, axis=2)
    image = bpy.data.images.load(str(scenes.write_exr(tmp_path / "light.exr", rows)))
    assert image.is_float
    pixels = read_pixels(image)
    assert pixels.shape == (1, len(linear), 3)
    assert pixels[0, :, 0] == pytest.approx([*ENCODED.values(), 0.0, 1.0], abs=1e-5)


def test_pixels_that_are_not_finite_are_made_so() -> None:
    image = bpy.data.images.new("light", 2, 1, float_buffer=True)
    image.pixels.foreach_set(np.array([np.nan, np.inf, -np.inf, 1, 0.5, 0.5, 0.5, 1], np.float32))
    pixels = read_pixels(image)
    assert pixels[0] == pytest.approx(np.array([[0, 1, 0], [ENCODED[0.5]] * 3]), abs=1e-5)


def test_packed_image_needs_no_file(tmp_path: Path) -> None:
    pixels = scenes.noise()
    image = loaded(tmp_path, pixels)
    image.use_fake_user = True
    image.pack()
    (tmp_path / "image.png").unlink()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "packed.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "packed.blend"))
    material = scenes.material()
    scenes.image_node(material, bpy.data.images["image.png"])
    assert np.array_equal(look(material).color.pixels, pixels)


def test_image_made_in_blender() -> None:
    image = bpy.data.images.new("generated", 4, 2)
    image.generated_color = (1.0, 0.5, 0.0, 1.0)
    pixels = read_pixels(image)
    assert pixels.shape == (2, 4, 3)
    assert (pixels == pixels[0, 0]).all() and pixels[0, 0, 0] == 255 and pixels[0, 0, 2] == 0


def break_image(path: Path, how: str) -> None:
    whole = scenes.write_png(path, scenes.noise(64)).read_bytes()
    if how == "missing":
        path.unlink()
    else:
        path.write_bytes({"truncated": whole[: len(whole) // 2], "empty": b"", "text": b"not an image"}[how])


@pytest.mark.parametrize("how", ["missing", "truncated", "empty", "text"])
def test_image_that_cannot_be_read_is_an_error_that_names_its_path(tmp_path: Path, how: str) -> None:
    path = tmp_path / "image.png"
    material = scenes.textured(scenes.write_png(path, scenes.noise()))
    break_image(path, how)
    bpy.data.images["image.png"].reload()
    with pytest.raises(MeshError) as caught:
        look(material)
    text = str(caught.value)
    assert str(path) in text and "--texture" in text and "\n" not in text
    assert ("missing" in text) == (how == "missing")


def test_missing_image_beside_a_blend_is_named_by_its_whole_path(tmp_path: Path) -> None:
    path = scenes.write_png(tmp_path / "image.png", scenes.noise())
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "asset.blend"))
    material = scenes.material()
    node = scenes.image_node(material, bpy.data.images.load(str(path)))
    node.image.filepath = "//image.png"
    path.unlink()
    node.image.reload()
    with pytest.raises(MeshError) as caught:
        look(material)
    assert str(path) in str(caught.value) and "//" not in str(caught.value)


def test_texture_node_without_an_image_is_an_error_that_names_the_material() -> None:
    material = scenes.material("Unfinished")
    scenes.image_node(material, None)
    with pytest.raises(MeshError, match="Object: material Unfinished: .*holds no image"):
        look(material)


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
    assert scenes.blocks() == before and np.array_equal(read_pixels(own), pixels)


def test_one_image_is_read_once(tmp_path: Path) -> None:
    cache = TextureCache()
    image = loaded(tmp_path, scenes.noise())
    materials = [scenes.material(name) for name in "AB"]
    for material in materials:
        scenes.image_node(material, image)
    first, second = (slot_color(material, cache, "Object").color.pixels for material in materials)
    assert first is second
