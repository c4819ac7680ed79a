# SPDX-License-Identifier: GPL-3.0-or-later
"""The measuring button: works between redraws of the window and can be cancelled."""

from __future__ import annotations

import json
import uuid
from typing import ClassVar

import bpy
import numpy as np

from ...blender.materials.types import Reading
from ...blender.scene.lods import are_kin
from ...blender.scene.measure import Outcome, measuring
from ...blender.scene.target import Target, target_of
from ...comparison.pair import PairOptions
from ...metric.errors import FMQMError
from ...metric.geometry import Floats
from ...report.trust_table import trust_dict
from .. import session, stale, stored_text
from ..modal import SteppedOperator, scene_of
from ..properties.items import item_target
from ..properties.rows import row_targets
from ..properties.scene import FMQMScene
from ..properties.settings import pair_options, patterns_of
from ..view.shown import forget_removed, show_heat_map
from .inputs import reference_of
from .polls import allowed


def why_not(fmqm: FMQMScene) -> str:
    """Why there is nothing to measure yet, for the greyed-out button; "" if there is. Cheap: it runs at each redraw."""
    reference = reference_of(fmqm)
    if reference is None:
        gone = fmqm.reference_kind == "OBJECT" and fmqm.reference is not None
        return f"{fmqm.reference.name} is gone; choose another original" if gone else "Choose the original"
    compared = [target for item in fmqm.compared if (target := item_target(item)) is not None]
    if not compared:
        return "Add an LOD to compare with the original"
    if reference in compared and not fmqm.bare_reference:
        return f"{reference.name} is the original and in the list too; remove it there, or use Own Modifiers"
    part = next((target for target in compared if are_kin(target, reference)), None)
    if part is not None:
        return f"{part.name} is measured with {reference.name}, as one hangs from the other; remove it from the list"
    if fmqm.bare_reference and (fmqm.reference_kind != "OBJECT" or reference.type != "MESH"):
        return "Without Modifiers needs a single mesh object as the original"
    return ""


class FMQM_OT_measure(SteppedOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.measure"
    bl_label = "Measure Quality"
    bl_description = "Score the listed LODs against the original. Esc cancels"
    bl_options: ClassVar = {"UNDO"}  # no REGISTER: adjusting the last operation would measure all over again

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, "A measurement is running" if session.job is not None else why_not(context.scene.fmqm))

    def begin(self, context: bpy.types.Context) -> bool:
        fmqm = context.scene.fmqm
        try:
            options, reading, self._settings_text = asked_of(fmqm)
        except FMQMError as error:
            self.report({"ERROR"}, str(error))
            return False
        compared = [target_of(target) for item in fmqm.compared if (target := item_target(item)) is not None]
        self._scene = context.scene.name_full
        self.stepper = measuring(
            target_of(reference_of(fmqm), fmqm.bare_reference),
            list(dict.fromkeys(compared)),
            options,
            reading,
        )
        return True

    def finish(self, context: bpy.types.Context) -> set[str]:
        """All rows at once: one undo step."""
        scene = scene_of(self._scene)
        if scene is None:
            self.report({"WARNING"}, "The scene is gone, and the scores with it")
            return {"CANCELLED"}
        outcomes = self.stepper.result
        for outcome in outcomes:
            write_row(scene.fmqm, outcome, self._settings_text)
        show_rows(scene, outcomes[0])
        failed = [outcome for outcome in outcomes if outcome.error]
        total = sum(outcome.seconds.get("total", 0.0) for outcome in outcomes)
        if failed:
            # Not an ERROR: that would make the call raise although the other rows have their scores.
            self.report({"WARNING"}, f"{len(failed)} of {len(outcomes)} not measured: {failed[0].error}")
        else:
            self.report({"INFO"}, f"{len(outcomes)} measured in {total:.1f} s")
        stale.redraw()
        return {"FINISHED"}


class FMQM_OT_cancel(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.cancel"
    bl_label = "Cancel"
    bl_description = "Stop the measurement; earlier results stay"
    bl_options: ClassVar = {"INTERNAL"}  # no UNDO: it changes nothing in the file

    @classmethod
    def poll(cls, _: bpy.types.Context) -> bool:
        return session.job is not None

    def execute(self, _: bpy.types.Context) -> set[str]:
        if session.job is not None:
            session.job.cancelled = True
        return {"FINISHED"}


def asked_of(fmqm: FMQMScene) -> tuple[PairOptions, Reading, str]:
    """What the settings ask about pairs, how assets are read, and both as rows keep them.

    Raises:
        SettingsError: the values contradict one another.
    """
    settings = fmqm.settings
    options = pair_options(settings)
    patterns = {name: text for name in ("include", "exclude") if (text := getattr(settings, name).strip())}
    reading = Reading(include=patterns_of(settings.include), exclude=patterns_of(settings.exclude))
    return options, reading, json.dumps(options.as_dict() | patterns)


def write_row(fmqm: FMQMScene, outcome: Outcome, settings_text: str) -> None:
    """Replaces the row of the same two assets, or adds one. Scores of what has been deleted meanwhile stay."""
    key = (outcome.reference_target, outcome.target)
    row = next((row for row in fmqm.rows if row_targets(row) == key), None)
    if row is not None and row.scores and outcome.error and any(target.is_gone() for target in key):
        return
    row = row or fmqm.rows.add()
    row.former = row.scores if row.settings == settings_text else ""
    row.uid = uuid.uuid4().hex
    row.name, row.kind = outcome.target.name, outcome.target.kind
    row.reference_name, row.reference_kind = outcome.reference_target.name, outcome.reference_target.kind
    row.bare_reference = outcome.reference_target.bare
    row.error = outcome.error or ""
    row.settings = settings_text
    row.warnings, row.notes = "\n".join(outcome.warnings), "\n".join(outcome.notes)
    row.fingerprint = " ".join(outcome.fingerprint)
    row.seconds = outcome.seconds.get("total", 0.0)
    row.stages = json.dumps(outcome.seconds)
    row.triangles = outcome.triangles
    row.share = 100 * outcome.triangles / outcome.reference_triangles if outcome.reference_triangles else 0.0
    row.attribution = "" if outcome.attribution is None else json.dumps(outcome.attribution.as_dict(), allow_nan=False)
    row.screen_size = ""
    row.trust = "" if outcome.trust is None else json.dumps(trust_dict(outcome.trust), allow_nan=False)
    parts = [] if outcome.trust is None else [part.as_dict() for part in outcome.trust.parts]
    row.parts = json.dumps(parts, allow_nan=False) if parts else ""
    result, comparison = outcome.pair_result, outcome.comparison
    row.space = "" if result is None else result.alignment.label
    row.reverse = "" if result is None or result.reverse is None else stored_text.readings_text(result.reverse)
    row.scores = "" if comparison is None else stored_text.readings_text(comparison)
    row.patches = 0 if comparison is None else len(comparison.result.patches)
    row.samples = 0 if comparison is None else len(comparison.result.samples.positions)
    if result is not None:
        session.put(
            row.uid,
            session.Measured(
                reference=result.reference,
                comparison=result.comparison,
                reference_to_world=np.eye(4),  # it is measured where it stands
                distorted_to_world=result.alignment.to_world,
                reference_stood=_stand(outcome.reference_target),
                distorted_stood=_stand(outcome.target),
            ),
        )


def _stand(target: Target) -> Floats | None:
    """(4, 4) the world matrix of a single object."""
    members = target.members()
    return np.array(members[0].matrix_world, np.float64) if len(members) == 1 else None


def show_rows(scene: bpy.types.Scene, outcome: Outcome) -> None:
    """After rows were written: chooses that of an outcome, and shows its heat map where that is wanted."""
    key = (outcome.reference_target, outcome.target)
    scene.fmqm.row_index = next((index for index, row in enumerate(scene.fmqm.rows) if row_targets(row) == key), 0)
    forget_removed()  # of rows that these replace
    show_heat_map(scene)


def _draw_in_object_menu(self: bpy.types.Menu, _: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator_context = "INVOKE_DEFAULT"
    self.layout.operator(FMQM_OT_measure.bl_idname, text="Measure Quality (FMQM)")


CLASSES = (FMQM_OT_measure, FMQM_OT_cancel)


def register() -> None:
    bpy.types.VIEW3D_MT_object.append(_draw_in_object_menu)


def unregister() -> None:
    bpy.types.VIEW3D_MT_object.remove(_draw_in_object_menu)
