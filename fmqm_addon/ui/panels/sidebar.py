# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels have in common: their place, and texts as wide as the sidebar."""

from __future__ import annotations

import bpy

from ..properties.rows import active_row, row_scores

CHARACTER = 6.6  # pixels at scale 1, of the panel's font, about


class Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "FMQM"


class OfResult(Sidebar):
    """A panel that is absent where the chosen row has nothing to show."""

    bl_parent_id = "FMQM_PT_main"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        row = active_row(context.scene)
        return row is not None and row_scores(row) is not None


def wrapped(
    layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE", icon_value: int = 0
) -> None:
    """A label of as many lines as the sidebar's width asks for; its icon by name, or by the number of one of ours."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    has_icon = icon != "NONE" or icon_value != 0
    for number, line in enumerate(_lines(text, room(context, 70 if has_icon else 50))):
        if number == 0 and icon_value:
            column.label(text=line, icon_value=icon_value)
        else:
            column.label(text=line, icon=icon if number == 0 else "BLANK1" if has_icon else "NONE")


def cut_in_the_middle(text: str, room: int) -> str:
    """A name of at most so many characters: what tells levels apart stands at its end, and what it is at its start."""
    if len(text) <= room:
        return text
    kept = max(room - 1, 2)
    return f"{text[: kept - kept // 2]}…{text[len(text) - kept // 2 :]}"


def short_count(count: int) -> str:
    """A number of triangles in few characters: 512, 8.7k, 1.2M."""
    for unit, name in ((1_000_000, "M"), (1_000, "k")):
        if count >= unit:
            share = count / unit
            return f"{share:.1f}{name}" if share < 99.95 else f"{share:.0f}{name}"
    return f"{count}"


def width(context: bpy.types.Context) -> float:
    """Of the sidebar, in pixels at scale 1."""
    return float(context.region.width / context.preferences.system.ui_scale)


def room(context: bpy.types.Context, margin: int) -> int:
    """How many characters fit beside the margin, in pixels at scale 1."""
    return max(12, int((width(context) - margin) / CHARACTER))


def _lines(text: str, room: int) -> list[str]:
    lines = [""]
    for word in text.split():
        if lines[-1] and len(lines[-1]) + 1 + len(word) > room:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines
