# SPDX-License-Identifier: GPL-3.0-or-later
"""The results' panel: the rows, and all about the chosen one."""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from ...comparison.judge import Judge
from ...report.explain import verdict
from ...report.numbers import score_text
from ...report.records import pair_record
from ...report.words import LABELS
from .. import session
from ..properties.rows import (
    FMQMRow,
    active_row,
    comparable,
    is_quick,
    is_whole,
    pair_of,
    row_former,
    row_scores,
)
from ..properties.scene import FMQMScene
from .sidebar import (
    EDGES,
    ICON,
    Sidebar,
    beside,
    cut_in_the_middle,
    is_narrow,
    list_width,
    short_count,
    width,
    with_buttons,
    wrapped,
)
from .swatches import swatch


class FMQM_UL_rows(bpy.types.UIList):  # noqa: N801
    """A table of the LODs. In a narrow sidebar columns are left out, no score is cut. Grey ones have other settings."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        _fmqm: FMQMScene,
        row: FMQMRow,
        _icon: int,
        _active_data: FMQMScene,
        _active_property: str,
    ) -> None:
        icon = "NONE"
        if row.error or row_scores(row) is None:
            icon = "CANCEL"
        elif row.uid in session.stale:
            icon = "FILE_REFRESH"
        elif row.warnings and not is_narrow(context):
            icon = "ERROR"
        scores, chosen = row_scores(row), active_row(context.scene)
        layout.active = chosen is None or comparable(row, chosen)
        cells = _cells(row, scores)
        for (column, share), place in _split(layout, columns_for(width(context), context.scene.fmqm.judge)):
            if column == "name":
                text = cut_in_the_middle(row.name, share - (_PADDING if icon == "NONE" else ICON))
                place.label(text=text, icon=icon, translate=False)
            elif column == "bar" and scores is not None:
                place.progress(factor=scores["perceived"], text="")
            else:
                place.label(text=cells.get(column, ""), translate=False)


def _cells(row: FMQMRow, scores: dict[str, float] | None) -> dict[str, str]:
    if scores is None:
        return {}
    return {
        "triangles": short_count(row.triangles),
        "share": f"{row.share:.0f} %" if row.share >= 1 else f"{row.share:.1g} %",
        "FMQM": score_text(scores["FMQM"], places=3),
        "perceived": score_text(scores["perceived"], places=3),
    }


# Columns of the table with their heads and widths, in pixels at scale 1, in the order in which they appear; the number
# says from which width of the sidebar on.
_TABLE = (
    ("triangles", "Tris", 46, 330),
    ("share", "Share", 46, 300),
    ("FMQM", "FMQM", 48, 0),
    ("perceived", "Perc.", 48, 240),
    ("bar", "", 40, 400),
)
_SENTENCES = 2  # of the explanation that stand with the verdict
_PADDING = 18  # of a label
_LABEL = 92  # of a feature's name with its square


def columns_for(whole: float, judge_name: str) -> list[tuple[str, float]]:
    """The columns that a sidebar of so many pixels at scale 1 has room for, with widths; the name gets the rest."""
    judge = Judge[judge_name].column
    narrow = whole < min(least for name, _, _, least in _TABLE if name == "perceived")
    shown = [
        (name, float(wide))
        for name, _, wide, least in _TABLE
        if (name == judge if narrow and name in ("FMQM", "perceived") else whole >= least)
    ]
    return [("name", max(list_width(whole) - sum(wide for _, wide in shown), 40.0)), *shown]


def _split(
    layout: bpy.types.UILayout, columns: list[tuple[str, float]]
) -> Iterator[tuple[tuple[str, float], bpy.types.UILayout]]:
    """A place in a row for each column."""
    rest = sum(wide for _, wide in columns)
    for number, column in enumerate(columns):
        if number == len(columns) - 1:
            yield column, layout.row()
            return
        layout = layout.split(factor=column[1] / rest)
        yield column, layout.row()
        rest -= column[1]


class FMQM_MT_results(bpy.types.Menu):  # noqa: N801
    bl_idname = "FMQM_MT_results"
    bl_label = "Results Specials"

    def draw(self, _: bpy.types.Context) -> None:
        self.layout.operator("fmqm.copy_results", icon="COPYDOWN")
        self.layout.operator("fmqm.clear_results", icon="X")


class FMQM_PT_results(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_results"
    bl_parent_id = "FMQM_PT_main"
    bl_label = "Results"
    bl_order = 1

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.fmqm.rows)

    def draw(self, context: bpy.types.Context) -> None:
        layout, fmqm = self.layout, context.scene.fmqm
        chosen = active_row(context.scene)
        if chosen is not None:
            _draw_verdict(layout, context, fmqm, chosen)
        beside(layout, context).prop(fmqm, "judge", expand=True)
        table, side = with_buttons(layout, context)
        _draw_heads(table, context)
        count = min(max(len(fmqm.rows), 2), 8)
        table.template_list("FMQM_UL_rows", "", fmqm, "rows", fmqm, "row_index", rows=count)
        side.operator("fmqm.sort_rows", text="", icon="SORTSIZE").column = Judge[fmqm.judge].column
        side.operator("fmqm.remove_row", text="", icon="REMOVE")
        side.menu("FMQM_MT_results", text="", icon="DOWNARROW_HLT")
        if chosen is not None and not all(comparable(chosen, other) for other in fmqm.rows if row_scores(other)):
            wrapped(layout, context, "Scores in grey were measured at other settings: do not compare", icon="INFO")
        row = beside(layout, context, align=False)
        row.operator_context = "INVOKE_DEFAULT"
        row.operator("fmqm.screen_sizes")
        row.operator("fmqm.report")
        row = layout.column(align=True) if is_narrow(context) else layout.split(factor=0.25, align=True)
        row.label(text="Save")
        row = row.row(align=True)
        row.operator_context = "INVOKE_DEFAULT"
        for kind in ("json", "csv", "npz"):
            row.operator("fmqm.save_results", text=kind.upper()).file_format = kind


def _draw_heads(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    heads = {name: head for name, head, _, _ in _TABLE}
    row = layout.row()
    row.active = False
    row.scale_y = 0.8
    for (column, _), place in _split(row, columns_for(width(context), context.scene.fmqm.judge)):
        place.label(text="LOD" if column == "name" else heads[column])


def _beginning(text: str) -> str:
    """The first sentences; Details has them all."""
    return ". ".join(text.split(". ")[:_SENTENCES]).removesuffix(".") + "."


def _draw_verdict(layout: bpy.types.UILayout, context: bpy.types.Context, fmqm: FMQMScene, row: FMQMRow) -> None:
    """What an artist wants to know of the chosen row: how bad, by which number, by what, and whether to believe it."""
    scores, former = row_scores(row), row_former(row)
    if row.error or scores is None:
        text = row.error or "This result cannot be read; measure again"
        wrapped(layout.box(), context, text, icon="CANCEL")
        return
    box = layout.box()
    record = pair_record(pair_of(row)) if is_whole(row) else None
    if record is not None:
        heading = record["impairment"]
        head = box.column()
        wrapped(head, context, heading[:1].upper() + heading[1:], icon_value=swatch(scores["perceived"]))
        note = box.column()
        wrapped(note, context, _beginning(verdict(record)))
    numbers = box.column(align=True)
    for judge in Judge:
        was = "" if former is None else f", was {score_text(former[judge.column])}"
        split = numbers.split(factor=0.4)
        split.label(text=LABELS[judge.column])
        split.label(text=f"{score_text(scores[judge.column])}{was}")
    bars = box.column(align=True)
    for name in Judge[fmqm.judge].features:
        share = max(0.5, _LABEL / (width(context) - EDGES))
        split = bars.column() if is_narrow(context) else bars.split(factor=share)
        label = split.row()
        label.alignment = "LEFT"
        label.operator("fmqm.sort_rows", text=LABELS[name], emboss=False, icon_value=swatch(scores[name])).column = name
        split.progress(factor=scores[name], text=score_text(scores[name], places=3))
    if row.uid in session.stale:
        wrapped(layout, context, session.stale[row.uid], icon="FILE_REFRESH")
    elif session.get(row.uid) is None:
        wrapped(layout, context, "Measured in an earlier session: measure again for the heat map", icon="INFO")
    if is_quick(row):
        text = f"{row.patches} patches were measured; what lies between is grey. Full gives the score to report"
        wrapped(layout, context, text, icon="INFO")
    if row.warnings:
        box = layout.box().column()
        for warning in row.warnings.splitlines():
            wrapped(box, context, warning, icon="ERROR")
        if "Match Scale" in row.warnings:
            box.prop(fmqm.settings, "match_scale", toggle=True)


CLASSES = (FMQM_UL_rows, FMQM_MT_results, FMQM_PT_results)
