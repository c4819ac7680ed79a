# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of the worst places."""

from __future__ import annotations

from ...comparison.judge import Judge
from ...metric.evaluation import Result
from ...report.visual import layers
from ...report.visual.worst import worst_patches
from ..properties.view import FMQMLook

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
        item.blame = f"{layers.LAYERS[worst.blame].label} {worst.value:.2f}"
    look.worst_uid = uid
    choose_worst(look, 0)
