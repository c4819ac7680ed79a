# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings' panels."""

from __future__ import annotations

from typing import ClassVar

import bpy
from bl_ui.utils import PresetPanel

from .sidebar import Sidebar, fields


class FMQM_PT_presets(PresetPanel, bpy.types.Panel):  # noqa: N801
    bl_label = "Measuring Presets"
    preset_subdir = "fmqm"
    preset_operator = "script.execute_preset"
    preset_add_operator = "fmqm.preset_add"


class FMQM_PT_settings(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_settings"
    bl_parent_id = "FMQM_PT_main"
    bl_label = "Settings"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}
    bl_order = 7

    def draw_header_preset(self, _: bpy.types.Context) -> None:
        FMQM_PT_presets.draw_panel_header(self.layout)

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.fmqm.settings
        fields(layout, context)
        layout.prop(settings, "preset")
        column = layout.column()
        column.prop(settings, "space")
        column.prop(settings, "match_scale")
        column.prop(settings, "align")
        column.prop(settings, "both")
        column.prop(settings, "attribution")
        column = layout.column(align=True)
        column.prop(settings, "include")
        column.prop(settings, "exclude")
        column = layout.column(align=True)
        column.prop(settings, "seed")
        column.prop(settings, "repeats")


class FMQM_PT_metric(Sidebar, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_metric"
    bl_parent_id = "FMQM_PT_settings"
    bl_label = "Metric"
    bl_options: ClassVar = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.fmqm.settings
        fields(layout, context)
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


CLASSES = (FMQM_PT_presets, FMQM_PT_settings, FMQM_PT_metric)
