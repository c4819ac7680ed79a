# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown is brought up to date: where a property changes, and before a view is drawn."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import bpy

from ...metric.errors import FMQMError
from ..properties import view as properties
from . import flip, heat, loupe, overlay, shells, shown, slice_plane, worst
from .result import look_of

_REST = 0.12  # seconds after which a slice that was moved is drawn finely again


def _on_change(scene: bpy.types.Scene, name: str, context: bpy.types.Context) -> None:
    """A property has changed. It has nowhere to say that the samples are gone; the panel does."""
    with suppress(FMQMError):
        if name == "worst_index":
            if not worst.choosing:
                worst.focus_patch(scene, context.area)
            return
        for update in _UPDATES[name]:
            update(scene)


def _move_slice(scene: bpy.types.Scene) -> None:
    """It is rough until it rests; without a window it never moves."""
    if not bpy.app.background:
        slice_plane.moving.add(scene.name)
        _later(_rest_slice, _REST)
    slice_plane.refresh(scene)


def _change_shells(scene: bpy.types.Scene) -> None:
    """They take a moment: while a number is dragged, those before stay."""
    if bpy.app.background or not look_of(scene).show_shells:
        shells.refresh(scene)
    else:
        _later(shells.refresh_all, _REST)


def _rest_slice() -> None:
    slice_plane.moving.clear()
    slice_plane.refresh_all()


_UPDATES: dict[str, tuple[Callable[[bpy.types.Scene], object], ...]] = {
    "row_index": (shown.follow_row,),
    "judge": (shown.follow_judge,),
    "show": (heat.refresh,),
    "layer": (heat.refresh,),
    "range": (heat.refresh, slice_plane.refresh),
    "place": (shown.follow_place,),
    "point_size": (heat.refresh,),
    "shells": (_change_shells,),
    "slice": (slice_plane.refresh,),
    "slice_place": (_move_slice,),
}


def _watch() -> None:
    """Called at each drawing of a view; the work waits for a timer, outside of the drawing."""
    scene = bpy.context.scene
    for kind, build_all in _TIMERS.items():
        if not kind.is_current(scene) and not bpy.app.timers.is_registered(build_all):
            bpy.app.timers.register(build_all, first_interval=0)
    loupe.watch()
    flip.watch()


_TIMERS = {heat: heat.build_all, shells: shells.refresh_all, slice_plane: slice_plane.refresh_all}


def _later(act: Callable[[], None], seconds: float) -> None:
    if bpy.app.timers.is_registered(act):
        bpy.app.timers.unregister(act)
    bpy.app.timers.register(act, first_interval=seconds)


def register() -> None:
    properties.on_change = _on_change
    overlay.register()
    overlay.on_draw = _watch


def unregister() -> None:
    shown.clear()  # nothing could take it away later
    slice_plane.moving.clear()
    overlay.on_draw = None
    overlay.unregister()
    properties.on_change = None
    for timer in (_rest_slice, *_TIMERS.values()):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
