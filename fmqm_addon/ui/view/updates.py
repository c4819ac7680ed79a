# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown is brought up to date: where a property changes, and where the slice is moved."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import bpy

from ...blender.display import scene_objects
from ...metric.errors import FMQMError
from ..properties import view as properties
from . import heat, overlay, shown, slice_plane, worst

_SLICE_REST = 0.12  # seconds after which a moved slice is drawn again


def _on_change(scene: bpy.types.Scene, name: str, context: bpy.types.Context) -> None:
    """A property has changed. It has nowhere to say that the samples are gone; the panel does."""
    with suppress(FMQMError):
        if name == "worst_index":
            if not worst.choosing:
                worst.focus_patch(scene, context.area)
            return
        for update in _UPDATES[name]:
            update(scene)


def _rebuild_slice(scene: bpy.types.Scene) -> None:
    if scene_objects.find_object(scene, scene_objects.SLICE) is not None:
        slice_plane.show_slice(scene)


_UPDATES: dict[str, tuple[Callable[[bpy.types.Scene], object], ...]] = {
    "row_index": (shown.follow_row,),
    "judge": (shown.follow_judge,),
    "show": (heat.refresh,),
    "layer": (heat.refresh,),
    "range": (heat.refresh, slice_plane.draw_slice),
    "place": (shown.follow_place,),
    "point_size": (heat.refresh,),
    "slice_layer": (slice_plane.draw_slice,),
    "slice_resolution": (_rebuild_slice,),
}


def _watch() -> None:
    """Called at each drawing of a view; the work waits for a timer, outside of the drawing."""
    scene = bpy.context.scene
    if slice_plane.slice_has_moved(scene) and not bpy.app.timers.is_registered(_redraw_slice):
        bpy.app.timers.register(_redraw_slice, first_interval=_SLICE_REST)
    if not heat.is_current(scene) and not bpy.app.timers.is_registered(heat.build_all):
        bpy.app.timers.register(heat.build_all, first_interval=0)


def _redraw_slice() -> None:
    for scene in bpy.data.scenes:
        if slice_plane.slice_has_moved(scene):
            with suppress(FMQMError):
                slice_plane.draw_slice(scene)


def register() -> None:
    properties.on_change = _on_change
    overlay.register()
    overlay.on_draw = _watch


def unregister() -> None:
    shown.clear()  # nothing could take it away later
    overlay.on_draw = None
    overlay.unregister()
    properties.on_change = None
    for timer in (_redraw_slice, heat.build_all):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
