# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether objects move with the frame, and by which clips."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ...comparison.pose import Pose

_CACHES = {"MESH_SEQUENCE_CACHE", "TRANSFORM_CACHE"}  # of Alembic and USD files


def pose_of(objects: Iterable[bpy.types.Object]) -> Pose:
    """The pose in which objects stand in the active scene."""
    clips: set[str] = set()
    moves = False
    for object_ in _with_movers(objects):
        for block in (object_, object_.data, getattr(object_.data, "shape_keys", None)):
            motion = getattr(block, "animation_data", None)
            if motion is None:
                continue
            tracks = [track for track in motion.nla_tracks if not track.mute]
            strips = [strip for track in tracks for strip in track.strips if not strip.mute]
            clips |= {each.action.name for each in (motion, *strips) if each.action is not None}
            moves |= bool(motion.action or strips)
        moves |= any(each.type in _CACHES for each in (*object_.modifiers, *object_.constraints))
    return Pose(bpy.context.scene.frame_current, tuple(sorted(clips))) if moves else Pose()


def _with_movers(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Objects with those that they hang from or that their modifiers and constraints name, at any depth."""
    waiting = list(objects)
    found: dict[int, bpy.types.Object] = {}
    while waiting:
        object_ = waiting.pop()
        if object_ is not None and object_.as_pointer() not in found:
            found[object_.as_pointer()] = object_
            waiting += [object_.parent, *(_object_of(each) for each in (*object_.modifiers, *object_.constraints))]
    return list(found.values())


def _object_of(block: bpy.types.Modifier | bpy.types.Constraint) -> bpy.types.Object | None:
    """What a modifier or constraint follows: armatures, lattices, hooks, targets."""
    for name in ("object", "target"):
        found = getattr(block, name, None)
        if isinstance(found, bpy.types.Object):
            return found
    return None
