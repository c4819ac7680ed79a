# SPDX-License-Identifier: GPL-3.0-or-later
"""What the mark "has changed" notices of an asset, and what it must not take for a change."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.scene.fingerprint import fingerprint, in_edit_mode
from fmqm_addon.blender.scene.target import target_of
from tests.blender import scenes

Object = bpy.types.Object
Change = Callable[[Object], None]


def mark(object_: Object, bare: bool = False) -> str:
    bpy.context.view_layer.update()
    return fingerprint(target_of(object_, bare), True)


def new_node(tree: bpy.types.NodeTree, kind: str, **values: object) -> bpy.types.Node:
    node = tree.nodes.new(kind)
    for name, value in values.items():
        setattr(node, name, value)
    return node


def group_in(tree: bpy.types.NodeTree, name: str) -> bpy.types.NodeTree:
    """A new node group, used in a tree."""
    inner = bpy.data.node_groups.new(name, tree.bl_idname)
    new_node(tree, tree.bl_idname.replace("Tree", "Group"), node_tree=inner)
    return inner


@pytest.fixture
def everything(tmp_path: Path) -> Object:
    """A monkey with all of it: nodes in groups, Geometry Nodes, UV maps, weights, shape keys, helpers, a texture."""
    material = scenes.textured(scenes.write_png(tmp_path / "a.png", scenes.noise(8)))
    monkey = scenes.monkey(materials=[material])
    tree = material.node_tree
    for kind in ("RGB", "Value", "ValToRGB", "RGBCurve", "Mapping", "Mix"):
        new_node(tree, f"ShaderNode{kind}", name=kind)
    inner = group_in(group_in(tree, "Outer"), "Inner")
    new_node(inner, "ShaderNodeValue", name="Deep")
    new_node(inner, "ShaderNodeValToRGB", name="Deep Ramp")

    mesh = monkey.data
    mesh.uv_layers.new(name="Second")
    mesh.color_attributes.new("Color", "FLOAT_COLOR", "POINT")
    mesh.attributes.new("Own", "FLOAT", "POINT").data[0].value = 0.5
    monkey.vertex_groups.new(name="Group").add(range(0, 500, 2), 0.5, "REPLACE")
    for name in ("Basis", "Smile"):
        monkey.shape_key_add(name=name)
    mesh.shape_keys.key_blocks["Smile"].value = 0.5

    texture = bpy.data.textures.new("Clouds", "CLOUDS")
    texture.use_color_ramp = True
    displace = monkey.modifiers.new("Displace", "DISPLACE")
    displace.texture, displace.vertex_group, displace.strength = texture, "Group", 0.1
    warp = monkey.modifiers.new("Warp", "WARP")
    cutter = scenes.cube("Cutter")
    cutter.modifiers.new("Bevel", "BEVEL").width = 0.1
    warp.object_from = warp.object_to = cutter
    warp.falloff_type = "CURVE"
    nodes = monkey.modifiers.new("Nodes", "NODES")
    nodes.node_group = geometry = bpy.data.node_groups.new("Geometry", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        geometry.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    geometry.interface.new_socket("Size", in_out="INPUT", socket_type="NodeSocketFloat")
    start, end = new_node(geometry, "NodeGroupInput"), new_node(geometry, "NodeGroupOutput")
    move = new_node(geometry, "GeometryNodeTransform", name="Move")
    geometry.links.new(start.outputs[0], move.inputs["Geometry"])
    geometry.links.new(move.outputs[0], end.inputs[0])
    new_node(geometry, "ShaderNodeFloatCurve", name="Curve")
    new_node(group_in(geometry, "Inner Geometry"), "ShaderNodeValue", name="Deep")
    curve = bpy.data.objects.new("Curve", bpy.data.curves.new("Curve", "CURVE"))
    bpy.context.scene.collection.objects.link(curve)
    curve.data.splines.new("BEZIER").bezier_points.add(1)
    new_node(geometry, "GeometryNodeObjectInfo", name="Info").inputs["Object"].default_value = curve
    return monkey


def shader(name: str) -> bpy.types.Node:
    return bpy.data.materials["Textured"].node_tree.nodes[name]


def group(tree: str, name: str) -> bpy.types.Node:
    return bpy.data.node_groups[tree].nodes[name]


def set_size(monkey: Object) -> None:
    modifier = monkey.modifiers["Nodes"]
    size = next(item.identifier for item in modifier.node_group.interface.items_tree if item.name == "Size")
    if hasattr(modifier, "properties"):
        getattr(modifier.properties.inputs, size).value = 0.7
    else:
        modifier[size] = 0.7


def put(thing: object, name: str, value: object) -> None:
    assert getattr(thing, name) != value
    setattr(thing, name, value)


CHANGES: dict[str, Change] = {
    "RGB node": lambda _: put(shader("RGB").outputs[0], "default_value", (1, 0, 0, 1)),
    "Value node": lambda _: put(shader("Value").outputs[0], "default_value", 0.25),
    "color ramp": lambda _: put(shader("ValToRGB").color_ramp.elements[0], "position", 0.3),
    "color of a ramp": lambda _: put(shader("ValToRGB").color_ramp.elements[1], "color", (1, 0, 0, 1)),
    "curve": lambda _: put(shader("RGBCurve").mapping.curves[0].points[0], "location", (0, 0.4)),
    "point of a curve": lambda _: shader("RGBCurve").mapping.curves[3].points.new(0.5, 0.6),
    "mapping": lambda _: put(shader("Mapping").inputs["Scale"], "default_value", (2, 1, 1)),
    "kind of mix": lambda _: put(shader("Mix"), "data_type", "RGBA"),
    "muted node": lambda _: put(shader("RGB"), "mute", True),
    "node in a group in a group": lambda _: put(group("Inner", "Deep").outputs[0], "default_value", 0.25),
    "ramp in a group": lambda _: put(group("Inner", "Deep Ramp").color_ramp, "interpolation", "EASE"),
    "link": lambda _: shader("RGB").id_data.links.new(shader("RGB").outputs[0], shader("ValToRGB").inputs[0]),
    "node of Geometry Nodes": lambda _: put(group("Geometry", "Move").inputs["Scale"], "default_value", (2, 1, 1)),
    "link of Geometry Nodes": lambda _: bpy.data.node_groups["Geometry"].links.remove(
        bpy.data.node_groups["Geometry"].links[0]
    ),
    "curve in Geometry Nodes": lambda _: group("Geometry", "Curve").mapping.curves[0].points.new(0.5, 0.6),
    "group in Geometry Nodes": lambda _: put(group("Inner Geometry", "Deep").outputs[0], "default_value", 0.25),
    "object in Geometry Nodes": lambda _: put(
        bpy.data.curves["Curve"].splines[0].bezier_points[0], "handle_left", (0, 0, 1)
    ),
    "value of the modifier": set_size,
    "another UV map": lambda o: put(o.data.uv_layers["Second"].uv[5], "vector", (0.3, 9)),
    "which UV map is shown": lambda o: put(o.data.uv_layers["Second"], "active_render", True),
    "vertex color": lambda o: put(o.data.color_attributes["Color"].data[3], "color", (1, 0, 0, 1)),
    "attribute": lambda o: put(o.data.attributes["Own"].data[3], "value", 0.2),
    "weight": lambda o: o.vertex_groups["Group"].add([4], 0.75, "REPLACE"),
    "vertex out of a group": lambda o: o.vertex_groups["Group"].remove([4]),
    "shape key": lambda o: put(o.data.shape_keys.key_blocks["Smile"].points[7], "co", (0, 0, 2)),
    "value of a shape key": lambda o: put(o.data.shape_keys.key_blocks["Smile"], "value", 0.25),
    "texture of a modifier": lambda _: put(bpy.data.textures["Clouds"], "noise_scale", 0.5),
    "ramp of a texture": lambda _: put(bpy.data.textures["Clouds"].color_ramp.elements[0], "position", 0.3),
    "curve of a modifier": lambda o: o.modifiers["Warp"].falloff_curve.curves[0].points.new(0.5, 0.2),
    "place of a helper": lambda _: put(bpy.data.objects["Cutter"], "location", (0, 0, 1)),
    "modifier of a helper": lambda _: put(bpy.data.objects["Cutter"].modifiers["Bevel"], "width", 0.2),
    "modifier off": lambda o: put(o.modifiers["Displace"], "show_viewport", False),
    "material of a face": lambda o: put(o.data.polygons[3], "material_index", 1),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_what_changes_the_look_changes_the_mark(everything: Object, change: Change) -> None:
    before = mark(everything)
    assert mark(everything) == before
    change(everything)
    assert mark(everything) != before


def edit_mode(monkey: Object) -> None:
    bpy.context.view_layer.objects.active = monkey
    for mode in ("EDIT", "OBJECT", "SCULPT", "OBJECT", "WEIGHT_PAINT", "OBJECT"):
        bpy.ops.object.mode_set(mode=mode)


def select_all(monkey: Object) -> None:
    bpy.context.view_layer.objects.active = monkey
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.hide(unselected=False)
    bpy.ops.mesh.reveal()
    bpy.ops.object.mode_set(mode="OBJECT")
    for polygon in monkey.data.polygons[:9]:
        polygon.select, polygon.hide = True, True


def tidy_nodes(monkey: Object) -> None:
    for tree in (*bpy.data.node_groups, bpy.data.materials["Textured"].node_tree):
        for node in tree.nodes:
            node.location, node.select, node.hide, node.label = (99, 99), True, True, "Label"
            node.use_custom_color = True
        tree.nodes.active = tree.nodes[0]
        new_node(tree, "NodeFrame")


def look_around(monkey: Object) -> None:
    for modifier in monkey.modifiers:
        modifier.show_expanded = False
    monkey.select_set(False)
    monkey.hide_set(True)
    monkey.display_type, monkey.show_name = "WIRE", True
    monkey.data.uv_layers["Second"].active = True
    monkey.active_shape_key_index = 1
    monkey.vertex_groups.active_index = 0
    bpy.data.materials["Textured"].preview_render_type = "CUBE"


def next_frame(monkey: Object) -> None:
    bpy.context.scene.frame_set(7)


def evaluate(monkey: Object) -> None:
    evaluated = monkey.evaluated_get(bpy.context.evaluated_depsgraph_get())
    evaluated.to_mesh()
    evaluated.to_mesh_clear()


UNCHANGED: list[Change] = [edit_mode, select_all, tidy_nodes, look_around, next_frame, evaluate]


@pytest.mark.parametrize("act", UNCHANGED)
def test_what_is_no_change_is_no_mark(everything: Object, act: Change) -> None:
    before = mark(everything)
    act(everything)
    assert mark(everything) == before


def test_the_mark_is_that_of_the_saved_file(everything: Object, tmp_path: Path) -> None:
    before, path = mark(everything), str(tmp_path / "saved.blend")
    for _ in range(2):
        bpy.ops.wm.save_as_mainfile(filepath=path)
        assert mark(everything) == before
        bpy.ops.wm.open_mainfile(filepath=path)
        everything = bpy.data.objects["Monkey"]
        assert mark(everything) == before


def test_in_edit_mode_the_mark_is_that_of_leaving_it(everything: Object) -> None:
    before = mark(everything)
    bpy.context.view_layer.objects.active = everything
    bpy.ops.object.mode_set(mode="EDIT")
    assert in_edit_mode(target_of(everything)) and mark(everything) == before
    bpy.ops.object.mode_set(mode="OBJECT")
    assert not in_edit_mode(target_of(everything)) and mark(everything) == before


def test_without_modifiers_weights_are_of_no_matter(everything: Object) -> None:
    before = mark(everything, bare=True)
    everything.vertex_groups["Group"].add([4], 0.75, "REPLACE")
    everything.modifiers["Displace"].strength = 3
    assert mark(everything, bare=True) == before


def test_faces_of_other_corners(everything: Object) -> None:
    """The same corners in the same order, cut into other faces."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 1, 0), (2, 2, 0), (1, 2, 0)]
    marks = set()
    for cut in (3, 4):
        order = [0, 1, 2, 3, 4, 5, 6]
        object_ = scenes.add(f"Cut{cut}", corners, [order[:cut], order[cut:]], uv=False)
        marks.add(fingerprint(target_of(object_), True))
    assert len(marks) == 2


def test_an_instanced_collection_marks(everything: Object) -> None:
    held = bpy.data.collections.new("Held")
    held.objects.link(everything)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", held
    bpy.context.scene.collection.objects.link(instance)
    before = mark(instance)
    held.instance_offset = (0, 0, 1)
    moved = mark(instance)
    everything.modifiers["Displace"].strength = 3
    assert len({before, moved, mark(instance)}) == 3


def test_it_is_quick_on_large_meshes() -> None:
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=424, y_subdivisions=424)
    target = target_of(bpy.context.object)
    times = []
    for _ in range(5):
        began = time.perf_counter()
        fingerprint(target, True)
        times.append(time.perf_counter() - began)
    print(f"{len(bpy.context.object.data.polygons):,} faces in {np.median(times):.3f} s")
    assert min(times) < 0.3
