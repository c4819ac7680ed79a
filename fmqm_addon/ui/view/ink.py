# SPDX-License-Identifier: GPL-3.0-or-later
"""What is written and painted over the 3D view with: this user's type, colors and lengths."""

from __future__ import annotations

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...blender.display.drawing import for_own_shaders

_FONT = 0
_MARGIN = 14  # pixels at a UI scale of 1
_OPACITY = 0.9

Color = tuple[float, float, float, float]


class Ink:
    """Type, colors and lengths of this user's interface."""

    def __init__(self) -> None:
        preferences = bpy.context.preferences
        self._scale = preferences.system.ui_scale
        widget = preferences.themes[0].user_interface.wcol_tooltip
        self.back: Color = (*widget.inner[:3], _OPACITY)
        self.text: Color = (*widget.text[:3], 1.0)
        self.faint: Color = (*widget.text[:3], 0.7)
        self.points = preferences.ui_styles[0].widget.points * self._scale

    def px(self, length: float) -> float:
        return round(length * self._scale)

    def width(self, text: str) -> float:
        blf.size(_FONT, self.points)
        return float(blf.dimensions(_FONT, text)[0])

    def write(self, text: str, x: float, y: float, color: Color | None = None) -> None:
        """Text with its baseline's left end at a place."""
        blf.size(_FONT, self.points)
        blf.color(_FONT, *(color or self.text))
        blf.position(_FONT, x, y, 0)
        blf.draw(_FONT, text)


def free_corner(ink: Ink) -> tuple[float, float]:
    """The lower left corner of what no toolbar or header covers, and a margin."""
    window = bpy.context.region
    left, bottom = 0, 0
    for region in bpy.context.area.regions:
        if region.width <= 1 or region.height <= 1 or region == window:
            continue
        if region.type == "TOOLS" and region.alignment == "LEFT":
            left = max(left, region.x + region.width - window.x)
        elif region.type == "HUD" or (region.alignment == "BOTTOM" and region.y <= window.y + 1):
            bottom = max(bottom, region.y + region.height - window.y)
    return left + ink.px(_MARGIN), bottom + ink.px(_MARGIN)


def free_part(area: bpy.types.Area, window: bpy.types.Region) -> tuple[float, float, float, float]:
    """Left, bottom, right and top of what no toolbar, header or sidebar covers of a view, in pixels of its region."""
    left, bottom, right, top = 0, 0, window.width, window.height
    for region in area.regions:
        if region.width <= 1 or region.height <= 1 or region == window or region.type == "HUD":
            continue
        x, y = region.x - window.x, region.y - window.y
        if region.alignment == "LEFT":
            left = max(left, x + region.width)
        elif region.alignment == "RIGHT":
            right = min(right, x)
        elif region.alignment == "BOTTOM":
            bottom = max(bottom, y + region.height)
        elif region.alignment == "TOP":
            top = min(top, y)
    return left, bottom, right, top


def box(x: float, y: float, width: float, height: float, color: Color) -> None:
    corners = [(x, y), (x + width, y), (x, y + height), (x + width, y + height)]
    draw_shape("TRI_STRIP", corners, [color] * 4)


def draw_shape(kind: str, positions: list[tuple[float, float]], colors: list[Color]) -> None:
    """Colors that are encoded, as themes and legends have them."""
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    gpu.state.blend_set("ALPHA")
    flat, shown = [(x, y, 0.0) for x, y in positions], np.array(colors, np.float32)
    shown[:, :3] = for_own_shaders(shown[:, :3])
    batch_for_shader(shader, kind, {"pos": flat, "color": shown}).draw(shader)
    gpu.state.blend_set("NONE")
