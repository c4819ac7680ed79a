# SPDX-License-Identifier: GPL-3.0-or-later
"""What is measured: every kind of object that has a surface, its instances, and what renders show of files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mathutils import Euler, Matrix, Vector

from fmqm_addon.blender.baking import bake
from fmqm_addon.blender.files.load import load_asset, load_mesh
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene import mesh_arrays as mesh_module
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.evaluated import evaluated
from fmqm_addon.blender.scene.fingerprint import fingerprint
from fmqm_addon.blender.scene.measure import measuring
from fmqm_addon.blender.scene.members import check_object, metaball_mother, scene_members
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays
from fmqm_addon.blender.scene.target import take, target_of
from fmqm_addon.comparison.alignment import align
from fmqm_addon.comparison.measurement import Measurement
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.colorspace import decode_srgb
from fmqm_addon.metric.errors import MeshError
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.surface import MeshArrays
from tests.blender import scenes


def linked(object_: bpy.types.Object, collection: bpy.types.Collection | None = None) -> bpy.types.Object:
    (collection or bpy.context.scene.collection).objects.link(object_)
    return object_


def collection(name: str, parent: bpy.types.Collection | None = None) -> bpy.types.Collection:
    made = bpy.data.collections.new(name)
    (parent or bpy.context.scene.collection).children.link(made)
    return made


def instancer(name: str, of: bpy.types.Collection, where: bpy.types.Collection | None = None) -> bpy.types.Object:
    made = linked(bpy.data.objects.new(name, None), where)
    made.instance_type, made.instance_collection = "COLLECTION", of
    return made


def library(name: str) -> bpy.types.Collection:
    """A collection that only instances show."""
    made = collection(name)
    bpy.context.view_layer.layer_collection.children[name].exclude = True
    return made


def triangles(arrays: MeshArrays) -> np.ndarray:
    """(T, 3, 3) positions, in an order of their own: for comparing sets of triangles."""
    rows = np.round(arrays.positions[arrays.triangles].reshape(-1, 9), 4) + 0.0
    return rows[np.lexsort(rows.T)]


# Kinds of objects


def added(operator: Callable[[], object], name: str) -> bpy.types.Object:
    operator()
    made = bpy.context.object
    made.name = name
    made.matrix_world = scenes.PLACED
    return made


def tube() -> bpy.types.Object:
    made = added(bpy.ops.curve.primitive_bezier_circle_add, "Tube")
    made.data.bevel_depth = 0.1
    return made


def text() -> bpy.types.Object:
    made = added(bpy.ops.object.text_add, "Text")
    made.data.extrude = 0.1
    made.modifiers.new("Mirror", "MIRROR")
    return made


def patch() -> bpy.types.Object:
    return added(bpy.ops.surface.primitive_nurbs_surface_sphere_add, "Patch")


def balls() -> bpy.types.Object:
    mother = added(bpy.ops.object.metaball_add, "Ball")
    bpy.ops.object.metaball_add(location=(3, 2, 1))
    bpy.context.object.name = "Ball.001"
    bpy.context.object.parent = mother  # moved alone, the two would flow together otherwise
    mother.data.render_resolution = mother.data.resolution
    mother.update_tag()  # Blender does not notice that a name makes them flow together
    return mother


KINDS = [tube, text, patch, balls]


@pytest.mark.parametrize("hidden", [False, True], ids=["visible", "hidden"])
@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
def test_kinds_have_the_surface_that_blender_converts_them_to(
    make: Callable[[], bpy.types.Object], hidden: bool
) -> None:
    object_ = make()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    converted = bpy.data.objects.new("Converted", bpy.data.meshes.new_from_object(object_.evaluated_get(depsgraph)))
    linked(converted).matrix_world = object_.matrix_world
    wanted = mesh_arrays([converted], "asset")
    object_.hide_viewport = hidden
    before = scenes.blocks()
    mine = take(target_of(object_)).world()
    assert scenes.blocks() == before
    assert len(mine.triangles) == len(wanted.triangles) > 100
    np.testing.assert_allclose(triangles(mine), triangles(wanted), atol=2e-4)


def test_metaballs_belong_to_their_mother() -> None:
    mother = balls()
    child = bpy.data.objects["Ball.001"]
    assert metaball_mother(child) == mother
    with pytest.raises(MeshError, match=r"^Ball\.001: .* belongs to Ball; choose that$"):
        take(target_of(child))
    assert scene_members() == [mother]


EDITS: dict[Callable[[], bpy.types.Object], Callable[[bpy.types.ID], None]] = {
    tube: lambda data: setattr(data.splines[0].bezier_points[0], "co", (1, 2, 3)),
    text: lambda data: setattr(data, "body", "Other"),
    patch: lambda data: setattr(data.splines[0].points[0], "co", (1, 2, 3, 1)),
    balls: lambda data: setattr(data.elements[0], "radius", 3.0),
}


@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
def test_edits_are_noticed(make: Callable[[], bpy.types.Object]) -> None:
    object_ = make()
    bpy.context.view_layer.update()
    before = fingerprint(target_of(object_), False)
    assert fingerprint(target_of(object_), False) == before
    object_.location.x += 1
    bpy.context.view_layer.update()
    assert fingerprint(target_of(object_), False) == before
    assert fingerprint(target_of(object_), True) != before
    EDITS[make](object_.data)
    assert fingerprint(target_of(object_), False) != before


def test_inputs_of_geometry_nodes_are_noticed() -> None:
    """Where Blender keeps them differs between its versions."""
    tree = bpy.data.node_groups.new("Inputs", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    size, other = (
        tree.interface.new_socket(name, in_out="INPUT", socket_type=f"NodeSocket{name}").identifier
        for name in ("Float", "Object")
    )
    object_ = scenes.cube()
    nodes = object_.modifiers.new("Nodes", "NODES")
    marks = [fingerprint(target_of(object_), False)]
    nodes.node_group = tree
    marks.append(fingerprint(target_of(object_), False))
    assert fingerprint(target_of(object_), False) == marks[-1]
    for identifier, value in ((size, 2.5), (other, scenes.square())):
        if hasattr(nodes, "properties"):
            getattr(nodes.properties.inputs, identifier).value = value
        else:
            nodes[identifier] = value
        marks.append(fingerprint(target_of(object_), False))
    assert len(set(marks)) == 4


@pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
def test_kinds_score_1_against_themselves(make: Callable[[], bpy.types.Object]) -> None:
    object_ = make()
    (outcome,) = measuring(
        target_of(object_), [target_of(object_)], PairOptions(settings=Settings(samples=800, patches=8))
    ).run()
    assert outcome.error is None and list(outcome.scores) == [1.0] * 5


@pytest.mark.parametrize("kind", ["CAMERA", "ARMATURE", "LIGHT"])
def test_other_kinds_are_refused(kind: str) -> None:
    data = {
        "CAMERA": lambda: bpy.data.cameras.new("Other"),
        "ARMATURE": lambda: bpy.data.armatures.new("Other"),
        "LIGHT": lambda: bpy.data.lights.new("Other", "POINT"),
    }[kind]()
    with pytest.raises(MeshError, match=f"^Other: the object is of type {kind.lower()}; a mesh, curve"):
        check_object(linked(bpy.data.objects.new("Other", data)))


def test_a_curve_without_a_surface() -> None:
    with pytest.raises(MeshError, match="Line: the mesh has no faces"):
        take(target_of(added(bpy.ops.curve.primitive_bezier_circle_add, "Line")))


# Instances


@pytest.mark.parametrize("hidden", [False, True], ids=["visible", "hidden"])
def test_nested_collection_instances(hidden: bool) -> None:
    inner, outer = library("Inner"), library("Outer")
    scenes.square("Square", collection=inner).location.z = 0.5
    linked(text(), inner)
    inner.instance_offset = (0, 0, 0.25)
    instancer("In", inner, outer).matrix_world = scenes.PLACED
    scenes.cube("Cube", collection=outer)
    top = instancer("Top", outer)
    top.matrix_world = Matrix.LocRotScale((5, 6, 7), Matrix.Rotation(0.3, 3, "X"), (-1, 2, 1))
    bpy.context.view_layer.update()
    there = top.matrix_world @ scenes.PLACED @ Matrix.Translation((0, 0, -0.25))
    square = np.array([there @ (vertex.co + Vector((0, 0, 0.5))) for vertex in bpy.data.meshes["Square"].vertices])
    top.hide_viewport = hidden
    before = scenes.blocks()
    arrays = take(target_of(top)).world()
    assert scenes.blocks() == before
    letters = len(mesh_arrays([bpy.data.objects["Text"]], "asset").triangles)
    assert len(arrays.triangles) == 2 + 12 + letters
    distance = np.abs(arrays.positions[None] - square[:, None]).max(axis=2).min(axis=1)
    assert distance.max() < 1e-5


NUMBERS = st.floats(-3, 3, width=32)
FACTORS = st.floats(0.25, 4, width=32) | st.floats(-4, -0.25, width=32)
TRANSFORMS = st.builds(
    lambda place, angles, scale: Matrix.LocRotScale(place, Euler(angles), scale),
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
    st.tuples(NUMBERS, NUMBERS, NUMBERS),
    st.tuples(FACTORS, FACTORS, FACTORS),
)


@settings(max_examples=25)
@given(st.lists(TRANSFORMS, min_size=4, max_size=4))
def test_transforms_of_parents_and_instances_compose(matrices: list[Matrix]) -> None:
    """Mirrors and shears included: a square under a parent, in a collection, instanced by the child of an empty."""
    scenes.clear()
    shape = library("Shape")
    inside, square = linked(bpy.data.objects.new("Inside", None), shape), scenes.square(collection=shape)
    top, outside = instancer("Top", shape), linked(bpy.data.objects.new("Outside", None))
    square.parent, top.parent = inside, outside
    chain = (outside, top, inside, square)
    for object_, matrix in zip(chain, matrices, strict=True):
        object_.matrix_basis = matrix
    # Blender keeps location, rotation, scale: near a gimbal lock that is not quite the matrix that it was given.
    kept = [np.array(object_.matrix_basis, np.float64) for object_ in chain]
    exact = np.linalg.multi_dot(kept)
    wanted = np.array(scenes.SQUARE) @ exact[:3, :3].T + exact[:3, 3]
    placed = take(target_of(outside))
    np.testing.assert_allclose(placed.world().positions, wanted, atol=2e-5 * np.abs(exact).max())
    np.testing.assert_allclose(placed.origin, kept[0], atol=1e-5)


@pytest.mark.parametrize("hidden", [False, True], ids=["visible", "hidden"])
@pytest.mark.parametrize(("kind", "count"), [("VERTS", 4), ("FACES", 1)])
def test_children_on_vertices_and_faces(kind: str, count: int, hidden: bool) -> None:
    parent, child = scenes.square("Parent"), scenes.cube("Child")
    child.parent = parent
    parent.instance_type = kind
    parent.hide_viewport = hidden
    assert len(mesh_arrays([parent], "asset").triangles) == 2 + 12 * count
    parent.show_instancer_for_render = False
    assert len(mesh_arrays([parent], "asset").triangles) == 12 * count


def on_points(instance: bpy.types.Object) -> bpy.types.NodeTree:
    """Geometry Nodes: the object's own surface, and on each vertex an instance of another and a blue cube."""
    tree = bpy.data.node_groups.new("On Points", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    names = ("NodeGroupInput", "NodeGroupOutput", "GeometryNodeInstanceOnPoints", "GeometryNodeObjectInfo",
             "GeometryNodeMeshCube", "GeometryNodeSetMaterial")  # fmt: skip
    entry, end, points, info, box, paint = (tree.nodes.new(name) for name in names)
    both, everything = (tree.nodes.new("GeometryNodeJoinGeometry") for _ in range(2))
    info.inputs["Object"].default_value = instance
    info.inputs["As Instance"].default_value = True
    paint.inputs["Material"].default_value = scenes.material("Blue", (0, 0, 1))
    for source, sink in (
        (box.outputs["Mesh"], paint.inputs["Geometry"]),
        (paint.outputs[0], both.inputs[0]),
        (info.outputs["Geometry"], both.inputs[0]),
        (both.outputs[0], points.inputs["Instance"]),
        (entry.outputs[0], points.inputs["Points"]),
        (entry.outputs[0], everything.inputs[0]),
        (points.outputs[0], everything.inputs[0]),
        (everything.outputs[0], end.inputs[0]),
    ):
        tree.links.new(source, sink)
    return tree


@pytest.mark.parametrize("hidden", [False, True], ids=["visible", "hidden"])
def test_instances_of_geometry_nodes(hidden: bool) -> None:
    red, source = scenes.material("Red", (1, 0, 0)), scenes.square("Source")
    source.hide_render = True  # what instances show of it counts all the same
    ground = scenes.square("Ground", materials=[red])
    ground.modifiers.new("Nodes", "NODES").node_group = on_points(source)
    ground.hide_viewport = hidden
    arrays = mesh_arrays([ground], "asset")
    assert len(arrays.triangles) == 2 + 4 * (2 + 12)
    share = {look.name: np.count_nonzero(arrays.material == row) for row, look in enumerate(arrays.materials)}
    assert share == {"Red": 2, "Blue": 4 * 12, "": 4 * 2}
    assert [note.partition(":")[0] for note in arrays.notes] == ["Source"]


def test_many_instances_share_what_they_can() -> None:
    shape = library("Shape")
    scenes.square("Leaf", collection=shape, materials=[scenes.material("Green", (0, 1, 0))])
    ground = collection("Ground")
    for number in range(300):
        instancer(f"Tree {number}", shape, ground).location.x = number
    arrays = take(target_of(ground)).world()
    assert len(arrays.triangles) == 600 and len(arrays.materials) == 1


FIELD = """#usda 1.0
(
    upAxis = "Z"
    metersPerUnit = 1
)
def PointInstancer "Field"
{
    point3f[] positions = [(0, 0, 0), (2, 0, 0), (4, 0, 0)]
    int[] protoIndices = [0, 1, 0]
    rel prototypes = [</Field/Kinds/Quad>, </Field/Kinds/Leaf>]
    def Scope "Kinds"
    {
        def Mesh "Quad"
        {
            int[] faceVertexCounts = [4]
            int[] faceVertexIndices = [0, 1, 2, 3]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        }
        def Mesh "Leaf"
        {
            int[] faceVertexCounts = [3]
            int[] faceVertexIndices = [0, 1, 2]
            point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0)]
        }
    }
}
"""


def test_point_instancers_of_usd_files(tmp_path: Path) -> None:
    """Blender makes a point cloud of them, whose Geometry Nodes instance prototypes that only they show."""
    file = tmp_path / "field.usda"
    file.write_text(FIELD, encoding="utf-8")
    arrays = load_mesh(str(file))
    assert len(arrays.triangles) == 2 * 2 + 1
    assert sorted(arrays.positions[arrays.triangles].min(axis=1)[:, 0].tolist()) == [0, 0, 2, 4, 4]
    scenes.clear()
    bpy.ops.wm.usd_import(filepath=str(file))
    field = bpy.data.objects["Field"]
    assert field.type == "POINTCLOUD"
    assert scenes.same(take(target_of(field)).world(), replace(arrays, name="Field"))
    parent = linked(bpy.data.objects.new("Parent", None))
    field.parent = parent
    assert len(take(target_of(parent)).mesh.triangles) == 5


def test_particles_are_left_out_and_counted() -> None:
    object_, leaf = scenes.square("Emitter"), scenes.cube("Leaf")
    object_.modifiers.new("Particles", "PARTICLE_SYSTEM")
    hair = object_.particle_systems[0].settings
    hair.type, hair.count, hair.render_type, hair.instance_object = "HAIR", 7, "OBJECT", leaf
    arrays = mesh_arrays([object_], "asset")
    assert len(arrays.triangles) == 2
    assert any(warning.startswith("Emitter: 7 particle instances are left out") for warning in arrays.warnings)


def test_order_does_not_depend_on_the_files() -> None:
    def build(order: list[str]) -> MeshArrays:
        scenes.clear()
        inner, outer = library("Inner"), library("Outer")
        made = {name: scenes.square(name, collection=None) for name in "ABC"}
        for name in order:
            bpy.context.scene.collection.objects.unlink(made[name])
            inner.objects.link(made[name])
            made[name].location.x = 2 * ord(name)
        for name in order:
            instancer(f"I{name}", inner, outer).location.y = ord(name)
        return take(target_of(instancer("Top", outer))).mesh

    assert scenes.same(build(["A", "B", "C"]), build(["C", "A", "B"]))


# An asset of many parts


def parts(rows: int = 5, columns: int = 7) -> list[bpy.types.Object]:
    """Distinct spheres, turned, stretched, some of them mirrored, a row hanging from an empty each, all from one;
    of three materials."""
    top = linked(bpy.data.objects.new("Top", None))
    top.matrix_basis = Matrix.LocRotScale((1, 2, 3), Euler((0.2, 0.3, 0.4)), (1, 1.5, 1))
    looks = [scenes.material("Red", (0.8, 0.1, 0.1)), scenes.material("Blue", (0.1, 0.2, 0.9)), scenes.material("Grey")]
    made = []
    for row in range(rows):
        holder = linked(bpy.data.objects.new(f"Row {row}", None))
        holder.parent = top
        holder.matrix_basis = Matrix.LocRotScale((0, 3 * row, 0), Euler((0, 0.1 * row, 0)), (1, 1, 1 + 0.1 * row))
        for column in range(columns):
            bpy.ops.mesh.primitive_uv_sphere_add(segments=6 + column, ring_count=4 + row, radius=1)
            part = bpy.context.object
            part.name = f"Part {row} {column}"
            part.parent = holder
            mirror = -1 if (row + column) % 2 else 1
            part.matrix_basis = Matrix.LocRotScale((3 * column, 0, 0), Euler((0, row, column)), (1, mirror * 0.8, 0.6))
            part.data.materials.append(looks[(row + column) % 3])
            made.append(part)
    return made


def test_a_gltf_of_35_parts_is_one_asset(tmp_path: Path) -> None:
    """Exactly 1 against itself, and the same as what Blender joins of it."""
    made = parts()
    corners = sum(len(polygon.vertices) - 2 for part in made for polygon in part.data.polygons)
    glb = scenes.export(tmp_path, "glb", "parts")
    with bpy.context.temp_override(active_object=made[0], object=made[0], selected_editable_objects=made):
        bpy.ops.object.join()
    joined = scenes.export(tmp_path, "blend", "joined")
    asset = load_asset(str(glb))
    assert len(asset.mesh.triangles) == corners
    assert sorted(look.name for look in asset.mesh.materials) == ["Blue", "Grey", "Red"]
    measurement = Measurement(asset.world(), BVHQuery, Settings(samples=4000, patches=20))
    measurement.prepare().run()
    assert list(measurement.compare(asset.world()).run().scores) == [1.0] * 5
    alignment = align(asset, load_asset(str(joined)))
    assert alignment.space == "world"
    np.testing.assert_allclose(measurement.compare(alignment.mesh).run().scores, 1, atol=1e-3)


# Hidden from rendering


def test_what_renders_hide_of_an_instanced_collection() -> None:
    shape = library("Shape")
    inner = collection("Off", shape)
    inner.hide_render = True
    scenes.square("Square", collection=shape)
    scenes.cube("Cube", collection=inner)
    scenes.cube("Hidden", collection=shape).hide_render = True
    assert len(take(target_of(instancer("Top", shape))).mesh.triangles) == 2


def test_what_viewports_hide_of_an_instanced_collection_is_counted() -> None:
    """In a nested collection, and in one that is disabled; Blender lists neither. Not what renders hide, too."""
    shape, nested = library("Shape"), library("Nested")
    inner = collection("Inner", shape)
    inner.hide_viewport = True
    scenes.cube("Cube", collection=inner)
    scenes.square("Square", collection=shape)
    scenes.cube("Disabled", collection=nested).hide_viewport = True
    nowhere = scenes.cube("Nowhere", collection=shape)
    nowhere.hide_viewport = nowhere.hide_render = True
    instancer("Deep", nested, shape)
    arrays = take(target_of(instancer("Top", shape))).mesh
    assert len(arrays.triangles) == 2
    assert arrays.warnings[0].startswith("Top: 2 objects that it instances are left out; enable them in viewports")


def test_excluding_a_collection_does_not_hide_its_instances() -> None:
    shape = collection("Shape")
    scenes.square("Square", collection=shape)
    scenes.cube("Cube", collection=collection("Inner", shape))
    bpy.context.view_layer.layer_collection.children["Shape"].children["Inner"].exclude = True
    assert len(take(target_of(instancer("Top", shape))).mesh.triangles) == 2 + 12
    assert len(take(target_of(shape)).mesh.triangles) == 2


def test_linked_duplicates_in_edit_mode_have_their_own_modifiers() -> None:
    first, second = scenes.cube("First"), scenes.cube("Second")
    second.data = first.data
    smooth = first.modifiers.new("Subdivision", "SUBSURF")
    smooth.levels = smooth.render_levels = 1
    bpy.context.view_layer.objects.active = first
    bpy.ops.object.mode_set(mode="EDIT")
    assert len(mesh_arrays([first, second], "asset").triangles) == 48 + 12


def test_what_renders_hide_of_a_collection() -> None:
    top = collection("Top")
    off, excluded = collection("Off", top), collection("Excluded", top)
    off.hide_render = True
    bpy.context.view_layer.layer_collection.children["Top"].children["Excluded"].exclude = True
    scenes.square("Square", collection=top)
    scenes.cube("Cube", collection=off)
    scenes.cube("Other", collection=excluded)
    assert len(take(target_of(top)).mesh.triangles) == 2
    assert len(take(target_of(off)).mesh.triangles) == 12  # it is named
    assert len(take(target_of(excluded)).mesh.triangles) == 12


# Values at corners


@pytest.mark.parametrize("kind", ["BYTE_COLOR", "FLOAT_COLOR"])
@pytest.mark.parametrize("domain", ["POINT", "CORNER"])
def test_colors_without_a_material(kind: str, domain: str) -> None:
    """Scans have colors and no material; what is stored is linear light in either kind."""
    object_ = scenes.square("Scan")
    colors = object_.data.color_attributes.new("Color", kind, domain)
    linear = np.random.default_rng(3).uniform(0, 1, (4, 4)).astype(np.float32)
    for item, value in zip(colors.data, linear, strict=True):
        item.color = value
    arrays = mesh_arrays([object_], "asset")
    stored = linear[arrays.triangles]  # the only face's corners run as its vertices
    assert arrays.corners == pytest.approx(stored, abs=0.006 if kind == "BYTE_COLOR" else 1e-6)
    assert not arrays.warnings and arrays.materials[0].how == "none"
    center = np.array([[0.2, 0.3, 0.4, 1.0]])
    encoded = 1.055 * center[0, :3] ** (1 / 2.4) - 0.055
    assert arrays.materials[0].color.lookup(center)[0] == pytest.approx(encoded)


def test_the_attribute_for_rendering_counts() -> None:
    object_ = scenes.square("Scan")
    for value in (0.25, 0.75):
        colors = object_.data.color_attributes.new(f"{value}", "FLOAT_COLOR", "POINT")
        colors.data.foreach_set("color", np.full(16, value, np.float32))
    object_.data.color_attributes.render_color_index = 1
    object_.data.color_attributes.active_color_index = 0
    assert np.unique(mesh_arrays([object_], "asset").corners).tolist() == [0.75]


def test_slots_have_layers_of_their_own_width() -> None:
    """A slot with texture coordinates beside one with none: theirs are 0."""
    looks = [scenes.material("Plain", (1, 0, 0)), scenes.material("Textured")]
    scenes.image_node(looks[1], bpy.data.images.new("image", 2, 2))
    object_ = scenes.cube(materials=looks)
    object_.data.polygons.foreach_set("material_index", [0, 1, 0, 1, 0, 1])
    arrays = mesh_arrays([object_], "asset")
    assert arrays.corners.shape == (12, 3, 2)
    plain = arrays.material == [look.name for look in arrays.materials].index("Plain")
    assert np.count_nonzero(plain) == 6
    assert not arrays.corners[plain].any() and arrays.corners[~plain].any(axis=(1, 2)).all()


# Files


def test_many_objects_without_material_say_so_once(tmp_path: Path) -> None:
    for number in range(35):
        scenes.cube(f"Part {number:02d}").location.x = 3 * number
    path = scenes.export(tmp_path, "glb")
    scenes.clear()
    arrays = load_mesh(str(path))
    assert len(arrays.triangles) == 35 * 12
    assert arrays.notes == ("Part 00, Part 01 and 33 more: there is no material; Blender's default grey is taken",)


UP = {
    "obj": lambda path: bpy.ops.wm.obj_export(filepath=path),  # importers turn it back
    "glb": lambda path: bpy.ops.export_scene.gltf(filepath=path, export_format="GLB"),
    "ply": lambda path: bpy.ops.wm.ply_export(filepath=path, up_axis="Y", forward_axis="NEGATIVE_Z"),  # not these
    "stl": lambda path: bpy.ops.wm.stl_export(filepath=path, up_axis="Y", forward_axis="NEGATIVE_Z"),
}


def test_kinds_of_files_whose_axes_differ(tmp_path: Path) -> None:
    """As scanned models come: Y is up in all the files, and importers of OBJ and glTF turn that."""
    monkey = scenes.monkey(materials=[scenes.material("Grey", (0.8, 0.8, 0.8))])
    monkey.matrix_world = Matrix.Diagonal((1, 2, 1.5, 1))
    monkey.modifiers.new("Triangulate", "TRIANGULATE")
    bpy.ops.object.modifier_apply(modifier="Triangulate")
    for kind, write in UP.items():
        write(str(tmp_path / f"monkey.{kind}"))
    turns = {}
    for kind in UP:
        reference = load_asset(str(tmp_path / f"monkey.{kind}"))
        measurement = Measurement(reference.world(), BVHQuery, Settings(samples=4000, patches=40))
        measurement.prepare().run()
        for other in UP:
            alignment = align(reference, load_asset(str(tmp_path / f"monkey.{other}")))
            assert measurement.compare(alignment.mesh).run().scores[0] >= 0.999, (kind, other)
            turns[kind, other] = alignment.turn
    assert turns["glb", "ply"] == "90 degrees about X" and turns["stl", "glb"] == "-90 degrees about X"
    assert turns["ply", "stl"] == turns["obj", "glb"] == ""


def rigged() -> bpy.types.Object:
    """A cube on two bones of an armature."""
    bpy.ops.object.armature_add(enter_editmode=True)
    rig = bpy.context.object
    bpy.ops.armature.extrude_move(TRANSFORM_OT_translate={"value": (0, 0, 1)})
    bpy.ops.object.mode_set(mode="OBJECT")
    skin = scenes.cube("Skin", materials=[scenes.material("Skin", (0.5, 0.4, 0.3))])
    for bone in rig.data.bones:
        skin.vertex_groups.new(name=bone.name).add(range(8), 0.5, "REPLACE")
    skin.parent = rig
    skin.modifiers.new("Armature", "ARMATURE").object = rig
    return skin


def test_bone_shapes_of_the_importer_are_not_the_asset(tmp_path: Path) -> None:
    rigged()
    path = scenes.export(tmp_path, "glb")
    scenes.clear()
    bpy.ops.import_scene.gltf(filepath=str(path), bone_heuristic="BLENDER", disable_bone_shape=False)
    shapes = [bone.custom_shape for bone in bpy.data.objects["Armature"].pose.bones]
    assert all(shape is not None for shape in shapes)  # there is something to leave out
    shape = shapes[0]
    if not shape.users_scene:
        linked(shape)
    shape.hide_render = False
    name = shape.name
    blend = scenes.export(tmp_path, "blend")
    for file in (path, blend):
        arrays = load_mesh(str(file))
        assert len(arrays.triangles) == 12 and [look.name for look in arrays.materials] == ["Skin"]
    assert len(load_mesh(f"{blend}:{name}").triangles) > 12  # it is named


def test_evaluated_objects_keep_their_order() -> None:
    """Those that the view layer leaves out are evaluated elsewhere."""
    objects = [scenes.square(name) for name in "BCA"]
    objects[1].hide_viewport = True
    with evaluated(objects) as found:
        assert [each.original for each in found] == objects
        assert found[1].object.original != objects[1] and found[0].object.original == objects[0]


# What has to be baked


def procedural() -> bpy.types.Material:
    made = scenes.material("Veins")
    noise = made.node_tree.nodes.new("ShaderNodeTexNoise")
    made.node_tree.links.new(noise.outputs[1], scenes.base_color(made))
    return made


@pytest.mark.parametrize("hidden", [False, True], ids=["visible", "hidden"])
def test_what_cannot_be_read_is_baked_once_for_all_instances(hidden: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    shape = library("Shape")
    cube = scenes.cube("Cube", collection=shape, materials=[scenes.material("Red", (1, 0, 0)), procedural()])
    cube.data.polygons.foreach_set("material_index", [0, 1, 1, 0, 1, 1])
    ground = collection("Ground")
    for number in range(3):
        instancer(f"Stone {number}", shape, ground).location.x = 3 * number
    ground.hide_viewport = hidden
    baked = []

    def bake_slots(object_: bpy.types.Object, *rest: object) -> object:
        baked.append(object_.name)
        return bake.bake_slots(object_, *rest)

    monkeypatch.setattr(mesh_module, "bake_slots", bake_slots)
    before = scenes.blocks()
    arrays = take(target_of(ground), Reading(bake=64)).mesh
    assert scenes.blocks() == before
    assert baked == ["Cube"]
    assert [(look.name, look.how) for look in arrays.materials] == [("Red", "read"), ("Veins", "baked")]
    assert np.count_nonzero(arrays.material == 1) == 3 * 8
    veins = arrays.corners[arrays.material == 1]
    assert np.ptp(arrays.materials[1].color.lookup(veins.mean(axis=1)), axis=0).max() > 0.05


def test_baking_that_is_forbidden() -> None:
    arrays = mesh_arrays([scenes.cube(materials=[procedural()])], "asset", Reading(bake=0))
    assert arrays.materials[0].how == "plain"
    (warning,) = arrays.warnings
    assert warning.startswith("Cube: material Veins: Noise Texture") and "baking is off" in warning


@pytest.mark.parametrize("make", [tube, balls], ids=lambda make: make.__name__)
def test_other_kinds_are_baked_too(make: Callable[[], bpy.types.Object]) -> None:
    object_ = make()
    object_.data.materials.append(procedural())
    arrays = mesh_arrays([object_], "asset", Reading(bake=64))
    assert [look.how for look in arrays.materials] == ["baked"]


def test_meshes_that_only_instances_have_are_baked_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside a mesh of the owner's own that has as many triangles and is baked, too."""
    veins = procedural()
    ground = scenes.cube("Ground", materials=[veins])
    tree = on_points(scenes.square("Source", materials=[scenes.material("Green", (0, 1, 0))]))
    ground.modifiers.new("Nodes", "NODES").node_group = tree
    next(node for node in tree.nodes if node.type == "SET_MATERIAL").inputs["Material"].default_value = veins
    sizes = []

    def bake_slots(object_: bpy.types.Object, *rest: object) -> object:
        sizes.append(np.ptp([vertex.co for vertex in object_.data.vertices]))
        return bake.bake_slots(object_, *rest)

    monkeypatch.setattr(mesh_module, "bake_slots", bake_slots)
    before = scenes.blocks()
    arrays = mesh_arrays([ground], "asset", Reading(bake=64))
    assert scenes.blocks() == before
    assert sorted(sizes) == [1, 2]  # the node's cube has sides of 1, the ground's of 2
    assert Counter(look.how for look in arrays.materials) == {"read": 1, "baked": 2}
    assert np.count_nonzero(np.isin(arrays.material, np.flatnonzero(["baked" == m.how for m in arrays.materials]))) == (
        12 + 8 * 12
    )


def test_an_instances_own_mesh_is_baked_where_it_stands() -> None:
    """The color is the place in the world, of the one instance, which is sheared and mirrored."""
    colored = scenes.material("Place")
    place = colored.node_tree.nodes.new("ShaderNodeNewGeometry")
    colored.node_tree.links.new(place.outputs["Position"], scenes.base_color(colored))
    point = scenes.add("Point", [(0.2, 0.2, 0.2)], [])
    tree = on_points(scenes.add("Nothing", [], []))
    next(node for node in tree.nodes if node.type == "SET_MATERIAL").inputs["Material"].default_value = colored
    point.modifiers.new("Nodes", "NODES").node_group = tree
    parent = linked(bpy.data.objects.new("Parent", None))
    point.parent, point.matrix_basis = parent, Matrix.Identity(4)
    point.matrix_parent_inverse = Matrix(((0.2, 0.1, 0, 0.3), (0, -0.3, 0.05, 0.5), (0, 0, 0.2, 0.4), (0, 0, 0, 1)))
    arrays = mesh_arrays([point], "asset", Reading(bake=128))
    (look,) = arrays.materials
    middle = arrays.positions[arrays.triangles].mean(axis=1)
    assert look.how == "baked" and len(middle) == 12
    seen = decode_srgb(look.color.lookup(arrays.corners.mean(axis=1).astype(np.float64)))
    assert np.abs(seen - middle).max() < 0.02


def test_a_mesh_that_only_instances_have_is_baked_with_its_owners_properties() -> None:
    tinted = scenes.material("Tinted")
    tint = tinted.node_tree.nodes.new("ShaderNodeAttribute")
    tint.attribute_name, tint.attribute_type = "tint", "OBJECT"
    tinted.node_tree.links.new(tint.outputs["Color"], scenes.base_color(tinted))
    point = scenes.add("Point", [(0, 0, 0)], [])
    point["tint"] = (0.8, 0.3, 0.1)
    tree = on_points(scenes.add("Nothing", [], []))
    next(node for node in tree.nodes if node.type == "SET_MATERIAL").inputs["Material"].default_value = tinted
    point.modifiers.new("Nodes", "NODES").node_group = tree
    arrays = mesh_arrays([point], "asset", Reading(bake=64))
    seen = decode_srgb(arrays.materials[0].color.lookup(arrays.corners.mean(axis=1).astype(np.float64)))
    assert np.abs(seen - (0.8, 0.3, 0.1)).max() < 0.02


def test_the_panel_says_that_it_bakes() -> None:
    """Before the step that takes a while."""
    stone = scenes.cube("Stone", materials=[procedural(), scenes.material("Red", (1, 0, 0))])
    shape = library("Shape")
    scenes.cube("Pebble", collection=shape, materials=[stone.material_slots[0].material])
    instances = instancer("Instances", shape)
    plain = scenes.cube("Plain", materials=[scenes.material("Green", (0, 1, 0))])
    nodes = scenes.cube("Nodes")
    nodes.modifiers.new("Nodes", "NODES").node_group = tree = on_points(scenes.square("Leaf"))
    next(node for node in tree.nodes if node.type == "SET_MATERIAL").inputs["Material"].default_value = procedural()
    few = Settings(samples=400, patches=4)
    compared = [target_of(instances), target_of(plain), target_of(nodes)]
    stepper = measuring(target_of(stone), compared, PairOptions(settings=few), Reading(bake=32))
    stages = []
    while stepper.step():
        stages.append(stepper.progress.stage)
    reading = [stage for stage in dict.fromkeys(stages) if stage.startswith("Reading")]
    assert reading == [
        "Reading Stone", "Reading Stone: baking Veins",
        "Reading Instances", "Reading Instances: baking Veins",
        "Reading Plain",
        "Reading Nodes", "Reading Nodes: baking Veins.001",
    ]  # fmt: skip
    assert all(outcome.error is None for outcome in stepper.result)
