# SPDX-License-Identifier: GPL-3.0-or-later
"""Tells whether an asset has changed since it was measured.

Original data are walked, not evaluated ones: cheap, and the same whether an object is hidden or in edit mode. What
Python cannot read is not seen: sculpted details of a Multiresolution modifier, what simulations have cached, and
frames of Alembic files.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from zlib import crc32

import bpy
import numpy as np
from numpy.typing import NDArray

from ...metric.geometry import Floats
from .. import arrays
from ..materials.image_files import image_paths
from .members import collection_members, instanced, instances_of, metaball_family
from .target import Target

_MOST_PAINTED = 2**24  # values of an image that are looked through, 2048 x 2048 pixels; more would hold up painting

_VALUES = {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}
_UNSEEN = ("active", "bl_", "execution_time", "open_", "select", "show_", "texspace", "use_pin")  # beginnings of names
_SEEN_ALL_THE_SAME = {"show_render", "show_viewport"}  # of modifiers
# By type: what neither shapes nor colors anything, or follows from the rest.
_LEFT_OUT: dict[str, set[str]] = {
    "ID": {prop.identifier for prop in bpy.types.ID.bl_rna.properties} | {"animation_data", "grease_pencil"},
    "Node": {
        "location", "location_absolute", "width", "height", "label", "color", "use_custom_color", "hide", "parent",
        "inputs", "outputs", "internal_links", "panel_states", "warning_propagation",
    },
    "NodeTree": {"nodes", "links", "color_tag", "default_group_node_width", "description", "annotation"},
    "NodeTreeInterfaceItem": {"parent", "interface_items", "description", "menu_expanded"},
    "Modifier": {"is_active", "point_cache", "domain_settings", "bakes", "panels", "node_warnings"},
    "Curve": {"splines", "shape_keys", "materials", "edit_format"},
    "Lattice": {"points", "shape_keys"},
    "ImageUser": {"frame_current"},
    "MetaBall": {"materials"},
}  # fmt: skip
_WALKED = (bpy.types.NodeTree, bpy.types.Texture, bpy.types.Curve, bpy.types.MetaBall, bpy.types.Lattice)
# By the type of an attribute: the key to its values, how many an element has, and their kind.
_ATTRIBUTES: dict[str, tuple[str, int, type]] = {
    "FLOAT": ("value", 1, np.float32), "FLOAT2": ("vector", 2, np.float32), "FLOAT_VECTOR": ("vector", 3, np.float32),
    "FLOAT_COLOR": ("color", 4, np.float32), "BYTE_COLOR": ("color", 4, np.float32),
    "QUATERNION": ("value", 4, np.float32), "FLOAT4X4": ("value", 16, np.float32), "INT": ("value", 1, np.int32),
    "INT32_2D": ("value", 2, np.int32), "INT16_2D": ("value", 2, np.int16), "INT8": ("value", 1, np.int8),
    "BOOLEAN": ("value", 1, np.bool_),
}  # fmt: skip
_SHOWN_ATTRIBUTES = {"FLOAT2", "FLOAT_COLOR", "BYTE_COLOR"}  # UV maps and colors count even where all is zero
_TOPOLOGY = {".corner_vert", ".edge_verts"}  # other names with a dot are selections and what is hidden
_NORMALS = "custom_normal"  # FMQM does not see them, and edit mode writes them anew


def fingerprint(target: Target, place_counts: bool) -> str:
    """A short text that differs when shape, modifiers, materials, size or, where it counts, the place have changed.

    It is the same in another session, after saving, and after edit mode in which nothing was changed. "" if the
    asset is gone.
    """
    if target.is_gone():
        return ""
    walk, root = _Walk(), target.find()
    for object_ in target.members():
        matrix = np.array(object_.matrix_world, np.float32)
        walk.add_array(matrix if place_counts else matrix[:3, :3])
        if isinstance(root, bpy.types.Object) and object_ != root:  # a part that has moved makes another whole
            walk.add_steps(np.array(root.matrix_world.inverted_safe() @ object_.matrix_world))
        walk.add_object(object_, target.bare and object_ == root)
    return walk.digest.hexdigest()


def in_edit_mode(target: Target) -> bool:
    """Whether something of an asset is being edited: what it will be is not known before that ends."""
    objects = target.members()
    return any(getattr(object_.data, "is_editmode", False) for object_ in (*objects, *instances_of(objects)))


class _Walk:
    """Goes from an object along all that shapes or colors it, each thing once, and digests what it comes by."""

    def __init__(self) -> None:
        self.digest = hashlib.blake2b(digest_size=12)
        self._seen: dict[tuple[int, str], int] = {}
        self._properties: dict[int, list[tuple[str, str]]] = {}
        self._owner: bpy.types.Object | None = None  # of what is being walked; helpers stand somewhere to it

    def add(self, *values: Any) -> None:
        self.digest.update(repr(values).encode())

    def add_array(self, values: NDArray[Any]) -> None:
        self.digest.update(np.ascontiguousarray(values).data)

    def _is_new(self, block: Any) -> bool:
        """Whether this is met for the first time; its number is digested, by which pointers differ."""
        key = (block.as_pointer(), block.bl_rna.identifier)
        new = key not in self._seen
        self.add(self._seen.setdefault(key, len(self._seen)))
        return new

    # --- What shapes an object

    def add_object(self, object_: bpy.types.Object, bare: bool = False) -> None:
        """All but where it stands. bare: without modifiers."""
        if not self._is_new(object_):
            return
        outer, self._owner = self._owner, object_
        modifiers = () if bare else tuple(object_.modifiers)
        self._add_shape(object_, weighted=bool(modifiers) and len(object_.vertex_groups) > 0)
        for modifier in modifiers:
            self._add_struct(modifier)
            if modifier.type == "NODES" and not hasattr(modifier, "properties"):  # before Blender 5.2
                for key, value in sorted(modifier.items()):
                    self.add(key)
                    self._add_value(value)
        if object_.parent_type in {"ARMATURE", "LATTICE"}:
            self._add_pointer(object_.parent)
        self._add_pointer(instanced(object_))
        if object_.instance_type in {"VERTS", "FACES"}:
            for child in sorted(object_.children, key=lambda child: child.name_full):
                self._add_pointer(child)
        for slot in object_.material_slots:
            self._add_pointer(slot.material)
        self._owner = outer

    def _add_shape(self, object_: bpy.types.Object, weighted: bool) -> None:
        data = object_.data
        if object_.type == "MESH":
            with _out_of_edit_mode(object_) as mesh:
                self._add_mesh(mesh)
                if weighted:
                    self.add([group.name for group in object_.vertex_groups])
                    self.add([(each.group, each.weight) for v in mesh.vertices for each in (*v.groups, _NEXT)])
        elif object_.type == "META":
            for ball in metaball_family(object_):
                self.add_steps(np.array(object_.matrix_world.inverted_safe() @ ball.matrix_world))
                self._add_pointer(ball.data)
        elif object_.type == "ARMATURE":
            self.add(data.pose_position)
            self.add_steps(np.array([bone.matrix for bone in object_.pose.bones]))
        elif isinstance(data, bpy.types.Curve):
            self._add_pointer(data)
            for spline in data.splines:
                self._add_points(spline.points, co=4, radius=1, tilt=1)
                self._add_points(spline.bezier_points, co=3, handle_left=3, handle_right=3, radius=1, tilt=1)
                self._add_struct(spline, {"points", "bezier_points"})
        elif object_.type == "LATTICE":
            self._add_pointer(data)
            self._add_points(data.points, co_deform=3)
        elif hasattr(data, "attributes"):
            self._add_attributes(data)
        self._add_shape_keys(object_)

    def _add_mesh(self, mesh: bpy.types.Mesh) -> None:
        self.add(len(mesh.vertices), len(mesh.edges), len(mesh.loops), len(mesh.polygons))
        if len(mesh.loops) != 3 * len(mesh.polygons):  # else all are triangles
            self._add_points(mesh.polygons, kind=np.int32, loop_start=1)
        self._add_attributes(mesh)
        self.add([layer.name for layer in mesh.uv_layers if layer.active_render], mesh.attributes.default_color_name)

    def _add_attributes(self, data: Any) -> None:
        for attribute in sorted(data.attributes, key=lambda attribute: attribute.name):
            name, known = attribute.name, _ATTRIBUTES.get(attribute.data_type)
            if known is None or name == _NORMALS or (name.startswith(".") and name not in _TOPOLOGY):
                continue
            key, width, kind = known
            values = arrays.read(attribute.data, key, width, kind)
            # Blender keeps attributes of nothing but zeros or not, as it likes.
            if attribute.data_type in _SHOWN_ATTRIBUTES or values.any():
                self.add(name, attribute.domain, attribute.data_type)
                self.add_array(values)

    def _add_shape_keys(self, object_: bpy.types.Object) -> None:
        keys = getattr(object_.data, "shape_keys", None)
        if keys is None:
            return
        pinned = object_.active_shape_key_index if object_.show_only_shape_key else None
        self.add(keys.use_relative, keys.eval_time, pinned)
        for key in keys.key_blocks:
            relative = key.relative_key.name if key.relative_key else ""
            self.add(key.name, key.value, key.mute, key.interpolation, key.vertex_group, relative, key.frame)
            if key.points:  # of meshes and lattices
                self._add_points(key.points, co=3)
            else:
                self.add([_plain(getattr(point, "co", None)) for point in key.data])

    def _add_points(self, points: Any, kind: type = np.float32, **widths: int) -> None:
        for key, width in widths.items():
            self.add_array(arrays.read(points, key, width, kind))

    def add_steps(self, values: Floats) -> None:
        """Numbers up to rounding, which differs where things are moved together."""
        values = np.nan_to_num(values)
        largest = np.abs(values).max(initial=0.0)
        step = 1e-4 * 2.0 ** np.ceil(np.log2(largest)) if largest > 0 else 1.0
        self.add_array(np.rint(values / step).astype(np.int32))

    # --- Anything

    def _add_value(self, value: Any) -> None:
        if isinstance(value, bpy.types.ID):
            self._add_pointer(value)
        else:
            self.add(_plain(value))

    def _add_pointer(self, block: Any) -> None:
        """What a property points at, and what that points at in turn."""
        if block is None:
            self.add(None)
        elif isinstance(block, bpy.types.Object):
            if self._owner is not None:
                self.add_steps(np.array(self._owner.matrix_world.inverted_safe() @ block.matrix_world))
            self.add_object(block)
        elif isinstance(block, bpy.types.Collection):
            self._add_collection(block)
        elif isinstance(block, bpy.types.Material):
            self._add_material(block)
        elif isinstance(block, bpy.types.Image):
            self.add(block.name_full)
            if self._is_new(block):
                self.add(_image_state(block))
        elif isinstance(block, bpy.types.ID) and not isinstance(block, _WALKED):
            self.add(block.name_full)
        else:
            self._add_struct(block)

    def _add_collection(self, collection: bpy.types.Collection) -> None:
        if not self._is_new(collection):
            return
        self.add(_plain(collection.instance_offset))
        for member in collection_members(collection):
            self.add_array(np.array(member.matrix_world, np.float32))
            self.add_object(member)

    def _add_material(self, material: bpy.types.Material) -> None:
        if not self._is_new(material):
            return
        self.add(_plain(material.diffuse_color))
        if bpy.app.version < (5, 0):  # later all have nodes
            self.add(material.use_nodes)
        if material.node_tree is not None:
            self._add_struct(material.node_tree)

    def _add_struct(self, struct: Any, left_out: set[str] | frozenset[str] = frozenset()) -> None:
        """The settings of a node tree, node, modifier, texture, ..., and what is in it."""
        if not self._is_new(struct):
            return
        self.add(struct.bl_rna.identifier)
        for name, kind in self._properties_of(struct):
            if name in left_out:
                continue
            value = getattr(struct, name)
            if kind == "COLLECTION":
                self.add(name, len(value))
                for item in value:
                    self._add_struct(item)
            elif kind == "POINTER":
                self.add(name)
                self._add_pointer(value)
            else:
                self.add(name, _plain(value))
        if isinstance(struct, bpy.types.NodeTree):
            self._add_nodes(struct)
        elif isinstance(struct, bpy.types.Node):
            for socket in (*struct.inputs, *struct.outputs):
                self.add(socket.identifier)
                self._add_value(getattr(socket, "default_value", None))

    def _add_nodes(self, tree: bpy.types.NodeTree) -> None:
        """By name: which is in front of which is of no matter."""
        for node in sorted(tree.nodes, key=lambda node: node.name):
            if node.bl_idname != "NodeFrame":
                self._add_struct(node)
        self.add(
            sorted(
                (
                    (link.to_node.name, link.to_socket.identifier, link.multi_input_sort_id),
                    (link.from_node.name, link.from_socket.identifier, link.is_muted),
                )
                for link in tree.links
            )
        )

    def _properties_of(self, struct: Any) -> list[tuple[str, str]]:
        """Names and types of the properties that count."""
        rna = struct.bl_rna
        found = self._properties.get(rna.as_pointer())
        if found is None:
            left_out = {"rna_type"}.union(*(_LEFT_OUT.get(each.__name__, ()) for each in type(struct).__mro__))
            found = self._properties[rna.as_pointer()] = [
                (prop.identifier, prop.type)
                for prop in rna.properties
                if prop.identifier not in left_out
                and (prop.identifier in _SEEN_ALL_THE_SAME or not prop.identifier.startswith(_UNSEEN))
                and not (prop.is_readonly and prop.type in _VALUES)  # follows from others
            ]
        return found


class _Next:
    """Ends the groups of a vertex."""

    group, weight = -1, 0.0


_NEXT = _Next()


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


def _image_state(image: bpy.types.Image) -> list[Any]:
    """Of a painted image the pixels, of a file what tells that it was written since: not its folder, which saving
    makes relative and which may move with the .blend."""
    known: list[Any] = [image.source, image.colorspace_settings.name, image.alpha_mode]
    if image.is_dirty and len(image.pixels) > _MOST_PAINTED:
        known.append("painted")
    elif image.is_dirty:
        known.append(crc32(arrays.read_pixels(image).data))
    elif image.packed_files:
        known += [file.packed_file.size for file in image.packed_files if file.packed_file is not None]
    elif image.source == "GENERATED":
        known += [image.generated_type, image.generated_width, image.generated_height, *image.generated_color]
    else:
        for path in image_paths(image):
            known += [os.path.basename(path), *_written(path)]
    return known


def _written(path: str) -> tuple[int, ...]:
    """When a file was written, and its size; empty: there is none."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return ()
    return found.st_mtime_ns, found.st_size


def _plain(value: Any) -> Any:
    """Something whose repr tells its value: Blender's arrays print their addresses, its vectors round."""
    if isinstance(value, bool):  # Blender 4.5 saves those of Geometry Nodes as numbers
        return int(value)
    if value is None or isinstance(value, (int, float, str)):
        return value
    if isinstance(value, (set, frozenset)):
        return sorted(value)
    try:
        return tuple(map(_plain, value))
    except TypeError:
        return str(type(value))
