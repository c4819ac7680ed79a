# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel at the top: what is compared with what, and the measuring button."""

from __future__ import annotations

import bpy

from ...blender.scene.target import target_of
from ...blender.scene.triangle_count import triangle_count
from .. import live, session
from ..operators.inputs import reference_of
from ..operators.measure import why_not
from ..properties.items import FMQMItem, item_target
from ..properties.scene import FMQMScene
from .sidebar import (
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

_COUNT = 44  # pixels at scale 1, of the column of triangles


class FMQM_UL_compared(bpy.types.UIList):  # noqa: N801
    """Names of what is compared."""

    def draw_item(
        self,
        context: bpy.types.Context,
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
            return
        icon = "OUTLINER_COLLECTION"
        if isinstance(target, bpy.types.Object):
            icon = "OBJECT_DATA" if target.type == "MESH" else "EMPTY_DATA"
        whole, beside_name = list_width(width(context)), 0 if is_narrow(context) else _COUNT
        split = layout.split(factor=1 - beside_name / whole)
        name = cut_in_the_middle(target.name, whole - beside_name - ICON)
        split.label(text=name, icon=icon, translate=False)
        count = triangle_count(target_of(target), context.view_layer.depsgraph)
        if count is not None and beside_name:
            split.label(text=short_count(count), translate=False)


class FMQM_MT_compared(bpy.types.Menu):  # noqa: N801
    bl_idname = "FMQM_MT_compared"
    bl_label = "List Specials"

    def draw(self, _: bpy.types.Context) -> None:
        self.layout.operator("fmqm.add_collection", icon="OUTLINER_COLLECTION")
        self.layout.operator("fmqm.clear_compared", icon="X")


class FMQM_PT_main(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_main"
    bl_label = "Mesh Quality (FMQM)"

    def draw(self, context: bpy.types.Context) -> None:
        layout, fmqm = self.layout, context.scene.fmqm
        if reference_of(fmqm) is None and not fmqm.compared:
            wrapped(layout, context, "Select the LODs, then the original last, and press Use Selection", icon="INFO")
        self._draw_reference(layout, context, fmqm)
        self._draw_compared(layout, context, fmqm)
        self._draw_measure(layout, context, fmqm)

    def _draw_reference(self, layout: bpy.types.UILayout, context: bpy.types.Context, fmqm: FMQMScene) -> None:
        column = layout.column(align=True)
        column.operator("fmqm.find_lods", icon="VIEWZOOM")
        row = beside(column, context)
        row.operator("fmqm.use_selection")
        row.operator("fmqm.own_modifiers")
        column = layout.column(align=True)
        original = reference_of(fmqm)
        count = None
        if original is not None:
            count = triangle_count(target_of(original, fmqm.bare_reference), context.view_layer.depsgraph)
        triangles = "" if count is None else f": {count:,}" if is_narrow(context) else f": {count:,} triangles"
        column.label(text=f"Original{triangles}")
        row = column.row(align=True)
        row.prop(fmqm, "reference_kind", expand=True, icon_only=True)
        row.prop(fmqm, "reference" if fmqm.reference_kind == "OBJECT" else "reference_collection", text="")
        if fmqm.bare_reference:
            column.prop(fmqm, "bare_reference")

    def _draw_compared(self, layout: bpy.types.UILayout, context: bpy.types.Context, fmqm: FMQMScene) -> None:
        column = layout.column(align=True)
        column.label(text="LODs")
        table, side = with_buttons(column, context)
        table.template_list("FMQM_UL_compared", "", fmqm, "compared", fmqm, "compared_index", rows=3)
        side.operator("fmqm.add_selected", text="", icon="ADD")
        side.operator("fmqm.remove_compared", text="", icon="REMOVE")
        side.operator("fmqm.swap", text="", icon="FILE_REFRESH")
        side.menu("FMQM_MT_compared", text="", icon="DOWNARROW_HLT")

    def _draw_measure(self, layout: bpy.types.UILayout, context: bpy.types.Context, fmqm: FMQMScene) -> None:
        job = session.job
        if job is not None:
            column = layout.column(align=True)
            column.progress(factor=job.progress, text=f"{100 * job.progress:.0f} %")
            column.label(text=job.text, translate=False)
            layout.operator("fmqm.cancel", icon="X")
            return
        finer = _finer_than_original(context, fmqm)
        if finer:
            wrapped(layout, context, f"{finer} has more triangles than the original: swap them?", icon="ERROR")
        layout.prop(fmqm.settings, "preset", text="")
        row = layout.column(align=True) if is_narrow(context) else layout.split(factor=0.75, align=True)
        row.scale_y = 1.5
        row.operator_context = "INVOKE_DEFAULT"
        row.operator("fmqm.measure", icon="DRIVER_DISTANCE")
        row.operator("fmqm.live", text="Live", depress=live.current is not None)
        reason = why_not(fmqm)
        if reason:
            wrapped(layout, context, reason, icon="INFO")


def _finer_than_original(context: bpy.types.Context, fmqm: FMQMScene) -> str:
    """The first LOD that has more triangles than its original; "" if none has."""
    original, depsgraph = reference_of(fmqm), context.view_layer.depsgraph
    most = None if original is None else triangle_count(target_of(original, fmqm.bare_reference), depsgraph)
    if most is None or fmqm.bare_reference:  # modifiers may well add some
        return ""
    for item in fmqm.compared:
        target = item_target(item)
        count = None if target is None else triangle_count(target_of(target), depsgraph)
        if target is not None and count is not None and count > most:
            return str(target.name)
    return ""


CLASSES = (FMQM_UL_compared, FMQM_MT_compared, FMQM_PT_main)
