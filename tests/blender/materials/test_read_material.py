# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a material is read, what it wants of the mesh, and what is said of the rest. Colors: test_cycles.py."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.materials.images import TextureCache
from fmqm_addon.blender.materials.read_material import plain_look, read_look
from fmqm_addon.blender.materials.types import Look, MeshLayer, Reading, Unread
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays
from fmqm_addon.metric.errors import MeshError
from fmqm_addon.metric.texture import PlainColor, Texture
from tests.blender import scenes

# Linear light and its sRGB encoding, by hand from IEC 61966-2-1.
ENCODED = {0.0: 0.0, 0.002: 0.02584, 0.0031308: 0.04045, 0.18: 0.461356, 0.5: 0.735357, 1.0: 1.0}


def look(material: bpy.types.Material | None, reading: Reading = Reading()) -> Look:  # noqa: B008
    found = read_look(material, TextureCache(), reading)
    assert isinstance(found, Look), found
    return found


def color(material: bpy.types.Material) -> object:
    return look(material).material.color


def loaded(tmp_path: Path, pixels: np.ndarray, name: str = "image.png") -> bpy.types.Image:
    return bpy.data.images.load(str(scenes.write_png(tmp_path / name, pixels)))


def behind(material: bpy.types.Material, kind: str, start: bpy.types.NodeSocket | None = None) -> bpy.types.Node:
    """A node of a kind before Base Color, fed by a socket."""
    node = material.node_tree.nodes.new(f"ShaderNode{kind}")
    if start is not None:
        material.node_tree.links.new(start, node.inputs[0])
    material.node_tree.links.new(node.outputs[0], scenes.base_color(material))
    return node


def test_image_that_feeds_base_color(tmp_path: Path) -> None:
    pixels = scenes.noise()
    material = scenes.material("Painted")
    scenes.image_node(material, loaded(tmp_path, scenes.noise(seed=5), "roughness.png"), link=False)
    scenes.image_node(material, loaded(tmp_path, pixels))
    seen = look(material)
    assert isinstance(seen.material.color, Texture) and not seen.warnings and seen.material.alpha is None
    assert (seen.material.name, seen.material.how, seen.material.uv) == ("Painted", "read", 0)
    assert seen.material.color.pixels.dtype == np.uint8 and np.array_equal(seen.material.color.pixels, pixels)
    assert seen.layers == (MeshLayer("uv", ""),)


def test_texture_of_another_socket_is_not_taken_but_told(tmp_path: Path) -> None:
    material = scenes.material(color=(0.5, 0.18, 0.002))
    node = scenes.image_node(material, loaded(tmp_path, scenes.noise()), link=False)
    shader = scenes.base_color(material).node
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Roughness"])
    seen = look(material)
    assert isinstance(seen.material.color, PlainColor) and seen.layers == ()
    assert [(image.role, image.name) for image in seen.material.images] == [("Roughness", "image.png")]


def test_images_are_told_apart_by_role_and_content(tmp_path: Path) -> None:
    """The normal map is reached through its node, the same file twice has one digest, a missing one none."""
    facts = {}
    for name, seed in (("first", 1), ("second", 2), ("again", 1)):
        material = scenes.material(name)
        tree, shader = material.node_tree, scenes.base_color(material).node
        scenes.image_node(material, loaded(tmp_path, scenes.noise(seed=9), "base.png"))
        normal = scenes.image_node(material, loaded(tmp_path, scenes.noise(8, seed), f"{name}.png"), link=False)
        normal.image.colorspace_settings.name = "Non-Color"
        convert = tree.nodes.new("ShaderNodeNormalMap")
        tree.links.new(normal.outputs["Color"], convert.inputs["Color"])
        tree.links.new(convert.outputs["Normal"], shader.inputs["Normal"])
        (tmp_path / "gone.png").unlink(missing_ok=True)
        gone = scenes.image_node(material, loaded(tmp_path, scenes.noise(), "gone.png"), link=False)
        (tmp_path / "gone.png").unlink()
        tree.links.new(gone.outputs["Color"], shader.inputs["Metallic"])
        facts[name] = look(material).material.images
    assert [image.role for image in facts["first"]] == ["base color", "Metallic", "Normal"]
    base, gone, normal = facts["first"]
    assert (base.width, base.height, base.color_space, base.missing) == (16, 16, "sRGB", False)
    assert (normal.width, normal.color_space) == (8, "Non-Color") and normal.path == str(tmp_path / "first.png")
    assert gone.missing and gone.digest == "" and gone.width == 0
    assert normal.digest == facts["again"][2].digest != facts["second"][2].digest


def test_an_image_that_only_other_sockets_use_is_not_decoded(tmp_path: Path) -> None:
    material = scenes.material()
    node = scenes.image_node(material, loaded(tmp_path, scenes.noise()), link=False)
    material.node_tree.links.new(node.outputs["Color"], scenes.base_color(material).node.inputs["Roughness"])
    look(material)
    assert not node.image.has_data


@pytest.mark.parametrize(("linear", "encoded"), ENCODED.items())
def test_plain_color_is_encoded(linear: float, encoded: float) -> None:
    seen = look(scenes.material(color=(linear, 0.5, 0.0)))
    assert seen.material.color.rgb == pytest.approx((encoded, ENCODED[0.5], 0.0), abs=1e-5)
    assert seen.layers == () and not seen.warnings


@pytest.mark.parametrize("strange", [float("nan"), float("inf"), -float("inf"), 1e38])
def test_sockets_that_are_not_finite_give_finite_colors(strange: float) -> None:
    material = scenes.material(color=(strange, 0.5, 0.0))
    mix = behind(material, "MixRGB")
    mix.inputs["Color1"].default_value = mix.inputs["Color2"].default_value = (strange, 1, 1, 1)
    mix.inputs["Fac"].default_value = 0.5
    rgb = np.array(look(material).material.color.rgb)
    assert np.isfinite(rgb).all() and (rgb >= 0).all() and (rgb <= 1).all()


def test_no_material_is_default_grey_with_a_note() -> None:
    seen = look(None)
    assert seen.material.how == "none" and len(seen.notes) == 1
    assert seen.material.color.rgb == pytest.approx((0.906332,) * 3, abs=1e-5)  # 0.8 encoded


def test_no_shader_takes_the_viewport_color() -> None:
    material = scenes.material("Toon")
    material.node_tree.nodes.clear()
    material.diffuse_color = (0.5, 0.18, 1.0, 1.0)
    seen = look(material)
    assert seen.material.color.rgb == pytest.approx((ENCODED[0.5], ENCODED[0.18], 1.0), abs=1e-5)
    assert seen.material.how == "plain" and len(seen.warnings) == 1 and "Toon" in seen.warnings[0]


@pytest.mark.skipif(bpy.app.version >= (5, 0), reason="materials always use their nodes")
def test_nodes_that_are_not_used_do_not_count() -> None:
    material = scenes.material("Toon", (0.18, 0.18, 0.18))
    material.use_nodes = False
    material.diffuse_color = (0.5, 0.5, 0.5, 1.0)
    seen = look(material)
    assert seen.material.color.rgb == pytest.approx((ENCODED[0.5],) * 3, abs=1e-5)
    assert seen.warnings == ("material Toon does not use nodes; its viewport color is taken",)


def test_vector_sockets_of_two_dimensions_have_no_third() -> None:
    material = scenes.material()
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketVector").dimensions = 2
    output = group.nodes.new("NodeGroupOutput")
    output.inputs[0].default_value = (0.5, 0.18)
    node = material.node_tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    material.node_tree.links.new(node.outputs[0], scenes.base_color(material))
    assert color(material).rgb == pytest.approx((ENCODED[0.5], ENCODED[0.18], 0), abs=1e-5)


def test_of_two_shaders_the_one_at_the_output_counts() -> None:
    material = scenes.material(color=(0.5, 0.5, 0.5))
    other = material.node_tree.nodes.new("ShaderNodeBsdfPrincipled")
    other.inputs["Base Color"].default_value = (0.18, 0.18, 0.18, 1)
    output = material.node_tree.get_output_node("ALL")
    material.node_tree.links.new(other.outputs["BSDF"], output.inputs["Surface"])
    assert color(material).rgb == pytest.approx((ENCODED[0.18],) * 3, abs=1e-5)


@pytest.mark.parametrize("targets", [("EEVEE",), ("CYCLES",), ("EEVEE", "CYCLES")])
def test_outputs_of_one_renderer_count_and_cycles_first(targets: tuple[str, ...]) -> None:
    material = scenes.material()
    tree = material.node_tree
    tree.nodes.clear()
    for target in targets:
        shader, output = tree.nodes.new("ShaderNodeBsdfPrincipled"), tree.nodes.new("ShaderNodeOutputMaterial")
        shader.inputs["Base Color"].default_value = (0.5 if target == targets[-1] else 0.18,) * 4
        output.target = target
        tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    seen = look(material)
    assert seen.material.color.rgb == pytest.approx((ENCODED[0.5],) * 3, abs=1e-5) and not seen.warnings


@pytest.mark.parametrize("kind", ["TexChecker", "TexNoise", "Gamma", "ValToRGB", "HueSaturation", "NewGeometry"])
def test_other_nodes_are_left_to_the_baker(kind: str) -> None:
    material = scenes.material()
    node = behind(material, kind)
    assert read_look(material, TextureCache(), Reading()) == Unread(node.name, "is not read")


def test_what_is_not_read_of_images_is_left_to_the_baker(tmp_path: Path) -> None:
    for number, change in enumerate(
        (
            lambda node: setattr(node, "projection", "BOX"),
            lambda node: setattr(node.texture_mapping, "scale", (2, 2, 2)),
            lambda node: setattr(node.image, "source", "SEQUENCE"),
            lambda node: setattr(node.image.colorspace_settings, "name", "Filmic sRGB"),
        )
    ):
        material = scenes.material()
        node = scenes.image_node(material, loaded(tmp_path, scenes.noise(), f"{number}.png"))
        change(node)
        found = read_look(material, TextureCache(), Reading())
        assert isinstance(found, Unread) and found.node == node.name, number


def test_vectors_that_are_not_read_are_left_to_the_baker(tmp_path: Path) -> None:
    for output in ("Generated", "Object", "Normal", "Camera", "Window", "Reflection"):
        material = scenes.material()
        node = scenes.image_node(material, loaded(tmp_path, scenes.noise()))
        source = material.node_tree.nodes.new("ShaderNodeTexCoord")
        material.node_tree.links.new(source.outputs[output], node.inputs["Vector"])
        assert isinstance(read_look(material, TextureCache(), Reading()), Unread), output


def test_the_number_of_an_attribute_is_no_vector(tmp_path: Path) -> None:
    """Though its name may be a UV map's."""
    material = scenes.material()
    node = scenes.image_node(material, loaded(tmp_path, scenes.noise()))
    attribute = material.node_tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = "UVMap"
    for output, found in zip(attribute.outputs, (Look, Look, Unread, Unread), strict=True):  # the last two are numbers
        material.node_tree.links.new(output, node.inputs["Vector"])
        assert isinstance(read_look(material, TextureCache(), Reading()), found), output.name


def test_a_mix_by_a_factor_that_varies_is_left_to_the_baker(tmp_path: Path) -> None:
    material = scenes.material()
    node = scenes.image_node(material, loaded(tmp_path, scenes.noise()), link=False)
    mix = behind(material, "MixRGB", node.outputs["Color"])
    found = read_look(material, TextureCache(), Reading())
    assert isinstance(found, Unread) and (found.node, found.why) == (mix.name, "has a factor that varies")
    assert [image.role for image in found.images] == ["base color"]


def test_a_very_long_chain_is_left_to_the_baker() -> None:
    """As is one that doubles at each step, which would take for ever."""
    material = scenes.material()
    start = material.node_tree.nodes.new("ShaderNodeVertexColor").outputs["Color"]
    for _ in range(100):
        mix = material.node_tree.nodes.new("ShaderNodeMixRGB")
        material.node_tree.links.new(start, mix.inputs["Color1"])
        material.node_tree.links.new(start, mix.inputs["Color2"])
        start = mix.outputs["Color"]
    material.node_tree.links.new(start, scenes.base_color(material))
    found = read_look(material, TextureCache(), Reading())
    assert isinstance(found, Unread) and "too many" in found.why


def doubled_groups(levels: int, empty: bool) -> bpy.types.Material:
    """Before Base Color, groups within groups, each used twice: 2 ** levels gammas in a row, or nothing at all."""
    inner: bpy.types.NodeTree | None = None
    for level in range(levels):
        tree = bpy.data.node_groups.new(f"Level {level}", "ShaderNodeTree")
        for way in ("INPUT", "OUTPUT"):
            tree.interface.new_socket("Color", in_out=way, socket_type="NodeSocketColor")
        last = tree.nodes.new("NodeGroupInput").outputs[0]
        for _ in range(0 if empty and inner is None else 2):
            node = tree.nodes.new("ShaderNodeGamma" if inner is None else "ShaderNodeGroup")
            if inner is not None:
                node.node_tree = inner
            tree.links.new(last, node.inputs[0])
            last = node.outputs[0]
        tree.links.new(last, tree.nodes.new("NodeGroupOutput").inputs[0])
        inner = tree
    material = scenes.material("Doubled")
    group = material.node_tree.nodes.new("ShaderNodeGroup")
    group.node_tree = inner
    material.node_tree.links.new(group.outputs[0], scenes.base_color(material))
    return material


@pytest.mark.parametrize("empty", [False, True])
def test_groups_that_double_in_each_other_end(empty: bool) -> None:
    """A million nodes; Cycles would make them all."""
    with pytest.raises(MeshError, match="material Doubled has more than 100,000 nodes"):
        read_look(doubled_groups(20, empty), TextureCache(), Reading())
    few = read_look(doubled_groups(8, empty), TextureCache(), Reading())
    assert isinstance(few, Look if empty else Unread)


def test_alpha_that_is_not_read_is_opaque_with_a_warning(tmp_path: Path) -> None:
    material = scenes.material("Leaf")
    scenes.image_node(material, loaded(tmp_path, scenes.noise()))
    noise = material.node_tree.nodes.new("ShaderNodeTexNoise")
    material.node_tree.links.new(noise.outputs[0], scenes.base_color(material).node.inputs["Alpha"])
    seen = look(material)
    assert seen.material.alpha is None and isinstance(seen.material.color, Texture)
    assert len(seen.warnings) == 1 and "Leaf" in seen.warnings[0] and noise.name in seen.warnings[0]


def test_missing_alpha_image_is_opaque(tmp_path: Path) -> None:
    material = scenes.material(color=(0.5, 0.5, 0.5))
    path = scenes.write_png(tmp_path / "alpha.png", scenes.noise())
    node = scenes.image_node(material, bpy.data.images.load(str(path)), link=False)
    path.unlink()
    for output in ("Alpha", "Color"):
        material.node_tree.links.new(node.outputs[output], scenes.base_color(material).node.inputs["Alpha"])
        seen = look(material)
        assert seen.material.alpha is None
        assert [(image.role, image.missing) for image in seen.material.images] == [("alpha", True)]


@pytest.mark.parametrize("output", ["Alpha", "Color"])
@pytest.mark.parametrize("flipped", [False, True])
def test_missing_image_between_a_shader_and_a_transparent_one_is_opaque(
    tmp_path: Path, output: str, flipped: bool
) -> None:
    material = scenes.material(color=(0.5, 0.5, 0.5))
    tree, path = material.node_tree, scenes.write_png(tmp_path / "alpha.png", scenes.noise())
    node = scenes.image_node(material, bpy.data.images.load(str(path)), link=False)
    path.unlink()
    mix, transparent = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    tree.links.new(node.outputs[output], mix.inputs[0])
    tree.links.new(transparent.outputs[0], mix.inputs[2 if flipped else 1])
    tree.links.new(scenes.base_color(material).node.outputs[0], mix.inputs[1 if flipped else 2])
    tree.links.new(mix.outputs[0], tree.get_output_node("ALL").inputs["Surface"])
    seen = look(material)
    assert seen.material.alpha is None and seen.material.color.rgb == pytest.approx((ENCODED[0.5],) * 3, abs=1e-5)
    assert [(image.role, image.missing) for image in seen.material.images] == [("alpha", True)]


def test_attribute_without_a_name_is_black_with_a_note() -> None:
    material = scenes.material("Bare")
    behind(material, "Attribute")
    seen = look(material)
    assert seen.material.color.rgb == (0, 0, 0) and seen.layers == ()
    assert seen.notes == ("material Bare: Attribute names no attribute; it is black, as Blender renders it",)


def test_plain_look_is_the_shader_s_own_color(tmp_path: Path) -> None:
    material = scenes.material("Rock", (0.5, 0.18, 0.0))
    behind(material, "TexChecker")
    seen = plain_look(material, "material Rock: not read")
    assert seen.material.color.rgb == pytest.approx((ENCODED[0.5], ENCODED[0.18], 0.0), abs=1e-5)
    assert (seen.material.how, seen.layers, seen.warnings) == ("plain", (), ("material Rock: not read",))


def test_given_texture_replaces_everything() -> None:
    texture = Texture(scenes.noise())
    for material in (None, scenes.material("Procedural")):
        seen = look(material, Reading(texture=texture))
        assert seen.material.color is texture and seen.material.how == "given" and not seen.warnings


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
    assert np.array_equal(seen.material.color.pixels, pixels) and seen.layers == (MeshLayer("uv", "Second"),)


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
    assert str(path) in text and "repair it" in text and "\n" not in text
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
    with pytest.raises(MeshError, match="material Unfinished: .*holds no image"):
        look(material)


@pytest.mark.parametrize("how", ["missing", "truncated", "none"])
def test_magenta_stands_in_where_that_is_allowed(tmp_path: Path, how: str) -> None:
    path = tmp_path / "image.png"
    material = scenes.textured(scenes.write_png(path, scenes.noise()))
    node = material.node_tree.nodes["Image Texture"]
    if how == "none":
        node.image = None
    else:
        break_image(path, how)
        node.image.reload()
    seen = look(material, Reading(stand_in=True))
    assert seen.material.color.rgb == pytest.approx((1.0, 0.0, 1.0)) and seen.layers == ()
    assert len(seen.warnings) == 1 and (str(path) in seen.warnings[0]) == (how != "none")


def test_one_material_is_read_once(tmp_path: Path) -> None:
    """So that objects share it; and one image that two materials use."""
    cache = TextureCache()
    image = loaded(tmp_path, scenes.noise())
    materials = [scenes.material(name) for name in "AB"]
    for material in materials:
        scenes.image_node(material, image)
    first, second = (read_look(material, cache, Reading()) for material in materials)
    assert read_look(materials[0], cache, Reading()) is first
    assert first.material.color.pixels is second.material.color.pixels


@pytest.mark.skipif(bpy.app.version < (5, 0), reason="before 5.0 every file works in one space")
def test_another_working_space_is_a_warning() -> None:
    object_ = scenes.square(materials=[scenes.material(color=(0.1, 0.8, 0.1))])
    assert not mesh_arrays([object_], "asset").warnings
    bpy.ops.wm.set_working_color_space(working_space="ACEScg")
    (warning,) = mesh_arrays([object_], "asset").warnings
    assert "working space is ACEScg" in warning
