# SPDX-License-Identifier: GPL-3.0-or-later
"""The 3D viewports: framing a place, and going back from it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...metric.geometry import Floats

_MARGIN = 1.9  # view distance in diameters of what is framed, at Blender's usual focal length
_before: dict[int, dict[str, Any]] = {}  # by area: where a view was before it was framed


def show_in_local_views(object_: bpy.types.Object) -> None:
    """Adds an object to the views that are local, in which a new object would not appear."""
    for window in bpy.context.window_manager.windows:  # of a screen in no window, Blender 5.2 crashes
        if object_.name not in window.view_layer.objects:
            continue
        for _, space in _spaces(window.screen):
            if space.local_view is not None:
                object_.local_view_set(space, True)


def frame_place(area: bpy.types.Area | None, center: Floats, diameter: float, normal: Floats) -> None:
    """Turns the 3D view of an area to a place, so that the place faces the viewer.

    Args:
        center: (3,) world. diameter: scene units. normal: (3,) unit out of the surface there, or zero.
    """
    if area is None or area.type != "VIEW_3D":
        return
    region = area.spaces.active.region_3d
    _before.setdefault(area.as_pointer(), _pose(region))
    if region.view_perspective == "CAMERA":
        region.view_perspective = "PERSP"
    region.view_location = Vector(center.tolist())
    region.view_distance = max(_MARGIN * diameter, 1e-3)
    if np.linalg.norm(normal) > 0:
        region.view_rotation = _facing(Vector(normal.tolist())).to_quaternion()
    area.tag_redraw()


def unframe() -> None:
    """Takes the views that were framed back to where they were before."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            pose = _before.pop(area.as_pointer(), None)
            if pose is not None and area.type == "VIEW_3D":
                for name, value in pose.items():
                    setattr(area.spaces.active.region_3d, name, value)
    _before.clear()


def _pose(region: bpy.types.RegionView3D) -> dict[str, Any]:
    copied = {name: getattr(region, name).copy() for name in ("view_location", "view_rotation")}
    return {"view_perspective": region.view_perspective, "view_distance": region.view_distance, **copied}


def _facing(direction: Vector) -> Matrix:
    """The rotation of a view whose back points in a direction, Z up."""
    up = Vector((0.0, 0.0, 1.0)) if abs(direction.z) < 0.98 else Vector((0.0, 1.0, 0.0))
    right = up.cross(direction).normalized()
    return Matrix((right, direction.cross(right), direction)).transposed()


def redraw() -> None:
    """Has every 3D view drawn again."""
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _spaces(screen: bpy.types.Screen) -> Iterator[tuple[str, bpy.types.SpaceView3D]]:
    """The 3D views of a screen, those behind other editors too, each with a key."""
    for number, area in enumerate(screen.areas):
        for index, space in enumerate(area.spaces):
            if space.type == "VIEW_3D":
                yield f"{number}.{index}", space
