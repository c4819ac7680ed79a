# SPDX-License-Identifier: GPL-3.0-or-later
"""All that is shown together: it follows the chosen row, and goes."""

from __future__ import annotations

import bpy
from mathutils import Matrix

from ...blender.display import scene_objects, viewport
from ...comparison.judge import Judge
from .. import session
from ..properties.rows import active_row
from . import overlay, worst
from .cloud import build_cloud, show_all_patches
from .painted import build_painted, keep_fields
from .result import UID, look_of, measured_of, measured_row, world_matrix
from .shells import build_shells
from .slice_plane import draw_slice
from .units import follow_unit


def follow_row(scene: bpy.types.Scene) -> None:
    """What is shown becomes that of the row just chosen or measured; hidden things stay hidden.

    Raises:
        FMQMError: the row has nothing to show. The list of worst places is empty then, the rest stays.
    """
    look, row = look_of(scene), active_row(scene)
    if row is None or row.uid != look.worst_uid:
        worst.forget_worst(look)
    uid, _, measured = measured_row(scene)
    builders = {
        scene_objects.CLOUD: build_cloud,
        scene_objects.PAINTED: build_painted,
        scene_objects.SHELLS: build_shells,
        scene_objects.SLICE: draw_slice,
    }
    for kind, build in builders.items():
        shown = scene_objects.find_object(scene, kind)
        if shown is not None and shown.get(UID) != uid:
            build(scene)
    worst.fill_worst(look, measured.comparison.result, uid)
    follow_unit(scene)


def follow_judge(scene: bpy.types.Scene) -> None:
    """The worst places become those of the judge just chosen, and its scores are shown where another's were.

    Raises:
        FMQMError: as follow_row.
    """
    look = look_of(scene)
    worst.forget_worst(look)
    if look.layer in [judge.column for judge in Judge]:
        look.layer = Judge[scene.fmqm.judge].column
    follow_row(scene)
    if look.focused:
        show_all_patches(scene)


def move_shown(scene: bpy.types.Scene) -> None:
    """Moves what is shown to the place that the look says."""
    for kind in (scene_objects.CLOUD, scene_objects.PAINTED, scene_objects.SHELLS):
        shown = scene_objects.find_object(scene, kind)
        measured = measured_of(shown)
        if shown is not None and measured is not None:
            shown.matrix_world = Matrix(world_matrix(measured, look_of(scene).place).tolist())
    follow_unit(scene)


def clear() -> int:
    """Removes all of it from the file and gives the views their settings back; how many data-blocks there were."""
    overlay.figure = None
    keep_fields(set())
    for scene in bpy.data.scenes:
        look_of(scene).focused = False
    count = scene_objects.clear()
    viewport.restore_colors()
    viewport.redraw()
    return count


def forget_removed() -> None:
    """Lets go of the arrays of rows that no scene has any more; undo brings such a row back without them. Cheap."""
    uids = {row.uid for scene in bpy.data.scenes for row in scene.fmqm.rows}
    session.keep(uids)
    keep_fields(uids)
    if overlay.figure is not None and overlay.figure.uid not in uids:
        overlay.figure = None


def settle_colors() -> None:
    """After undo and redo, which leave the views' settings as they are: these follow what is shown now."""
    if not scene_objects.anything_colored():
        viewport.restore_colors()
    elif not viewport.colors_changed():  # else they are what they were, but for what the user has chosen since
        viewport.show_colors()


def anything() -> bool:
    return overlay.figure is not None or scene_objects.anything() or viewport.colors_changed()
