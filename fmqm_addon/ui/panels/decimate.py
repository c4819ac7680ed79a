# SPDX-License-Identifier: GPL-3.0-or-later
"""The sub-panel of Decimate to Quality."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ...comparison.judge import Judge
from ...report.words import LABELS
from ..operators.decimate import FMQM_OT_decimate
from .sidebar import Sidebar, fields, switched


class FMQM_PT_decimate(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_parent_id = "FMQM_PT_main"
    bl_idname = "FMQM_PT_decimate"
    bl_label = "Decimate to Quality"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}
    bl_order = 8

    def draw(self, context: bpy.types.Context) -> None:
        layout, decimate = self.layout, context.scene.fmqm.decimate
        fields(layout, context)
        label = f"{LABELS[Judge[context.scene.fmqm.judge].column]} Target"
        layout.prop(decimate, "target", text=label, slider=True)
        switched(layout, decimate, "limited", "max_triangles", "Max Triangles")
        switched(layout, decimate, "textures", "texture_target", "Smaller Textures", slider=True)
        row = layout.row()
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(FMQM_OT_decimate.bl_idname, icon="MOD_DECIM")
        if decimate.path:
            column = layout.column(align=True)
            column.scale_y = 0.8
            column.label(text=decimate.path_of, icon="OBJECT_DATA", translate=False)
            for number, line in enumerate(decimate.path.splitlines()):
                column.label(text=line, icon="CHECKMARK" if number == decimate.found else "BLANK1", translate=False)


CLASSES = (FMQM_PT_decimate,)
