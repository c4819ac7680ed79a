# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of the results: sort, remove, copy."""

from __future__ import annotations

from typing import ClassVar

import bpy
from bpy.props import EnumProperty

from ...report.records import table_text
from ...report.words import LABELS, MEANINGS
from ..properties.rows import active_row, is_whole, pair_of, row_scores
from ..view.shown import forget_removed
from .polls import OfRows

_COLUMNS = [(name, label, MEANINGS[name]) for name, label in LABELS.items()]


def broken_text(count: int) -> str:
    """What to say of so many rows that were left out because they cannot be read."""
    return f"; {count} left out, which cannot be read" if count else ""


class FMQM_OT_sort_rows(OfRows, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.sort_rows"
    bl_label = "Sort by Score"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    column: EnumProperty(
        name="Column",
        description="Number to sort by",
        items=_COLUMNS,
    )

    @classmethod
    def description(cls, _: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return f"{MEANINGS[properties.column]}.\nClick to sort the results by it, again for the other direction"

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        chosen = active_row(context.scene)
        chosen_uid = chosen.uid if chosen else ""
        values = {
            row.uid: scores[self.column]
            for row in fmqm.rows
            if (scores := row_scores(row)) is not None and is_whole(row)
        }
        now = list(values)
        order = sorted(now, key=values.__getitem__, reverse=True)
        if order == now:
            order.reverse()
        order += [row.uid for row in fmqm.rows if row.uid not in values]
        for place, uid in enumerate(order):
            fmqm.rows.move(next(i for i, row in enumerate(fmqm.rows) if row.uid == uid), place)
        fmqm.row_index = next((i for i, row in enumerate(fmqm.rows) if row.uid == chosen_uid), 0)
        return {"FINISHED"}


class FMQM_OT_remove_row(OfRows, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.remove_row"
    bl_label = "Remove Result"
    bl_description = "Remove the chosen row from the results"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        if active_row(context.scene) is not None:
            fmqm.rows.remove(fmqm.row_index)
        fmqm.row_index = max(0, min(fmqm.row_index, len(fmqm.rows) - 1))
        forget_removed()
        return {"FINISHED"}


class FMQM_OT_clear_results(OfRows, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.clear_results"
    bl_label = "Clear Results"
    bl_description = "Remove all rows of the results"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.scene.fmqm.rows.clear()
        context.scene.fmqm.row_index = 0
        forget_removed()
        return {"FINISHED"}


class FMQM_OT_copy_results(OfRows, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.copy_results"
    bl_label = "Copy as Text"
    bl_description = "Copy the results to the clipboard as a table"
    bl_options: ClassVar = {"INTERNAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        rows = [row for row in context.scene.fmqm.rows if is_whole(row)]
        context.window_manager.clipboard = table_text([pair_of(row) for row in rows])
        number = len(rows)
        broken = broken_text(len(context.scene.fmqm.rows) - number)
        self.report({"INFO"}, ("1 result copied" if number == 1 else f"{number} results copied") + broken)
        return {"FINISHED"}


CLASSES = (FMQM_OT_sort_rows, FMQM_OT_remove_row, FMQM_OT_clear_results, FMQM_OT_copy_results)
