# SPDX-License-Identifier: GPL-3.0-or-later
"""The sub-panel of LOD Chain."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ...comparison.judge import Judge
from ...report.words import LABELS
from ..operators.chain import FMQM_OT_lod_chain
from .sidebar import Sidebar, fields


class FMQM_PT_chain(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_parent_id = "FMQM_PT_main"
    bl_idname = "FMQM_PT_chain"
    bl_label = "LOD Chain"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}
    bl_order = 9

    def draw(self, context: bpy.types.Context) -> None:
        layout, chain = self.layout, context.scene.fmqm.chain
        fields(layout, context)
        layout.prop(chain, "levels")
        column = layout.column(align=True)
        judge = LABELS[Judge[context.scene.fmqm.judge].column]
        for level in range(chain.levels):
            column.prop(chain, "qualities", index=level, text=f"LOD{level + 1} {judge}", slider=True)
        row = layout.row()
        row.use_property_split = False
        row.prop(chain, "name_original")
        row = layout.row()
        row.operator_context = "INVOKE_DEFAULT"
        row.operator(FMQM_OT_lod_chain.bl_idname, icon="MOD_DECIM")


CLASSES = (FMQM_PT_chain,)
