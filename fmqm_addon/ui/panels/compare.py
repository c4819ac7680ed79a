# SPDX-License-Identifier: GPL-3.0-or-later
"""The sub-panel of what shows Original and LOD together in one place."""

from __future__ import annotations

import bpy

from ..keys import key_text
from ..operators.flip import FMQM_OT_flip
from ..operators.loupe import FMQM_OT_loupe
from ..view import flip, loupe
from ..view.result import why_not
from .sidebar import OfResult, beside, is_narrow, wrapped

_KEY = 290  # pixels of a sidebar in which one of two buttons has room for its key


class FMQM_PT_compare(OfResult, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_compare"
    bl_label = "Compare"
    bl_order = 4

    def draw(self, context: bpy.types.Context) -> None:
        reason = why_not(context.scene)
        if reason:
            wrapped(self.layout, context, reason[:1].upper() + reason[1:], "INFO")
            return
        area = context.area.as_pointer()
        has_loupe = loupe.shown is not None and loupe.shown.area == area
        name = FMQM_OT_loupe.bl_label if is_narrow(context) else _with_key(FMQM_OT_loupe)
        self.layout.operator(FMQM_OT_loupe.bl_idname, text=name, icon="VIEWZOOM", depress=has_loupe)
        shown = flip.shown if flip.shown is not None and flip.shown.area == area else None
        row = beside(self.layout, context)
        alone, wipes = shown is not None and shown.wipe is None, shown is not None and shown.wipe is not None
        name = FMQM_OT_flip.bl_label if is_narrow(context, _KEY) else _with_key(FMQM_OT_flip)
        row.operator(FMQM_OT_flip.bl_idname, text=name, icon="FILE_REFRESH", depress=alone)
        row.operator(FMQM_OT_flip.bl_idname, text="Wipe", icon="ARROW_LEFTRIGHT", depress=wipes).wipe = True


def _with_key(operator: type[bpy.types.Operator]) -> str:
    """Its name, and the key that does the same."""
    key = key_text(operator.bl_idname)
    return f"{operator.bl_label}  ({key})" if key else operator.bl_label


CLASSES: tuple[type, ...] = (FMQM_PT_compare,)
