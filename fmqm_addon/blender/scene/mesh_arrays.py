# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangulated arrays of one or many objects and their instances, with the values that their materials want."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from itertools import zip_longest

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...comparison.alignment import moved
from ...metric.errors import MeshError, one_line
from ...metric.geometry import Floats
from ...metric.surface import MeshArrays, join_meshes
from ...metric.texture import Material
from .. import arrays
from ..baking.bake import Baked, bake_slots, copy_properties
from ..limits import MAX_TRIANGLES
from ..materials.expressions import Encoded, VertexColor
from ..materials.images import TextureCache
from ..materials.read_material import plain_look, read_look
from ..materials.types import Look, MeshLayer, Reading, Unread
from .evaluated import Evaluated, Shown, evaluated, shown
from .members import disabled_when_instanced, instanced
from .mesh_layers import (
    Rows,
    Triangles,
    layer_values,
    look_on_mesh,
    missing_warning,
    own_normals,
    range_warnings,
    rows_by_slot,
    triangulated,
)

AS_FOUND = Reading()  # with the images that the file names, baking what must be
_WORKING_SPACE = "Linear Rec.709"  # what plain colors and color attributes are taken to be in
_NAMED = 2  # of the objects that share a warning
# What scans have: colors, and no material.
_VERTEX_COLORS = Look(Material("", Encoded(VertexColor(0)), how="none"), (MeshLayer("color", ""),))

_Key = tuple[int, ...]


def mesh_arrays(
    objects: Sequence[bpy.types.Object],
    name: str,
    reading: Reading = AS_FOUND,
    frame: Floats | None = None,
    cache: TextureCache | None = None,
) -> MeshArrays:
    """The objects and their instances as one mesh: modifiers applied, triangulated, in the world frame.

    Args:
        name: what messages call the whole.
        reading: how the materials are read.
        frame: (4, 4) to the world from the frame that positions are wanted in; None is the world's own.
        cache: of what has been read of this asset's materials already.

    Raises:
        MeshError: none of the objects has a face, or a color cannot be read.
    """
    cache = cache or TextureCache()
    shapes: dict[_Key, _Shape | None] = {}
    instances: list[_Instance] = []
    particles: Counter[str] = Counter()
    triangles = 0
    with evaluated(objects) as found, ExitStack() as temporary:
        order = {each.original.as_pointer(): index for index, each in enumerate(found)}
        for each in shown(found):
            if each.particle:
                particles[each.owner.original.name] += 1
                continue
            key = _key(each)
            if key not in shapes:
                shapes[key] = _read_shape(each, cache, reading, temporary)
            shape = shapes[key]
            if shape is not None:
                triangles += len(shape.triangles)
                if triangles > MAX_TRIANGLES:
                    raise MeshError(f"{name}: its instances show more than {MAX_TRIANGLES:,} triangles; measure a part")
                matrix = _relative(each.matrix, frame, each.name)
                instances.append(_Instance(order[each.owner.original.as_pointer()], each.name, matrix, key))
        warnings = _left_out(found)
        parts = {key: _as_arrays(shape, reading) for key, shape in shapes.items() if shape is not None}
    if not instances:
        what = "the mesh has no faces" if objects else "no mesh in it"
        raise MeshError(f"{name}: {what}; a surface is wanted")
    # Blender lists instances in an order that depends on the file's.
    instances.sort(key=lambda instance: (instance.owner, instance.name, instance.matrix.ravel().tolist()))
    warnings += [(instance.name, warning) for instance in instances for warning in parts[instance.shape].warnings]
    warnings += [
        (owner, f"{count} particle instances are left out; make them real to measure them")
        for owner, count in sorted(particles.items())
    ]
    space = getattr(getattr(bpy.data, "colorspace", None), "working_space", _WORKING_SPACE)  # none before 5.0
    if space != _WORKING_SPACE:
        warnings.append((name, f"the file's working space is {space}; its colors are taken as {_WORKING_SPACE}"))
    placed = [replace(moved(parts[each.shape], each.matrix), name=each.name) for each in instances]
    joined = join_meshes(placed, one_line(name))
    notes = [(instance.name, note) for instance in instances for note in parts[instance.shape].notes]
    return replace(joined, warnings=_joined(warnings), notes=_joined(notes))


def _left_out(objects: Sequence[Evaluated]) -> list[tuple[str, str]]:
    """Names of instancers and what is to be said of them."""
    collections = {each.original.name: instanced(each.original) for each in objects}
    disabled = {each: disabled_when_instanced(each) for each in set(collections.values()) if each is not None}
    return [
        (name, f"{disabled[each]} objects that it instances are left out; enable them in viewports to measure them")
        for name, each in collections.items()
        if each is not None and disabled[each]
    ]


def to_bake(objects: Sequence[bpy.types.Object], reading: Reading, cache: TextureCache) -> tuple[str, ...]:
    """Names of the materials that mesh_arrays will bake, which takes a while; what is read now stays in the cache."""
    if not reading.bake:
        return ()
    with evaluated(objects) as found:
        names = {
            material.name
            for each in shown(found)
            if not each.particle
            for material in slot_materials(each.object)
            if material is not None and _is_unread(material, each.object.data, reading, cache)
        }
    return tuple(sorted(names))


def _is_unread(material: bpy.types.Material, data: bpy.types.ID, reading: Reading, cache: TextureCache) -> bool:
    """Whether a material must be baked on what an object shows, a mesh or what becomes one."""
    try:
        look = read_look(material, cache, reading)
    except MeshError:  # mesh_arrays says so, if a face has it
        return False
    return isinstance(look, Unread) or (
        isinstance(data, bpy.types.Mesh) and isinstance(look_on_mesh(data, look), Unread)
    )


@dataclass(frozen=True)
class _Instance:
    """Where a shape is shown: by which of the objects, under which name, (4, 4) to the wanted frame."""

    owner: int
    name: str
    matrix: Floats
    shape: _Key


@dataclass(frozen=True)
class _Slot:
    """The faces of a material slot.

    Attributes:
        material: in the slot. look: of the material.
        rows: of its triangles. corners: (rows, 3, K) float32, what the look's layers hold there.
        warnings: of layers that the mesh has not, and of colors that cannot be meant.
    """

    material: bpy.types.Material | None
    look: Look | Unread
    rows: Rows
    corners: NDArray[np.float32]
    warnings: tuple[str, ...]


@dataclass(frozen=True)
class _Shape:
    """An evaluated mesh in its own coordinates.

    Attributes:
        source: the object, not evaluated, that has or makes the mesh, known as name.
        depsgraph: where that is evaluated.
        made: a temporary copy of a mesh that no object has as its own and that has something to bake. matrix: (4, 4),
            where it is first shown.
        positions: (V, 3) float32. triangles: (T, 3) int32. slots: by their index.
        normals: (T, 3, 3) float32; None: none were asked for, or it has none of its own.
    """

    source: bpy.types.Object
    name: str
    depsgraph: bpy.types.Depsgraph
    made: bpy.types.Mesh | None
    matrix: Floats
    positions: NDArray[np.float32]
    triangles: NDArray[np.int32]
    slots: dict[int, _Slot]
    normals: NDArray[np.float32] | None


def _key(each: Shown) -> _Key:
    """Equal for what has the same mesh and the same materials."""
    mesh = each.object.original if each.edited else each.object.data  # edit mode: modifiers are each object's own
    materials = slot_materials(each.object)
    return (mesh.as_pointer(), *(0 if found is None else found.as_pointer() for found in materials))


def _read_shape(each: Shown, cache: TextureCache, reading: Reading, temporary: ExitStack) -> _Shape | None:
    """None without faces. temporary: removes what is copied for baking."""
    object_, depsgraph = each.object, each.owner.depsgraph
    # What edit mode shows may lack modifiers: then all of them run once more, otherwise they have run.
    again = {"preserve_all_data_layers": True, "depsgraph": depsgraph} if each.edited else {}
    mesh = object_.to_mesh(**again)
    try:
        if mesh is None or not len(mesh.polygons):
            return None
        if reading.texture is not None and not len(mesh.uv_layers):
            raise MeshError(f"{each.name}: the mesh has no UV map, which the given image needs; unwrap it first")
        cut = triangulated(mesh, each.name)
        slots = {
            index: _read_slot(mesh, cut, rows, _slot_material(object_, index), cache, reading)
            for index, rows in rows_by_slot(mesh, cut).items()
        }
        made = None
        if reading.bake and each.made and any(isinstance(slot.look, Unread) for slot in slots.values()):
            made = bpy.data.meshes.new_from_object(object_)
            temporary.callback(bpy.data.meshes.remove, made)
        return _Shape(
            source=object_.original,
            name=each.name,
            depsgraph=depsgraph,
            made=made,
            matrix=each.matrix,
            positions=arrays.read_attribute(mesh, "position", "vector", 3, np.float32),
            triangles=cut.vertices,
            slots=slots,
            normals=own_normals(mesh, cut) if reading.normals else None,
        )
    finally:
        object_.to_mesh_clear()


def slot_materials(object_: bpy.types.Object) -> list[bpy.types.Material | None]:
    """What an evaluated object's slots show."""
    materials = [slot.material for slot in object_.material_slots]
    if bpy.app.version < (5, 2):
        return materials
    # Of a slot that is linked to the object and empty there, the evaluated object tells the mesh's material, which
    # renders do not show.
    kept = [slot.link == "OBJECT" and slot.material is None for slot in object_.original.material_slots]
    return [None if empty else found for found, empty in zip_longest(materials, kept[: len(materials)])]


def _slot_material(object_: bpy.types.Object, index: int) -> bpy.types.Material | None:
    """Blender draws a face whose slot does not exist with the last slot there is, or with the first."""
    materials = slot_materials(object_)
    return materials[min(max(index, 0), len(materials) - 1)] if materials else None


def _read_slot(
    mesh: bpy.types.Mesh,
    cut: Triangles,
    rows: Rows,
    material: bpy.types.Material | None,
    cache: TextureCache,
    reading: Reading,
) -> _Slot:
    if material is None and reading.texture is None and len(mesh.color_attributes):
        look: Look | Unread = _VERTEX_COLORS
    else:
        look = read_look(material, cache, reading)
        look = look_on_mesh(mesh, look) if isinstance(look, Look) else look
    warnings: list[str] = []
    values = [np.empty((*cut.loops[rows].shape, 0), np.float32)]
    layers = () if isinstance(look, Unread) else look.layers
    for layer in layers:
        found = layer_values(mesh, layer, cut, rows)
        if found is None:
            warnings.append(missing_warning(layer, material))
            found = np.zeros((len(values[0]), 3, layer.width), np.float32)
        elif layer.kind == "color" and len(layers) == 1:  # nothing else gives it color
            warnings += range_warnings(layer, found[:, :, :3])
        values.append(found)
    corners = values[-1] if len(values) <= 2 else np.concatenate(values, axis=2)
    return _Slot(material, look, rows, corners, tuple(warnings))


def _as_arrays(shape: _Shape, reading: Reading) -> MeshArrays:
    """The shape in its own coordinates; neither it nor its warnings and notes have a name."""
    resolved = _resolved(shape, reading)
    material = np.zeros(len(shape.triangles), np.int32)
    if len(shape.slots) == 1:
        ((_, corners),) = resolved.values()
    else:
        corners = np.zeros((len(material), 3, max(values.shape[2] for _, values in resolved.values())), np.float32)
        for row, (index, (_, values)) in enumerate(resolved.items()):
            rows = shape.slots[index].rows
            material[rows] = row
            corners[rows, :, : values.shape[2]] = values
    looks = [look for look, _ in resolved.values()]
    of_slots = (warning for slot in shape.slots.values() for warning in slot.warnings)
    return MeshArrays(
        name="",
        positions=shape.positions.astype(np.float64),
        triangles=shape.triangles,
        corners=corners,
        material=material,
        materials=tuple(look.material for look in looks),
        warnings=(*(warning for look in looks for warning in look.warnings), *of_slots),
        notes=tuple(note for look in looks for note in look.notes),
        rounding=_rounding(shape.positions),
        normals=shape.normals,
    )


def _rounding(positions: NDArray[np.float32]) -> float:
    """The step between the numbers that a file or Blender can hold where these are."""
    farthest = np.abs(positions[np.isfinite(positions).all(axis=1)]).max(initial=0)
    return float(np.spacing(farthest))


def _resolved(shape: _Shape, reading: Reading) -> dict[int, tuple[Look, NDArray[np.float32]]]:
    """Look and corner values of each slot; what could not be read is baked."""
    unread = {index: (slot.material, slot.look) for index, slot in shape.slots.items() if isinstance(slot.look, Unread)}
    baked: dict[int, Baked] = {}
    why = "baking is off"  # or failed
    if unread and reading.bake:
        try:
            with _bakeable(shape) as source:
                baked = bake_slots(source, shape.depsgraph, unread, reading.bake, shape.name)
        except MeshError as error:
            why = str(error)
    found = {}
    for index, slot in shape.slots.items():
        if isinstance(slot.look, Look):
            found[index] = (slot.look, slot.corners)
        elif index in baked:
            found[index] = (baked[index].look, baked[index].corners)
        else:
            found[index] = (_plain_look(slot.material, slot.look, why), slot.corners)
    return found


@contextmanager
def _bakeable(shape: _Shape) -> Iterator[bpy.types.Object]:
    """The object that has the shape's mesh; a temporary one for a mesh that only instances have."""
    if shape.made is None:
        yield shape.source.evaluated_get(shape.depsgraph)
        return
    stand_in = bpy.data.objects.new(shape.name, shape.made)
    try:
        stand_in.matrix_world = Matrix(shape.matrix.tolist())  # kept as it is, shears too: the object is in no scene
        stand_in.color, stand_in.pass_index = shape.source.color, shape.source.pass_index
        copy_properties(shape.source, stand_in)
        yield stand_in
    finally:
        bpy.data.objects.remove(stand_in)


def _plain_look(material: bpy.types.Material, unread: Unread, why: str) -> Look:
    return plain_look(
        material, f"material {material.name}: {unread.node} {unread.why}, and {why}; its plain color is taken"
    )


def _relative(matrix: Floats, frame: Floats | None, name: str) -> Floats:
    """(4, 4) from the object to the frame; exactly the identity where the frame is the object's own."""
    if frame is None:
        return matrix
    if np.array_equal(matrix, frame):
        return np.eye(4)
    try:
        return np.asarray(np.linalg.inv(frame) @ matrix)
    except np.linalg.LinAlgError as error:
        raise MeshError(f"{name}: its parent has a scale of zero; mend that transform") from error


def _joined(said: Iterable[tuple[str, str]]) -> tuple[str, ...]:
    """Names and what is to be said of them as warnings or notes: what many share is said once."""
    names: dict[str, dict[str, None]] = {}
    for name, text in said:
        names.setdefault(text, {})[name] = None
    return tuple(one_line(f"{_listed(list(those))}: {text}") for text, those in names.items())


def _listed(names: list[str]) -> str:
    """ "A", "A, B", or "A, B and 33 more"."""
    more = len(names) - _NAMED
    return ", ".join(names[:_NAMED]) + (f" and {more} more" if more > 0 else "")
