# SPDX-License-Identifier: GPL-3.0-or-later
"""The 3D viewports: letting Solid shading show colors, and giving it back; framing a place."""

from __future__ import annotations

import json
from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..metric.spatial import Floats

# On a Screen, which undo does not touch and which is saved with the views: color types before ours.
_BEFORE = "fmqm_color_types"
_ATTRIBUTE = "VERTEX"
_MARGIN = 1.9  # view distance in diameters of what is framed, at Blender's usual focal length


def show_colors() -> None:
    """Sets the color of Solid shading to Attribute in every 3D view; restore_colors() undoes it."""
    for screen in bpy.data.screens:
        before = json.loads(screen.get(_BEFORE, "{}"))
        for key, space in _spaces(screen):
            if space.shading.color_type != _ATTRIBUTE:
                before[key] = space.shading.color_type
                space.shading.color_type = _ATTRIBUTE
        if before:
            screen[_BEFORE] = json.dumps(before)


def restore_colors() -> None:
    """Gives every 3D view the color it had; a view that was split off since gets its screen's."""
    for screen in bpy.data.screens:
        if _BEFORE not in screen:
            continue
        before = json.loads(screen[_BEFORE])
        usual = next(iter(before.values()))
        for key, space in _spaces(screen):
            if space.shading.color_type == _ATTRIBUTE:  # else the user has chosen since
                space.shading.color_type = before.get(key, usual)
        del screen[_BEFORE]


def colors_changed() -> bool:
    """Whether restore_colors() has something to do."""
    return any(_BEFORE in screen for screen in bpy.data.screens)


def show_in_local_views(object_: bpy.types.Object) -> None:
    """Adds an object to the views that are local, in which a new object would not appear."""
    for screen in bpy.data.screens:
        for _, space in _spaces(screen):
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
    if region.view_perspective == "CAMERA":
        region.view_perspective = "PERSP"
    region.view_location = Vector(center.tolist())
    region.view_distance = max(_MARGIN * diameter, 1e-3)
    if np.linalg.norm(normal) > 0:
        region.view_rotation = _facing(Vector(normal.tolist())).to_quaternion()
    area.tag_redraw()


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
