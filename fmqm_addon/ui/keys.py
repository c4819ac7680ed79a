# SPDX-License-Identifier: GPL-3.0-or-later
"""Keys of the 3D view. An operator whose poll says no lets its key pass, so they act only where there is a result."""

from __future__ import annotations

from typing import Any

import bpy

from .operators.flip import FMQM_OT_flip
from .operators.loupe import FMQM_OT_loupe

# Blender itself uses none of these in any mode of the 3D view.
_KEYS = ((FMQM_OT_loupe.bl_idname, "L"), (FMQM_OT_flip.bl_idname, "F"))
_KEYMAP = "3D View"
_added: list[tuple[Any, Any]] = []


def key_text(idname: str) -> str:
    """What to press for an operator, as the user has it; "" for nothing."""
    config = bpy.context.window_manager.keyconfigs.user
    keymap = None if config is None else config.keymaps.get(_KEYMAP)
    item = None if keymap is None else next((each for each in keymap.keymap_items if each.idname == idname), None)
    return item.to_string() if item is not None and item.active else ""


def register() -> None:
    config = bpy.context.window_manager.keyconfigs.addon
    if config is None:
        return  # without a window
    keymap = config.keymaps.new(_KEYMAP, space_type="VIEW_3D")
    for idname, key in _KEYS:
        _added.append((keymap, keymap.keymap_items.new(idname, key, "PRESS", ctrl=True, shift=True)))


def unregister() -> None:
    while _added:
        keymap, item = _added.pop()
        keymap.keymap_items.remove(item)
