# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of the sizes on screen: from which on each LOD may be shown, and an engine's numbers for that."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ...report.records import size_notes, size_text
from ..operators.screen_sizes import FMQM_OT_copy_sizes
from ..properties.rows import row_screen_size
from ..sizes import engine_text, levels_of, sized_rows
from .sidebar import EDGES, Sidebar, cut_in_the_middle, fields, is_narrow, width, wrapped

_SIZE = 80  # pixels at scale 1, of the column of sizes


class FMQM_PT_sizes(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_sizes"
    bl_parent_id = "FMQM_PT_main"
    bl_label = "Screen Sizes"
    bl_description = "At which size on screen each LOD may be shown, and what an engine takes for that"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}
    bl_order = 1

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(sized_rows(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        layout, sizes = self.layout, context.scene.fmqm.sizes
        rows = sized_rows(context.scene)
        table, whole = layout.column(align=True), width(context) - EDGES
        beside_name = 0 if is_narrow(context) else _SIZE
        for row in rows:
            split = table.split(factor=1 - beside_name / whole) if beside_name else table
            split.label(text=cut_in_the_middle(row.name, whole - beside_name), translate=False)
            split.label(text=f"{size_text(row_screen_size(row) or {}, sizes.transition)} px")
        for said in dict.fromkeys(said for row in rows for said in size_notes(row_screen_size(row) or {})):
            wrapped(layout, context, said, icon="INFO")
        for level in levels_of(context.scene):
            if level.why:
                wrapped(layout, context, f"{level.name} has no place in the chain: {level.why}", icon="INFO")
        note = layout.column()
        note.active = False
        wrapped(note, context, "Pixels that the diagonal of the original's box spans")
        layout.row().prop(sizes, "transition", expand=True)
        fields(layout, context)
        layout.prop(sizes, "engine")
        column = layout.column(align=True)
        column.prop(sizes, "height")
        if sizes.engine in ("unreal", "gltf"):
            column.prop(sizes, "width")
        if sizes.engine in ("godot", "threejs"):
            column.prop(sizes, "fov")
        if sizes.engine == "unity":
            column.prop(sizes, "lod_bias")
        if sizes.engine == "gltf":
            column.prop(sizes, "height_ratio")
        box = layout.box().column(align=True)
        for line in engine_text(context.scene).splitlines():
            wrapped(box, context, line)
        layout.operator(FMQM_OT_copy_sizes.bl_idname, icon="COPYDOWN")


CLASSES = (FMQM_PT_sizes,)
