# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding the levels of detail of an asset in a scene."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import bpy

from .target import contains_surface

Asset: TypeAlias = bpy.types.Object | bpy.types.Collection

# Rock_LOD0, rock_lod1, LOD1_Rock, Rock.LOD1, Rock LOD 2, Rock_LOD1_low; not "Melody3" and not "Exploded1".
_LOD = re.compile(r"(?:(?:^|[_\-. ])(?i:lod)|(?<=[a-z0-9])LOD)[_\-. ]?(\d{1,2})(?!\d)")
_COPY_NUMBER = re.compile(r"\.\d{3,}$")  # Rock_LOD1.001
_SEPARATORS = "_-. "


@dataclass(frozen=True)
class LODGroup:
    """Levels of one asset, the finest first. how: where they were found, for the message."""

    levels: tuple[Asset, ...]
    how: str


def lod_of_name(name: str) -> tuple[str, int] | None:
    """The asset's name, in lower case, and the level that a name tells; None if it tells none."""
    base = _COPY_NUMBER.sub("", name)
    match = _LOD.search(base)
    if match is None:
        return None
    before, after = base[: match.start()].strip(_SEPARATORS), base[match.end() :].strip(_SEPARATORS)
    return "_".join(part for part in (before, after) if part).lower(), int(match[1])


def find_lods(scene: bpy.types.Scene, active: bpy.types.Object | None) -> LODGroup | None:
    """The levels that belong to the active object, or the only ones that there are.

    In this order: names of objects, the children of an FBX LodGroup empty, names of collections, and the
    members of the active object's collection, of which the one with the most faces is the finest.
    """
    objects = [object_ for object_ in scene.objects if contains_surface(object_)]
    family = _family(active)
    by_name = _by_names(_outermost(objects), family)
    if by_name:
        return LODGroup(by_name, "names")
    for empty in (*family, *(object_ for object_ in objects if active is None)):
        if empty.type == "EMPTY" and empty.get("fbx_type") == "LodGroup":
            return LODGroup(_by_level(child for child in empty.children if contains_surface(child)), "LodGroup")
    collections = [c for c in scene.collection.children_recursive if lod_of_name(c.name) and contains_surface(c)]
    mine = [c for c in collections if any(object_.name_full in c.all_objects for object_ in family)]
    by_name = _by_names(collections, mine)
    if by_name:
        return LODGroup(by_name, "collections")
    if active is not None:
        return _collection_members(scene, active)
    return None


def find_chains(scene: bpy.types.Scene) -> list[tuple[str, list[tuple[int, bpy.types.Object]]]]:
    """Every chain that the names of mesh objects tell: its name, and its levels from fine to coarse.

    Level -1 is the original that stands without a level beside those with one.
    """
    groups = _groups(_outermost(object_ for object_ in scene.objects if object_.type == "MESH"))
    chains = []
    for stem, levels in sorted(groups.items()):
        finest = levels[min(levels)].name
        at = finest.lower().find(stem)
        chains.append((finest[at : at + len(stem)] if at >= 0 else stem, sorted(levels.items())))
    return chains


def _family(active: bpy.types.Object | None) -> list[bpy.types.Object]:
    """The active object and what it hangs from, the nearest first."""
    family = []
    while active is not None:
        family.append(active)
        active = active.parent
    return family


def _outermost(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Without those whose parents already name a level: these are parts of it."""
    return [object_ for object_ in objects if not any(lod_of_name(parent.name) for parent in _family(object_.parent))]


def _by_names(assets: Sequence[Asset], mine: Sequence[Asset]) -> tuple[Asset, ...]:
    """The levels of the group that one of mine belongs to, or else of the only group; () if there is none."""
    groups = _groups(assets)
    chosen = next((_stem(asset) for asset in mine if _stem(asset) in groups), None)
    if chosen is None and len(groups) == 1:
        chosen = next(iter(groups))
    return () if chosen is None else tuple(groups[chosen][level] for level in sorted(groups[chosen]))


def _groups(assets: Sequence[Asset]) -> dict[str, dict[int, Asset]]:
    """Levels by the asset's name, two at least. Of Rock_LOD1 and its copies Rock_LOD1.001 the first is taken."""
    groups: dict[str, dict[int, Asset]] = {}
    for asset in sorted(assets, key=lambda asset: asset.name_full):
        found = lod_of_name(asset.name)
        if found is not None:
            groups.setdefault(found[0], {}).setdefault(found[1], asset)
    for asset in assets:  # Rock beside Rock_LOD1 and Rock_LOD2 is the original
        stem = _stem(asset)
        if lod_of_name(asset.name) is None and stem in groups and 0 not in groups[stem]:
            groups[stem][-1] = asset
    return {stem: levels for stem, levels in groups.items() if len(levels) > 1}


def _stem(asset: Asset) -> str:
    """The asset's name without its level, in lower case."""
    found = lod_of_name(asset.name)
    return _COPY_NUMBER.sub("", asset.name).lower() if found is None else found[0]


def _by_level(objects: Iterable[bpy.types.Object]) -> tuple[bpy.types.Object, ...]:
    def level(object_: bpy.types.Object) -> tuple[int, str]:
        found = lod_of_name(object_.name)
        return (found[1] if found else 0, object_.name_full)

    return tuple(sorted(objects, key=level))


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
