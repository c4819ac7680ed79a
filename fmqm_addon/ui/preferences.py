# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on's preferences: where to find help."""

from __future__ import annotations

from pathlib import Path

import bpy

_PACKAGE = (__package__ or "").removesuffix(".ui")
_HELP = Path(__file__).resolve().parents[2] / "README.md"  # the extension has it beside its manifest


class FMQMPreferences(bpy.types.AddonPreferences):
    """Nothing to set: settings are the scene's."""

    bl_idname = _PACKAGE.rpartition(".")[0] or _PACKAGE  # of an extension: the package that Blender has enabled

    def draw(self, _: bpy.types.Context) -> None:
        row = self.layout.row()
        row.label(text="In the 3D viewport's sidebar, tab FMQM")
        row.operator("wm.path_open", text="Help", icon="HELP").filepath = str(_HELP)


CLASSES = (FMQMPreferences,)
