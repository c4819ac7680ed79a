# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets of the settings, as Blender's own operators have them."""

from __future__ import annotations

from typing import ClassVar

import bpy
from bl_operators.presets import AddPresetBase

from ..properties.settings import PRESET_PROPERTIES


class FMQM_OT_preset_add(AddPresetBase, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.preset_add"
    bl_label = "Add Measuring Preset"
    bl_description = "Save these settings as a preset, or remove the chosen one"
    bl_options: ClassVar = {"INTERNAL"}
    preset_menu = "FMQM_PT_presets"
    preset_defines: ClassVar = ["settings = bpy.context.scene.fmqm.settings"]
    preset_values: ClassVar = [f"settings.{name}" for name in PRESET_PROPERTIES]
    preset_subdir = "fmqm"


CLASSES = (FMQM_OT_preset_add,)
