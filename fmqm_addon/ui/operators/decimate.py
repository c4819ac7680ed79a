# SPDX-License-Identifier: GPL-3.0-or-later
"""Decimate to Quality: a copy of the active object with as few triangles as a target allows."""

from __future__ import annotations

from typing import ClassVar

import bpy

from ...blender.scene.decimate import decimated_copy, scene_reader
from ...blender.scene.fingerprint import fingerprint
from ...blender.scene.node_queries import surface_query
from ...blender.scene.target import target_of
from ...comparison.decimation import DecimationGoal, DecimationResult, SearchResult, Step, VersionReader, decimating
from ...comparison.judge import Judge
from ...metric.errors import FMQMError
from ...metric.settings import Settings
from ...metric.stepper import Stepper, Work
from ...report.numbers import score_text
from .. import session
from ..modal import SteppedOperator
from ..properties.decimate import FMQMDecimate
from ..properties.settings import metric_settings
from .polls import allowed


class FMQM_OT_decimate(SteppedOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.decimate"
    bl_label = "Decimate to Quality"
    bl_description = (
        "Copy the active object with a live Decimate modifier, as strong as the target allows. The original stays as "
        "it is and is hidden behind it. Esc cancels"
    )
    bl_options: ClassVar = {"UNDO"}  # no REGISTER: adjusting the last operation would search all over again

    noun = "Decimation"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, _why_not(context))

    def begin(self, context: bpy.types.Context) -> bool:
        fmqm, self._name = context.scene.fmqm, context.active_object.name_full
        goal = DecimationGoal(
            (round(fmqm.decimate.target, 4),),  # a property is float32: 0.9 must not become 0.90000004
            fmqm.decimate.max_triangles if fmqm.decimate.limited else None,
            judge=Judge[fmqm.judge],
        )
        self._judge = goal.judge
        try:
            settings = metric_settings(fmqm.settings)
        except FMQMError as error:
            self.report({"ERROR"}, str(error))
            return False
        context.view_layer.update()  # or a transform that is still to be applied would pass for a change
        self._scene, self._mark = context.scene.name_full, fingerprint(target_of(context.active_object), False)
        self.stepper = Stepper(_attempt(scene_reader([self._name], self._name), goal, settings))
        return True

    def finish(self, context: bpy.types.Context) -> set[str]:
        """The copy and the path it took, in one undo step."""
        result = self.stepper.result
        if isinstance(result, FMQMError):
            self.report({"WARNING"}, str(result))
            return {"CANCELLED"}
        found = result.results[0].last
        original = next((object_ for object_ in bpy.data.objects if object_.name_full == self._name), None)
        scene = next((scene for scene in bpy.data.scenes if scene.name_full == self._scene), None)
        if original is None or scene is None:
            gone = self._name if original is None else "The scene"
            self.report({"WARNING"}, f"{gone} is gone, and what was found with it")
            return {"CANCELLED"}
        if fingerprint(target_of(original), False) != self._mark:
            self.report({"WARNING"}, f"{self._name} was changed meanwhile; search again")
            return {"CANCELLED"}
        best, judge = found.best, self._judge
        score = best.score(judge)
        _write_path(scene.fmqm.decimate, original.name, found, judge)
        if not found.reached:
            self.report(
                {"WARNING"},
                f"{self._name} misses {found.target:.2f} even with {best.triangles:,} triangles"
                + ("" if score is None else f" ({judge.column} {score_text(score)})"),
            )
            return {"CANCELLED"}
        copy = decimated_copy(original, best.version.ratio, f"{original.name} {judge.column} {found.target:.2f}")
        context.view_layer.update()
        hidden = ""
        if copy.name in context.view_layer.objects:  # not in another scene, or where its collection is excluded
            for object_ in context.selected_objects:
                object_.select_set(False)
            context.view_layer.objects.active = copy
            copy.select_set(True)
            original.hide_set(True)  # the two would flicker, each as near to the viewer as the other
            hidden = f"; {original.name} is hidden, Alt H shows it"
        self.report(
            {"INFO"},
            f"{copy.name}: {best.triangles:,} of {result.triangles:,} triangles, "
            f"{judge.column} {score_text(score)}{hidden}",
        )
        return {"FINISHED"}


def _why_not(context: bpy.types.Context) -> str:
    """Why there is nothing to decimate, for the greyed-out button; "" if there is."""
    active = context.active_object
    if session.job is not None:
        return "A measurement is running"
    if active is None or active.type != "MESH":
        return "Make a mesh object the active one"
    return "" if active.mode == "OBJECT" else "Leave the object's edit or paint mode"


def _attempt(read: VersionReader, goal: DecimationGoal, settings: Settings) -> Work[DecimationResult | FMQMError]:
    """The search, or why it could not be done."""
    try:
        return (yield from decimating(read, surface_query, goal, settings).steps())
    except FMQMError as error:
        return error


def _write_path(decimate: FMQMDecimate, name: str, found: SearchResult, judge: Judge) -> None:
    """Its versions, from the most triangles down; "about" where few patches were looked at."""
    steps = sorted(found.path, key=lambda step: (-step.triangles, step.quick))
    lines = list(dict.fromkeys(_step_text(step, judge) for step in steps))
    decimate.path, decimate.path_of = "\n".join(lines), name
    decimate.found = lines.index(_step_text(found.best, judge)) if found.reached else -1


def _step_text(step: Step, judge: Judge) -> str:
    score = step.score(judge)
    reached = "nothing left" if score is None else score_text(score)
    return f"{step.triangles:,} triangles: {'about ' if step.quick else ''}{reached}"


CLASSES = (FMQM_OT_decimate,)
