# SPDX-License-Identifier: GPL-3.0-or-later
"""Notices that what was measured has changed since, and marks its rows.

Handlers only note that something has changed; some time after the last change a timer compares fingerprints.
There is nobody to see marks without a window, and a handler left in bpy 4.5 keeps Python from ending: none there.
"""

from __future__ import annotations

import functools

import bpy

from ..blender.scene.fingerprint import fingerprint, in_edit_mode
from ..blender.scene.node_queries import sweep
from ..comparison.alignment import location_counts
from . import handlers, session
from .properties.items import item_target, kept
from .properties.rows import row_targets
from .view.shown import forget_removed, put_away

WATCHED = tuple(
    getattr(bpy.types, name)
    for name in (
        *("Object", "Collection", "Mesh", "Key", "Curve", "MetaBall", "Armature", "Lattice"),
        *("Material", "NodeTree", "Texture", "Image"),
    )
)
_DELAY = 0.7  # seconds without a change before the rows are looked at


def check(scene: bpy.types.Scene) -> None:
    """Brings session.stale up to date for the rows of a scene, but for those of which something is being edited."""
    mark = functools.cache(fingerprint)  # the reference is mostly the same
    for row in scene.fmqm.rows:
        reference, target = row_targets(row)
        if row.error or in_edit_mode(reference) or in_edit_mode(target):
            continue
        was = row.fingerprint.partition(" ")[::2]
        now = [mark(asset, location_counts(row.space)) for asset in (reference, target)]
        parts = []
        for asset, before, after in ((reference, was[0], now[0]), (target, was[1], now[1])):
            if not after:
                parts.append(f"{asset.name} is gone")
            elif before != after:
                parts.append(f"{asset.name} has changed")
        if parts:
            text = " and ".join(dict.fromkeys(parts))
            session.stale[row.uid] = text if "" in now else f"{text} since; measure again"
        else:
            session.stale.pop(row.uid, None)


def forget_deleted(scene: bpy.types.Scene) -> None:
    """Lets go of compared objects that were deleted: as long as a property points at them they would be saved."""
    for item in scene.fmqm.compared:
        if item.object is not None and item_target(item) is None:
            item.name, item.object = item.object.name, None
    if scene.fmqm.reference is not None and kept(scene.fmqm.reference) is None:
        scene.fmqm.reference = None


def redraw() -> None:
    """The sidebars of all windows, and only these: the scene beside them may take long to draw."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            for region in area.regions if area.type == "VIEW_3D" else ():
                if region.type == "UI":
                    region.tag_redraw()


def _check_all() -> None:
    if session.job is not None:
        return  # the end of the job asks again
    for scene in bpy.data.scenes:
        check(scene)
    redraw()


def soon() -> None:
    """Asks for a check a little later; a change in between puts it off."""
    if bpy.app.background:
        return
    if bpy.app.timers.is_registered(_check_all):
        bpy.app.timers.unregister(_check_all)
    bpy.app.timers.register(_check_all, first_interval=_DELAY)


@handlers.kept
def _on_change(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    forget_removed()
    if not scene.fmqm.rows:
        return
    for update in depsgraph.updates:
        if isinstance(update.id, WATCHED):
            soon()
            return


@handlers.kept
def _on_undo(*_: object) -> None:
    sweep()  # the step may be one of during a measurement
    forget_removed()
    soon()


@handlers.kept
def _before_load(*_: object) -> None:
    _stop_job()
    put_away()


@handlers.kept
def _after_load(*_: object) -> None:
    sweep()  # what was saved on its own during a measurement
    session.clear()
    soon()


@handlers.kept
def _before_save(*_: object) -> None:
    for scene in bpy.data.scenes:
        forget_deleted(scene)


def _stop_job() -> None:
    if session.job is not None:
        session.job.stop()


_HANDLERS = (
    ("depsgraph_update_post", _on_change),
    ("undo_post", _on_undo),
    ("redo_post", _on_undo),
    ("load_pre", _before_load),
    ("load_post", _after_load),
    ("save_pre", _before_save),
)


def register() -> None:
    if not bpy.app.background:
        handlers.add(_HANDLERS)


def unregister() -> None:
    handlers.remove(_HANDLERS)
    _stop_job()  # which asks for a check
    if bpy.app.timers.is_registered(_check_all):
        bpy.app.timers.unregister(_check_all)
    session.clear()
