# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of the worst places, and the view of one."""

from __future__ import annotations

import bpy
import numpy as np

from ...blender.display import viewport
from ...comparison.judge import Judge
from ...metric.errors import FMQMError
from ...metric.evaluation import Result
from ...report.numbers import score_text
from ...report.visual import layers
from ...report.visual.worst import patch_view, worst_patches
from ..properties.rows import active_row
from ..properties.view import FMQMLook
from . import heat
from .result import look_of, measured_row, world_length

WORST_COUNT = 20
choosing = False  # the index of the worst places is being set from here


def choose_worst(look: FMQMLook, index: int) -> None:
    """Sets the index of the list without framing the view, which a click in the list does."""
    global choosing
    choosing = True
    try:
        look.worst_index = index
    finally:
        choosing = False


def forget_worst(look: FMQMLook) -> None:
    look.worst.clear()
    look.worst_uid = ""


def fill_worst(look: FMQMLook, result: Result, uid: str) -> None:
    """Lists the patches that the scene's judge scores lowest, unless they are there."""
    if look.worst_uid == uid and len(look.worst):
        return
    look.worst.clear()
    for worst in worst_patches(result, WORST_COUNT, Judge[look.id_data.fmqm.judge]):
        item = look.worst.add()
        item.name = f"Patch {worst.patch}"
        item.patch, item.score, item.value = worst.patch, worst.score, worst.value
        item.blame = f"{layers.LAYERS[worst.blame].label} {score_text(worst.value, places=2)}"
    look.worst_uid = uid
    choose_worst(look, 0)


def focus_patch(scene: bpy.types.Scene, area: bpy.types.Area | None) -> None:
    """Frames the chosen one of the worst patches and shows only it.

    Raises:
        FMQMError: nothing to show.
    """
    look = look_of(scene)
    uid, _, measured = measured_row(scene)
    result = measured.comparison.result
    fill_worst(look, result, uid)
    if not 0 <= look.worst_index < len(look.worst):
        raise FMQMError("the result has no patches")
    if look.show == heat.OFF:
        look.show = heat.SURFACE
    look.focused = True
    heat.refresh(scene)
    center, diameter, normal = patch_view(result, look.worst[look.worst_index].patch)
    place = heat.LOD if look.place == heat.BOTH else look.place  # where the fault can be seen
    row = active_row(scene)
    members = [] if row is None else heat.members_at(row, place)
    matrix = np.array(heat.placed(measured, place, members), np.float64)
    turned = np.linalg.inv(matrix[:3, :3]).T @ normal
    length = float(np.linalg.norm(turned))
    viewport.frame_place(
        area,
        matrix[:3, :3] @ center + matrix[:3, 3],
        diameter * world_length(measured),
        turned / length if length > 0 else turned,
    )


def step_worst(scene: bpy.types.Scene, area: bpy.types.Area | None, step: int) -> None:
    """Goes so far along the list, and round it; as focus_patch. The first step shows the worst one."""
    look = look_of(scene)
    uid, _, measured = measured_row(scene)
    fill_worst(look, measured.comparison.result, uid)
    if look.focused and look.worst:
        choose_worst(look, (look.worst_index + step) % len(look.worst))
    focus_patch(scene, area)


def show_all_patches(scene: bpy.types.Scene) -> None:
    look_of(scene).focused = False
    heat.refresh(scene)
