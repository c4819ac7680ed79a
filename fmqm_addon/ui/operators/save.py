# SPDX-License-Identifier: GPL-3.0-or-later
"""Saving the results as JSON, CSV or NPZ."""

from __future__ import annotations

import os
from typing import ClassVar

import bpy
from bpy.props import BoolProperty, EnumProperty, StringProperty

from ...metric.errors import FMQMError
from ...provenance import provenance
from ...report.atomic_files import write_text
from ...report.npz import save_fields
from ...report.records import csv_text, json_text
from .. import session, stored_text
from ..properties.rows import active_row, is_whole, pair_of
from .polls import OfRows
from .results import broken_text


class FMQM_OT_save_results(OfRows, bpy.types.Operator):  # noqa: N801
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
    check_existing: BoolProperty(
        name="Check Existing", description="Warn before a file is overwritten", default=True, options={"HIDDEN"}
    )

    @classmethod
    def description(cls, _: bpy.types.Context, properties: bpy.types.OperatorProperties) -> str:
        return str(properties.bl_rna.properties["file_format"].enum_items[properties.file_format].description)

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
        tail = "" if self.file_format == "npz" else tail + broken_text(len(alike) - len(rows))
        self.report({"INFO"}, f"Saved {os.path.basename(path)}{tail}")
        return {"FINISHED"}

    def _with_suffix(self) -> str:
        suffix = f".{self.file_format}"
        return self.filepath if self.filepath.lower().endswith(suffix) else self.filepath + suffix


CLASSES = (FMQM_OT_save_results,)
