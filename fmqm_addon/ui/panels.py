# SPDX-License-Identifier: GPL-3.0-or-later
"""The sidebar's panels: inputs, settings, results. They show what is stored and compute nothing."""

from __future__ import annotations

from typing import ClassVar

import bpy
from bl_ui.utils import PresetPanel

from ..comparison.alignment import SPACE_LABELS
from ..metric.evaluation import COLUMNS
from ..report.records import SHOWN
from ..report.trust_table import Line, trust_lines
from . import session
from .measuring import why_not
from .properties import (
    FMQMItem,
    FMQMRow,
    active_row,
    item_target,
    row_attribution,
    row_reverse,
    row_scores,
    row_stderr,
    row_trust,
)
from .results import EXPLAINED, comparable, settings_name
from .scene import FMQMScene

_WIDE = 330  # pixels at scale 1: from here on the rows have room for the four features
_CHARACTER = 6.6  # pixels at scale 1, of the panel's font, about
_SHORT_SPACE = {SPACE_LABELS["location"]: "Origins Aligned"}
NOT_SEEN = "Normal maps, roughness and lighting are not part of FMQM"


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "FMQM"


def wrapped(layout: bpy.types.UILayout, context: bpy.types.Context, text: str, icon: str = "NONE") -> None:
    """A label of as many lines as the sidebar's width asks for."""
    column = layout.column(align=True)
    column.scale_y = 0.8
    first = True
    for line in _lines(text, _room(context, 70 if icon != "NONE" else 50)):
        column.label(text=line, icon=icon if first else ("BLANK1" if icon != "NONE" else "NONE"))
        first = False


def _room(context: bpy.types.Context, margin: int) -> int:
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


class FMQM_UL_compared(bpy.types.UIList):  # noqa: N801
    """Names of what is compared."""

    def draw_item(
        self,
        _context: bpy.types.Context,
        layout: bpy.types.UILayout,
        _data: FMQMScene,
        item: FMQMItem,
        _icon: int,
        _active_data: FMQMScene,
        _active_property: str,
    ) -> None:
        target = item_target(item)
        if target is None:
            name = item.name if item.object is None else item.object.name
            layout.label(text=f"{name} (gone)", icon="ERROR", translate=False)
        elif isinstance(target, bpy.types.Collection):
            layout.label(text=target.name, icon="OUTLINER_COLLECTION", translate=False)
        else:
            icon = "OBJECT_DATA" if target.type == "MESH" else "EMPTY_DATA"
            layout.label(text=target.name, icon=icon, translate=False)


class FMQM_UL_rows(bpy.types.UIList):  # noqa: N801
    """Name and score, greyed at other settings than the chosen row's; in a wide sidebar the four features too."""

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
        for name in SHOWN if wide else SHOWN[:1]:
            numbers.label(text=f"{scores[name]:.4f}" if name == "FMQM" else f"{scores[name]:.2f}")


class FMQM_MT_compared(bpy.types.Menu):  # noqa: N801
    bl_idname = "FMQM_MT_compared"
    bl_label = "List Specials"

    def draw(self, _: bpy.types.Context) -> None:
        self.layout.operator("fmqm.add_collection", icon="OUTLINER_COLLECTION")
        self.layout.operator("fmqm.clear_compared", icon="X")


class FMQM_MT_results(bpy.types.Menu):  # noqa: N801
    bl_idname = "FMQM_MT_results"
    bl_label = "Results Specials"

    def draw(self, _: bpy.types.Context) -> None:
        self.layout.operator("fmqm.copy_results", icon="COPYDOWN")
        self.layout.operator("fmqm.clear_results", icon="X")


class FMQM_PT_main(_Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_main"
    bl_label = "Mesh Quality (FMQM)"

    def draw(self, context: bpy.types.Context) -> None:
        layout, fmqm = self.layout, context.scene.fmqm
        self._draw_reference(layout, fmqm)
        self._draw_compared(layout, fmqm)
        self._draw_measure(layout, context, fmqm)

    def _draw_reference(self, layout: bpy.types.UILayout, fmqm: FMQMScene) -> None:
        column = layout.column(align=True)
        column.operator("fmqm.find_lods", icon="VIEWZOOM")
        row = column.row(align=True)
        row.operator("fmqm.use_selection")
        row.operator("fmqm.own_modifiers")
        column = layout.column(align=True)
        column.label(text="Reference")
        row = column.row(align=True)
        row.prop(fmqm, "reference_kind", expand=True, icon_only=True)
        row.prop(fmqm, "reference" if fmqm.reference_kind == "OBJECT" else "reference_collection", text="")
        if fmqm.bare_reference:
            column.prop(fmqm, "bare_reference")

    def _draw_compared(self, layout: bpy.types.UILayout, fmqm: FMQMScene) -> None:
        column = layout.column(align=True)
        column.label(text="Compared")
        row = column.row()
        row.template_list("FMQM_UL_compared", "", fmqm, "compared", fmqm, "compared_index", rows=3)
        side = row.column(align=True)
        side.operator("fmqm.add_selected", text="", icon="ADD")
        side.operator("fmqm.remove_compared", text="", icon="REMOVE")
        side.separator()
        side.menu("FMQM_MT_compared", text="", icon="DOWNARROW_HLT")

    def _draw_measure(self, layout: bpy.types.UILayout, context: bpy.types.Context, fmqm: FMQMScene) -> None:
        job = session.job
        if job is not None:
            column = layout.column(align=True)
            column.progress(factor=job.progress, text=f"{100 * job.progress:.0f} %")
            column.label(text=job.text, translate=False)
            layout.operator("fmqm.cancel", icon="X")
            return
        row = layout.row()
        row.scale_y = 1.5
        row.operator_context = "INVOKE_DEFAULT"
        row.operator("fmqm.measure", icon="DRIVER_DISTANCE")
        reason = why_not(fmqm)
        if reason:
            wrapped(layout, context, reason, icon="INFO")


class FMQM_PT_presets(PresetPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Measuring Presets"
    preset_subdir = "fmqm"
    preset_operator = "script.execute_preset"
    preset_add_operator = "fmqm.preset_add"


class FMQM_PT_settings(_Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_settings"
    bl_parent_id = "FMQM_PT_main"
    bl_label = "Settings"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}
    bl_order = 1

    def draw_header_preset(self, _: bpy.types.Context) -> None:
        FMQM_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.fmqm.settings
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "preset")
        column = layout.column()
        column.prop(settings, "space")
        column.prop(settings, "match_scale")
        column.prop(settings, "both")
        column.prop(settings, "attribution")
        column = layout.column(align=True)
        column.prop(settings, "seed")
        column.prop(settings, "repeats")


class FMQM_PT_metric(_Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_metric"
    bl_parent_id = "FMQM_PT_settings"
    bl_label = "Metric"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.fmqm.settings
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(align=True)
        for name in ("samples", "patches", "color_units"):
            column.prop(settings, name)
        column = layout.column()
        column.prop(settings, "score_all", text="Score All")
        if not settings.score_all:
            column.prop(settings, "scored_patches")
        layout.prop(settings, "sigma")
        for radius, whole in (("radius", "radius_whole"), ("gradient_radius", "gradient_whole")):
            column = layout.column(align=True)
            row = column.row()
            row.active = not getattr(settings, whole)
            row.prop(settings, radius)
            column.prop(settings, whole, text="Whole Patch")
        column = layout.column(align=True)
        column.prop(settings, "normal_threshold", text="Normal Thr.")
        column.prop(settings, "tangent_threshold", text="Tangent Thr.")
        for name in ("centers", "color_space", "pooling"):
            layout.prop(settings, name)


class FMQM_PT_results(_Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_results"
    bl_parent_id = "FMQM_PT_main"
    bl_label = "Results"
    bl_order = 2

    def draw(self, context: bpy.types.Context) -> None:
        layout, fmqm = self.layout, context.scene.fmqm
        if not fmqm.rows:
            layout.label(text="Nothing measured yet")
            return
        row = layout.row()
        row.template_list("FMQM_UL_rows", "", fmqm, "rows", fmqm, "row_index", rows=3)
        side = row.column(align=True)
        side.operator("fmqm.sort_rows", text="", icon="SORTSIZE").column = "FMQM"
        side.operator("fmqm.remove_row", text="", icon="REMOVE")
        side.separator()
        side.menu("FMQM_MT_results", text="", icon="DOWNARROW_HLT")
        chosen = active_row(context.scene)
        if chosen is not None:
            _draw_row(layout, context, fmqm, chosen)
        row = layout.row(align=True)
        row.operator_context = "INVOKE_DEFAULT"
        row.label(text="Save")
        for kind in ("json", "csv", "npz"):
            row.operator("fmqm.save_results", text=kind.upper()).file_format = kind
        note = layout.column()
        note.active = False
        wrapped(note, context, NOT_SEEN)


class FMQM_PT_trust(_Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_trust"
    bl_parent_id = "FMQM_PT_results"
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


def _draw_fact(layout: bpy.types.UILayout, context: bpy.types.Context, line: Line) -> None:
    """In one line where there is room for it; else its unit, or why it is not known, goes below, and a long value."""
    # What reports call distorted is Compared here. One value where both have the same: the sidebar is narrow.
    label, unit = (text.replace("distorted", "compared") for text in (line.label, line.unit))
    value = " / ".join(dict.fromkeys(line.values))
    if unit.partition(" ")[0] in label.split():  # vertices welded are vertices
        unit = ""
    room = _room(context, 40) - len(label) - 2
    label, whole = label[:1].upper() + label[1:], f"{value} {unit}".strip()
    if len(value) > room:
        layout.label(text=label)
        _draw_below(layout, context, whole)
        return
    row = layout.row(align=True)
    row.label(text=label)
    right = row.row(align=True)
    right.alignment = "RIGHT"
    right.label(text=whole if len(whole) <= room else value, translate=False)
    if len(whole) > room:
        note = layout.column(align=True)
        note.active = False
        _draw_below(note, context, unit)


def _draw_below(layout: bpy.types.UILayout, context: bpy.types.Context, text: str) -> None:
    """Indented."""
    row = layout.row(align=True)
    row.separator(factor=2.0)
    wrapped(row, context, text)


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
    for name in SHOWN:
        split = column.split(factor=0.5, align=True)
        label = split.row()
        label.alignment = "LEFT"
        label.operator("fmqm.sort_rows", text=EXPLAINED[name][0], emboss=False).column = name
        error = f" ± {stderr[name]:.4f}" if stderr else ""
        split.label(text=f"{scores[name]:.4f}{error}")
    reverse = row_reverse(row)
    if reverse is not None:
        split = column.split(factor=0.5, align=True)
        split.label(text="    FMQM Reversed")
        split.label(text=f"{reverse['FMQM']:.4f}")
    attribution = row_attribution(row)
    if attribution is not None:
        for label, key in (("Geometry Loss", "geometry_loss"), ("Texture Loss", "texture_loss")):
            split = column.split(factor=0.5, align=True)
            split.label(text=f"    {label}")
            split.label(text=f"{attribution[key]:.4f}")
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
    if row.warnings:
        box = layout.box().column()
        for warning in row.warnings.splitlines():
            wrapped(box, context, warning, icon="ERROR")
        if "Match Scale" in row.warnings:
            box.prop(fmqm.settings, "match_scale", toggle=True)


CLASSES = (
    FMQM_UL_compared,
    FMQM_UL_rows,
    FMQM_MT_compared,
    FMQM_MT_results,
    FMQM_PT_main,
    FMQM_PT_presets,
    FMQM_PT_settings,
    FMQM_PT_metric,
    FMQM_PT_results,
    FMQM_PT_trust,
)
assert set(SHOWN) == set(COLUMNS)
