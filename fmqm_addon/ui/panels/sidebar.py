# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels have in common: their place, and texts as wide as the sidebar."""

from __future__ import annotations

import bpy

_CHARACTER = 6.6  # pixels at scale 1, of the panel's font, about


class Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "FMQM"


def wrapped(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE") -> None:
    """A label of as many lines as the sidebar's width asks for."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    first = True
    for line in _lines(text, room(context, 70 if icon != "NONE" else 50)):
        column.label(text=line, icon=icon if first else ("BLANK1" if icon != "NONE" else "NONE"))
        first = False


def room(context: bpy.types.Context, margin: int) -> int:
    """How many characters fit beside the margin, in pixels at scale 1."""
    scale = context.preferences.system.ui_scale
    return max(12, int((context.region.width / scale - margin) / _CHARACTER))


def _lines(text: str, room: int) -> list[str]:
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > room:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines
