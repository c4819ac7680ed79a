# SPDX-License-Identifier: GPL-3.0-or-later
"""The score of Live in the lower right corner of every 3D view."""

from __future__ import annotations

from typing import Any

import bpy

from .. import live
from .ink import Ink, box

_PAD, _LINE, _MARGIN = 8, 18, 14  # pixels at a UI scale of 1
_handles: list[Any] = []


def register() -> None:
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


def _draw() -> None:
    scene = bpy.context.scene
    if live.current is not None and not live.current.is_busy and live.current.follow(scene):
        live.touch()
    shown = live.texts(scene)
    if not shown or not bpy.context.space_data.overlay.show_overlays:
        return
    ink = Ink()
    pad, line = ink.px(_PAD), ink.px(_LINE)
    width, height = max(map(ink.width, shown)) + 2 * pad, len(shown) * line + 2 * pad
    right, bottom = _corner()
    x, y = right - ink.px(_MARGIN) - width, bottom + ink.px(_MARGIN)
    box(x, y, width, height, ink.back)
    for number, text in enumerate(shown):
        ink.write(text, x + pad, y + height - pad - line * number - ink.px(12), ink.faint if number else None)


def _corner() -> tuple[float, float]:
    """The lower right corner of what no sidebar or header covers."""
    window = bpy.context.region
    right, bottom = window.width, 0
    for region in bpy.context.area.regions:
        if region.width <= 1 or region.height <= 1 or region == window:
            continue
        if region.type == "UI" and region.alignment == "RIGHT":
            right = min(right, region.x - window.x)
        elif region.alignment == "BOTTOM" and region.y <= window.y + 1:
            bottom = max(bottom, region.y + region.height - window.y)
    return right, bottom
