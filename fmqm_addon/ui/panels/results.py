# SPDX-License-Identifier: GPL-3.0-or-later
"""The results' panel: the rows, and all about the chosen one."""

from __future__ import annotations

import bpy

from ...comparison.alignment import SPACE_LABELS
from ...comparison.judge import Judge
from ...report.explain import verdict
from ...report.records import pair_record, size_text
from .. import session
from ..properties.rows import (
    EXPLAINED,
    FMQMRow,
    active_row,
    comparable,
    is_whole,
    pair_of,
    row_attribution,
    row_reverse,
    row_scores,
    row_screen_size,
    row_stderr,
    settings_name,
)
from ..properties.scene import FMQMScene
from .sidebar import Sidebar, wrapped

_WIDE = 330  # pixels at scale 1: from here on the rows have room for the four features
_SHORT_SPACE = {SPACE_LABELS["location"]: "Origins Aligned"}
NOT_SEEN = "Normal maps, roughness and lighting are not part of FMQM"


class FMQM_UL_rows(bpy.types.UIList):  # noqa: N801
    """Name and the judge's score, in a wide sidebar its features too; grey at other settings than the chosen row's."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        fmqm: FMQMScene,
        row: FMQMRow,
        _icon: int,
        _active_data: FMQMScene,
        _active_property: str,
    ) -> None:
        icon = "BLANK1"  # names stay in line
        if row.error or row_scores(row) is None:
            icon = "CANCEL"
        elif row.uid in session.stale:
            icon = "FILE_REFRESH"
        elif row.warnings:
            icon = "ERROR"
        scores = row_scores(row)
        if scores is None:
            layout.label(text=row.name, icon=icon, translate=False)
            return
        wide = context.region.width / context.preferences.system.ui_scale > _WIDE
        split = layout.split(factor=0.36 if wide else 0.68)
        split.label(text=row.name, icon=icon, translate=False)
        numbers = split.row()
        chosen = active_row(context.scene)
        numbers.active = chosen is None or comparable(row, chosen)
        judge = Judge[fmqm.judge]
        numbers.label(text=f"{scores[judge.column]:.4f}")
        for name in judge.features if wide else ():
            numbers.label(text=f"{scores[name]:.2f}")


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
    bl_order = 2

    def draw(self, context: bpy.types.Context) -> None:
        layout, fmqm = self.layout, context.scene.fmqm
        if not fmqm.rows:
            layout.label(text="Nothing measured yet")
            return
        layout.row().prop(fmqm, "judge", expand=True)
        row = layout.row()
        row.template_list("FMQM_UL_rows", "", fmqm, "rows", fmqm, "row_index", rows=3)
        side = row.column(align=True)
        side.operator("fmqm.sort_rows", text="", icon="SORTSIZE").column = Judge[fmqm.judge].column
        side.operator("fmqm.remove_row", text="", icon="REMOVE")
        side.separator()
        side.menu("FMQM_MT_results", text="", icon="DOWNARROW_HLT")
        chosen = active_row(context.scene)
        if chosen is not None:
            _draw_row(layout, context, fmqm, chosen)
        row = layout.row()
        row.operator_context = "INVOKE_DEFAULT"
        row.operator("fmqm.screen_sizes")
        row = layout.row(align=True)
        row.operator_context = "INVOKE_DEFAULT"
        row.label(text="Save")
        for kind in ("json", "csv", "npz"):
            row.operator("fmqm.save_results", text=kind.upper()).file_format = kind
        note = layout.column()
        note.active = False
        wrapped(note, context, NOT_SEEN)


def _draw_row(layout: bpy.types.UILayout, context: bpy.types.Context, fmqm: FMQMScene, row: FMQMRow) -> None:
    """All about the chosen row."""
    if row.error:
        wrapped(layout.box(), context, row.error, icon="CANCEL")
        return
    scores, stderr = row_scores(row), row_stderr(row)
    if scores is None:
        wrapped(layout.box(), context, "This result cannot be read; measure again", icon="CANCEL")
        return
    if row.uid in session.stale:
        wrapped(layout, context, session.stale[row.uid], icon="FILE_REFRESH")
    column = layout.column(align=True)
    for name in EXPLAINED:
        if name == "perceived":
            column.separator()
        split = column.split(factor=0.5, align=True)
        label = split.row()
        label.alignment = "LEFT"
        label.operator("fmqm.sort_rows", text=EXPLAINED[name][0], emboss=False).column = name
        error = f" ± {stderr[name]:.4f}" if stderr else ""
        split.label(text=f"{scores[name]:.4f}{error}")
    reverse = row_reverse(row)
    if reverse is not None:
        for judge in Judge:
            split = column.split(factor=0.5, align=True)
            split.label(text=f"    {EXPLAINED[judge.column][0]} Reversed")
            split.label(text=f"{judge.score(reverse):.4f}")
    attribution = row_attribution(row)
    if attribution is not None:
        for label, key in (("Geometry Loss", "geometry_loss"), ("Texture Loss", "texture_loss")):
            split = column.split(factor=0.5, align=True)
            split.label(text=f"    {label}")
            split.label(text=f"{attribution[key]:.4f}")
    sizes = row_screen_size(row)
    for label, kind in (("Up to (Hard Switch)", "strict"), ("Up to (Faded)", "fade")) if sizes else ():
        split = column.split(factor=0.5, align=True)
        split.label(text=f"    {label}")
        split.label(text=f"{size_text(sizes, kind)} px")
    reference = f"{row.reference_name} (no modifiers)" if row.bare_reference else row.reference_name
    for label, text in (
        ("Against", reference),
        ("Triangles", f"{row.triangles:,} ({row.share:.3g} %)"),
        ("Space", _SHORT_SPACE.get(row.space, row.space.capitalize())),
        ("Settings", settings_name(row)),
        ("Patches", f"{row.patches:,}"),
        ("Samples", f"{row.samples:,}"),
        ("Time", f"{row.seconds:.2f} s"),
    ):
        split = column.split(factor=0.5, align=True)
        split.label(text=f"    {label}")
        split.label(text=text, translate=False)
    if not all(comparable(row, other) for other in fmqm.rows if row_scores(other)):
        wrapped(layout, context, "Scores in grey were measured at other settings: do not compare", icon="INFO")
    if attribution is not None:
        phrase = attribution["phrase"]
        wrapped(layout, context, phrase[:1].upper() + phrase[1:], icon="INFO")
    if is_whole(row):
        wrapped(layout, context, verdict(pair_record(pair_of(row))), icon="INFO")
    if row.warnings:
        box = layout.box().column()
        for warning in row.warnings.splitlines():
            wrapped(box, context, warning, icon="ERROR")
        if "Match Scale" in row.warnings:
            box.prop(fmqm.settings, "match_scale", toggle=True)


CLASSES = (FMQM_UL_rows, FMQM_MT_results, FMQM_PT_results)
