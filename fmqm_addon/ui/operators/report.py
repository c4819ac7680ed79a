# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of the results as a web page: where it is to be, writing it, opening it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import ClassVar

import bpy
from bpy.props import BoolProperty, StringProperty

from ...blender.display.picture_bytes import png_bytes
from ...comparison.judge import Judge
from ...metric.errors import FMQMError
from ...metric.stepper import Stepper, Work
from ...provenance import provenance
from ...report.html.scored import ScoredPair, writing_report
from ...report.picture_files import EncodedPicture, has_pillow
from ...report.render import Pixels
from .. import session, stored_text
from ..modal import SteppedOperator
from ..properties.rows import FMQMRow, active_row, is_whole, pair_of
from .polls import allowed, no_rows

_FOLDER = "fmqm_report"


class FMQM_OT_report(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.report"
    bl_label = "Report"
    bl_description = "Write a web page of the results with pictures of every LOD, and open it"
    bl_options: ClassVar = {"INTERNAL"}  # writes files, changes nothing in the scene

    filepath: StringProperty(name="Folder", description="Folder of the page; it is made", subtype="FILE_PATH")

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, "A measurement is running" if session.job is not None else no_rows(context))

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        self.filepath = default_folder()
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, _: bpy.types.Context) -> set[str]:
        # Another operator: one that was in the file browser cannot go on under a timer.
        result: set[str] = bpy.ops.fmqm.write_report("INVOKE_DEFAULT", folder=self.filepath, open_page=True)
        return {"CANCELLED"} if result == {"CANCELLED"} else {"FINISHED"}


class FMQM_OT_write_report(SteppedOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.write_report"
    bl_label = "Write Report"
    bl_description = "Write a web page of the results with pictures of every LOD. Esc cancels"
    bl_options: ClassVar = {"INTERNAL"}

    folder: StringProperty(name="Folder", description="Folder of the page; it is made", subtype="DIR_PATH")
    open_page: BoolProperty(name="Open Page", description="Show it in the web browser", default=False)

    noun = "Report"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, "A measurement is running" if session.job is not None else no_rows(context))

    def begin(self, context: bpy.types.Context) -> bool:
        fmqm = context.scene.fmqm
        chosen = active_row(context.scene) or fmqm.rows[0]
        # One page tells of one set of settings: scores at others do not compare.
        rows = [row for row in fmqm.rows if row.settings == chosen.settings and is_whole(row)]
        self._left_out = len(fmqm.rows) - len(rows)
        if not rows:
            self.report({"ERROR"}, f"{chosen.name}: this result cannot be read; measure again")
            return False
        folder = os.path.normpath(bpy.path.abspath(self.folder or default_folder()))
        settings = stored_text.read_settings(chosen.settings) or {}
        encoder = None if has_pillow() else _encode
        writing = writing_report(
            folder,
            [_scored(row) for row in rows],
            Judge[fmqm.judge],
            settings,
            provenance(bpy.app.version_string),
            encoder,
        )
        self.stepper = Stepper(_attempt(writing))
        return True

    def finish(self, _: bpy.types.Context) -> set[str]:
        page = self.stepper.result
        if isinstance(page, FMQMError):
            self.report({"ERROR"}, str(page))
            return {"CANCELLED"}
        if self.open_page and not bpy.app.background:
            bpy.ops.wm.url_open(url=Path(page).as_uri())
        tail = f"; {self._left_out} measured with other settings left out" if self._left_out else ""
        if Path(page).is_relative_to(bpy.app.tempdir):
            tail += ". That folder goes when Blender ends"
        self.report({"INFO"}, f"Written: {page}{tail}")
        return {"FINISHED"}


def default_folder() -> str:
    """Beside the .blend, or in the session's temporary folder while there is none."""
    if not bpy.data.filepath:
        return os.path.join(bpy.app.tempdir, _FOLDER)
    blend = Path(bpy.data.filepath)
    return str(blend.with_name(f"{blend.stem}_{_FOLDER}"))


def _scored(row: FMQMRow) -> ScoredPair:
    measured = session.get(row.uid)
    if measured is None:
        return ScoredPair(pair_of(row))
    return ScoredPair(pair_of(row), measured.reference, measured.comparison)


def _encode(pixels: Pixels) -> EncodedPicture:
    return EncodedPicture(png_bytes(pixels), "png")


def _attempt(writing: Work[str]) -> Work[str | FMQMError]:
    """The page's path, or why it could not be written."""
    try:
        return (yield from writing)
    except FMQMError as error:
        return error


CLASSES = (FMQM_OT_report, FMQM_OT_write_report)
