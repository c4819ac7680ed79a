# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons of the results: sort, remove, copy, save."""

from __future__ import annotations

import os
from typing import Any, ClassVar

import bpy
from bpy.props import EnumProperty, StringProperty

from ..metric.errors import FMQMError
from ..metric.evaluation import Scores
from ..metric.settings import PRESETS, SETTING_NAMES, Settings
from ..provenance import provenance
from ..report.atomic_files import write_text
from ..report.npz import save_fields
from ..report.record_check import record_fault
from ..report.records import SHOWN, PairScore, csv_text, json_text, pair_record, table_text
from . import session, stale, stored_text
from .properties import FMQMRow, active_row, row_attribution, row_reverse, row_scores, row_stderr, row_trust

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
assert set(EXPLAINED) == set(SHOWN)


def settings_name(row: FMQMRow) -> str:
    """The preset that a row was measured with, or Custom."""
    used = _settings_that_count(row)
    if used is None:
        return "?"
    for name, values in PRESETS.items():
        preset = Settings(**values).as_dict()
        if all(preset[each] == value for each, value in used.items()):
            return name.capitalize()
    return "Custom"


def comparable(row: FMQMRow, other: FMQMRow) -> bool:
    """Whether the scores of two rows may be compared: they were measured at equal settings."""
    return row.settings == other.settings or _settings_that_count(row) == _settings_that_count(other)


def _settings_that_count(row: FMQMRow) -> dict[str, Any] | None:
    used = stored_text.read_settings(row.settings)
    return None if used is None else {name: used[name] for name in SETTING_NAMES if name != "seed"}


def is_whole(row: FMQMRow) -> bool:
    """Whether all that a row holds can be read; whoever sent the file may have written something else there."""
    readers = (
        (row.scores, stored_text.read_columns),
        (row.stderr, stored_text.read_columns),
        (row.reverse, stored_text.read_columns),
        (row.attribution, stored_text.read_attribution),
        (row.trust, stored_text.read_trust),
        (row.settings, stored_text.read_settings),
        (row.stages, stored_text.read_stages),
    )
    readable = stored_text.read_settings(row.settings) and all(read(text) is not None for text, read in readers if text)
    return bool(readable) and not record_fault(pair_record(pair_of(row)))


def pair_of(row: FMQMRow) -> PairScore:
    """A row as the reports want it."""
    reference, target = stale.row_targets(row)
    attribution = row_attribution(row)
    return PairScore(
        reference=reference.label,
        distorted=target.label,
        scores=_scores(row_scores(row)),
        stderr=_scores(row_stderr(row)),
        patches=row.patches or None,
        samples=row.samples or None,
        seconds=stored_text.read_stages(row.stages) or {},
        warnings=tuple(row.warnings.splitlines()),
        error=row.error or None,
        space=row.space or None,
        reverse=_scores(row_reverse(row)),
        trust=row_trust(row),
        findings={} if attribution is None else {"attribution": attribution},
    )


def _scores(columns: dict[str, float] | None) -> Scores | None:
    return None if columns is None else Scores(**columns)


def _has_rows(cls: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    if not context.scene.fmqm.rows:
        cls.poll_message_set("Nothing has been measured yet")
        return False
    return True


def _broken_text(count: int) -> str:
    return f"; {count} left out, which cannot be read" if count else ""


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
        chosen = active_row(context.scene)
        chosen_uid = chosen.uid if chosen else ""
        values = {
            row.uid: scores[self.column]
            for row in fmqm.rows
            if (scores := row_scores(row)) is not None and is_whole(row)
        }
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
        if active_row(context.scene) is not None:
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
        rows = [row for row in context.scene.fmqm.rows if is_whole(row)]
        context.window_manager.clipboard = table_text([pair_of(row) for row in rows])
        number = len(rows)
        broken = _broken_text(len(context.scene.fmqm.rows) - number)
        self.report({"INFO"}, ("1 result copied" if number == 1 else f"{number} results copied") + broken)
        return {"FINISHED"}


class FMQM_OT_save_results(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.save_results"
    bl_label = "Save Results"
    bl_options: ClassVar = {"INTERNAL"}  # writes a file, changes nothing in the scene

    file_format: EnumProperty(
        name="Format",
        description="What is saved",
        items=[
            ("json", "JSON", "Scores in full precision, with settings, times, warnings and trust reports"),
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
        if not os.path.basename(self.filepath):
            self.report({"ERROR"}, "No file is named; say which one to write to")
            return {"CANCELLED"}
        fmqm = context.scene.fmqm
        row = active_row(context.scene) or fmqm.rows[0]
        path = bpy.path.abspath(self._with_suffix())
        # One file tells of one set of settings: scores at others do not compare.
        alike = [other for other in fmqm.rows if other.settings == row.settings]
        rows = [other for other in alike if is_whole(other)]
        try:
            if self.file_format == "npz":
                measured = session.get(row.uid)
                if measured is None:
                    raise FMQMError(f"{row.name}: the samples are not in memory any more; measure again")
                save_fields(path, measured.comparison.result)
            elif not rows:
                raise FMQMError(f"{row.name}: this result cannot be read; measure again")
            elif self.file_format == "csv":
                write_text(path, csv_text([pair_of(other) for other in rows]))
            else:
                settings = stored_text.read_settings(row.settings) or {}
                versions = provenance(bpy.app.version_string)
                write_text(path, json_text([pair_of(other) for other in rows], settings, versions))
        except FMQMError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        left_out = len(fmqm.rows) - len(alike)
        tail = f"; {left_out} measured with other settings left out" if left_out else ""
        tail = "" if self.file_format == "npz" else tail + _broken_text(len(alike) - len(rows))
        self.report({"INFO"}, f"Saved {os.path.basename(path)}{tail}")
        return {"FINISHED"}

    def _with_suffix(self) -> str:
        suffix = f".{self.file_format}"
        return self.filepath if self.filepath.lower().endswith(suffix) else self.filepath + suffix


CLASSES = (
    FMQM_OT_sort_rows,
    FMQM_OT_remove_row,
    FMQM_OT_clear_results,
    FMQM_OT_copy_results,
    FMQM_OT_save_results,
)
