# SPDX-License-Identifier: GPL-3.0-or-later
"""The sizes on screen of a chain's results as the numbers of an engine."""

from __future__ import annotations

import bpy

from ..screen_size.engines import SCREEN_NAMES, Extent, Level, Screen, chain, numbers, pasteable
from ..screen_size.measure import Switch
from . import stored_text
from .properties.rows import FMQMRow, active_row, row_screen_size, row_targets


def sized_rows(scene: bpy.types.Scene) -> list[FMQMRow]:
    """The results of the chosen one's original that have a size on screen, from fine to coarse."""
    chosen = active_row(scene)
    if chosen is None:
        return []
    original = row_targets(chosen)[0]
    rows = [row for row in scene.fmqm.rows if row_targets(row)[0] == original and row_screen_size(row) is not None]
    return sorted(rows, key=lambda row: -row.triangles)


def levels_of(scene: bpy.types.Scene) -> tuple[Level, ...]:
    """These rows as a chain; none where there are no sizes."""
    rows = sized_rows(scene)
    kind = scene.fmqm.sizes.transition
    return chain([row.name for row in rows], [Switch(*_switch(row, kind)) for row in rows])


def engine_text(scene: bpy.types.Scene) -> str:
    """What to paste into the chosen engine; "" where there is nothing."""
    levels, sizes = levels_of(scene), scene.fmqm.sizes
    extent = next(filter(None, (stored_text.read_extent(row.screen_extent) for row in sized_rows(scene))), None)
    if extent is None:
        return ""
    screen = Screen(**{name: getattr(sizes, name) for name in SCREEN_NAMES})
    return pasteable(sizes.engine, numbers(sizes.engine, levels, Extent(*extent), screen))


def _switch(row: FMQMRow, kind: str) -> tuple[float, str, int]:
    found = (row_screen_size(row) or {})[kind]
    return found["pixels"], found["bound"], found["worst_view"]
