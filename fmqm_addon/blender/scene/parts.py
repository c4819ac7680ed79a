# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parts of an asset are measured: what is asked for, without collision hulls, in one level of detail."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import bpy

from ...metric.errors import MeshError
from ..materials.types import Reading
from .lod_names import is_collider
from .lods import COLLECTIONS, Chain, boxes_agree, chains_of
from .members import check_object, collection_members, family_members, lineage, scene_members

_NAMED = 3  # of many


@dataclass(frozen=True)
class Parts:
    """The objects of an asset that are measured, by name, and what was left out, a sentence each."""

    objects: list[bpy.types.Object]
    notes: tuple[str, ...] = ()


def parts_of(block: bpy.types.Object | bpy.types.Collection | None, reading: Reading) -> Parts:
    """The measured parts of an object with those below it, of a collection, or, None, of the active scene.

    What is hidden from rendering is left out unless all is; then what reading.include does not name, or
    reading.exclude does; then hulls for collisions, unless nothing else is there; then all levels of detail but the
    finest that is left, where two of one asset have about the same box.

    Raises:
        MeshError: the object shows no surface; or the patterns leave nothing.
    """
    if isinstance(block, bpy.types.Object):
        check_object(block)
        objects, collections = family_members(block), list[bpy.types.Collection]()
    elif block is None:
        objects, collections = scene_members(), list(bpy.context.scene.collection.children_recursive)
    else:
        objects, collections = collection_members(block), list(block.children_recursive)
    objects, notes = _asked(objects, reading), []
    hulls = [each for each in objects if any(is_collider(above.name) for above in _within(each, block))]
    if 0 < len(hulls) < len(objects):
        objects = [each for each in objects if each not in hulls]
        notes.append(f"left out as collision hulls: {_listed(each.name for each in hulls)}")
    if len(objects) > 1:
        bpy.context.view_layer.update()
        for chain in chains_of(objects, collections):
            if _is_inside(chain, block) and boxes_agree(chain, in_place=not chain.sure):
                objects, left = _finest(objects, chain)
                notes += left
    return Parts(objects, tuple(notes))


def _asked(objects: Sequence[bpy.types.Object], reading: Reading) -> list[bpy.types.Object]:
    """Those that patterns choose by their names, or those of what they hang from or of their collections."""
    if not objects or not (reading.include or reading.exclude):
        return list(objects)
    names = {each.name_full: [above.name.lower() for above in lineage(each)] for each in objects}
    for collection in bpy.data.collections:
        for name in names.keys() & set(collection.all_objects.keys()):
            names[name].append(collection.name.lower())

    def matches(object_: bpy.types.Object, patterns: Iterable[str]) -> bool:
        return any(fnmatchcase(name, pattern.lower()) for pattern in patterns for name in names[object_.name_full])

    included = [each for each in objects if not reading.include or matches(each, reading.include)]
    found = [each for each in included if not matches(each, reading.exclude)]
    if not found:
        told = f"of {_listed(each.name for each in objects)}"
        why = "excluded" if included else "included"
        raise MeshError(f"the patterns leave nothing: {told} {'all are' if included else 'none is'} {why}")
    return found


def _within(object_: bpy.types.Object, block: bpy.types.Object | bpy.types.Collection | None) -> list[bpy.types.Object]:
    """An object and what it hangs from, below the one that is measured: what the user names is meant."""
    above = lineage(object_)
    return above[: above.index(block)] if isinstance(block, bpy.types.Object) else above


def _is_inside(chain: Chain, block: bpy.types.Object | bpy.types.Collection | None) -> bool:
    """Whether the levels are parts of what is measured, not what it is a part of."""
    if not isinstance(block, bpy.types.Object):
        return True
    below = {each.as_pointer() for each in (block, *block.children_recursive)}
    return all(asset.as_pointer() in below for asset in chain.assets)


def _finest(objects: list[bpy.types.Object], chain: Chain) -> tuple[list[bpy.types.Object], list[str]]:
    """Without those of the coarser levels; and a note."""
    places = {each.name_full: chain.level_of(each) for each in objects}
    there = sorted({place for place in places.values() if place is not None})
    if len(there) < 2:
        return objects, []
    names = [asset.name for asset in chain.assets]
    left = _listed(names[place] for place in there[1:])
    kind = "the collection " if chain.how == COLLECTIONS else ""
    note = f"{kind}{names[there[0]]} is measured; left out as its coarser levels of detail: {left}"
    return [each for each in objects if places[each.name_full] in (None, there[0])], [note]


def _listed(names: Iterable[str]) -> str:
    found = list(names)
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    return ", ".join(found[:_NAMED]) + more
