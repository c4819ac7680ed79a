# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels have in common: their place, and what fits into a sidebar of any width. Lengths are in pixels at a
UI scale of 1."""

from __future__ import annotations

from typing import Any

import blf
import bpy

from ..properties.rows import active_row, row_scores

NARROW = 215  # of the sidebar: below it, what stands side by side elsewhere stands one below the other
ICON = 34  # of a label, with what is left and right of it
_BEFORE = 20  # of an icon alone
_FONT = 0
EDGES = 76  # of the sidebar: what is left and right of a label in a box
_LIST, _BUTTONS = 66, 28  # the same of the rows of a list, and of the buttons beside one


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


def width(context: bpy.types.Context) -> float:
    """Of the sidebar."""
    return float(context.region.width / context.preferences.system.ui_scale)


def is_narrow(context: bpy.types.Context, least: float = NARROW) -> bool:
    """Whether the sidebar is less wide than that."""
    return width(context) < least


def text_width(text: str) -> float:
    """Of a label's text."""
    blf.size(_FONT, bpy.context.preferences.ui_styles[0].widget.points)
    return float(blf.dimensions(_FONT, text)[0])


def beside(
    layout: bpy.types.UILayout, context: bpy.types.Context, least: float = NARROW, align: bool = True
) -> bpy.types.UILayout:
    """A row; in a sidebar less wide than that a column, so that no button loses its words."""
    return layout.column(align=align) if is_narrow(context, least) else layout.row(align=align)


def fields(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Has properties stand behind their names, as in Blender's own panels, where both have room."""
    layout.use_property_split, layout.use_property_decorate = not is_narrow(context), False


def switched(
    layout: bpy.types.UILayout, owner: Any, switch: str, name: str, heading: str, slider: bool = False
) -> None:
    """A number, and before it the switch that says whether it counts."""
    if not layout.use_property_split:
        layout.label(text=heading)
        heading = ""
    row = layout.row(heading=heading)
    row.prop(owner, switch, text="")
    number = row.row()
    number.active = getattr(owner, switch)
    number.prop(owner, name, text="", slider=slider)


def with_buttons(
    layout: bpy.types.UILayout, context: bpy.types.Context
) -> tuple[bpy.types.UILayout, bpy.types.UILayout]:
    """Where a list stands, and where its buttons: beside it, or below."""
    if is_narrow(context):
        return layout.column(align=True), layout.row(align=True)
    row = layout.row()
    return row.column(align=True), row.column(align=True)


def list_width(whole: float) -> float:
    """Of the rows of a list with buttons, in a sidebar of a width."""
    return whole - _LIST - (0 if whole < NARROW else _BUTTONS)


def wrapped(
    layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE", icon_value: int = 0
) -> None:
    """A label of as many lines as the sidebar's width asks for; its icon by name, or by the number of one of ours."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    has_icon = icon != "NONE" or icon_value != 0
    for number, line in enumerate(_lines(text, width(context) - EDGES - (_BEFORE if has_icon else 0))):
        if number == 0 and icon_value:
            column.label(text=line, icon_value=icon_value)
        else:
            column.label(text=line, icon=icon if number == 0 else "BLANK1" if has_icon else "NONE")


def fits(context: bpy.types.Context, *texts: str) -> bool:
    """Whether they have room in one line."""
    return sum(map(text_width, texts)) + EDGES <= width(context)


def cut_in_the_middle(text: str, room: float) -> str:
    """A name of at most that width: what tells levels apart stands at its end, and what it is at its start."""
    cut, kept = text, len(text)
    while kept > 2 and text_width(cut) > room:
        kept -= 1
        cut = f"{text[: kept - kept // 2]}…{text[len(text) - kept // 2 :]}"
    return cut


def short_count(count: int) -> str:
    """A number of triangles in few characters: 512, 8.7k, 1.2M."""
    for unit, name in ((1_000_000, "M"), (1_000, "k")):
        if count >= unit:
            share = count / unit
            return f"{share:.1f}{name}" if share < 99.95 else f"{share:.0f}{name}"
    return f"{count}"


def _lines(text: str, room: float) -> list[str]:
    """Of at most that width; of names that are wider their beginning and their end."""
    lines = [""]
    for word in (cut_in_the_middle(each, room) for each in text.split()):
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and text_width(longer) > room:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines
