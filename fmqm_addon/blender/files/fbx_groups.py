# SPDX-License-Identifier: GPL-3.0-or-later
"""LOD groups of FBX files, of which Blender's importer keeps only the names and the tree."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import bpy

from ..scene.lods import GROUP, LEVEL

_KIND = b"LodGroup"
# A node of the tree: its number, name and kind; and whose child it is. Binary as letter, length and bytes; or text.
_NODE = re.compile(rb"L(.{8})S.{4}([^\x00]{1,255})\x00\x01ModelS.{4}(\w+)", re.DOTALL)  # the kind may run on
_CHILD = re.compile(rb"S\x02\x00\x00\x00OOL(.{8})L(.{8})", re.DOTALL)
_NODE_TEXT = re.compile(rb'\bModel:[ \t]*(-?\d+),[ \t]*"Model::([^"\n]{1,255})",[ \t]*"(\w*)"')
_CHILD_TEXT = re.compile(rb'\bC:[ \t]*"OO",[ \t]*(-?\d+),[ \t]*(-?\d+)')


def mark_groups(path: str) -> None:
    """Marks the objects, just imported from an FBX file, that are levels of a LOD group, in the file's order."""
    data = Path(path).read_bytes()
    if _KIND not in data:
        return
    is_binary = data.startswith(b"Kaydara FBX Binary")
    nodes = {number: (name, kind) for number, name, kind in (_NODE if is_binary else _NODE_TEXT).findall(data)}
    levels: dict[bytes, list[bytes]] = defaultdict(list)
    for child, parent in (_CHILD if is_binary else _CHILD_TEXT).findall(data):
        if child in nodes and parent in nodes and nodes[parent][1].startswith(_KIND):
            levels[parent].append(child)
    for parent, children in levels.items():
        group = _text(nodes[parent][0])
        for level, child in enumerate(children):
            found = bpy.data.objects.get(_text(nodes[child][0]))
            if found is not None:
                found[LEVEL], found[GROUP] = level, group


def _text(name: bytes) -> str:
    return name.decode("utf-8", "replace")
