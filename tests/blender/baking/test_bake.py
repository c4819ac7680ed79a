# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that only Cycles can evaluate: their base color on the surface, and nothing left behind."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.baking import bake
from fmqm_addon.blender.baking.bake import Baked, bake_slots
from fmqm_addon.blender.materials.image_headers import ImageLimits
from fmqm_addon.blender.materials.types import Reading, Unread
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays
from fmqm_addon.metric.colorspace import decode_srgb, encode_srgb
from fmqm_addon.metric.errors import MeshError
from fmqm_addon.metric.surface import prepare_surface
from fmqm_addon.metric.texture import Texture
from tests.blender import scenes

CLOSE = 1.5 / 255
RED, GREEN = (0.9, 0.1, 0.1), (0.1, 0.9, 0.1)
REASON = Unread("Noise Texture", "is not read")


@dataclass(frozen=True)
class Seen:
    """Random places of one slot: (N, 3) local positions, colors as baked, (N,) opacities, (N,) polygons."""

    position: np.ndarray
    color: np.ndarray
    opacity: np.ndarray
    polygon: np.ndarray


def evaluated(object_: bpy.types.Object) -> tuple[bpy.types.Object, bpy.types.Depsgraph]:
    depsgraph = bpy.context.evaluated_depsgraph_get()
    depsgraph.update()
    return object_.evaluated_get(depsgraph), depsgraph


def baked(object_: bpy.types.Object, size: int = 256) -> dict[int, Baked]:
    """All slots of an object, in a session that stays as it was."""
    before = scenes.blocks()
    seen, depsgraph = evaluated(object_)
    slots = {index: (slot.material, REASON) for index, slot in enumerate(seen.material_slots)}
    found = bake_slots(seen, depsgraph, slots, size, object_.name)
    assert scenes.blocks() == before
    return found


def look_at(object_: bpy.types.Object, found: Baked, slot: int = 0, each: int = 60) -> Seen:
    """What was baked at the corners and inside of the triangles of a slot."""
    source, depsgraph = evaluated(object_)
    mesh = source.to_mesh(preserve_all_data_layers=True, depsgraph=depsgraph)
    faces = [face for face in mesh.loop_triangles if mesh.polygons[face.polygon_index].material_index == slot]
    corners = np.array([[mesh.vertices[vertex].co for vertex in face.vertices] for face in faces])
    polygon = np.array([face.polygon_index for face in faces])
    source.to_mesh_clear()
    assert found.corners.shape == (len(faces), 3, 2) and found.corners.dtype == np.float32
    places = np.random.default_rng(0).dirichlet((0.5, 0.5, 0.5), (len(faces), each))
    places[:, :3] = np.eye(3)
    values = np.einsum("tnk,tkc->tnc", places, found.corners.astype(float)).reshape(-1, 2)
    material = found.look.material
    return Seen(
        np.einsum("tnk,tkc->tnc", places, corners).reshape(-1, 3),
        material.color.lookup(values),
        np.ones(len(values)) if material.alpha is None else material.alpha.opacity(values),
        np.repeat(polygon, each),
    )


def node(tree: bpy.types.NodeTree, kind: str, **values: object) -> bpy.types.Node:
    made = tree.nodes.new(kind)
    for name, value in values.items():
        setattr(made, name, value)
    return made


def gradient(tree: bpy.types.NodeTree, coordinates: str = "Object") -> bpy.types.NodeSocket:
    """0.5 + 0.3 times a coordinate, for each axis."""
    scaled = node(tree, "ShaderNodeVectorMath", operation="MULTIPLY_ADD")
    scaled.inputs[1].default_value, scaled.inputs[2].default_value = (0.3, 0.3, 0.3), (0.5, 0.5, 0.5)
    tree.links.new(node(tree, "ShaderNodeTexCoord").outputs[coordinates], scaled.inputs[0])
    return scaled.outputs[0]


def of_gradient(position: np.ndarray) -> np.ndarray:
    return encode_srgb(0.5 + 0.3 * position)


def procedural(name: str = "Gradient", coordinates: str = "Object") -> bpy.types.Material:
    material = scenes.material(name)
    tree = material.node_tree
    tree.links.new(gradient(tree, coordinates), scenes.base_color(material))
    return material


def checker(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """Squares of 1/2: 1 where the sum of their numbers is odd, else 0. Moved off the faces of the cube."""
    moved = node(tree, "ShaderNodeVectorMath", operation="ADD")
    moved.inputs[1].default_value = (0.1, 0.1, 0.1)
    made = node(tree, "ShaderNodeTexChecker")
    made.inputs["Scale"].default_value = 2
    tree.links.new(node(tree, "ShaderNodeTexCoord").outputs["Object"], moved.inputs[0])
    tree.links.new(moved.outputs[0], made.inputs["Vector"])
    return made.outputs["Fac"]


def of_checker(position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The checker's values, and where no step is near."""
    cell = (position + 0.1) * 2
    odd = np.floor(cell).astype(int).sum(axis=1) % 2 == 1
    return odd.astype(float), (np.abs(cell - np.round(cell)) > 0.1).all(axis=1)


def surface(material: bpy.types.Material) -> bpy.types.NodeSocket:
    return material.node_tree.get_output_node("ALL").inputs["Surface"]


def shader(tree: bpy.types.NodeTree, kind: str, color: tuple[float, ...] | bpy.types.NodeSocket = ()) -> bpy.types.Node:
    made = node(tree, kind)
    if isinstance(color, bpy.types.NodeSocket):
        tree.links.new(color, made.inputs["Color"])
    elif color:
        made.inputs["Color"].default_value = (*color, 1)
    return made


def mix(
    tree: bpy.types.NodeTree, factor: float | bpy.types.NodeSocket, first: bpy.types.Node, second: bpy.types.Node
) -> bpy.types.NodeSocket:
    made = node(tree, "ShaderNodeMixShader")
    if isinstance(factor, float):
        made.inputs[0].default_value = factor
    else:
        tree.links.new(factor, made.inputs[0])
    tree.links.new(first.outputs[0], made.inputs[1])
    tree.links.new(second.outputs[0], made.inputs[2])
    return made.outputs[0]


@pytest.mark.parametrize("uv", [True, False], ids=["overlapping UV map", "no UV map"])
def test_gradient_at_every_place(uv: bool) -> None:
    object_ = scenes.cube(uv=uv, materials=[procedural()])
    object_.matrix_world = scenes.PLACED
    found = baked(object_)[0]
    seen = look_at(object_, found)
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE
    assert found.look.material.how == "baked" and found.look.material.alpha is None
    assert found.look.notes == ("material Gradient: Noise Texture is not read; baked at 256 x 256",)
    assert len(found.look.layers) == 1 and found.look.layers[0].kind == "uv"


def test_gradient_on_many_small_triangles() -> None:
    object_ = scenes.monkey(materials=[procedural()])
    seen = look_at(object_, baked(object_)[0])
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE


def test_checker() -> None:
    material = scenes.material()
    material.node_tree.links.new(checker(material.node_tree), scenes.base_color(material))
    object_ = scenes.cube(materials=[material])
    seen = look_at(object_, baked(object_)[0], each=400)
    wanted, sure = of_checker(seen.position)
    assert sure.mean() > 0.3 and np.abs(seen.color[:, 0] - wanted)[sure].max() < CLOSE


def test_ramp() -> None:
    """Black to red in object x from 0 to 1, in linear light."""
    material = scenes.material()
    tree = material.node_tree
    ramp = node(tree, "ShaderNodeValToRGB")
    ramp.color_ramp.elements[1].color = (1, 0, 0, 1)
    parts = node(tree, "ShaderNodeSeparateXYZ")
    tree.links.new(node(tree, "ShaderNodeTexCoord").outputs["Object"], parts.inputs[0])
    tree.links.new(parts.outputs["X"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], scenes.base_color(material))
    object_ = scenes.square(uv=False, materials=[material])
    seen = look_at(object_, baked(object_)[0])
    # The display's curve is steep near black: there two pixels lie 15/255 apart. Compared in linear light.
    assert decode_srgb(seen.color)[:, 0] == pytest.approx(seen.position[:, 0], abs=2 * CLOSE)
    assert (seen.color[:, 1:] == 0).all()


def test_noise_agrees_with_a_bake_at_four_times_the_side() -> None:
    material = scenes.material()
    noise = node(material.node_tree, "ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 3
    material.node_tree.links.new(noise.outputs["Color"], scenes.base_color(material))
    object_ = scenes.cube(materials=[material])
    coarse, fine = (look_at(object_, baked(object_, size)[0]) for size in (256, 1024))
    assert np.ptp(fine.color, axis=0).min() > 0.2
    assert np.abs(coarse.color - fine.color).mean() < CLOSE


@pytest.mark.parametrize(
    "kind",
    [
        "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfGlossy", "ShaderNodeBsdfGlass", "ShaderNodeBsdfTranslucent",
        "ShaderNodeBsdfToon", "ShaderNodeBsdfSheen", "ShaderNodeSubsurfaceScattering", "ShaderNodeEmission",
    ],
)  # fmt: skip
def test_every_shader_shows_its_color(kind: str) -> None:
    material = scenes.material()
    tree = material.node_tree
    tree.links.new(shader(tree, kind, gradient(tree)).outputs[0], surface(material))
    object_ = scenes.square(materials=[material])
    seen = look_at(object_, baked(object_, 64)[0])
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE


@pytest.mark.parametrize("see_through", [False, True])
def test_principled_that_only_shines(see_through: bool) -> None:
    """Of a plain black base color only the emission is seen, by its strength."""
    material = scenes.material(color=(0, 0, 0))
    tree = material.node_tree
    principled = next(each for each in tree.nodes if each.type == "BSDF_PRINCIPLED")
    tree.links.new(gradient(tree), principled.inputs["Emission Color"])
    principled.inputs["Emission Strength"].default_value = 0.5
    if see_through:
        half = node(tree, "ShaderNodeValue")
        half.outputs[0].default_value = 0.5
        tree.links.new(half.outputs[0], principled.inputs["Alpha"])
    object_ = scenes.square(materials=[material])
    seen = look_at(object_, baked(object_, 64)[0])
    wanted = encode_srgb(decode_srgb(of_gradient(seen.position)) * 0.5)
    assert np.abs(seen.color - wanted).max() < CLOSE
    assert np.abs(seen.opacity - (0.5 if see_through else 1)).max() < CLOSE


def test_mix_of_shaders_is_the_mix_of_their_colors() -> None:
    material = scenes.material()
    tree = material.node_tree
    red = shader(tree, "ShaderNodeBsdfDiffuse", (0.8, 0, 0.2))
    tree.links.new(mix(tree, 0.25, red, shader(tree, "ShaderNodeBsdfGlossy", (0, 0.4, 0.2))), surface(material))
    object_ = scenes.square(materials=[material])
    found = baked(object_, 64)[0]
    seen = look_at(object_, found)
    assert np.abs(seen.color - encode_srgb([0.6, 0.1, 0.2])).max() < CLOSE and found.look.material.alpha is None


def test_transparency_is_opacity_and_does_not_darken() -> None:
    """Through nested mixes: a half, then a checker, of a gradient."""
    material = scenes.material()
    tree = material.node_tree
    leaf = shader(tree, "ShaderNodeBsdfDiffuse", gradient(tree))
    half = mix(tree, 0.5, shader(tree, "ShaderNodeBsdfTransparent"), leaf)
    tree.links.new(mix(tree, checker(tree), shader(tree, "ShaderNodeBsdfTransparent"), half.node), surface(material))
    object_ = scenes.cube(materials=[material])
    seen = look_at(object_, baked(object_)[0], each=400)
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE
    wanted, sure = of_checker(seen.position)
    assert np.abs(seen.opacity - 0.5 * wanted)[sure].max() < CLOSE


def test_added_shaders_are_the_sum_of_their_colors() -> None:
    """Also where one of them makes an opacity necessary."""
    material = scenes.material(color=(0.2, 0.1, 0.3))
    tree = material.node_tree
    principled = scenes.base_color(material).node
    principled.inputs["Alpha"].default_value = 0.5
    both = node(tree, "ShaderNodeAddShader")
    tree.links.new(principled.outputs[0], both.inputs[0])
    tree.links.new(shader(tree, "ShaderNodeBsdfGlossy", (0.3, 0.2, 0.1)).outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], surface(material))
    object_ = scenes.square(materials=[material])
    seen = look_at(object_, baked(object_, 32)[0])
    assert np.abs(seen.color - encode_srgb([0.5, 0.3, 0.4])).max() < CLOSE and (seen.opacity == 1).all()


def test_world_position_under_a_shear() -> None:
    """A parent's scale and a child's turn make a matrix that is no location, rotation and scale."""
    material = scenes.material()
    tree = material.node_tree
    scaled = node(tree, "ShaderNodeVectorMath", operation="MULTIPLY_ADD")
    scaled.inputs[1].default_value, scaled.inputs[2].default_value = (0.1, 0.1, 0.1), (0.5, 0.5, 0.5)
    tree.links.new(node(tree, "ShaderNodeNewGeometry").outputs["Position"], scaled.inputs[0])
    tree.links.new(scaled.outputs[0], scenes.base_color(material))
    object_ = scenes.cube(materials=[material])
    object_.parent = bpy.data.objects.new("Parent", None)
    bpy.context.scene.collection.objects.link(object_.parent)
    object_.parent.scale, object_.rotation_euler, object_.scale = (1, 2, 0.5), (0.4, 0.5, 0.6), (-1, 1, 1)
    bpy.context.view_layer.update()
    seen = look_at(object_, baked(object_)[0])
    matrix = np.array(object_.matrix_world)
    world = seen.position @ matrix[:3, :3].T + matrix[:3, 3]
    assert np.abs(seen.color - encode_srgb(0.5 + 0.1 * world)).max() < CLOSE


def test_animated_values_are_those_of_the_frame() -> None:
    material = scenes.material()
    tree = material.node_tree
    color = node(tree, "ShaderNodeRGB").outputs[0]
    tree.links.new(shader(tree, "ShaderNodeBsdfDiffuse", color).outputs[0], surface(material))
    for frame, red in ((1, 0.2), (5, 0.5)):
        color.default_value = (red, 0.2, 0.2, 1)
        color.keyframe_insert("default_value", frame=frame)
    bpy.context.scene.frame_set(5)
    object_ = scenes.square(materials=[material])
    assert np.abs(look_at(object_, baked(object_, 32)[0]).color - encode_srgb([0.5, 0.2, 0.2])).max() < CLOSE


def test_output_that_only_eevee_uses() -> None:
    material = procedural()
    material.node_tree.get_output_node("ALL").target = "EEVEE"
    object_ = scenes.square(materials=[material])
    seen = look_at(object_, baked(object_, 64)[0])
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE


def outputs_for(targets: tuple[str, str], active: int) -> bpy.types.Object:
    """Red by the first output, green by the second."""
    material = scenes.material()
    tree = material.node_tree
    outputs = [tree.get_output_node("ALL"), node(tree, "ShaderNodeOutputMaterial")]
    for output, target, color in zip(outputs, targets, (RED, GREEN), strict=True):
        tree.links.new(shader(tree, "ShaderNodeBsdfDiffuse", color).outputs[0], output.inputs["Surface"])
        output.target = target
    for number, output in enumerate(outputs):
        output.is_active_output = number == active
    return scenes.square(materials=[material])


@pytest.mark.parametrize("active", [0, 1])
@pytest.mark.parametrize(
    ("targets", "shown"),
    [(("ALL", "CYCLES"), 1), (("CYCLES", "EEVEE"), 0), (("ALL", "EEVEE"), 0), (("ALL", "ALL"), -1)],
)
def test_of_several_outputs_that_of_cycles(targets: tuple[str, str], shown: int, active: int) -> None:
    """Else the active one."""
    object_ = outputs_for(targets, active)
    wanted = (RED, GREEN)[active if shown < 0 else shown]
    assert np.abs(look_at(object_, baked(object_, 32)[0]).color - encode_srgb(wanted)).max() < CLOSE


@pytest.mark.parametrize("where", ["Base Color", "Alpha", "factor"])
def test_muted_links_count_for_nothing(where: str) -> None:
    """Neither do they into a black base color, beside which a shader's emission is all that is seen."""
    material = scenes.material(color=(0, 0, 0))
    tree = material.node_tree
    principled = scenes.base_color(material).node
    principled.inputs["Emission Color"].default_value = (0.2, 0.4, 0.6, 1)
    principled.inputs["Emission Strength"].default_value = 1
    half = mix(tree, 0.5, principled, shader(tree, "ShaderNodeBsdfGlossy", (0.4, 0.2, 0)))
    tree.links.new(half, surface(material))
    link = tree.links.new(gradient(tree), half.node.inputs[0] if where == "factor" else principled.inputs[where])
    link.is_muted = True
    object_ = scenes.square(materials=[material])
    seen = look_at(object_, baked(object_, 32)[0])
    assert np.abs(seen.color - encode_srgb([0.3, 0.3, 0.3])).max() < CLOSE and (seen.opacity == 1).all()


@pytest.mark.parametrize("grouped", [False, True])
@pytest.mark.parametrize(
    ("kind", "domain"), [("FLOAT2", "CORNER"), ("FLOAT", "POINT"), ("INT", "FACE"), ("BOOLEAN", "POINT")]
)
def test_color_attribute_node_that_names_a_number(kind: str, domain: str, grouped: bool) -> None:
    """As the geometry nodes of a mask make it, or a UV map's name: Cycles itself would crash. Shown as EEVEE does."""
    object_ = scenes.square(materials=[scenes.material()])
    made = object_.data.attributes.new("Mask", kind, domain)
    for each in made.data:
        setattr(each, "vector" if kind == "FLOAT2" else "value", (0.5, 0.25) if kind == "FLOAT2" else 1)
    tree = object_.data.materials[0].node_tree
    inner = tree
    target = scenes.base_color(object_.data.materials[0])
    if grouped:
        inner = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        inner.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
        tree.links.new(node(tree, "ShaderNodeGroup", node_tree=inner).outputs[0], target)
        target = node(inner, "NodeGroupOutput").inputs[0]
    inner.links.new(node(inner, "ShaderNodeVertexColor", layer_name="Mask").outputs["Color"], target)
    wanted = (0.5, 0.25, 0) if kind == "FLOAT2" else (1, 1, 1)
    assert np.abs(look_at(object_, baked(object_, 32)[0]).color - encode_srgb(wanted)).max() < CLOSE


def test_number_that_is_the_default_color() -> None:
    material = scenes.material()
    tree = material.node_tree
    tree.links.new(node(tree, "ShaderNodeVertexColor").outputs["Color"], scenes.base_color(material))
    object_ = scenes.square(materials=[material])
    object_.data.attributes.new("Mask", "FLOAT", "POINT")
    object_.data.attributes.default_color_name = "Mask"
    assert (look_at(object_, baked(object_, 32)[0]).color == 0).all()


@pytest.mark.parametrize("value", [(0.8, 0.3, 0.1), 0.25, 1])
@pytest.mark.parametrize("kind", ["OBJECT", "mesh", "modified mesh", "INSTANCER", "VIEW_LAYER", "scene"])
def test_custom_properties(kind: str, value: float | tuple[float, ...]) -> None:
    object_ = scenes.square(materials=[scenes.material()])
    tree = object_.data.materials[0].node_tree
    if kind == "modified mesh":
        refine(object_)
    at = "mesh" if "mesh" in kind else kind
    of = {"mesh": object_.data, "VIEW_LAYER": bpy.context.view_layer, "scene": bpy.context.scene}.get(at, object_)
    of["tint"] = value
    of["idle"] = {"a": "not a number"}
    tint = node(tree, "ShaderNodeAttribute", attribute_name="tint")
    tint.attribute_type = {"mesh": "OBJECT", "scene": "VIEW_LAYER"}.get(at, at)
    tree.links.new(tint.outputs["Color"], scenes.base_color(object_.data.materials[0]))
    wanted = encode_srgb(np.broadcast_to(value, 3).astype(float))
    assert np.abs(look_at(object_, baked(object_, 32)[0]).color - wanted).max() < CLOSE


def test_no_uv_map_but_pairs_of_numbers_on_faces() -> None:
    """As USD's uniform primvars come: they are a UV map in no way but their type."""
    object_ = scenes.cube(uv=False, materials=[procedural()])
    object_.data.attributes.new("st", "FLOAT2", "FACE")
    seen = look_at(object_, baked(object_, 64)[0])
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE


def test_link_that_ends_in_nothing() -> None:
    """Since Blender 5.2 the value of the shader's own input counts."""
    material = scenes.material(color=(0.4, 0.2, 0.6))
    tree = material.node_tree
    tree.links.new(node(tree, "NodeReroute").outputs[0], scenes.base_color(material))
    black = shader(tree, "ShaderNodeBsdfGlossy", (0, 0, 0))
    tree.links.new(mix(tree, 0.5, scenes.base_color(material).node, black), surface(material))
    object_ = scenes.square(materials=[material])
    wanted = encode_srgb([0.2, 0.1, 0.3] if bpy.app.version >= (5, 2) else [0, 0, 0])
    assert np.abs(look_at(object_, baked(object_, 32)[0]).color - wanted).max() < CLOSE


def test_alpha_above_one_is_one() -> None:
    """Also to the mix that it goes into."""
    material = procedural()
    tree = material.node_tree
    principled = scenes.base_color(material).node
    bright = node(tree, "ShaderNodeValue")
    bright.outputs[0].default_value = 1.5
    tree.links.new(bright.outputs[0], principled.inputs["Alpha"])
    tree.links.new(mix(tree, 0.4, shader(tree, "ShaderNodeBsdfTransparent"), principled), surface(material))
    object_ = scenes.square(materials=[material])
    assert look_at(object_, baked(object_, 32)[0]).opacity == pytest.approx(0.4, abs=CLOSE)


def test_alpha_of_the_shader() -> None:
    material = procedural()
    tree = material.node_tree
    tree.links.new(checker(tree), scenes.base_color(material).node.inputs["Alpha"])
    object_ = scenes.cube(materials=[material])
    seen = look_at(object_, baked(object_)[0], each=400)
    wanted, sure = of_checker(seen.position)
    assert np.abs(seen.opacity - wanted)[sure].max() < CLOSE
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE


def test_shaders_inside_groups() -> None:
    """A group in a group, used twice; the groups stay as they are."""
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    inner.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketShader")
    leaf = shader(inner, "ShaderNodeBsdfDiffuse", gradient(inner))
    inner.links.new(leaf.outputs[0], node(inner, "NodeGroupOutput").inputs[0])
    outer = bpy.data.node_groups.new("Outer", "ShaderNodeTree")
    outer.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketShader")
    twice = [node(outer, "ShaderNodeGroup", node_tree=inner) for _ in range(2)]
    outer.links.new(mix(outer, 0.5, *twice), node(outer, "NodeGroupOutput").inputs[0])
    material = scenes.material()
    group = node(material.node_tree, "ShaderNodeGroup", node_tree=outer)
    material.node_tree.links.new(group.outputs[0], surface(material))
    object_ = scenes.square(materials=[material])
    seen = look_at(object_, baked(object_, 64)[0])
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE
    assert leaf.id_data == inner and [each.type for each in inner.nodes].count("BSDF_DIFFUSE") == 1


def test_shader_to_rgb_passes_the_shaders_color() -> None:
    """As toon materials have it, here turned to its negative; Cycles itself knows no such node."""
    for linked in (True, False):
        material = scenes.material()
        tree = material.node_tree
        leaf = shader(tree, "ShaderNodeBsdfDiffuse", gradient(tree) if linked else (0.2, 0.4, 0.6))
        negative = node(tree, "ShaderNodeInvert")
        converted = node(tree, "ShaderNodeShaderToRGB")
        tree.links.new(leaf.outputs[0], converted.inputs[0])
        tree.links.new(converted.outputs[0], negative.inputs["Color"])
        tree.links.new(shader(tree, "ShaderNodeEmission", negative.outputs[0]).outputs[0], surface(material))
        object_ = scenes.square(materials=[material])
        seen = look_at(object_, baked(object_, 64)[0])
        wanted = encode_srgb(1 - (0.5 + 0.3 * seen.position if linked else np.array([0.2, 0.4, 0.6])))
        assert np.abs(seen.color - wanted).max() < 2 * CLOSE


def test_a_color_at_the_shaders_place() -> None:
    material = scenes.material()
    tree = material.node_tree
    tree.links.new(mix(tree, 0.5, gradient(tree).node, shader(tree, "ShaderNodeBsdfTransparent")), surface(material))
    object_ = scenes.square(materials=[material])
    seen = look_at(object_, baked(object_, 64)[0])
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE
    assert seen.opacity == pytest.approx(0.5, abs=CLOSE)


def test_neighbors_never_bleed() -> None:
    """Each face of a mesh of triangles, quads and hexagons has a color of its own."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=9, ring_count=7)
    sphere = bpy.context.object
    bpy.ops.mesh.primitive_cylinder_add(vertices=6)
    object_ = bpy.context.object
    sphere.select_set(True)
    bpy.ops.object.join()
    mesh = object_.data
    colors = np.random.default_rng(0).integers(0, 2, (len(mesh.polygons), 3)).astype(float)
    mesh.color_attributes.new("Decoy", "FLOAT_COLOR", "CORNER")
    painted = mesh.color_attributes.new("Paint", "FLOAT_COLOR", "CORNER")
    mesh.color_attributes.render_color_index = 1
    for face in mesh.polygons:
        for loop in face.loop_indices:
            painted.data[loop].color = (*colors[face.index], 1)
    material = scenes.material()
    material.node_tree.links.new(
        node(material.node_tree, "ShaderNodeVertexColor").outputs[0], scenes.base_color(material)
    )
    mesh.materials.append(material)
    seen = look_at(object_, baked(object_, 128)[0])
    assert {3, 4, 6} == {len(face.vertices) for face in mesh.polygons}
    assert np.abs(seen.color - colors[seen.polygon]).max() < CLOSE


def inverted(path: Path) -> bpy.types.Material:
    """An image by the UV map, turned to its negative by a node; its alpha is that of the shader."""
    material = scenes.material("Negative")
    tree = material.node_tree
    image = scenes.image_node(material, bpy.data.images.load(str(path)), link=False)
    image.interpolation = "Closest"
    node_ = node(tree, "ShaderNodeInvert")
    tree.links.new(image.outputs[0], node_.inputs["Color"])
    tree.links.new(node_.outputs[0], scenes.base_color(material))
    tree.links.new(image.outputs[1], scenes.base_color(material).node.inputs["Alpha"])
    return material


@pytest.mark.parametrize("overlapping", [False, True])
def test_images_keep_the_uv_map_that_they_had(tmp_path: Path, overlapping: bool) -> None:
    """Baked by the own map where it serves, by another where faces overlap; the image is read by the own in both.

    Its colors are not darkened where its alpha is a half.
    """
    alpha = np.random.default_rng(1).choice([128, 255], (4, 4, 1)).astype(np.uint8)
    pixels = np.kron(np.concatenate([scenes.noise(4), alpha], axis=2), np.ones((16, 16, 1), np.uint8))
    make = scenes.cube if overlapping else scenes.square
    object_ = make(materials=[inverted(scenes.write_png(tmp_path / "image.png", pixels))])
    uv = np.empty(2 * len(object_.data.loops), np.float32)
    object_.data.uv_layers[0].uv.foreach_get("vector", uv)
    rendered = object_.data.uv_layers.new(name="For rendering")
    rendered.uv.foreach_set("vector", uv)
    rendered.active_render = True
    object_.data.uv_layers[0].uv.foreach_set("vector", uv[::-1] / 3)
    object_.data.uv_layers.active_index = 0
    found = baked(object_)[0]
    loops = np.array([face.loops[:] for face in object_.data.loop_triangles])
    own = uv.reshape(-1, 2)[loops]
    assert np.array_equal(own, found.corners) is not overlapping
    assert (found.look.material.uv == 0) is not overlapping
    places = np.random.default_rng(0).dirichlet((1, 1, 1), 300)
    worst = 0.0
    for face in range(len(loops)):
        original = places @ own[face]
        sure = (np.abs(original * 4 - np.round(original * 4)) > 0.1).all(axis=1)  # no step of the image is near
        wanted = 1 - decode_srgb(Texture(pixels, interpolation="closest").lookup(original[sure]))
        seen = found.look.material.color.lookup(places[sure] @ found.corners[face].astype(float))
        # Color times alpha in 8 bits has 128 steps here; in linear light they are up to 0.018 high.
        worst = max(worst, np.abs(decode_srgb(seen) - wanted).max())
    assert worst < 0.02


def test_two_slots_and_one_without_faces() -> None:
    plain = scenes.material("Plain")
    tree = plain.node_tree
    tree.links.new(shader(tree, "ShaderNodeBsdfDiffuse", (0.1, 0.5, 0.9)).outputs[0], surface(plain))
    object_ = scenes.cube(materials=[plain, scenes.material("Unused"), procedural()])
    for face in object_.data.polygons[:2]:
        face.material_index = 2
    found = baked(object_)
    assert set(found) == {0, 2}
    assert np.abs(look_at(object_, found[0], 0).color - encode_srgb([0.1, 0.5, 0.9])).max() < CLOSE
    seen = look_at(object_, found[2], 2)
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE


def bend(object_: bpy.types.Object) -> None:
    object_.modifiers.new("Bend", "SIMPLE_DEFORM").angle = 1.0


def refine(object_: bpy.types.Object) -> None:
    object_.modifiers.new("Refine", "SUBSURF").levels = 2


def thicken(object_: bpy.types.Object) -> None:
    object_.modifiers.new("Thicken", "SOLIDIFY").thickness = 0.3


@pytest.mark.parametrize("modify", [bend, refine, thicken])
def test_modifiers_are_applied(modify: Callable[[bpy.types.Object], None]) -> None:
    object_ = scenes.cube(materials=[procedural()])
    modify(object_)
    seen = look_at(object_, baked(object_)[0])
    assert np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE


@pytest.mark.parametrize("modify", [bend, refine])
def test_generated_coordinates_are_those_before_the_modifiers_bend_it(
    modify: Callable[[bpy.types.Object], None],
) -> None:
    """They run from 0 to 1 through the box of the mesh as it was modeled, and stick to it."""
    object_ = scenes.cube(materials=[procedural(coordinates="Generated")])
    at_rest = np.array([vertex.co for vertex in object_.data.vertices])
    modify(object_)
    seen = look_at(object_, baked(object_)[0], each=3)  # the corners only
    source, depsgraph = evaluated(object_)
    bent = np.array([vertex.co for vertex in source.to_mesh(depsgraph=depsgraph).vertices])
    source.to_mesh_clear()
    original = at_rest if len(at_rest) == len(bent) else bent
    nearest = np.linalg.norm(seen.position[:, None] - bent, axis=2).argmin(axis=1)
    assert np.abs(seen.color - of_gradient((original[nearest] + 1) / 2)).max() < CLOSE


def curve() -> bpy.types.ID:
    made = bpy.data.curves.new("Curve", "CURVE")
    made.dimensions, made.bevel_depth = "3D", 0.2
    made.splines.new("POLY").points.add(2)
    for place, point in enumerate(made.splines[0].points):
        point.co = (place, place % 2, 0, 1)
    return made


def text() -> bpy.types.ID:
    made = bpy.data.curves.new("Text", "FONT")
    made.body, made.extrude = "Go", 0.1
    return made


def ball() -> bpy.types.ID:
    made = bpy.data.metaballs.new("Ball")
    made.elements.new()
    return made


@pytest.mark.parametrize("make", [curve, text, ball])
def test_other_kinds_of_objects(make: Callable[[], bpy.types.ID]) -> None:
    data = make()
    data.materials.append(procedural())
    object_ = bpy.data.objects.new("Other", data)
    bpy.context.scene.collection.objects.link(object_)
    seen = look_at(object_, baked(object_)[0])
    assert len(seen.color) and np.abs(seen.color - of_gradient(seen.position)).max() < CLOSE


def test_users_scene_stays_as_it_is() -> None:
    scenes.cube("Other").select_set(True)
    object_ = scenes.cube(materials=[procedural()])
    bpy.context.view_layer.objects.active = object_
    scene = bpy.context.scene
    scene.frame_current = 7

    def state() -> list[object]:
        return [
            bpy.context.scene.name, bpy.context.view_layer.name, bpy.context.object.name,
            [each.name for each in bpy.context.selected_objects], scene.render.engine, scene.frame_current,
            scene.cycles.samples, scene.render.bake.margin, object_.mode, object_.data.uv_layers.active.name,
            [each.name for each in object_.material_slots[0].material.node_tree.nodes], object_.data.users,
        ]  # fmt: skip

    before = state()
    baked(object_, 32)
    assert state() == before


def test_nothing_stays_after_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    object_ = scenes.cube("Crate", materials=[procedural("Rust")])

    def fail(*_: object) -> None:
        raise RuntimeError("Error: it\nError: the baker is ill\n")

    monkeypatch.setattr(bake, "_run", fail)
    before = scenes.blocks()
    with pytest.raises(MeshError) as caught:
        baked(object_)
    assert str(caught.value) == "baking Crate failed: the baker is ill"
    assert scenes.blocks() == before


def test_blender_without_cycles() -> None:
    object_ = scenes.cube("Crate", materials=[procedural("Rust")])
    bpy.ops.preferences.addon_disable(module="cycles")
    before = scenes.blocks()
    try:
        with pytest.raises(MeshError, match="baking Crate failed: this Blender has no Cycles"):
            baked(object_)
        assert scenes.blocks() == before
    finally:
        bpy.ops.preferences.addon_enable(module="cycles")


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e30])
def test_coordinates_that_are_no_numbers(bad: float) -> None:
    object_ = scenes.cube(materials=[procedural()])
    object_.data.vertices[0].co.x = bad
    found = baked(object_, 32)[0]
    assert np.isfinite(found.corners).all() and found.corners.shape == (12, 3, 2)


def test_colors_outside_the_range_are_clipped() -> None:
    material = scenes.material()
    tree = material.node_tree
    shining = shader(tree, "ShaderNodeEmission", (5.0, 0.5, -3.0))
    tree.links.new(shining.outputs[0], surface(material))
    object_ = scenes.square(materials=[material])
    seen = look_at(object_, baked(object_, 32)[0])
    assert np.abs(seen.color - encode_srgb([1, 0.5, 0])).max() < CLOSE


def test_standard_output_of_a_script_stays_its_own() -> None:
    """Cycles prints from C; what a script writes to the standard output it took is all that arrives."""
    program = """
import sys
sys.path[:0] = [sys.argv[1]]
from fmqm_addon.cli.process import reserve_stdout
out = reserve_stdout()
from tests.blender import scenes
from tests.blender.baking import test_bake
scenes.clear()
test_bake.baked(scenes.cube(materials=[test_bake.procedural()]), 32)
print("only this", file=out, flush=True)
"""
    root = str(Path(__file__).resolve().parents[3])
    done = subprocess.run([sys.executable, "-c", program, root], capture_output=True, text=True, check=True)
    assert done.stdout == "only this\n"


def test_meshes_are_baked_where_they_cannot_be_read() -> None:
    object_ = scenes.cube("Crate", materials=[procedural("Rust"), scenes.material("Plain", (0.1, 0.5, 0.9))])
    object_.matrix_world = scenes.PLACED
    object_.data.polygons[3].material_index = 1
    arrays = mesh_arrays([object_], "asset", Reading(bake=128))
    assert [each.how for each in arrays.materials] == ["baked", "read"]
    assert [note for note in arrays.notes if "Rust" in note and "baked at 128 x 128" in note]
    surface = prepare_surface(arrays, BVHQuery)
    rng = np.random.default_rng(0)
    triangle, place = rng.integers(0, 12, 500), rng.dirichlet((1, 1, 1), 500)
    position = np.einsum("nk,nkc->nc", place, surface.vertices[surface.triangles[triangle]])
    local = surface.frame.leave(position) @ np.linalg.inv(np.array(scenes.PLACED))[:3, :3].T
    local += np.linalg.inv(np.array(scenes.PLACED))[:3, 3]
    plain = surface.material[triangle] == 1
    wanted = np.where(plain[:, None], encode_srgb([0.1, 0.5, 0.9]), of_gradient(local))
    assert plain.any() and np.abs(surface.color_at(triangle, place) - wanted).max() < CLOSE


@pytest.mark.parametrize("size", [0, 64], ids=["forbidden", "failing"])
def test_plain_color_where_baking_is_impossible(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("Error: the baker is ill")

    monkeypatch.setattr(bake, "_run", fail)
    material = procedural("Rust")
    scenes.base_color(material).default_value = (0.1, 0.5, 0.9, 1)
    arrays = mesh_arrays([scenes.cube("Crate", materials=[material])], "asset", Reading(bake=size))
    assert arrays.materials[0].how == "plain"
    assert arrays.materials[0].color.lookup(np.zeros((1, 2)))[0] == pytest.approx(encode_srgb([0.1, 0.5, 0.9]))
    (warning,) = arrays.warnings
    assert "material Rust: Texture Coordinate is not read" in warning and "plain color" in warning
    assert ("the baker is ill" in warning) is (size > 0)


def test_plain_color_of_the_first_shader_that_has_one() -> None:
    material = scenes.material()
    tree = material.node_tree
    red, green = (shader(tree, f"ShaderNodeBsdf{kind}", color) for kind, color in (("Diffuse", RED), ("Glossy", GREEN)))
    both = mix(tree, 0.5, red, green)
    tree.links.new(mix(tree, 0.5, shader(tree, "ShaderNodeBsdfTransparent"), both.node), surface(material))
    arrays = mesh_arrays([scenes.cube("Crate", materials=[material])], "asset", Reading(bake=0))
    assert arrays.materials[0].color.lookup(np.zeros((1, 2)))[0] == pytest.approx(encode_srgb(RED))
    assert "its plain color is taken" in arrays.warnings[0]


def test_missing_images_are_no_secret_of_the_baker(tmp_path: Path) -> None:
    path = scenes.write_png(tmp_path / "image.png", scenes.noise(4))
    object_ = scenes.square(materials=[inverted(path)])
    path.unlink()
    with pytest.raises(MeshError, match=r"image\.png: the base-color image is missing"):
        mesh_arrays([object_], "asset")
    arrays = mesh_arrays([object_], "asset", Reading(bake=32, stand_in=True))
    assert any("image.png" in warning and "magenta" in warning for warning in arrays.warnings)
    assert arrays.materials[0].how == "baked" and [image.missing for image in arrays.materials[0].images] == [True]
    seen = arrays.materials[0].color.lookup(arrays.corners[0].astype(float))
    assert np.abs(seen - [0, 1, 0]).max() < CLOSE  # magenta's negative
    assert mesh_arrays([object_], "asset", Reading(bake=0)).materials[0].how == "plain"


def test_huge_images_are_not_decoded_for_the_baker(tmp_path: Path) -> None:
    object_ = scenes.square(materials=[inverted(scenes.write_png(tmp_path / "image.png", scenes.noise(40)))])
    with pytest.raises(MeshError, match=r"image\.png: the image promises 40 x 40 pixels, more than the 32 a side"):
        mesh_arrays([object_], "asset", Reading(limits=ImageLimits(side=32)))
