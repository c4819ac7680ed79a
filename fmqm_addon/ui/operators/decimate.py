# SPDX-License-Identifier: GPL-3.0-or-later
"""Decimate to Quality: a copy of the active object with as few triangles, and as small textures, as targets allow."""

from __future__ import annotations

import bpy

from ...blender.materials.color_images import falling_sides
from ...blender.materials.types import Reading
from ...blender.scene.parts import parts_of
from ...blender.scene.versions import FoundVersions
from ...comparison.decimation import DecimationGoal, Step, TargetResult
from ...comparison.judge import Judge
from ...comparison.pair import PairOptions
from ...report.numbers import score_text
from ..properties.decimate import FMQMDecimate
from ..properties.settings import plain
from ..versions import Search, VersionsOperator, hide

_LARGEST = 10**9  # pixels: textures as they are come before all smaller ones


class FMQM_OT_decimate(VersionsOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.decimate"
    bl_label = "Decimate to Quality"
    bl_description = (
        "Copy the active object with a live Decimate modifier, as strong as the target allows, and measure the copy. "
        "The original stays as it is and is hidden behind it. Esc cancels"
    )
    noun = "Decimation"

    def asked(self, context: bpy.types.Context, _: PairOptions, reading: Reading) -> Search:
        fmqm, active = context.scene.fmqm, context.active_object
        decimate, judge = fmqm.decimate, Judge[fmqm.judge]
        sides = falling_sides(parts_of(active, reading).objects, active.name) if decimate.textures else ()
        goal = DecimationGoal(
            (plain(decimate.target),),
            decimate.max_triangles if decimate.limited else None,
            plain(decimate.texture_target) if decimate.textures else None,
            sides,
            judge,
        )
        name = f" {judge.column} {score_text(goal.targets[0], places=2)}"
        return Search(goal, active.name, (_free(active.name, name),), active.name)

    def keep(
        self, context: bpy.types.Context, scene: bpy.types.Scene, original: bpy.types.Object, found: FoundVersions
    ) -> set[str]:
        """The copy, its row and the path that the search took, in one undo step."""
        searched, judge = found.result.results[0], self.search.goal.judge
        _write_path(scene.fmqm.decimate, original.name, searched, judge)
        if not found.versions:
            best = searched.last.best
            score = best.score(judge)
            self.report(
                {"WARNING"},
                f"{original.name} misses {searched.last.target:g} even with {best.triangles:,} triangles"
                + ("" if score is None else f" ({judge.column} {score_text(score)})"),
            )
            return {"CANCELLED"}
        (copy,) = self.make(context, scene, original, found)
        hidden = hide(context, [original], copy)
        made = found.versions[0]
        comparison = made.outcome.comparison
        assert comparison is not None
        side = f", textures of {made.version.texture} pixels" if made.version.texture else ""
        numbers = f"{made.outcome.triangles:,} of {found.result.triangles:,} triangles{side}"
        told = f"{copy.name}: {numbers}, {judge.column} {score_text(judge.score(comparison))}{hidden}"
        if searched.last.reached:
            self.report({"INFO"}, told)
        else:
            self.report({"WARNING"}, f"{told}. It misses {searched.last.target:g} for smaller textures: they stay")
        return {"FINISHED"}


def _free(base: str, suffix: str) -> str:
    """The suffix, numbered where there is an object of such a name."""
    free, number = suffix, 0
    while base + free in bpy.data.objects:
        number += 1
        free = f"{suffix}.{number:03d}"
    return free


def _write_path(decimate: FMQMDecimate, name: str, searched: TargetResult, judge: Judge) -> None:
    """Its versions, from the most triangles and largest textures down; "about" where few patches were looked at."""
    steps = [step for found in (searched.geometry, searched.texture) if found is not None for step in found.path]
    steps.sort(key=lambda step: (-step.triangles, -(step.version.texture or _LARGEST), step.quick))
    lines = list(dict.fromkeys(_step_text(step, judge) for step in steps))
    decimate.path, decimate.path_of = "\n".join(lines), name
    reached = [found for found in (searched.geometry, searched.texture) if found is not None and found.reached]
    decimate.found = lines.index(_step_text(reached[-1].best, judge)) if reached else -1


def _step_text(step: Step, judge: Judge) -> str:
    score = step.score(judge)
    reached = "nothing left" if score is None else score_text(score)
    side = f", textures of {step.version.texture}" if step.version.texture else ""
    return f"{step.triangles:,} triangles{side}: {'about ' if step.quick else ''}{reached}"


CLASSES = (FMQM_OT_decimate,)
