# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel at the top: what is compared with what, and the measuring button."""

from __future__ import annotations

import bpy

from .. import session
from ..operators.measure import why_not
from ..properties.items import FMQMItem, item_target
from ..properties.scene import FMQMScene
from .sidebar import Sidebar, wrapped


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


CLASSES = (FMQM_UL_compared, FMQM_MT_compared, FMQM_PT_main)
