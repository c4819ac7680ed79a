# SPDX-License-Identifier: GPL-3.0-or-later
"""The sub-panels that show a result in the 3D view: Heat Map, Worst Places, NCF Debugging."""

from __future__ import annotations

from typing import Any

import bpy

from ...report.numbers import score_text
from .. import session
from ..operators.pick import FMQM_OT_unit_pick
from ..operators.probe import FMQM_OT_probe
from ..operators.view import (
    FMQM_OT_clear,
    FMQM_OT_keep,
    FMQM_OT_shells,
    FMQM_OT_slice,
    FMQM_OT_unit_step,
    FMQM_OT_worst_all,
    FMQM_OT_worst_step,
)
from ..properties.rows import active_row
from ..view.result import look_of
from .sidebar import OfResult, beside, fields, list_width, switched, text_width, width, wrapped

_LONG_WORDS = 280  # pixels of a sidebar in which two buttons with icons have room for their words
_SCORE, _BLAME, _NUMBER = 46, 80, 40  # pixels at scale 1, of the columns of the worst places


class FMQM_UL_worst(bpy.types.UIList):  # noqa: N801
    def draw_item(
        self, context: bpy.types.Context, layout: Any, _data: Any, item: Any, _icon: int, _active: Any, _property: str
    ) -> None:
        """The score, what is lowest there, and, where there is room, the patch."""
        room = list_width(width(context))
        split = layout.split(factor=_SCORE / room)
        split.label(text=score_text(item.score, places=3))
        rest = room - _SCORE
        if rest > _BLAME + _NUMBER:
            split = split.split(factor=1 - _NUMBER / rest)
        fitting = text_width(item.blame) + 12 < rest
        split.label(text=item.blame if fitting else item.blame.rpartition(" ")[0])
        if rest > _BLAME + _NUMBER:
            split.label(text=f"#{item.patch}")

    def draw_filter(self, _context: bpy.types.Context, _layout: Any) -> None:
        """Twenty rows in their order need no filter."""


class FMQM_PT_look(OfResult, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_look"
    bl_label = "Heat Map"
    bl_order = 2

    def draw(self, context: bpy.types.Context) -> None:
        layout, look = self.layout, look_of(context.scene)
        fields(layout, context)
        _say_if_gone(layout, context)
        _switch(layout, context, look, "show")
        column = layout.column()
        column.active = look.show != "OFF"
        column.prop(look, "layer")
        column.prop(look, "range")
        if look.range == "CUSTOM":
            pair = column.column(align=True)
            pair.prop(look, "low", slider=True)
            pair.prop(look, "high", slider=True)
        switched(column, look, "only_below", "below", "Only Below", slider=True)
        column.label(text="Show On")
        _switch(column, context, look, "place")
        if look.show == "POINTS":
            column.prop(look, "point_size", slider=True)
        row = layout.row()
        row.use_property_split = False
        row.prop(look, "show_after")
        layout.operator(FMQM_OT_probe.bl_idname, icon="EYEDROPPER")
        row = beside(layout, context, _LONG_WORDS)
        row.operator(FMQM_OT_keep.bl_idname, icon="FAKE_USER_ON")
        row.operator(FMQM_OT_clear.bl_idname, icon="TRASH")


class FMQM_PT_worst(OfResult, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_worst"
    bl_label = "Worst Places"
    bl_order = 3

    def draw(self, context: bpy.types.Context) -> None:
        layout, look = self.layout, look_of(context.scene)
        _say_if_gone(layout, context)
        if len(look.worst):
            layout.template_list("FMQM_UL_worst", "", look, "worst", look, "worst_index", rows=4, maxrows=8)
        row = beside(layout, context)
        row.operator(FMQM_OT_worst_step.bl_idname, text="Previous", icon="TRIA_LEFT").step = -1
        row.operator(FMQM_OT_worst_step.bl_idname, text="Next", icon="TRIA_RIGHT").step = 1
        layout.operator(FMQM_OT_worst_all.bl_idname)


class FMQM_PT_ncf(OfResult, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_ncf"
    bl_label = "NCF Debugging"
    bl_order = 6
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, look = self.layout, look_of(context.scene)
        fields(layout, context)
        _say_if_gone(layout, context)
        column = layout.column(align=True)
        column.label(text="Units of One Sample")
        column.operator(FMQM_OT_unit_pick.bl_idname, icon="EYEDROPPER")
        row = beside(column, context)
        row.operator(FMQM_OT_unit_step.bl_idname, text="Previous", icon="TRIA_LEFT").step = -1
        row.operator(FMQM_OT_unit_step.bl_idname, text="Next", icon="TRIA_RIGHT").step = 1
        column = layout.column()
        column.operator(FMQM_OT_slice.bl_idname, icon="MESH_PLANE", depress=look.show_slice)
        column = column.column()
        column.active = look.show_slice
        beside(column, context).prop(look, "slice_axis", expand=True)
        column.prop(look, "slice_offset", slider=True)
        column.prop(look, "slice_layer")
        column.prop(look, "slice_resolution")
        column = layout.column()
        column.operator(FMQM_OT_shells.bl_idname, icon="MOD_THICKNESS", depress=look.show_shells)
        column = column.column()
        column.active = look.show_shells
        beside(column, context).prop(look, "shell_field", expand=True)
        beside(column, context).prop(look, "shell_layout", expand=True)
        column.prop(look, "shell_distance")
        column.prop(look, "shell_points")


def _switch(layout: bpy.types.UILayout, context: bpy.types.Context, look: Any, name: str) -> None:
    """A choice of buttons over the whole width, where their names are not cut."""
    row = beside(layout, context)
    row.use_property_split = False
    row.prop(look, name, expand=True)


def _say_if_gone(layout: Any, context: bpy.types.Context) -> None:
    row = active_row(context.scene)
    if row is not None and not row.error and session.get(row.uid) is None:
        wrapped(layout, context, "Samples are gone: Measure Again", icon="INFO")


CLASSES: tuple[type, ...] = (FMQM_UL_worst, FMQM_PT_look, FMQM_PT_worst, FMQM_PT_ncf)
