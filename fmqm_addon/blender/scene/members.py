# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects belong to an asset: what renders show of a collection, a file, or what hangs from an empty."""

from __future__ import annotations

import re
from collections.abc import Iterable

import bpy

from ...metric.errors import MeshError
from ..limits import MAX_INSTANCES

SURFACE_TYPES = ("MESH", "CURVE", "SURFACE", "FONT", "META")  # objects that Blender shows as meshes
WANTED = "a mesh, curve, surface, text, metaball or empty is wanted"

_DEEPEST = 8  # collections in one another that Blender shows

_NUMBER = re.compile(r"(.*)\.(\d+)", re.DOTALL)
_NOT_EXPORTED = "glTF_not_exported"  # where the glTF importer puts what it made for display


def is_measured(object_: bpy.types.Object) -> bool:
    """Whether an object may show a surface: its own, that of the collection it instances, or what its Geometry Nodes
    make of it, as point clouds from USD files have them. Cheap."""
    return (
        object_.type in SURFACE_TYPES
        or instanced(object_) is not None
        or any(modifier.type == "NODES" for modifier in object_.modifiers)
    )


def shows_surface(object_: bpy.types.Object) -> bool:
    """Whether an object, or one below it, may show a surface."""
    return is_measured(object_) or any(map(is_measured, object_.children_recursive))


def lineage(object_: bpy.types.Object | None) -> list[bpy.types.Object]:
    """An object and what it hangs from, the nearest first."""
    found = []
    while object_ is not None:
        found.append(object_)
        object_ = object_.parent
    return found


def check_object(object_: bpy.types.Object) -> None:
    """Refuses what cannot be measured by its name.

    Raises:
        MeshError: the object shows no surface, nor those below it, or its surface is held by another.
    """
    if object_.type != "EMPTY" and not shows_surface(object_):
        kind = object_.type.lower().replace("_", " ")
        raise MeshError(f"{object_.name}: the object is of type {kind}; {WANTED}")
    mother = metaball_mother(object_) if object_.type == "META" else object_
    if mother != object_:
        raise MeshError(f"{object_.name}: the surface of these metaballs belongs to {mother.name}; choose that")


def instanced(object_: bpy.types.Object) -> bpy.types.Collection | None:
    """The collection that an object shows in its place."""
    return object_.instance_collection if object_.instance_type == "COLLECTION" else None


def check_instances(objects: Iterable[bpy.types.Object]) -> None:
    """Counts what objects instance without unfolding it: collections that instance each other multiply.

    Raises:
        MeshError: it is too much.
    """
    roots = [instanced(object_) for object_ in objects]
    if not any(roots):
        return
    held = {each: [instanced(object_) for object_ in each.all_objects] for each in bpy.data.collections}
    shown = {None: 0} | dict.fromkeys(held, 0)
    for _ in range(_DEEPEST):
        shown |= {each: sum(1 + shown[inner] for inner in nested) for each, nested in held.items()}
    count = sum(shown[root] for root in roots)
    if count > MAX_INSTANCES:
        raise MeshError(
            f"its collections show {count:,} objects by instancing each other; at most {MAX_INSTANCES:,} are measured"
        )


def collection_members(collection: bpy.types.Collection) -> list[bpy.types.Object]:
    """What a collection that the user names shows, by name; if renders show nothing of it, all there is in it."""
    excluded = _excluded(bpy.context.view_layer)
    if collection.name_full in excluded:  # the whole is named all the same
        excluded = frozenset()
    return _members(_visible(collection, excluded)) or _members(collection.all_objects)


def family_members(object_: bpy.types.Object) -> list[bpy.types.Object]:
    """What an object and those below it show, by name: the object itself, hidden or not; those that are hidden only
    if it is, too, and there are no others."""
    below = object_.children_recursive
    visible = [member for member in below if not member.hide_render]
    own = [object_] if is_measured(object_) else []
    is_hidden = object_.hide_render or not own
    found = own + _members(below if is_hidden and not _members(visible) else visible)
    return sorted(found, key=lambda each: each.name_full)


def instances_of(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
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


def scene_members() -> list[bpy.types.Object]:
    """What renders show of the active scene, by name."""
    view_layer = bpy.context.view_layer
    return _members(_visible(view_layer.layer_collection.collection, _excluded(view_layer)))


def _visible(
    collection: bpy.types.Collection, excluded: frozenset[str] = frozenset(), viewports: bool = False
) -> list[bpy.types.Object]:
    """The objects in a collection and below that neither they nor collections hide from rendering.

    Args:
        excluded: names of collections that are left out. Where a collection is instanced none are.
        viewports: nor from viewports.
    """
    found: dict[str, bpy.types.Object] = {}

    def is_hidden(block: bpy.types.Object | bpy.types.Collection) -> bool:
        return block.hide_render or (viewports and block.hide_viewport)

    def visit(inner: bpy.types.Collection) -> None:
        found.update((object_.name_full, object_) for object_ in inner.objects if not is_hidden(object_))
        for child in inner.children:
            if not is_hidden(child) and child.name_full not in excluded:
                visit(child)

    visit(collection)
    return list(found.values())


def hidden_when_instanced(collection: bpy.types.Collection) -> frozenset[int]:
    """Addresses of the objects that renders do not show where a collection is instanced, at any depth."""
    shown: set[int] = set()
    every: set[int] = set()
    for inner in _with_nested(collection):
        every.update(object_.as_pointer() for object_ in inner.all_objects)
        shown.update(object_.as_pointer() for object_ in _visible(inner))
    return frozenset(every - shown)


def disabled_when_instanced(collection: bpy.types.Collection) -> int:
    """How many objects renders show where a collection is instanced, at any depth, and viewports do not: Blender
    lists to Python only the instances that viewports show."""
    rendered: set[int] = set()
    listed: set[int] = set()
    for inner in _with_nested(collection):
        rendered.update(each.as_pointer() for each in _visible(inner) if is_measured(each))
        listed.update(each.as_pointer() for each in _visible(inner, viewports=True))
    return len(rendered - listed)


def _with_nested(collection: bpy.types.Collection) -> list[bpy.types.Collection]:
    """The collection and those that instances show of it, at any depth, each once."""
    found = [collection]
    for each in found:  # which grows
        nested = (instanced(object_) for object_ in _visible(each))
        found += dict.fromkeys(inner for inner in nested if inner is not None and inner not in found)
    return found


def metaball_mother(object_: bpy.types.Object) -> bpy.types.Object:
    """The metaball whose name has the lowest number: it holds the mesh of all that share its name and scene."""
    return metaball_family(object_)[0]


def metaball_family(object_: bpy.types.Object) -> list[bpy.types.Object]:
    """The metaballs that flow into one surface with this one, the mother first."""
    stem, scenes = _split(object_.name)[0], set(object_.users_scene)
    family = [
        other
        for other in bpy.data.objects
        if other == object_
        or (other.type == "META" and _split(other.name)[0] == stem and scenes & set(other.users_scene))
    ]
    return sorted(family, key=lambda other: _split(other.name)[1])


def _members(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Those that show a surface of the asset's own, by name: the order must not depend on the file's."""
    extras = _display_shapes()
    found = [
        object_
        for object_ in objects
        if is_measured(object_)
        and object_.as_pointer() not in extras
        and (object_.type != "META" or metaball_mother(object_) == object_)
    ]
    return sorted(found, key=lambda object_: object_.name_full)


def _display_shapes() -> set[int]:
    """Addresses of what only gives bones their look."""
    shapes = {
        bone.custom_shape.as_pointer()
        for object_ in bpy.data.objects
        if object_.pose is not None
        for bone in object_.pose.bones
        if bone.custom_shape is not None
    }
    extra = bpy.data.collections.get(_NOT_EXPORTED)
    return shapes if extra is None else shapes | {object_.as_pointer() for object_ in extra.all_objects}


def _excluded(view_layer: bpy.types.ViewLayer) -> frozenset[str]:
    """Names of the collections that a view layer leaves out wherever they are linked."""
    left_out: set[str] = set()
    taken: set[str] = set()

    def visit(layer: bpy.types.LayerCollection) -> None:
        (left_out if layer.exclude else taken).add(layer.collection.name_full)
        for child in layer.children:
            visit(child)

    visit(view_layer.layer_collection)
    return frozenset(left_out - taken)


def _split(name: str) -> tuple[str, int]:
    """Name and number as Blender splits them: "Ball.002" is ("Ball", 2)."""
    match = _NUMBER.fullmatch(name)
    return (match[1], int(match[2])) if match else (name, 0)
