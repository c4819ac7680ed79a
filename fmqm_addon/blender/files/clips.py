# SPDX-License-Identifier: GPL-3.0-or-later
"""Clips that files hold: imported without them, in the pose that their nodes give, or with the first one at a frame."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy

from ..scene.lods import GROUP, LEVEL
from ..scene.motion import pose_of

_IMPORTER = "io_scene_gltf2"
_HOOK = "glTF2ImportUserExtension"  # where the importer looks for classes that are told what it does
_LOD = "MSFT_lod"
_SAMPLED = {".usd", ".usda", ".usdc", ".usdz", ".abc"}  # values over time, none without one
_MOST = 2**10  # levels of a node


@contextmanager
def gltf_hook(with_clips: bool) -> Iterator[None]:
    """While it lasts, glTF files are imported without their clips unless these are wanted, and objects are marked as
    the levels of detail that MSFT_lod makes of them.

    The importer has no switch for it: it would apply the first clip, and nobody could tell afterwards where the nodes
    had stood. It asks the modules of add-ons for such a class, its own among them.
    """
    module = sys.modules.get(_IMPORTER)

    class Hook:
        def __init__(self) -> None:
            self.objects: dict[int, bpy.types.Object] = {}  # by the address of their node

        def gather_import_gltf_before_hook(self, gltf: Any) -> None:
            if not with_clips:
                gltf.data.animations = None

        def gather_import_node_after_hook(self, vnode: Any, node: Any, object_: Any, gltf: Any) -> None:
            if node is not None and object_ is not None:
                self.objects[id(node)] = object_

        def gather_import_scene_after_nodes_hook(self, gltf_scene: Any, scene: Any, gltf: Any) -> None:
            for node in gltf.data.nodes or ():
                _mark(node, gltf.data.nodes, self.objects)

    if module is None:  # nor is there an importer
        yield
        return
    before = getattr(module, _HOOK, None)
    setattr(module, _HOOK, Hook)
    try:
        yield
    finally:
        if before is None:
            delattr(module, _HOOK)
        else:
            setattr(module, _HOOK, before)


def _mark(node: Any, nodes: list[Any], objects: dict[int, bpy.types.Object]) -> None:
    extension = (node.extensions or {}).get(_LOD)
    others = extension.get("ids") if isinstance(extension, dict) else None
    if id(node) not in objects or not isinstance(others, list):
        return
    name = objects[id(node)].name
    coarser = [nodes[each] for each in others[:_MOST] if type(each) is int and 0 <= each < len(nodes)]
    for level, each in enumerate((node, *coarser)):
        if id(each) in objects:
            objects[id(each)][LEVEL], objects[id(each)][GROUP] = level, name


def set_frame(suffix: str, frame: int | None) -> tuple[str, ...]:
    """Puts the session, just filled from a file, at the frame where it is measured; notes what is to be said of that.

    Alembic and USD files hold values over time and none without one: they stand at the first frame of theirs, where a
    viewer begins. What a .blend holds stays as it was saved.

    Args:
        frame: that is asked for; None: none.
    """
    scene = bpy.context.scene
    moves = pose_of(bpy.data.objects).frame is not None
    if frame is not None and not moves:
        return (f"nothing in it moves; frame {frame} is like any other",)
    if frame is not None:
        scene.frame_set(frame)
    elif moves and suffix in _SAMPLED:
        scene.frame_set(scene.frame_start)
        return (f"it holds no pose without a clip; measured at its first frame, {scene.frame_start}",)
    return ()
