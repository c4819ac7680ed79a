# SPDX-License-Identifier: GPL-3.0-or-later
"""What numpy cannot read of materials, drawn by Cycles: base color and opacity, on an image for each material."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from idprop.types import IDPropertyArray
from numpy.typing import NDArray

from ...metric.colorspace import encode_srgb
from ...metric.errors import MeshError
from ...metric.geometry import Floats, triangle_areas
from ...metric.texture import Material, Texture
from .. import arrays
from ..materials.expressions import ImageAlpha, Opacity
from ..materials.types import Look, MeshLayer, Unread
from .atlas import LARGEST, Layout, new_layout, own_layout
from .emission import BakePass, emission_copy, is_opaque, keeps_shaders, shines

_MARGIN = 8  # pixels around the parts of an own UV map, for bilinear lookups at their edges
_ROWS = 256  # of an image that are worked on at a time
_OPAQUE = 254.5 / 255  # what rounds to 255
_VALUES = {  # how the values of an attribute are called, and their number, by data type
    "FLOAT": ("value", 1, np.float32),
    "INT": ("value", 1, np.int32),
    "BOOLEAN": ("value", 1, np.bool_),
    "INT8": ("value", 1, np.int32),
    "FLOAT2": ("vector", 2, np.float32),
    "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32),
    "BYTE_COLOR": ("color", 4, np.float32),
}


@dataclass(frozen=True)
class Baked:
    """A baked material slot.

    Attributes:
        look: reads its two channels from corners.
        corners: (T, 3, 2) float32, for the slot's triangles in the order of Mesh.loop_triangles.
    """

    look: Look
    corners: NDArray[np.float32]


@dataclass(frozen=True)
class _Part:
    """The triangles of one slot: rows of loop_triangles, their places on an image, and that image."""

    slot: int
    rows: NDArray[np.int64]
    layout: Layout
    image: bpy.types.Image


def bake_slots(
    object_: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    slots: Mapping[int, tuple[bpy.types.Material, Unread]],
    size: int,
    owner: str,
) -> dict[int, Baked]:
    """Bakes materials of one evaluated object with Cycles on the CPU; nothing stays in bpy.data.

    Args:
        object_: evaluated; its mesh is the one that to_mesh(preserve_all_data_layers=True, depsgraph) gives.
        slots: what to bake and why, by Polygon.material_index; slots without faces have no result.
        size: side of the images in pixels; becomes a power of two, and larger if the faces need it.
        owner: what messages call the object.

    Raises:
        MeshError: this Blender has no Cycles, or it fails, or there are too many faces, or unsaved painting would be
            lost.
    """
    try:
        _check_unsaved()
        with ExitStack() as temporary:
            return _bake(object_, depsgraph, slots, size, temporary)
    except (MeshError, RuntimeError, TypeError) as error:
        why = (str(error).strip() or type(error).__name__).splitlines()[-1].removeprefix("Error: ")
        raise MeshError(f"baking {owner} failed: {why}") from error


def _check_unsaved() -> None:
    """Before Blender 5.2 its baker has every image read from its file again, and neither sees nor keeps painting."""
    if bpy.app.version >= (5, 2):
        return
    for image in bpy.data.images:
        if image.is_dirty and image.source not in {"GENERATED", "VIEWER"} and not len(image.packed_files):
            raise MeshError(f"image {image.name} has unsaved changes, which baking would lose; save or pack it first")


def _bake(
    object_: bpy.types.Object,
    depsgraph: bpy.types.Depsgraph,
    slots: Mapping[int, tuple[bpy.types.Material, Unread]],
    size: int,
    temporary: ExitStack,
) -> dict[int, Baked]:
    scene = _scene(depsgraph, temporary)
    source = bpy.data.meshes.new_from_object(object_, preserve_all_data_layers=True, depsgraph=depsgraph)
    temporary.callback(bpy.data.meshes.remove, source)
    vertices = np.nan_to_num(_values(source.attributes["position"]).astype(np.float64), posinf=0, neginf=0)
    parts = []
    slot = arrays.read(source.polygons, "material_index", 1, np.int32).ravel()[_polygons(source)]
    for index in slots:
        rows = np.flatnonzero(slot == index)
        if rows.size:
            layout = _layout(source, vertices, np.array(object_.matrix_world, np.float64), rows, size)
            image = bpy.data.images.new("FMQM bake", layout.side, layout.side, float_buffer=True, is_data=True)
            temporary.callback(bpy.data.images.remove, image)
            parts.append(_Part(index, rows, layout, image))
    if not parts:
        return {}

    mesh, uv_map = _triangles(source, parts, temporary)
    stand_in = _stand_in(object_, mesh, temporary)
    scene.collection.objects.link(stand_in)
    numbers = _numbers(mesh)

    def draw(bake_pass: BakePass) -> list[NDArray[np.float32]]:
        for index, part in enumerate(parts):
            material = emission_copy(slots[part.slot][0].original, bake_pass, numbers, temporary)
            target = material.node_tree.nodes.new("ShaderNodeTexImage")
            target.image = part.image
            material.node_tree.nodes.active = target
            mesh.materials[index] = material
        _run(scene, stand_in, uv_map)
        return [_pixels(part.image) for part in parts]

    colors = draw(BakePass.COLOR)
    materials = [slots[part.slot][0].original for part in parts]
    if any(keeps_shaders(each) and shines(each.node_tree) for each in materials):
        for color, own, material in zip(colors, draw(BakePass.OWN), materials, strict=True):
            if keeps_shaders(material):
                color[:, :, :3] -= own[:, :, :3]
    opaque = all(is_opaque(slots[part.slot][0].node_tree) for part in parts)
    weights = [None] * len(parts) if opaque else draw(BakePass.WEIGHT)
    return {
        part.slot: Baked(_look(*slots[part.slot], part.layout, color, weight), part.layout.corners)
        for part, color, weight in zip(parts, colors, weights, strict=True)
    }


def _scene(depsgraph: bpy.types.Depsgraph, temporary: ExitStack) -> bpy.types.Scene:
    scene = bpy.data.scenes.new("FMQM bake")
    temporary.callback(bpy.data.scenes.remove, scene)
    try:
        scene.render.engine = "CYCLES"
    except TypeError as error:
        raise MeshError("this Blender has no Cycles") from error
    # For image sequences; other animated values are copied as they are.
    like = depsgraph.scene
    scene.frame_current, scene.frame_subframe = like.frame_current, like.frame_subframe
    # The one sample of a pixel lies in its middle.
    scene.cycles.device, scene.cycles.samples, scene.cycles.max_bounces = "CPU", 1, 0
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    copy_properties(like, scene)
    copy_properties(depsgraph.view_layer, scene.view_layers[0])
    return scene


def _stand_in(object_: bpy.types.Object, mesh: bpy.types.Mesh, temporary: ExitStack) -> bpy.types.Object:
    """An object with another mesh of as many vertices, for shaders like the one it stands for."""
    made = bpy.data.objects.new("FMQM bake", mesh)
    temporary.callback(bpy.data.objects.remove, made)
    # An object's own location, rotation and scale cannot hold a shear; the inverse of a parent's can.
    made.parent = bpy.data.objects.new("FMQM bake", None)
    temporary.callback(bpy.data.objects.remove, made.parent)
    made.matrix_parent_inverse = object_.matrix_world
    made.color, made.pass_index = object_.color, object_.pass_index
    copy_properties(object_, made)
    copy_properties(object_.original.data, mesh)  # which modifiers may lose on their way
    copy_properties(object_.data, mesh)
    modeled = object_.original.data
    if isinstance(modeled, bpy.types.Mesh) and len(modeled.vertices) == len(mesh.vertices):
        _bend(made, arrays.read(modeled.vertices, "co", 3, np.float32), temporary)
    return made


def copy_properties(source: Any, target: Any) -> None:
    """Custom properties that Attribute nodes can read: numbers, and arrays of them."""
    for name, value in source.items():
        if isinstance(value, int | float | IDPropertyArray):
            target[name] = value


def _run(scene: bpy.types.Scene, object_: bpy.types.Object, uv_map: str) -> None:
    view_layer = scene.view_layers[0]
    view_layer.objects.active = object_
    object_.select_set(True, view_layer=view_layer)
    view_layer.update()
    with bpy.context.temp_override(
        scene=scene,
        view_layer=view_layer,
        object=object_,
        active_object=object_,
        selected_objects=[object_],
        selected_editable_objects=[object_],
    ):
        done = bpy.ops.object.bake(
            type="EMIT", target="IMAGE_TEXTURES", save_mode="INTERNAL", use_clear=True, use_selected_to_active=False,
            margin=_MARGIN, margin_type="EXTEND", uv_layer=uv_map,
        )  # fmt: skip
    if "FINISHED" not in done:
        raise MeshError("Cycles did not finish")


def _look(
    material: bpy.types.Material,
    unread: Unread,
    layout: Layout,
    colors: NDArray[np.float32],
    weights: NDArray[np.float32] | None,
) -> Look:
    """The drawn images as samplers.

    Args:
        colors, weights: (H, W, 4), row 0 at v = 0, see _pixels and BakePass; colors is overwritten. None: 1 all over.
    """
    opaque = weights is None or weights[:, :, 1].min(initial=1, where=weights[:, :, 3] > 0) >= _OPAQUE
    for rows in (slice(first, first + _ROWS) for first in range(0, layout.side, _ROWS)):
        _encode(colors[rows], None if weights is None else weights[rows])
    layout.fill(colors)
    pixels = np.empty((layout.side, layout.side, 3 if opaque else 4), np.uint8)
    for rows in (slice(first, first + _ROWS) for first in range(0, layout.side, _ROWS)):
        pixels[::-1][rows] = np.clip(colors[rows, :, : pixels.shape[2]], 0, 1) * 255 + 0.5
    texture = Texture(pixels, extension="extend")
    made = Material(
        material.name,
        texture,
        alpha=None if opaque else Opacity(ImageAlpha(texture)),
        how="baked",
        images=unread.images,
        uv=0 if layout.own else None,
    )
    note = f"material {material.name}: {unread.node} {unread.why}; baked at {layout.side} x {layout.side}"
    return Look(made, (MeshLayer("uv", ""),), unread.warnings, (note, *unread.notes))


def _encode(colors: NDArray[np.float32], weights: NDArray[np.float32] | None) -> None:
    """Divides what is transparent out and encodes for display, in place; the fourth channel becomes the opacity."""
    light = colors[:, :, :3]
    if weights is not None:
        weight = np.minimum(weights[:, :, :1], 1)  # more than 1 where shaders are added
        np.divide(light, weight, out=light, where=weight > 0)
        colors[:, :, 3] = weights[:, :, 1]
    colors[:, :, :3] = encode_srgb(light)


def _layout(mesh: bpy.types.Mesh, vertices: Floats, matrix: Floats, rows: NDArray[np.int64], size: int) -> Layout:
    """Places of the triangles in rows of loop_triangles."""
    world = vertices @ matrix[:3, :3].T
    triangles, loops = _loop_triangles(mesh, "vertices")[rows], _loop_triangles(mesh, "loops")[rows]
    active = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    if active is not None:
        uv = _values(mesh.attributes[active.name])[loops]
        own = own_layout(uv, triangle_areas(world, triangles), min(size, LARGEST))
        if own is not None:
            return own
    polygon = _polygons(mesh)[rows]
    first = arrays.read(mesh.polygons, "loop_start", 1, np.int32).ravel()[polygon]
    total = arrays.read(mesh.polygons, "loop_total", 1, np.int32).ravel()[polygon]
    return new_layout(world, triangles, loops - first[:, None], np.where(total == 4, polygon, -1), size)


def _triangles(source: bpy.types.Mesh, parts: list[_Part], temporary: ExitStack) -> tuple[bpy.types.Mesh, str]:
    """The parts' triangles as faces of a new mesh, with all that shaders may ask of the source; the name of the
    UV map that the baker draws by. Part i has material i."""
    rows = np.concatenate([part.rows for part in parts])
    triangles, loops = _loop_triangles(source, "vertices")[rows], _loop_triangles(source, "loops")[rows].ravel()
    kept = {"POINT": slice(None), "CORNER": loops, "FACE": _polygons(source)[rows]}

    mesh = bpy.data.meshes.new("FMQM bake")
    temporary.callback(bpy.data.meshes.remove, mesh)
    mesh.vertices.add(len(source.vertices))
    arrays.add_faces(mesh, triangles)
    for attribute in source.attributes:
        if attribute.name[0] != "." and attribute.domain in kept and attribute.data_type in _VALUES:
            _store(
                mesh, attribute.name, attribute.data_type, attribute.domain, _values(attribute)[kept[attribute.domain]]
            )
    normals = arrays.read(source.corner_normals, "vector", 3, np.float32)[loops]
    _store(mesh, "custom_normal", "FLOAT_VECTOR", "CORNER", normals)
    _store(mesh, "material_index", "INT", "FACE", np.repeat(np.arange(len(parts)), [len(part.rows) for part in parts]))
    for layer in source.uv_layers:
        mesh.uv_layers[layer.name].active_render = layer.active_render
    if source.attributes.default_color_name not in _numbers(mesh):
        mesh.attributes.default_color_name = source.attributes.default_color_name
    mesh.use_auto_texspace = False
    mesh.texspace_location, mesh.texspace_size = source.texspace_location, source.texspace_size
    for _ in parts:
        mesh.materials.append(None)
    target = mesh.attributes.new("FMQM bake", "FLOAT2", "CORNER")
    arrays.write(target.data, "vector", np.concatenate([part.layout.drawn for part in parts]))
    name = target.name
    mesh.uv_layers.active = mesh.uv_layers[name]  # the baker wants one, though it is told which
    mesh.update(calc_edges=True)
    return mesh, name


def _numbers(mesh: bpy.types.Mesh) -> set[str]:
    """Names of the attributes of fewer values than a color has."""
    kept = (each for each in mesh.attributes if each.data_type in _VALUES)
    return {each.name for each in kept if _VALUES[each.data_type][1] < 3}


def _bend(object_: bpy.types.Object, at_rest: NDArray[np.float32], temporary: ExitStack) -> None:
    """Has the mesh bent by a shape key from how it was modeled: Generated coordinates are those at rest."""
    position = object_.data.attributes["position"]
    bent = _values(position)
    if np.array_equal(bent, at_rest):
        return
    arrays.write(position.data, "vector", at_rest)
    temporary.callback(object_.shape_key_clear)
    object_.shape_key_add(name="At rest")
    key = object_.shape_key_add(name="Bent")
    arrays.write(key.data, "co", bent)
    key.value = 1


def _store(mesh: bpy.types.Mesh, name: str, data_type: str, domain: str, values: NDArray[Any]) -> None:
    attribute = mesh.attributes.get(name) or mesh.attributes.new(name, data_type, domain)
    arrays.write(attribute.data, _VALUES[data_type][0], values)


def _values(attribute: bpy.types.Attribute) -> NDArray[Any]:
    """(N, channels)"""
    return arrays.read(attribute.data, *_VALUES[attribute.data_type])


def _polygons(mesh: bpy.types.Mesh) -> NDArray[Any]:
    return arrays.read(mesh.loop_triangles, "polygon_index", 1, np.int32).ravel()


def _loop_triangles(mesh: bpy.types.Mesh, what: str) -> NDArray[Any]:
    return arrays.read(mesh.loop_triangles, what, 3, np.int32)


def _pixels(image: bpy.types.Image) -> NDArray[np.float32]:
    """(H, W, 4) linear, row 0 at v = 0, the fourth 0 where nothing was drawn; what is not a number is 0."""
    width, height = image.size
    return np.nan_to_num(arrays.read_pixels(image), copy=False).reshape(height, width, 4)
