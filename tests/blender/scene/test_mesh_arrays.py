# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects to arrays: what Blender shows is what is measured, and nothing stays behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bmesh
import bpy
import numpy as np
import pytest
from mathutils import Matrix

from fmqm_addon.blender.files.flatten import flatten_objects
from fmqm_addon.blender.materials.images import TextureCache
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays, to_bake
from fmqm_addon.metric.errors import MeshError
from fmqm_addon.metric.surface import prepare_surface
from fmqm_addon.metric.texture import Texture
from tests.blender import scenes

GIVEN = Reading(texture=Texture(scenes.noise()))


def subdivided(name: str = "Cube", **options: object) -> bpy.types.Object:
    """A cube that has 48 triangles once its modifier is applied, 12 without."""
    object_ = scenes.cube(name, **options)
    smooth = object_.modifiers.new("Subdivision", "SUBSURF")
    smooth.levels = smooth.render_levels = 1
    return object_


def test_quads_become_triangles_with_the_same_surface() -> None:
    arrays = mesh_arrays([scenes.cube()], "asset")
    assert arrays.positions.shape == (8, 3) and arrays.positions.dtype == np.float64
    assert arrays.triangles.shape == (12, 3) and arrays.corners.shape == (12, 3, 0) and arrays.material.shape == (12,)
    assert scenes.area(arrays) == pytest.approx(24)
    assert arrays.name == "asset"


def test_concave_ngon_is_cut_inside_its_outline() -> None:
    arrow = [(0, 0, 0), (2, 2, 0), (0, 4, 0), (1, 2, 0), (-3, 2, 0)]  # a fan from corner 0 would leave it
    x, y, _ = np.array(arrow).T
    shoelace = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    arrays = mesh_arrays([scenes.add("Arrow", arrow, [(0, 1, 2, 3, 4)])], "asset")
    assert len(arrays.triangles) == 3
    assert scenes.area(arrays) == pytest.approx(shoelace)


def test_corner_uvs_follow_their_corners() -> None:
    arrays = mesh_arrays([scenes.square(materials=[textured()])], "asset")
    assert arrays.corners == pytest.approx(arrays.positions[arrays.triangles][:, :, :2])


def textured() -> bpy.types.Material:
    made = scenes.material("Textured")
    scenes.image_node(made, bpy.data.images.new("image", 2, 2))
    return made


def test_modifiers_are_applied() -> None:
    assert len(mesh_arrays([subdivided()], "asset").triangles) == 48


def test_modifier_that_is_off_in_renders_is_not() -> None:
    object_ = subdivided()
    object_.modifiers[0].show_render = False
    assert len(mesh_arrays([object_], "asset").triangles) == 12


def test_shape_keys_are_applied() -> None:
    object_ = scenes.square()
    object_.shape_key_add(name="Basis")
    key = object_.shape_key_add(name="Raised")
    key.data[0].co.z = 2.0
    key.value = 0.5
    assert mesh_arrays([object_], "asset").positions[:, 2].max() == pytest.approx(1.0)


def test_objects_are_joined_with_their_transforms() -> None:
    near, far = scenes.cube("Near"), scenes.square("Far")
    far.matrix_world = scenes.PLACED
    arrays = mesh_arrays([near, far], "asset")
    assert arrays.triangles.shape == (14, 3) and arrays.positions.shape == (12, 3)
    wanted = [tuple(scenes.PLACED @ vertex.co) for vertex in far.data.vertices]
    assert arrays.positions[8:] == pytest.approx(np.array(wanted), abs=1e-6)
    assert arrays.triangles[12:].min() == 8 and arrays.triangles[:12].max() == 7


def test_parents_and_stale_matrices_count() -> None:
    parent, child = bpy.data.objects.new("Parent", None), scenes.square("Child")
    bpy.context.scene.collection.objects.link(parent)
    child.parent = parent
    parent.location = (10, 0, 0)  # matrix_world of both is stale now
    child.location = (0, 5, 0)
    assert mesh_arrays([child], "asset").positions.min(axis=0) == pytest.approx([10, 5, 0])


def test_transform_is_composed_in_float64() -> None:
    """float32 sums would lose the digits of the shape."""
    object_ = scenes.square()
    object_.data.vertices[2].co = (1 + 2**-20, 1, 0)
    object_.location = (2.0**20, 0, 0)
    assert mesh_arrays([object_], "asset").positions[2, 0] == 2.0**20 + 1 + 2**-20


def test_negative_scale_mirrors() -> None:
    object_ = scenes.square(materials=[textured()])
    object_.scale = (-2, 1, 1)
    arrays = mesh_arrays([object_], "asset")
    assert arrays.positions[:, 0].min() == -2 and arrays.positions[:, 0].max() == 0
    corners = arrays.positions[arrays.triangles]
    assert arrays.corners == pytest.approx(corners[:, :, :2] / [-2, 1])  # UVs stay with their vertices


def test_every_material_slot_has_its_own_color(tmp_path: Path) -> None:
    pixels = [scenes.noise(seed=seed) for seed in (1, 2)]
    looks = [scenes.textured(scenes.write_png(tmp_path / f"{k}.png", pixels[k]), f"Image {k}") for k in (0, 1)]
    looks.insert(1, scenes.material("Plain", (1.0, 0.0, 0.0)))
    object_ = scenes.cube(materials=looks)
    slot_of_face = [0, 1, 2, 2, 1, 0]
    object_.data.polygons.foreach_set("material_index", slot_of_face)
    arrays = mesh_arrays([object_], "asset")
    shown = [arrays.materials[index].color for index in arrays.material]
    for triangle, color in zip(arrays.triangles, shown, strict=True):
        face = next(k for k, corners in enumerate(scenes.CUBE_FACES) if set(triangle.tolist()) <= set(corners))
        if slot_of_face[face] == 1:
            assert color.rgb == pytest.approx((1, 0, 0))
        else:
            assert np.array_equal(color.pixels, pixels[0 if slot_of_face[face] == 0 else 1])


def test_colors_of_joined_objects_stay_apart() -> None:
    red, blue = scenes.material("Red", (1, 0, 0)), scenes.material("Blue", (0, 0, 1))
    objects = [scenes.cube("A", materials=[red]), scenes.cube("B", materials=[blue]), scenes.cube("C", materials=[red])]
    arrays = mesh_arrays(objects, "asset")
    rgb = np.array([look.color.rgb for look in arrays.materials])[arrays.material]
    assert rgb == pytest.approx(np.repeat([(1, 0, 0), (0, 0, 1), (1, 0, 0)], 12, axis=0))


def test_material_linked_to_the_object_wins() -> None:
    object_ = scenes.square(materials=[scenes.material("Data", (1, 0, 0))])
    object_.material_slots[0].link = "OBJECT"
    object_.material_slots[0].material = scenes.material("Object", (0, 0, 1))
    color = mesh_arrays([object_], "asset").materials[0].color
    assert color.rgb == pytest.approx((0, 0, 1))


def test_slot_that_is_linked_to_the_object_and_empty_there() -> None:
    """Since Blender 5.2 renders show no material, and older ones the mesh's, which both tell that they show."""
    object_ = scenes.square(materials=[scenes.material("Data", (1, 0, 0))])
    object_.material_slots[0].link = "OBJECT"
    is_old = bpy.app.version < (5, 2)
    arrays = mesh_arrays([object_], "asset")
    assert arrays.materials[0].how == ("read" if is_old else "none") and bool(arrays.notes) != is_old
    flatten_objects([object_], alone=True)
    (plain,) = bpy.data.objects
    assert [slot.material and slot.material.name for slot in plain.material_slots] == ["Data" if is_old else None]


def test_face_beyond_the_last_slot_has_the_last() -> None:
    object_ = scenes.square(materials=[scenes.material("First", (1, 0, 0)), scenes.material("Last", (0, 0, 1))])
    object_.data.polygons[0].material_index = 7
    color = mesh_arrays([object_], "asset").materials[0].color
    assert color.rgb == pytest.approx((0, 0, 1))


def test_face_of_a_negative_slot_has_the_first() -> None:
    object_ = scenes.square(materials=[scenes.material("First", (1, 0, 0)), scenes.material("Last", (0, 0, 1))])
    object_.data.attributes.new("material_index", "INT", "FACE").data.foreach_set("value", [-5])
    color = mesh_arrays([object_], "asset").materials[0].color
    assert color.rgb == pytest.approx((1, 0, 0))


@pytest.mark.parametrize("materials", [[], [None]], ids=["no slot", "empty slot"])
def test_without_material_default_grey_and_a_note(materials: list[None]) -> None:
    arrays = mesh_arrays([scenes.square("Bare", uv=False, materials=materials)], "asset")
    grey = 1.055 * 0.8 ** (1 / 2.4) - 0.055
    assert arrays.materials[0].color.rgb == pytest.approx((grey,) * 3)
    assert len(arrays.notes) == 1 and "Bare" in arrays.notes[0] and "grey" in arrays.notes[0]


def test_the_given_texture_replaces_all_materials() -> None:
    broken = scenes.material("Broken")
    scenes.image_node(broken, None)
    texture = Texture(scenes.noise())
    objects = [scenes.square("A", materials=[broken]), scenes.square("B")]
    arrays = mesh_arrays(objects, "asset", Reading(texture=texture))
    assert all(look.color is texture for look in arrays.materials) and not arrays.warnings


def excluded(object_: bpy.types.Object) -> None:
    collection = into_collection(object_)
    bpy.context.view_layer.layer_collection.children[collection.name].exclude = True


def into_collection(object_: bpy.types.Object) -> bpy.types.Collection:
    collection = bpy.data.collections.new("Other")
    bpy.context.scene.collection.children.link(collection)
    bpy.context.scene.collection.objects.unlink(object_)
    collection.objects.link(object_)
    return collection


def off_in_viewports(object_: bpy.types.Object) -> None:
    object_.hide_viewport = True


def collection_off_in_viewports(object_: bpy.types.Object) -> None:
    into_collection(object_).hide_viewport = True


def collection_eye_closed(object_: bpy.types.Object) -> None:
    collection = into_collection(object_)
    bpy.context.view_layer.layer_collection.children[collection.name].hide_viewport = True


def in_no_scene(object_: bpy.types.Object) -> None:
    bpy.context.scene.collection.objects.unlink(object_)


def eye_closed(object_: bpy.types.Object) -> None:
    object_.hide_set(True)


def off_in_renders(object_: bpy.types.Object) -> None:
    object_.hide_render = True


HIDERS = [
    excluded, off_in_viewports, collection_off_in_viewports, collection_eye_closed, in_no_scene, eye_closed,
    off_in_renders,
]  # fmt: skip


@pytest.mark.parametrize("hide", HIDERS, ids=lambda hide: hide.__name__)
def test_hidden_objects_are_evaluated_never_read_raw(hide: Callable[[bpy.types.Object], None]) -> None:
    """With modifiers, animated at the scene's frame, and with the parent's transform."""
    parent, object_ = bpy.data.objects.new("Parent", None), subdivided("Hidden")
    bpy.context.scene.collection.objects.link(parent)
    parent.matrix_world = scenes.PLACED
    object_.parent = parent
    object_.location.x = 0
    object_.keyframe_insert("location", frame=1)
    object_.location.x = 100
    object_.keyframe_insert("location", frame=2)
    bpy.context.scene.frame_set(2)
    shown = mesh_arrays([object_], "asset")
    assert len(shown.triangles) == 48 and np.ptp(shown.positions, axis=0).max() < 10
    hide(object_)
    before = scenes.blocks()
    hidden = mesh_arrays([object_], "asset")
    assert hidden.positions == pytest.approx(shown.positions)
    assert np.array_equal(hidden.triangles, shown.triangles)
    assert scenes.blocks() == before
    assert object_.name == "Hidden"


def test_hidden_parent_of_a_hidden_object() -> None:
    parent, child = subdivided("Parent"), subdivided("Child")
    child.parent = parent
    parent.location = (5, 0, 0)
    off_in_viewports(parent)
    off_in_viewports(child)
    assert mesh_arrays([child], "asset").positions.mean(axis=0) == pytest.approx([5, 0, 0], abs=1e-6)


def test_hidden_and_visible_objects_together() -> None:
    hidden, visible = subdivided("Hidden"), scenes.square("Visible")
    off_in_viewports(hidden)
    arrays = mesh_arrays([visible, hidden], "asset")
    assert len(arrays.triangles) == 2 + 48
    assert arrays.triangles[:2].max() == 3  # in the order given


def test_hidden_object_is_named_as_the_user_knows_it() -> None:
    object_ = scenes.cube("Hidden", uv=False, materials=[textured()])
    off_in_viewports(object_)
    with pytest.raises(MeshError, match="^Hidden: .*no UV map"):
        mesh_arrays([object_], "asset", GIVEN)
    bare = scenes.cube("Bare")
    off_in_viewports(bare)
    assert mesh_arrays([bare], "asset").notes[0].startswith("Bare: ")


@pytest.mark.parametrize("fails", [False, True], ids=["measured", "refused"])
@pytest.mark.parametrize("hidden", [False, True], ids=["visible", "hidden"])
def test_nothing_stays_in_the_session(fails: bool, hidden: bool) -> None:
    object_ = subdivided(uv=not fails, materials=[textured()])
    object_.hide_viewport = hidden
    before = scenes.blocks()
    users = object_.data.users
    if fails:
        with pytest.raises(MeshError):
            mesh_arrays([object_], "asset", GIVEN)
    else:
        mesh_arrays([object_], "asset")
    assert scenes.blocks() == before
    assert object_.data.users == users


def test_same_object_twice_gives_the_same_arrays() -> None:
    object_ = subdivided(materials=[textured()])
    assert scenes.same(mesh_arrays([object_], "a"), mesh_arrays([object_], "b"))


@pytest.mark.parametrize("hidden", [False, True], ids=["visible", "hidden"])
def test_edits_of_edit_mode_are_seen(hidden: bool) -> None:
    object_ = scenes.cube()
    bpy.context.view_layer.objects.active = object_
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(object_.data)
    edited.faces.ensure_lookup_table()
    bmesh.ops.delete(edited, geom=[edited.faces[0]], context="FACES")
    for vertex in edited.verts:
        vertex.co *= 3
    object_.hide_viewport = hidden
    arrays = mesh_arrays([object_], "asset")
    assert len(arrays.triangles) == 10 and arrays.positions.max() == 3
    assert object_.mode == "EDIT"


def test_no_faces() -> None:
    points = scenes.add("Points", scenes.SQUARE, [], uv=False)
    with pytest.raises(MeshError, match="asset: .*no faces"):
        mesh_arrays([points], "asset")
    lines = bpy.data.meshes.new("Lines")
    lines.from_pydata(scenes.SQUARE, [(0, 1), (1, 2)], [])
    with pytest.raises(MeshError, match="asset: .*no faces"):
        mesh_arrays([bpy.data.objects.new("Lines", lines), points], "asset")
    with pytest.raises(MeshError, match="no mesh"):
        mesh_arrays([], "asset")


def test_an_object_without_faces_costs_only_itself() -> None:
    objects = [scenes.add("Points", scenes.SQUARE, [], uv=False), scenes.square()]
    assert len(mesh_arrays(objects, "asset").triangles) == 2


def test_a_given_image_needs_uvs() -> None:
    with pytest.raises(MeshError, match="Bald: .*no UV map.*unwrap"):
        mesh_arrays([scenes.square(), scenes.square("Bald", uv=False)], "asset", GIVEN)


def test_a_material_that_wants_uvs_where_there_are_none_is_read_at_0() -> None:
    """As Blender renders it; said once for all that lack them."""
    made = textured()
    bald = [scenes.square(f"Bald {number}", uv=False, materials=[made]) for number in range(5)]
    arrays = mesh_arrays([scenes.square(materials=[made]), *bald], "asset")
    assert arrays.corners[:2].any() and not arrays.corners[2:].any()
    assert len(arrays.warnings) == 1
    assert arrays.warnings[0].startswith("Bald 0, Bald 1 and 3 more: the mesh has no UV map, which material Textured")


@pytest.mark.parametrize("kind, domain", [("FLOAT_COLOR", "FACE"), ("FLOAT_VECTOR", "POINT"), ("FLOAT", "FACE")])
def test_attributes_of_any_kind_are_baked(kind: str, domain: str) -> None:
    """Geometry Nodes make them, and Cycles reads them: they are neither black nor said to be missing."""
    made = scenes.material("Painted")
    node = made.node_tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name = "tint"
    made.node_tree.links.new(node.outputs["Color"], scenes.base_color(made))
    object_ = scenes.square(materials=[made])
    for each in object_.data.attributes.new("tint", kind, domain).data:
        if kind == "FLOAT_COLOR":
            each.color = (0.5, 0.5, 0.5, 1)
        elif kind == "FLOAT":
            each.value = 0.5
        else:
            each.vector = (0.5, 0.5, 0.5)
    assert to_bake([object_], Reading(bake=64), TextureCache()) == ("Painted",)
    arrays = mesh_arrays([object_], "asset", Reading(bake=64))
    assert arrays.materials[0].how == "baked" and not any("has no" in warning for warning in arrays.warnings)
    color = prepare_surface(arrays, BVHQuery).color_at(np.arange(2), np.full((2, 3), 1 / 3))
    assert color == pytest.approx(0.735357, abs=0.01)


@pytest.mark.parametrize(("kind", "opacity"), [("Attribute", 1), ("VertexColor", 0)])
def test_alpha_of_an_attribute_that_the_mesh_lacks_is_baked(kind: str, opacity: float) -> None:
    """Cycles has a color attribute's own node transparent then, and another one opaque."""
    made = scenes.material("Painted")
    node = made.node_tree.nodes.new(f"ShaderNode{kind}")
    setattr(node, "attribute_name" if kind == "Attribute" else "layer_name", "tint")
    made.node_tree.links.new(node.outputs["Alpha"], scenes.base_color(made).node.inputs["Alpha"])
    object_ = scenes.square(materials=[made])
    assert to_bake([object_], Reading(bake=64), TextureCache()) == ("Painted",)
    arrays = mesh_arrays([object_], "asset", Reading(bake=64))
    assert any("the color attribute tint is missing on the mesh; baked" in note for note in arrays.notes)
    found = prepare_surface(arrays, BVHQuery).alpha_at(np.arange(2), np.full((2, 3), 1 / 3))
    assert found == pytest.approx(opacity)


def test_uvs_that_are_not_finite_still_give_a_color() -> None:
    object_ = scenes.square(materials=[textured()])
    object_.data.uv_layers[0].uv[0].vector = (np.nan, np.nan)
    surface = prepare_surface(mesh_arrays([object_], "asset"), BVHQuery)
    assert np.isfinite(surface.color_at(np.arange(2), np.full((2, 3), 1 / 3))).all()
    assert any("UVs or colors that are not finite" in warning for warning in surface.warnings)


def test_scale_of_zero_reaches_the_metric_as_flat_triangles() -> None:
    object_ = scenes.cube()
    object_.matrix_world = Matrix.Diagonal((0, 0, 0, 1))
    assert scenes.area(mesh_arrays([object_], "asset")) == 0


@pytest.mark.parametrize(
    ("color", "word"),
    [
        ((0, 0, 0), "is black all over"),
        ((9, 200, 0.5), "is beyond 1, and shown as 1, in 67 % of its values"),
        ((2, 1, 0), ""),
    ],
)
def test_colors_that_cannot_be_meant(color: tuple[float, ...], word: str) -> None:
    """Of scans whose colors were exported as other numbers, such as floats from 0 to 255."""
    object_ = scenes.square()
    object_.data.color_attributes.new("Scan", "FLOAT_COLOR", "POINT").data.foreach_set("color", [*color, 1] * 4)
    found = [text for text in mesh_arrays([object_], "asset").warnings if "Scan" in text or "color attribute" in text]
    assert [word in text for text in found] == ([True] if word else [])
