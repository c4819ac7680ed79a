# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of the inputs, the measurement and the results."""

from __future__ import annotations

import json
import os
import time
import uuid
from collections.abc import Sequence
from typing import ClassVar

import bpy
import numpy as np
from bl_operators.presets import AddPresetBase
from bpy.props import EnumProperty, StringProperty

from .. import VERSION
from ..blender.job import Outcome, measuring
from ..blender.lods import find_lods
from ..blender.snapshot import OBJECT, Target, target_of
from ..metric.errors import FMQMError
from ..metric.score import COLUMNS, Stepper
from ..report.fields import save_fields
from ..report.files import write_text
from ..report.pair import SHOWN, PairScore, csv_text, json_text, table_text
from . import session, watch
from .properties import (
    PRESET_PROPERTIES,
    FMQMRow,
    is_asset,
    item_target,
    metric_settings,
    numbers_text,
    row_scores,
    row_stderr,
)
from .scene import FMQMScene

SLICE = 0.035  # seconds of work per tick of the timer: the window stays smooth
SHOWN_EVERY = 0.2  # seconds between redraws of the progress
TICK = 0.005  # seconds between ticks, for Blender to draw and listen

# What an artist should know of each number: label, and what a low value looks like.
EXPLAINED = {
    "FMQM": ("FMQM", "The whole score, 0 to 1: mean over all patches. 1 is the same as the reference"),
    "geoSSIM": (
        "Shape",
        "geoSSIM: distances to the surface. Low where the surface has moved, shrunk or lost its bumps",
    ),
    "geoGraSSIM": (
        "Direction",
        "geoGraSSIM: directions to the surface. Low where it is bent or faceted, so that its normals point elsewhere",
    ),
    "colorSSIM": (
        "Color",
        "colorSSIM: colors around a point. Low where the texture is blurred, shifted, tinted or compressed",
    ),
    "colorGraSSIM": (
        "Color Edges",
        "colorGraSSIM: the steepest color changes. Low where edges in the texture have moved, softened or broken up",
    ),
}


# ---------------------------------------------------------------------------------------------- inputs


def _selected_assets(context: bpy.types.Context) -> list[bpy.types.Object]:
    return sorted((o for o in context.selected_objects if is_asset(o)), key=lambda o: o.name_full)


def _set_compared(fmqm: FMQMScene, assets: Sequence[bpy.types.Object | bpy.types.Collection]) -> None:
    fmqm.compared.clear()
    for asset in assets:
        _add_compared(fmqm, asset)
    fmqm.compared_index = 0


def _add_compared(fmqm: FMQMScene, asset: bpy.types.Object | bpy.types.Collection) -> None:
    item = fmqm.compared.add()
    item.name = asset.name
    if isinstance(asset, bpy.types.Collection):
        item.collection = asset
    else:
        item.object = asset


def _set_reference(fmqm: FMQMScene, asset: bpy.types.Object | bpy.types.Collection) -> None:
    fmqm.bare_reference = False
    if isinstance(asset, bpy.types.Collection):
        fmqm.reference_kind, fmqm.reference_collection = "COLLECTION", asset
    else:
        fmqm.reference_kind, fmqm.reference = "OBJECT", asset


def reference_of(fmqm: FMQMScene) -> bpy.types.Object | bpy.types.Collection | None:
    """The asset that stands as the reference in the panel."""
    return fmqm.reference if fmqm.reference_kind == "OBJECT" else fmqm.reference_collection


class FMQM_OT_use_selection(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.use_selection"
    bl_label = "Use Selection"
    bl_description = "The active object becomes the reference, the other selected objects are compared with it"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        active = context.active_object
        if active is None or not is_asset(active):
            cls.poll_message_set("Make the original the active object: click it last")
            return False
        if not any(o != active and is_asset(o) for o in context.selected_objects):
            cls.poll_message_set("Select the objects to compare, and the original last")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm, active = context.scene.fmqm, context.active_object
        _set_reference(fmqm, active)
        _set_compared(fmqm, [o for o in _selected_assets(context) if o != active])
        return {"FINISHED"}


class FMQM_OT_find_lods(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.find_lods"
    bl_label = "Find LODs"
    bl_description = (
        "Find the levels of detail of the active object by their names (Rock_LOD0, LOD1_Rock, Rock.LOD2), "
        "an FBX LOD group or its collection. The finest is the reference"
    )
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        found = find_lods(context.scene, context.active_object)
        if found is None or len(found.levels) < 2:
            self.report(
                {"WARNING"},
                "No levels of detail found: make one of them active. Names such as Rock_LOD0 and Rock_LOD1 tell",
            )
            return {"CANCELLED"}
        fmqm = context.scene.fmqm
        _set_reference(fmqm, found.levels[0])
        _set_compared(fmqm, found.levels[1:])
        self.report({"INFO"}, f"{found.levels[0].name} and {len(found.levels) - 1} levels, by {found.how}")
        return {"FINISHED"}


class FMQM_OT_own_modifiers(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.own_modifiers"
    bl_label = "Own Modifiers"
    bl_description = "Compare the active object as its modifiers make it with its mesh without them"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        active = context.active_object
        if active is None or active.type != "MESH":
            cls.poll_message_set("Make a mesh object active")
            return False
        if not active.modifiers:
            cls.poll_message_set(f"{active.name} has no modifiers")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm, active = context.scene.fmqm, context.active_object
        _set_reference(fmqm, active)
        _set_compared(fmqm, [active])
        fmqm.bare_reference = True
        return {"FINISHED"}


class FMQM_OT_add_selected(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.add_selected"
    bl_label = "Add Selected"
    bl_description = "Add the selected objects to the list, but for the reference"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not any(is_asset(o) for o in context.selected_objects):
            cls.poll_message_set("Select a mesh, or an empty with meshes")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        there = {item.object for item in fmqm.compared} | {reference_of(fmqm)}
        for object_ in _selected_assets(context):
            if object_ not in there:
                _add_compared(fmqm, object_)
        fmqm.compared_index = max(0, len(fmqm.compared) - 1)
        return {"FINISHED"}


class FMQM_OT_add_collection(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.add_collection"
    bl_label = "Add Active Collection"
    bl_description = "Add the active collection to the list; its meshes count as one object"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.collection is None or context.collection == context.scene.collection:
            cls.poll_message_set("Choose a collection in the outliner")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        if context.collection not in {item.collection for item in fmqm.compared}:
            _add_compared(fmqm, context.collection)
        fmqm.compared_index = len(fmqm.compared) - 1
        return {"FINISHED"}


class FMQM_OT_remove_compared(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.remove_compared"
    bl_label = "Remove"
    bl_description = "Remove the chosen object from the list; the object itself stays"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return 0 <= context.scene.fmqm.compared_index < len(context.scene.fmqm.compared)

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        fmqm.compared.remove(fmqm.compared_index)
        fmqm.compared_index = max(0, min(fmqm.compared_index, len(fmqm.compared) - 1))
        return {"FINISHED"}


class FMQM_OT_clear_compared(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.clear_compared"
    bl_label = "Clear List"
    bl_description = "Empty the list; the objects themselves stay"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.fmqm.compared)

    def execute(self, context: bpy.types.Context) -> set[str]:
        _set_compared(context.scene.fmqm, [])
        return {"FINISHED"}


# ------------------------------------------------------------------------------------------- measuring


def why_not(fmqm: FMQMScene) -> str:
    """Why there is nothing to measure yet, for the greyed-out button; "" if there is. Cheap: it runs at each redraw."""
    reference = reference_of(fmqm)
    if reference is None:
        return "Choose a reference: the original mesh"
    compared = [target for item in fmqm.compared if (target := item_target(item)) is not None]
    if not compared:
        return "Add an object to compare with the reference"
    if reference in compared and not fmqm.bare_reference:
        return f"{reference.name} is the reference and in the list too; remove it there, or use Own Modifiers"
    if fmqm.bare_reference and (fmqm.reference_kind != "OBJECT" or reference.type != "MESH"):
        return "Without Modifiers needs a single mesh object as the reference"
    return ""


class FMQM_OT_measure(bpy.types.Operator):  # noqa: N801
    """In the window it works between redraws and can be cancelled; called from Python it runs at once."""

    bl_idname = "fmqm.measure"
    bl_label = "Measure Quality"
    bl_description = "Score the listed objects against the reference. Esc cancels"
    bl_options: ClassVar = {"UNDO"}  # no REGISTER: adjusting the last operation would measure all over again

    _stepper: Stepper[list[Outcome]]
    _job: session.Job
    _scene: str
    _shown: float = 0.0

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        reason = "A measurement is running" if session.job is not None else why_not(context.scene.fmqm)
        if reason:
            cls.poll_message_set(reason)
        return not reason

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self._prepare(context):
            return {"CANCELLED"}
        self._stepper.run()
        return self._finish(context)

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        if not self._prepare(context):
            return {"CANCELLED"}
        window_manager, stepper, workspace = context.window_manager, self._stepper, context.workspace
        timer = window_manager.event_timer_add(TICK, window=context.window)

        def stop() -> None:
            """Once; from wherever the end comes."""
            if session.job is not job:
                return
            session.job = None
            stepper.cancel()
            window_manager.event_timer_remove(timer)
            workspace.status_text_set(None)
            watch.redraw()
            watch.soon()

        self._job = job = session.job = session.Job(stop)
        session.longest_tick = 0.0
        window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = self._job
        if session.job is not job:  # another file, or the add-on was disabled
            return {"CANCELLED"}
        if job.cancelled or (event.type == "ESC" and event.value == "PRESS"):
            job.stop()
            self.report({"INFO"}, "Measurement cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            more = self._slice()
        except BaseException:
            job.stop()
            raise
        if more:
            self._show(context, job)
            return {"PASS_THROUGH"}
        job.stop()
        return self._finish(context)

    def cancel(self, _: bpy.types.Context) -> None:
        """Blender ends the operator: a window was closed, another file was opened."""
        self._job.stop()

    def _slice(self) -> bool:
        """Some milliseconds of work; whether there is more."""
        began = time.perf_counter()
        more = True
        while more and time.perf_counter() - began < SLICE:
            more = self._stepper.step()
        session.longest_tick = max(session.longest_tick, time.perf_counter() - began)
        return more

    def _show(self, context: bpy.types.Context, job: session.Job) -> None:
        """Progress in sidebar and status bar, some times a second."""
        progress = self._stepper.progress
        job.progress = progress.done
        now = time.perf_counter()
        if progress.stage == job.text and now - self._shown < SHOWN_EVERY:
            return
        self._shown, job.text = now, progress.stage
        context.workspace.status_text_set(f"FMQM: {job.text}, {100 * job.progress:.0f} %        Esc: Cancel")
        watch.redraw()

    def _prepare(self, context: bpy.types.Context) -> bool:
        fmqm = context.scene.fmqm
        try:
            settings = metric_settings(fmqm.settings)
        except FMQMError as error:
            self.report({"ERROR"}, str(error))
            return False
        asked = {
            "repeats": fmqm.settings.repeats,
            "space": fmqm.settings.space.lower(),
            "match_scale": fmqm.settings.match_scale,
        }
        compared = [target_of(target) for item in fmqm.compared if (target := item_target(item)) is not None]
        self._scene = context.scene.name_full
        self._settings_text = json.dumps({**settings.as_dict(), **asked})
        self._stepper = measuring(
            target_of(reference_of(fmqm), fmqm.bare_reference), list(dict.fromkeys(compared)), settings, **asked
        )
        return True

    def _finish(self, context: bpy.types.Context) -> set[str]:
        """All rows at once: one undo step."""
        scene = next((scene for scene in bpy.data.scenes if scene.name_full == self._scene), None)
        if scene is None:
            self.report({"WARNING"}, "The scene is gone, and the scores with it")
            return {"CANCELLED"}
        outcomes = self._stepper.result
        for outcome in outcomes:
            _write_row(scene.fmqm, outcome, self._settings_text)
        _choose_row(scene.fmqm, outcomes[0])
        failed = [outcome for outcome in outcomes if outcome.error]
        total = sum(outcome.seconds.get("total", 0.0) for outcome in outcomes)
        if failed:
            # Not an ERROR: that would make the call raise although the other rows have their scores.
            self.report({"WARNING"}, f"{len(failed)} of {len(outcomes)} not measured: {failed[0].error}")
        else:
            self.report({"INFO"}, f"{len(outcomes)} measured in {total:.1f} s")
        watch.redraw()
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


def _row_key(row: FMQMRow) -> tuple[Target, Target]:
    return watch.row_targets(row)


def _write_row(fmqm: FMQMScene, outcome: Outcome, settings_text: str) -> None:
    """Replaces the row of the same two assets, or adds one."""
    key = (outcome.reference_target, outcome.target)
    row = next((row for row in fmqm.rows if _row_key(row) == key), None) or fmqm.rows.add()
    session.drop(row.uid)
    row.uid = uuid.uuid4().hex
    row.name, row.kind = outcome.target.name, outcome.target.kind
    row.reference_name, row.reference_kind = outcome.reference_target.name, outcome.reference_target.kind
    row.bare_reference = outcome.reference_target.bare
    row.error = outcome.error or ""
    row.settings = settings_text
    row.warnings = "\n".join(outcome.warnings)
    row.fingerprint = " ".join(outcome.fingerprint)
    row.seconds = outcome.seconds.get("total", 0.0)
    row.stages = json.dumps(outcome.seconds)
    row.triangles = outcome.triangles
    row.share = 100 * outcome.triangles / outcome.reference_triangles if outcome.reference_triangles else 0.0
    comparison, placement = outcome.comparison, outcome.placement
    row.space = "" if placement is None else placement.label
    row.scores = "" if comparison is None else numbers_text(comparison.scores)
    row.stderr = "" if comparison is None or comparison.stderr is None else numbers_text(comparison.stderr)
    row.patches = 0 if comparison is None else len(comparison.result.patches)
    row.samples = 0 if comparison is None else len(comparison.result.samples.positions)
    if comparison is not None and placement is not None and outcome.reference is not None:
        session.put(
            row.uid,
            session.Measured(
                reference=outcome.reference,
                comparison=comparison,
                reference_to_world=np.eye(4),  # it is measured where it stands
                distorted_to_world=placement.to_world,
            ),
        )


def _choose_row(fmqm: FMQMScene, outcome: Outcome) -> None:
    key = (outcome.reference_target, outcome.target)
    fmqm.row_index = next((index for index, row in enumerate(fmqm.rows) if _row_key(row) == key), 0)


# --------------------------------------------------------------------------------------------- results


def active_row(fmqm: FMQMScene) -> FMQMRow | None:
    """The chosen row of the results."""
    return fmqm.rows[fmqm.row_index] if 0 <= fmqm.row_index < len(fmqm.rows) else None


def pair_of(row: FMQMRow) -> PairScore:
    """A row as the reports want it."""
    scores, stderr = row_scores(row), row_stderr(row)
    reference, target = watch.row_targets(row)
    return PairScore(
        reference=reference.label,
        distorted=target.label,
        scores=None if scores is None else np.array([scores[name] for name in COLUMNS]),
        stderr=None if stderr is None else np.array([stderr[name] for name in COLUMNS]),
        patches=row.patches or None,
        samples=row.samples or None,
        seconds=json.loads(row.stages or "{}"),
        warnings=tuple(row.warnings.splitlines()),
        error=row.error or None,
        space=row.space or None,
    )


def _has_rows(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    if not context.scene.fmqm.rows:
        cls.poll_message_set("Nothing has been measured yet")
        return False
    return True


class FMQM_OT_sort_rows(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.sort_rows"
    bl_label = "Sort by Score"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    column: EnumProperty(
        name="Column",
        description="Number to sort by",
        items=[(name, label, text) for name, (label, text) in EXPLAINED.items()],
    )

    @classmethod
    def description(cls, _: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return f"{EXPLAINED[properties.column][1]}.\nClick to sort the results by it, again for the other direction"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_rows(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        chosen = active_row(fmqm)
        chosen_uid = chosen.uid if chosen else ""
        values = {row.uid: scores[self.column] for row in fmqm.rows if (scores := row_scores(row)) is not None}
        now = list(values)
        order = sorted(now, key=values.__getitem__, reverse=True)
        if order == now:
            order.reverse()
        order += [row.uid for row in fmqm.rows if row.uid not in values]
        for place, uid in enumerate(order):
            fmqm.rows.move(next(i for i, row in enumerate(fmqm.rows) if row.uid == uid), place)
        fmqm.row_index = next((i for i, row in enumerate(fmqm.rows) if row.uid == chosen_uid), 0)
        return {"FINISHED"}


class FMQM_OT_remove_row(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.remove_row"
    bl_label = "Remove Result"
    bl_description = "Remove the chosen row from the results"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_rows(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        fmqm.rows.remove(fmqm.row_index)
        fmqm.row_index = max(0, min(fmqm.row_index, len(fmqm.rows) - 1))
        return {"FINISHED"}


class FMQM_OT_clear_results(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.clear_results"
    bl_label = "Clear Results"
    bl_description = "Remove all rows of the results"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_rows(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        # The fields stay in the session's memory: undo brings the rows back.
        context.scene.fmqm.rows.clear()
        context.scene.fmqm.row_index = 0
        return {"FINISHED"}


class FMQM_OT_copy_results(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.copy_results"
    bl_label = "Copy as Text"
    bl_description = "Copy the results to the clipboard as a table"
    bl_options: ClassVar = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_rows(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        context.window_manager.clipboard = table_text([pair_of(row) for row in context.scene.fmqm.rows])
        self.report({"INFO"}, f"{len(context.scene.fmqm.rows)} results copied")
        return {"FINISHED"}


class FMQM_OT_save_results(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.save_results"
    bl_label = "Save Results"
    bl_options: ClassVar = {"INTERNAL"}  # writes a file, changes nothing in the scene

    file_format: EnumProperty(
        name="Format",
        description="What is saved",
        items=[
            ("json", "JSON", "Scores in full precision, with settings, times and warnings"),
            ("csv", "CSV", "One row per result, for spreadsheets"),
            ("npz", "NPZ", "Samples, fields and patch scores of the chosen result, for numpy"),
        ],
    )
    filepath: StringProperty(name="File Path", description="File to write", subtype="FILE_PATH")
    filter_glob: StringProperty(name="Filter", description="Files that are shown", options={"HIDDEN"})
    check_existing: bpy.props.BoolProperty(
        name="Check Existing", description="Warn before a file is overwritten", default=True, options={"HIDDEN"}
    )

    @classmethod
    def description(cls, _: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return str(properties.bl_rna.properties["file_format"].enum_items[properties.file_format].description)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_rows(cls, context)

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        folder = os.path.dirname(bpy.data.filepath) or os.path.expanduser("~")
        self.filepath = os.path.join(folder, f"fmqm.{self.file_format}")
        self.filter_glob = f"*.{self.file_format}"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def check(self, _: bpy.types.Context) -> bool:
        wanted = self._with_suffix()
        changed = wanted != self.filepath
        self.filepath = wanted
        return changed

    def execute(self, context: bpy.types.Context) -> set[str]:
        fmqm = context.scene.fmqm
        row = active_row(fmqm) or fmqm.rows[0]
        path = bpy.path.abspath(self._with_suffix())
        # One file tells of one set of settings: scores at others do not compare.
        rows = [other for other in fmqm.rows if other.settings == row.settings]
        try:
            if self.file_format == "npz":
                measured = session.get(row.uid)
                if measured is None:
                    raise FMQMError(f"{row.name}: the samples are not in memory any more; measure again")
                save_fields(path, measured.comparison.result)
            elif self.file_format == "csv":
                write_text(path, csv_text([pair_of(other) for other in rows]))
            else:
                versions = {"fmqm_version": VERSION, "blender_version": bpy.app.version_string}
                write_text(path, json_text([pair_of(other) for other in rows], json.loads(row.settings), versions))
        except FMQMError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        left_out = len(fmqm.rows) - len(rows)
        tail = f"; {left_out} measured with other settings left out" if left_out and self.file_format != "npz" else ""
        self.report({"INFO"}, f"Saved {os.path.basename(path)}{tail}")
        return {"FINISHED"}

    def _with_suffix(self) -> str:
        suffix = f".{self.file_format}"
        return self.filepath if self.filepath.lower().endswith(suffix) else self.filepath + suffix


class FMQM_OT_preset_add(AddPresetBase, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.preset_add"
    bl_label = "Add Measuring Preset"
    bl_description = "Save these settings as a preset, or remove the chosen one"
    bl_options: ClassVar = {"INTERNAL"}
    preset_menu = "FMQM_PT_presets"
    preset_defines: ClassVar = ["settings = bpy.context.scene.fmqm.settings"]
    preset_values: ClassVar = [f"settings.{name}" for name in PRESET_PROPERTIES]
    preset_subdir = "fmqm"


def _draw_in_object_menu(self: bpy.types.Menu, _: bpy.types.Context) -> None:
    self.layout.separator()
    self.layout.operator_context = "INVOKE_DEFAULT"
    self.layout.operator(FMQM_OT_measure.bl_idname, text="Measure Quality (FMQM)")


CLASSES = (
    FMQM_OT_use_selection,
    FMQM_OT_find_lods,
    FMQM_OT_own_modifiers,
    FMQM_OT_add_selected,
    FMQM_OT_add_collection,
    FMQM_OT_remove_compared,
    FMQM_OT_clear_compared,
    FMQM_OT_measure,
    FMQM_OT_cancel,
    FMQM_OT_sort_rows,
    FMQM_OT_remove_row,
    FMQM_OT_clear_results,
    FMQM_OT_copy_results,
    FMQM_OT_save_results,
    FMQM_OT_preset_add,
)
assert set(EXPLAINED) == set(SHOWN) and OBJECT == "OBJECT"


def register() -> None:
    bpy.types.VIEW3D_MT_object.append(_draw_in_object_menu)


def unregister() -> None:
    bpy.types.VIEW3D_MT_object.remove(_draw_in_object_menu)
