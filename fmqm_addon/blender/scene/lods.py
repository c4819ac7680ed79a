# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding the levels of detail of an asset in a scene."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TypeAlias

import bpy
import numpy as np

from ...metric.geometry import Floats
from .lod_names import LODName, is_collider, lod_of_name, stem_of_name
from .members import SURFACE_TYPES, instanced, is_measured, lineage, shows_surface

Asset: TypeAlias = bpy.types.Object | bpy.types.Collection

NAMES, LOD_GROUP, COLLECTIONS = "names", "LodGroup", "collections"  # how levels are told, in the order they are asked
LEVEL, GROUP = "fmqm_lod_level", "fmqm_lod_group"  # what files tell of an object without a name for it
_AGREE = 0.25  # of the larger box's diagonal; a level loses its thin parts, and a billboard is flat


@dataclass(frozen=True)
class LODGroup:
    """Levels of one asset, the finest first. how: where they were found, for the message."""

    levels: tuple[Asset, ...]
    how: str


@dataclass(frozen=True)
class Chain:
    """Levels of one asset by their numbers, from fine to coarse; -1 is an original that stands without a number.

    Attributes:
        name: the asset's, as the finest level has it; "" where the levels have no other name.
        sure: nothing but levels has such names.
        how: NAMES, LOD_GROUP or COLLECTIONS.
    """

    name: str
    levels: tuple[tuple[int, Asset], ...]
    sure: bool
    how: str

    @property
    def assets(self) -> tuple[Asset, ...]:
        return tuple(asset for _, asset in self.levels)

    def level_of(self, object_: bpy.types.Object) -> int | None:
        """The place in levels of the one that an object belongs to, the nearest above it; None: to none."""
        places = {asset.as_pointer(): place for place, asset in enumerate(self.assets)}
        if self.how == COLLECTIONS:
            found = (place for place, asset in enumerate(self.assets) if object_.name_full in asset.all_objects)
        else:
            found = (places[each.as_pointer()] for each in lineage(object_) if each.as_pointer() in places)
        return next(found, None)


def lod_of(asset: Asset) -> LODName | None:
    """The level that an asset's file, the LOD group above it, or its name tells; None if none does."""
    if isinstance(asset, bpy.types.Object):
        level, group = asset.get(LEVEL), asset.get(GROUP)
        if isinstance(level, int) and isinstance(group, str):
            return LODName(group.lower(), level, True)
        if _is_lod_group(asset.parent):
            levels = _by_level(child for child in asset.parent.children if shows_surface(child))
            if asset in levels:
                return LODName(asset.parent.name.lower(), levels.index(asset), True)
    return lod_of_name(asset.name)


def are_kin(one: Asset | None, other: Asset | None) -> bool:
    """Whether one of two objects hangs from the other, so that it is measured with it: a part, not a level of it."""
    if not (isinstance(one, bpy.types.Object) and isinstance(other, bpy.types.Object)):
        return False
    if one not in lineage(other.parent) and other not in lineage(one.parent):
        return False
    mine, its = lod_of(one), lod_of(other)
    return mine is None or its is None or mine.stem != its.stem or mine.level == its.level


def find_lods(scene: bpy.types.Scene, active: bpy.types.Object | None) -> LODGroup | None:
    """The levels that belong to the active object, or the only ones that there are.

    In this order: names of objects, LOD groups of FBX and glTF files, names of collections, and the members of the
    active object's collection, of which the one with the most faces is the finest.
    """
    chains = find_chains(scene)
    family = lineage(active)
    for how in (NAMES, LOD_GROUP, COLLECTIONS):
        here = [chain for chain in chains if chain.how == how]
        mine = [chain for chain in here if any(_belongs(object_, chain) for object_ in family)]
        only = here if len(here) == 1 and (how != LOD_GROUP or active is None) else []
        for chain in mine or only:
            return LODGroup(chain.assets, how)
    return None if active is None else _collection_members(scene, active)


def find_chains(scene: bpy.types.Scene) -> list[Chain]:
    """Every chain that objects, LOD groups and collections of a scene tell, by name."""
    bpy.context.view_layer.update()
    objects = [each for each in scene.objects if is_measured(each) and not is_collider(each.name)]
    chains = chains_of(objects, scene.collection.children_recursive)
    return [chain for chain in chains if chain.sure or boxes_agree(chain, in_place=True)]


def chains_of(objects: Iterable[bpy.types.Object], collections: Iterable[bpy.types.Collection]) -> list[Chain]:
    """What the names of objects, of what they hang from and of collections tell; a chain of which each level is a part
    of some other chain's is left out, and a chain of collections whose objects tell the same."""
    shown = {each.name_full: each for each in objects}
    above = {each.name_full: each for object_ in shown.values() for each in lineage(object_)}
    found = _chains(list(above.values()))
    tops = [chain for chain in found if not any(_is_part(chain, other) for other in found if other != chain)]
    held = [each for each in collections if shown.keys() & set(each.all_objects.keys())]
    told = {asset.name_full for chain in tops for asset in chain.assets}
    return tops + [
        chain
        for chain in _chains(held)
        if not all(told & set(collection.all_objects.keys()) for collection in chain.assets)
    ]


def boxes_agree(chain: Chain, in_place: bool) -> bool:
    """Whether at least two levels have about the same box, in_place: where they stand."""
    boxes = [box for asset in chain.assets if (box := _box(asset)) is not None]
    return any(_alike(a, b, in_place) for a, b in combinations(boxes, 2))


def _alike(a: Floats, b: Floats, in_place: bool) -> bool:
    sizes = [box[1] - box[0] for box in (a, b)]
    apart = np.abs(a - b).max() if in_place else np.abs(sizes[0] - sizes[1]).max()
    return bool(apart <= _AGREE * max(float(np.linalg.norm(size)) for size in sizes))


def _chains(assets: Sequence[Asset]) -> list[Chain]:
    """By stem, two levels at least. Of Rock_LOD1 and its copies Rock_LOD1.001 the first is taken."""
    groups: dict[str, dict[int, Asset]] = {}
    told = {asset.name_full: lod_of(asset) for asset in assets}
    sure: dict[str, bool] = {}
    for asset in sorted(assets, key=lambda asset: asset.name_full):
        found = told[asset.name_full]
        if found is not None:
            groups.setdefault(found.stem, {}).setdefault(found.level, asset)
            sure[found.stem] = sure.get(found.stem, True) and found.sure
    for asset in assets:  # Rock beside Rock_LOD1 and Rock_LOD2 is the original
        stem = stem_of_name(asset.name)
        is_told = told[asset.name_full] is not None or not sure.get(stem) or 0 in groups[stem]
        if not is_told and not any(_holds(asset, level) for level in groups[stem].values()):
            groups[stem][-1] = asset
    return [
        Chain(_name(stem, levels), tuple(sorted(levels.items())), sure[stem], _how(levels))
        for stem, levels in sorted(groups.items())
        if len(levels) > 1
    ]


def _holds(asset: Asset, level: Asset) -> bool:
    """Whether an asset has no surface of its own and a level hangs from it."""
    return (
        isinstance(asset, bpy.types.Object)
        and isinstance(level, bpy.types.Object)
        and not is_measured(asset)
        and asset in lineage(level.parent)
    )


def _name(stem: str, levels: dict[int, Asset]) -> str:
    finest = levels[min(levels)].name
    at = finest.lower().find(stem)
    return finest[at : at + len(stem)] if at >= 0 else stem


def _how(levels: dict[int, Asset]) -> str:
    finest = levels[min(levels)]
    if isinstance(finest, bpy.types.Collection):
        return COLLECTIONS
    return LOD_GROUP if LEVEL in finest or _is_lod_group(finest.parent) else NAMES


def _is_part(chain: Chain, other: Chain) -> bool:
    """Whether each level hangs from some level of another chain."""
    return all(any(other.level_of(each) is not None for each in lineage(asset.parent)) for asset in chain.assets)


def _belongs(object_: bpy.types.Object, chain: Chain) -> bool:
    """Whether an object is in a level, or shares its name: a copy, say."""
    if chain.level_of(object_) is not None:
        return True
    found = lod_of(object_)
    return chain.how == NAMES and found is not None and found.stem == chain.name.lower()


def _is_lod_group(object_: bpy.types.Object | None) -> bool:
    return object_ is not None and object_.type == "EMPTY" and object_.get("fbx_type") == "LodGroup"


def _by_level(objects: Iterable[bpy.types.Object]) -> tuple[bpy.types.Object, ...]:
    def level(object_: bpy.types.Object) -> tuple[int, str]:
        found = lod_of_name(object_.name)
        return (found.level if found else 0, object_.name_full)

    return tuple(sorted(objects, key=level))


def _box(asset: Asset) -> Floats | None:
    """(2, 3) lowest and highest corner in the world of all that belongs to an asset; None: there is nothing."""
    objects = asset.all_objects if isinstance(asset, bpy.types.Collection) else [asset, *asset.children_recursive]
    corners = [corner for object_ in objects for corner in _corners(object_)]
    if not corners:
        return None
    joined = np.concatenate(corners)
    return np.stack([joined.min(axis=0), joined.max(axis=0)])


def _corners(object_: bpy.types.Object) -> list[Floats]:
    """(8, 3) each: of an object's box, and of those in the collection that it instances."""
    matrix = np.array(object_.matrix_world, np.float64)
    found = [_moved_box(object_, matrix)] if object_.type in SURFACE_TYPES else []
    collection = instanced(object_)
    if collection is not None:
        matrix = matrix @ _translation(-np.array(collection.instance_offset, np.float64))
        members = [each for each in collection.all_objects if each.type in SURFACE_TYPES]
        found += [_moved_box(each, matrix @ np.array(each.matrix_world, np.float64)) for each in members]
    return [corners for corners in found if np.isfinite(corners).all() and np.ptp(corners, axis=0).any()]


def _moved_box(object_: bpy.types.Object, matrix: Floats) -> Floats:
    return np.array(object_.bound_box, np.float64) @ matrix[:3, :3].T + matrix[:3, 3]


def _translation(by: Floats) -> Floats:
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


def _collection_members(scene: bpy.types.Scene, active: bpy.types.Object) -> LODGroup | None:
    """The scene's own collection is no group."""
    for collection in active.users_collection:
        if collection == scene.collection:
            continue
        meshes = [object_ for object_ in collection.objects if object_.type == "MESH"]
        if active in meshes and len(meshes) > 1:
            ordered = sorted(meshes, key=lambda object_: (-len(object_.data.polygons), object_.name_full))
            return LODGroup(tuple(ordered), "collection members")
    return None
