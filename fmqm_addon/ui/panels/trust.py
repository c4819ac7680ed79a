# SPDX-License-Identifier: GPL-3.0-or-later
"""The trust report of the chosen row."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ...report.trust_table import Line, trust_lines
from ..properties.rows import (
    active_row,
    row_trust,
)
from .sidebar import Sidebar, fits, wrapped


class FMQM_PT_trust(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_trust"
    bl_parent_id = "FMQM_PT_details"
    bl_label = "Trust"
    bl_description = "What is known of the chosen result: how far to believe its score"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        row = active_row(context.scene)
        return row is not None and bool(row.trust)

    def draw(self, context: bpy.types.Context) -> None:
        row = active_row(context.scene)
        report = None if row is None else row_trust(row)
        if report is None:
            return
        column = self.layout.column(align=True)
        for line in trust_lines(report):
            _draw_fact(column, context, line)
        for note in () if row is None else row.notes.splitlines():
            wrapped(column, context, note, icon="INFO")


def _draw_fact(layout: bpy.types.UILayout, context: bpy.types.Context, line: Line) -> None:
    """In one line where there is room for it; else its unit, or why it is not known, goes below, and a long value."""
    label, unit = line.label, line.unit
    value = " / ".join(dict.fromkeys(line.values))  # one where both have the same: the sidebar is narrow
    if unit.partition(" ")[0] in label.split():  # vertices welded are vertices
        unit = ""
    label, whole = label[:1].upper() + label[1:], f"{value} {unit}".strip()
    if not fits(context, label, value):
        layout.label(text=label)
        _draw_below(layout, context, whole)
        return
    row = layout.row(align=True)
    row.label(text=label)
    right = row.row(align=True)
    right.alignment = "RIGHT"
    is_short = fits(context, label, whole)
    right.label(text=whole if is_short else value, translate=False)
    if not is_short:
        note = layout.column(align=True)
        note.active = False
        _draw_below(note, context, unit)


def _draw_below(layout: bpy.types.UILayout, context: bpy.types.Context, text: str) -> None:
    """Indented."""
    row = layout.row(align=True)
    row.separator(factor=2.0)
    wrapped(row, context, text)


CLASSES = (FMQM_PT_trust,)
