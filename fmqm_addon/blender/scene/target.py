# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user named in a scene, as arrays and a transform; and whether it has changed since."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any
from zlib import crc32

import bpy
import numpy as np
from numpy.typing import NDArray

from ...comparison.alignment import AssetMesh
from ...metric.errors import MeshError
from ...metric.geometry import Floats
from ..materials.image_files import image_paths
from ..materials.images import TextureCache
from ..materials.types import Reading
from .evaluated import evaluated
from .members import SURFACE_TYPES, check_object, collection_members, family_members, instanced, is_measured
from .mesh_arrays import AS_FOUND, mesh_arrays, to_bake
from .shaping import check_shaping_images

OBJECT, COLLECTION = "OBJECT", "COLLECTION"
_MOST_PAINTED = 2**24  # values of an image that are looked through, 2048 x 2048 pixels; more would hold up painting


@dataclass(frozen=True)
class Target:
    """An asset by its name: Blender may delete, undo or reload the thing itself at any time.

    Attributes:
        kind: OBJECT or COLLECTION. name: with its library, as name_full has it.
        bare: without modifiers; for mesh objects.
    """

    kind: str
    name: str
    bare: bool = False

    @property
    def label(self) -> str:
        return f"{self.name} (no modifiers)" if self.bare else self.name

    def find(self) -> bpy.types.Object | bpy.types.Collection | None:
        blocks = bpy.data.objects if self.kind == OBJECT else bpy.data.collections
        return next((block for block in blocks if block.name_full == self.name), None)

    def is_gone(self) -> bool:
        block = self.find()
        return block is None or (isinstance(block, bpy.types.Object) and not block.users_scene)


def target_of(block: bpy.types.Object | bpy.types.Collection, bare: bool = False) -> Target:
    return Target(OBJECT if isinstance(block, bpy.types.Object) else COLLECTION, block.name_full, bare)


def take(target: Target, reading: Reading = AS_FOUND, cache: TextureCache | None = None) -> AssetMesh:
    """The asset's arrays, read from Blender; nothing stays behind.

    An object is itself with its instances. An empty is what hangs from it and what it instances, a collection is
    what it holds; what is hidden from rendering is left out of either, unless all is.

    Args:
        reading: how the materials are read. cache: of bakes, just before.

    Raises:
        MeshError: it is gone, of another type, or holds nothing that can be measured.
    """
    block = target.find()
    if block is None:
        raise MeshError(f"{target.name}: it is no longer in the file; choose another")
    if isinstance(block, bpy.types.Collection):
        return asset_mesh(collection_members(block), target.label, reading, cache=cache)
    if block.type == "EMPTY":
        return asset_mesh(family_members(block), target.label, reading, block, cache)
    check_object(block)
    if not block.users_scene:
        raise MeshError(f"{target.name}: it has been deleted from the scene; choose another")
    if target.bare:
        return _without_modifiers(block, target.label, reading, cache)
    return asset_mesh([block], target.label, reading, block, cache)


def bakes(target: Target, reading: Reading, cache: TextureCache) -> tuple[str, ...]:
    """Names of the materials that take will bake; as mesh.to_bake."""
    return to_bake(_members(target), reading, cache)


def asset_mesh(
    objects: Sequence[bpy.types.Object],
    name: str,
    reading: Reading = AS_FOUND,
    origin: bpy.types.Object | None = None,
    cache: TextureCache | None = None,
) -> AssetMesh:
    """Objects as one mesh in the frame of their origin.

    Args:
        origin: the object whose frame it is; None is the only one, or the one that all hang from, or else the world.
        reading: how the materials are read.

    Raises:
        MeshError: none of them has a face, or a color cannot be read.
    """
    if origin is None and len(objects) == 1:
        origin = objects[0]
    elif origin is None:
        roots = {_root(object_).name_full: _root(object_) for object_ in objects}
        origin = next(iter(roots.values())) if len(roots) == 1 else None
    matrix = np.eye(4) if origin is None else _matrix_of(origin)
    check_shaping_images(objects)
    return AssetMesh(mesh_arrays(objects, name, reading, matrix, cache), matrix)


def contains_surface(block: bpy.types.Object | bpy.types.Collection) -> bool:
    """Whether there is something to measure in an object or collection, faces or not."""
    if isinstance(block, bpy.types.Collection):
        return any(is_measured(object_) for object_ in block.all_objects)
    return is_measured(block) or (block.type == "EMPTY" and any(map(is_measured, block.children_recursive)))


def _without_modifiers(
    object_: bpy.types.Object, label: str, reading: Reading, cache: TextureCache | None
) -> AssetMesh:
    """By way of a duplicate of the object, on the same mesh."""
    if object_.mode == "EDIT":
        object_.update_from_editmode()
    duplicate = object_.copy()
    try:
        duplicate.modifiers.clear()
        result = asset_mesh([duplicate], label, reading, duplicate, cache)
        warnings = tuple(w.replace(duplicate.name, object_.name, 1) for w in result.mesh.warnings)
        return replace(result, mesh=replace(result.mesh, warnings=warnings))
    except MeshError as error:
        raise MeshError(str(error).replace(duplicate.name, object_.name)) from error
    finally:
        bpy.data.objects.remove(duplicate)


def _root(object_: bpy.types.Object) -> bpy.types.Object:
    while object_.parent is not None:
        object_ = object_.parent
    return object_


def _matrix_of(object_: bpy.types.Object) -> Floats:
    """(4, 4) float64, up to date, wherever the object is."""
    with evaluated([object_]) as [found]:
        return np.array(found.object.matrix_world, np.float64)


def fingerprint(target: Target, place_counts: bool) -> str:
    """A short text that differs when mesh, modifiers, materials, size or, where it counts, the place have changed.

    Original data, not evaluated: cheap, and the same whether the object is hidden or in edit mode. "" if it is gone.
    """
    if target.is_gone():
        return ""
    objects = _members(target)
    digest = hashlib.blake2b(digest_size=12)
    for object_ in objects:
        _add_object(digest, object_, place_counts, target.bare)
    for object_ in _instances_of(objects):
        _add_object(digest, object_, True, False)
    return digest.hexdigest()


def in_edit_mode(target: Target) -> bool:
    """Whether something of an asset is being edited: what it will be is not known before that ends."""
    objects = _members(target)
    return any(getattr(object_.data, "is_editmode", False) for object_ in (*objects, *_instances_of(objects)))


def _members(target: Target) -> list[bpy.types.Object]:
    """The objects that an asset consists of, instances aside."""
    block = target.find()
    if block is None:
        return []
    if isinstance(block, bpy.types.Collection):
        return collection_members(block)
    return family_members(block) if block.type == "EMPTY" else [block]


def _instances_of(objects: Sequence[bpy.types.Object]) -> list[bpy.types.Object]:
    """The objects of the collections that some instance, and of those that these instance, each once."""
    found: dict[str, bpy.types.Object] = {}
    seen: set[str] = set()
    waiting = list(objects)
    while waiting:
        collection = instanced(waiting.pop())
        if collection is not None and collection.name_full not in seen:
            seen.add(collection.name_full)
            members = collection_members(collection)
            found.update((member.name_full, member) for member in members)
            waiting += members
    return [found[name] for name in sorted(found)]


def _add_object(digest: Any, object_: bpy.types.Object, place_counts: bool, bare: bool) -> None:
    matrix = np.array(object_.matrix_world, np.float32)
    digest.update((matrix if place_counts else matrix[:3, :3]).tobytes())
    _add_shape(digest, object_)
    for modifier in () if bare else object_.modifiers:
        _add_values(digest, modifier)
    for helper in _helpers(object_, bare):
        _add_steps(digest, np.array(object_.matrix_world.inverted_safe() @ helper.matrix_world))
        _add_shape(digest, helper)
    for slot in object_.material_slots:
        _add_material(digest, slot.material)


def _helpers(object_: bpy.types.Object, bare: bool) -> list[bpy.types.Object]:
    """The objects by which modifiers, and some parents, deform an object: armatures, lattices, hooks, targets."""
    pointers = [object_.parent] if object_.parent_type in {"ARMATURE", "LATTICE"} else []
    for modifier in () if bare else object_.modifiers:
        kinds = modifier.bl_rna.properties
        pointers += [getattr(modifier, prop.identifier) for prop in kinds if prop.type == "POINTER"]
    return [each for each in pointers if isinstance(each, bpy.types.Object)]


def _add_shape(digest: Any, object_: bpy.types.Object) -> None:
    if object_.type == "MESH":
        with _out_of_edit_mode(object_) as mesh:
            _add_mesh(digest, mesh)
    elif object_.type == "META":
        for ball in object_.data.elements:
            _add_values(digest, ball)
    elif object_.type == "ARMATURE":
        _add_steps(digest, np.array([bone.matrix for bone in object_.pose.bones]))
    elif object_.type == "LATTICE":
        _add_array(digest, object_.data.points, "co_deform", len(object_.data.points) * 3, np.float32)
    elif object_.type in SURFACE_TYPES:
        _add_values(digest, object_.data)
        for spline in object_.data.splines:
            _add_values(digest, spline)
            for points in (spline.points, spline.bezier_points):
                digest.update(repr([_plain(point.co) for point in points]).encode())


@contextmanager
def _out_of_edit_mode(object_: bpy.types.Object) -> Iterator[bpy.types.Mesh]:
    """The mesh of an object, or in edit mode, where its arrays are empty, what it would be on leaving."""
    if not object_.data.is_editmode:
        yield object_.data
        return
    object_.update_from_editmode()
    try:
        yield object_.to_mesh()
    finally:
        object_.to_mesh_clear()


def _add_mesh(digest: Any, mesh: bpy.types.Mesh) -> None:
    digest.update(f"{len(mesh.vertices)} {len(mesh.loops)} {len(mesh.polygons)}".encode())
    for name, key, kind, width in (("position", "vector", np.float32, 3), (".corner_vert", "value", np.int32, 1)):
        attribute = mesh.attributes.get(name)
        if attribute is not None and len(attribute.data):
            _add_array(digest, attribute.data, key, len(attribute.data) * width, kind)
    layer = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    if layer is not None and len(layer.uv):
        _add_array(digest, layer.uv, "vector", len(layer.uv) * 2, np.float32)
    digest.update(mesh.attributes.default_color_name.encode())
    for colors in mesh.color_attributes:
        digest.update(colors.name.encode())
        _add_array(digest, colors.data, "color", len(colors.data) * 4, np.float32)
    if len(mesh.polygons):
        _add_array(digest, mesh.polygons, "material_index", len(mesh.polygons), np.int32)
    if mesh.shape_keys is not None:
        digest.update(repr([(key.name, key.value, key.mute) for key in mesh.shape_keys.key_blocks]).encode())


def _add_steps(digest: Any, values: Floats) -> None:
    """Numbers up to rounding, which differs where things are moved together."""
    values = np.nan_to_num(values)
    largest = np.abs(values).max(initial=0.0)
    step = 1e-4 * 2.0 ** np.ceil(np.log2(largest)) if largest > 0 else 1.0
    digest.update(np.rint(values / step).astype(np.int32).tobytes())


def _add_array(digest: Any, collection: Any, key: str, size: int, kind: type) -> None:
    values: NDArray[Any] = np.empty(size, kind)
    collection.foreach_get(key, values)
    digest.update(values)


def _add_material(digest: Any, material: bpy.types.Material | None) -> None:
    if material is None:
        digest.update(b"none")
        return
    digest.update(np.array(material.diffuse_color, np.float32))
    if material.node_tree is None:
        return
    for node in material.node_tree.nodes:
        _add_values(digest, node)
        for socket in node.inputs:
            digest.update(repr(_plain(getattr(socket, "default_value", None))).encode())
        image = getattr(node, "image", None)
        if image is not None:
            _add_image(digest, image)
    for link in material.node_tree.links:
        names = (link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier)
        digest.update(repr(names).encode())


def _add_image(digest: Any, image: bpy.types.Image) -> None:
    """Of a painted image the pixels, of a file what tells that it was written since: not its folder, which saving
    makes relative and which may move with the .blend."""
    known: list[Any] = [image.source, image.colorspace_settings.name, image.alpha_mode]
    if image.is_dirty and len(image.pixels) > _MOST_PAINTED:
        known.append("painted")
    elif image.is_dirty:
        pixels: NDArray[np.float32] = np.empty(len(image.pixels), np.float32)
        image.pixels.foreach_get(pixels)
        known.append(crc32(pixels.data))
    elif image.packed_files:
        known += [file.packed_file.size for file in image.packed_files if file.packed_file is not None]
    elif image.source == "GENERATED":
        known += [image.generated_type, image.generated_width, image.generated_height, *image.generated_color]
    else:
        for path in image_paths(image):
            known += [os.path.basename(path), *_written(path)]
    digest.update(repr(known).encode())


def _written(path: str) -> tuple[int, ...]:
    """When a file was written, and its size; empty: there is none."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return ()
    return found.st_mtime_ns, found.st_size


_NOT_A_VALUE = {
    "rna_type", "original", "location", "location_absolute", "width", "height", "select", "is_active", "dimensions",
}  # fmt: skip
_VALUES = {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}


def _add_values(digest: Any, block: Any) -> None:
    """The plain settings of a modifier or node, with what it points at by name."""
    for prop in block.bl_rna.properties:
        name = prop.identifier
        if name in _NOT_A_VALUE or name.startswith(("show_", "execution_time", "bl_")):
            continue
        if prop.type in _VALUES and not prop.is_readonly:
            value = getattr(block, name)
            digest.update(f"{name}={_plain(value)}".encode())
        elif prop.type == "POINTER" and isinstance(getattr(block, name), bpy.types.ID):
            digest.update(f"{name}={getattr(block, name).name_full}".encode())
    if isinstance(block, bpy.types.Modifier):
        digest.update(f"{block.show_viewport}".encode())
        if block.type == "NODES" and block.node_group is not None:
            _add_node_inputs(digest, block)


def _add_node_inputs(digest: Any, modifier: bpy.types.Modifier) -> None:
    if not hasattr(modifier, "properties"):  # before Blender 5.2
        digest.update(repr([(key, _plain(modifier[key])) for key in modifier.keys()]).encode())  # noqa: SIM118
        return
    inputs = modifier.properties.inputs
    for prop in inputs.bl_rna.properties:
        if prop.type == "POINTER" and prop.identifier != "rna_type":
            digest.update(prop.identifier.encode())
            _add_values(digest, getattr(inputs, prop.identifier))


def _plain(value: Any) -> Any:
    """Something whose repr tells its value: Blender's arrays print their addresses."""
    if value is None or isinstance(value, (int, float, str, set)):
        return value
    if isinstance(value, bpy.types.ID):
        return value.name_full
    try:
        return tuple(value)
    except TypeError:
        return str(type(value))
