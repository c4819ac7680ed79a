# SPDX-License-Identifier: GPL-3.0-or-later
"""All numbers of the chosen row."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ...comparison.alignment import SPACE_LABELS
from ...comparison.judge import Judge
from ...report.explain import verdict
from ...report.numbers import score_text
from ...report.records import pair_record, size_text
from ...report.words import LABELS
from ..properties.rows import (
    FMQMRow,
    active_row,
    is_whole,
    pair_of,
    row_attribution,
    row_reverse,
    row_scores,
    row_screen_size,
    row_stderr,
    settings_name,
)
from .sidebar import ICON, OfResult, is_narrow, text_width, width, wrapped

_EDGES = 50  # pixels at scale 1, left and right of what stands in no box
_SHORT_SPACE = {SPACE_LABELS["location"]: "Origins Aligned"}
NOT_SEEN = "Normal maps, roughness and lighting are not part of FMQM"


class FMQM_PT_details(OfResult, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_details"
    bl_label = "Details"
    bl_description = "All numbers of the chosen result, and how far to trust it"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}
    bl_order = 5

    def draw(self, context: bpy.types.Context) -> None:
        row = active_row(context.scene)
        if row is None:
            return
        column = self.layout.column(align=True)
        _draw_scores(column, context, row)
        for label, text in _facts(row):
            split = column.split(factor=0.5, align=True)
            split.label(text=f"    {label}")
            split.label(text=text, translate=False)
        attribution = row_attribution(row)
        if attribution is not None:
            phrase = attribution["phrase"]
            wrapped(self.layout, context, phrase[:1].upper() + phrase[1:], icon="INFO")
        if is_whole(row):
            wrapped(self.layout, context, verdict(pair_record(pair_of(row))), icon="INFO")
        note = self.layout.column()
        note.active = False
        wrapped(note, context, NOT_SEEN)


def _draw_scores(column: bpy.types.UILayout, context: bpy.types.Context, row: FMQMRow) -> None:
    scores, stderr, reverse = row_scores(row), row_stderr(row), row_reverse(row)
    if scores is None:
        return
    for name in LABELS:
        if name == "perceived":
            column.separator()
        text = score_text(scores[name], stderr[name] if stderr and not is_narrow(context) else None)
        room = width(context) - _EDGES
        split = column.split(factor=min(0.5, 1 - (text_width(text) + ICON / 2) / room), align=True)
        label = split.row()
        label.alignment = "LEFT"
        label.operator("fmqm.sort_rows", text=LABELS[name], emboss=False).column = name
        split.label(text=text)
    if reverse is None:
        return
    for judge in Judge:
        split = column.split(factor=0.5, align=True)
        split.label(text=f"    {LABELS[judge.column]} Reversed")
        split.label(text=score_text(judge.score(reverse)))


def _facts(row: FMQMRow) -> list[tuple[str, str]]:
    attribution = row_attribution(row) or {}
    losses = (("Geometry Loss", "geometry_loss"), ("Texture Loss", "texture_loss"))
    sizes = row_screen_size(row)
    switches = (("Up to (Hard Switch)", "strict"), ("Up to (Faded)", "fade")) if sizes else ()
    reference = f"{row.reference_name} (no modifiers)" if row.bare_reference else row.reference_name
    return [
        *((label, score_text(attribution[key])) for label, key in losses if key in attribution),
        *((label, f"{size_text(sizes, kind)} px") for label, kind in switches),
        ("Original", reference),
        ("Triangles", f"{row.triangles:,} ({row.share:.3g} %)"),
        ("Space", _SHORT_SPACE.get(row.space, row.space.capitalize())),
        ("Settings", settings_name(row)),
        ("Patches", f"{row.patches:,}"),
        ("Samples", f"{row.samples:,}"),
        ("Time", f"{row.seconds:.2f} s"),
    ]


CLASSES = (FMQM_PT_details,)
