# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's handlers, as the add-on uses them: lists of where each belongs and what it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
from bpy.app.handlers import persistent

Handlers = Sequence[tuple[str, Callable[..., None]]]


def kept(handler: Callable[..., None]) -> Callable[..., None]:
    """Blender's decorator, with types: the handler outlives the opening of another file."""
    kept: Callable[..., None] = persistent(handler)
    return kept


def add(handlers: Handlers) -> None:
    """Has each of them called from now on."""
    for name, handler in handlers:
        getattr(bpy.app.handlers, name).append(handler)


def remove(handlers: Handlers) -> None:
    """Those of them that are called are no longer."""
    for name, handler in reversed(handlers):
        there = getattr(bpy.app.handlers, name)
        if handler in there:
            there.remove(handler)
