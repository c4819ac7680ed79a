# SPDX-License-Identifier: GPL-3.0-or-later
"""The button that finds at which size on screen the measured LODs may be shown."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import astuple
from typing import ClassVar

import bpy

from ...blender.materials.types import Reading
from ...blender.scene.bvh import BVHQuery
from ...blender.scene.target import Target, take
from ...comparison.candidates import AssetMesh
from ...metric.errors import FMQMError
from ...metric.stepper import Progress, Stepper, Work, as_part
from ...screen_size.chain import SizedChain, sizing_chain
from ...screen_size.records import size_record
from .. import session, stale
from ..modal import SteppedOperator, scene_of
from ..properties.rows import FMQMRow, active_row, row_targets
from ..properties.settings import pair_options, patterns_of
from ..sizes import engine_text
from .polls import allowed

_READING = 0.1  # share of the whole that reading the scene takes, about


class FMQM_OT_screen_sizes(SteppedOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.screen_sizes"
    bl_label = "Screen Sizes"
    bl_description = (
        "Find at which size on screen each of the results may be shown in place of the chosen one's original: renders "
        "of base color and smooth shading are compared. Esc cancels"
    )
    bl_options: ClassVar = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        why = "" if _rows(context.scene) else "Measure the quality first, and choose a result"
        return allowed(cls, why if session.job is None else "A measurement is running")

    def begin(self, context: bpy.types.Context) -> bool:
        settings = context.scene.fmqm.settings
        try:
            options = pair_options(settings)
        except FMQMError as error:
            self.report({"ERROR"}, str(error))
            return False
        rows = _rows(context.scene)
        reading = Reading(include=patterns_of(settings.include), exclude=patterns_of(settings.exclude), normals=True)
        self._scene, self._uids = context.scene.name_full, [row.uid for row in rows]
        reference, targets = row_targets(rows[0])[0], [row_targets(row)[1] for row in rows]
        self.stepper = Stepper(_sizing(reference, targets, options.space, options.match_scale, reading))
        return True

    def finish(self, _: bpy.types.Context) -> set[str]:
        scene = scene_of(self._scene)
        sized_chain: str | SizedChain = self.stepper.result
        if scene is None or isinstance(sized_chain, str):
            self.report({"WARNING"}, "The scene is gone, and the sizes with it" if scene is None else str(sized_chain))
            return {"CANCELLED"}
        found, extent = sized_chain.lods, json.dumps(astuple(sized_chain.extent), allow_nan=False)
        sized = dict(zip(self._uids, found, strict=True))
        for row in scene.fmqm.rows:
            if row.uid in sized:
                size = sized[row.uid].size
                row.screen_size = "" if size is None else json.dumps(size_record(size), allow_nan=False)
                row.screen_extent = "" if size is None else extent
        failed = [each for each in found if each.error]
        if failed:
            self.report({"WARNING"}, f"{len(failed)} of {len(found)} not rendered: {failed[0].error}")
        else:
            self.report({"INFO"}, f"{len(found)} sizes on screen found")
        stale.redraw()
        return {"FINISHED"}


def _rows(scene: bpy.types.Scene) -> list[FMQMRow]:
    """Those with the chosen row's reference."""
    chosen = active_row(scene)
    if chosen is None:
        return []
    reference = row_targets(chosen)[0]
    return [row for row in scene.fmqm.rows if row_targets(row)[0] == reference and not row.error]


def _sizing(
    reference: Target, targets: Sequence[Target], space: str, match_scale: bool, reading: Reading
) -> Work[str | SizedChain]:
    """Sizes in the order of the targets; or why there are none."""
    read: list[tuple[str, AssetMesh | str]] = []
    for index, target in enumerate((reference, *targets)):
        yield Progress(f"Reading {target.label}", _READING * index / (len(targets) + 1))
        try:
            read.append((target.label, take(target, reading)))
        except FMQMError as error:
            read.append((target.label, str(error)))
    original = read[0][1]
    if isinstance(original, str):
        return original
    try:
        sizing = sizing_chain(original, read[1:], BVHQuery, space=space, match_scale=match_scale)
        return (yield from as_part(sizing, _READING, 1 - _READING))
    except FMQMError as error:
        return str(error)


class FMQM_OT_copy_sizes(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.copy_sizes"
    bl_label = "Copy for Engine"
    bl_description = "Copy these lines to the clipboard, to paste them into the engine"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, "" if engine_text(context.scene) else "Press Screen Sizes first")

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.window_manager.clipboard = engine_text(context.scene) + "\n"
        self.report({"INFO"}, "Copied")
        return {"FINISHED"}


CLASSES = (FMQM_OT_screen_sizes, FMQM_OT_copy_sizes)
