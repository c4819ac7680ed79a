# SPDX-License-Identifier: GPL-3.0-or-later
"""The button of Live."""

from __future__ import annotations

from typing import ClassVar

import bpy

from .. import live
from .polls import allowed


class FMQM_OT_live(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.live"
    bl_label = "Live"
    bl_description = (
        "Measure the chosen LOD again by itself after each change of it or of the original, quickly, with the score in "
        "the corner of the view. Results stay as they are"
    )
    bl_options: ClassVar = {"INTERNAL"}  # no UNDO: it changes nothing in the file

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        there = live.current is not None or live.chosen_pair(context.scene) is not None
        return allowed(cls, "" if there else "Choose an original and an LOD")

    def execute(self, _: bpy.types.Context) -> set[str]:
        if live.current is None:
            live.turn_on()
        else:
            live.turn_off()
        return {"FINISHED"}


CLASSES = (FMQM_OT_live,)
