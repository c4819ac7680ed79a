# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of the chosen row."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ...report.parts_table import part_cells, worst_first
from ..properties.rows import active_row, row_parts
from .sidebar import Sidebar, wrapped

_SHOWN = 12  # of the parts; reports show all


class FMQM_PT_parts(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_parts"
    bl_parent_id = "FMQM_PT_details"
    bl_label = "Parts"
    bl_description = "Objects, materials and connected parts of the original, the worst first"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        row = active_row(context.scene)
        return row is not None and bool(row.parts)

    def draw(self, context: bpy.types.Context) -> None:
        row = active_row(context.scene)
        parts = [] if row is None else worst_first(row_parts(row))
        column = self.layout.column(align=True)
        for part in parts[:_SHOWN]:
            kind, name, _, _, _, perceived, gone = part_cells(part)
            split = column.split(factor=0.75, align=True)
            split.label(text=name, icon=_ICONS.get(kind, "NONE"), translate=False)
            right = split.row()
            right.alert = bool(gone)
            right.label(text=gone.capitalize() or perceived, translate=False)
        if len(parts) > _SHOWN:
            wrapped(column, context, f"and {len(parts) - _SHOWN} more, in the saved JSON")


_ICONS = {"object": "OBJECT_DATA", "material": "MATERIAL", "connected": "MESH_DATA"}

CLASSES = (FMQM_PT_parts,)
