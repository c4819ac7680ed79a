# SPDX-License-Identifier: GPL-3.0-or-later
"""The 3D viewports: letting Solid shading show colors, and giving it back; framing a place."""

from __future__ import annotations

import json
from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ...metric.geometry import Floats

# On a Screen, which undo does not touch and which is saved with the views: what we changed, and from what.
_BEFORE = "fmqm_shading"
# Solid shading shows the color attribute, in the light made for judging painted colors: the usual one
# shows less than half of a color's brightness, and legends would not match.
_OURS = {"color_type": "VERTEX", "studio_light": "paint.sl"}
_MARGIN = 1.9  # view distance in diameters of what is framed, at Blender's usual focal length


def show_colors() -> None:
    """Has Solid shading show color attributes in every 3D view; restore_colors() undoes it."""
    for screen in bpy.data.screens:
        before = json.loads(screen.get(_BEFORE, "{}"))
        for key, space in _spaces(screen):
            shading = space.shading
            for name, value in _OURS.items():
                # The light's name is Solid's only while Solid is on; flat light and matcaps are the user's choice.
                if name == "studio_light" and (shading.type, shading.light) != ("SOLID", "STUDIO"):
                    continue
                was = getattr(shading, name)
                if was != value and _set(shading, name, value):
                    before.setdefault(key, {}).setdefault(name, was)
        if before:
            screen[_BEFORE] = json.dumps(before)


def restore_colors() -> None:
    """Gives every 3D view the shading it had; a view that was split off since gets its screen's."""
    for screen in bpy.data.screens:
        if _BEFORE not in screen:
            continue
        before = json.loads(screen[_BEFORE])
        usual = next(iter(before.values()))
        for key, space in _spaces(screen):
            shading, kind = space.shading, space.shading.type
            if kind != "SOLID":
                shading.type = "SOLID"
            for name, was in before.get(key, usual).items():
                if getattr(shading, name) == _OURS[name]:  # else the user has chosen since
                    _set(shading, name, was)
            if kind != "SOLID":
                shading.type = kind
        del screen[_BEFORE]


def _set(shading: bpy.types.View3DShading, name: str, value: str) -> bool:
    try:
        setattr(shading, name, value)
    except TypeError:  # an installation without that light
        return False
    return True


def colors_changed() -> bool:
    """Whether restore_colors() has something to do."""
    return any(_BEFORE in screen for screen in bpy.data.screens)


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
