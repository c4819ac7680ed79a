# SPDX-License-Identifier: GPL-3.0-or-later
"""All that is shown together: it follows the chosen row, and goes."""

from __future__ import annotations

import bpy

from ...blender.display import scene_objects, viewport
from ...comparison.judge import Judge
from .. import session
from ..properties.rows import active_row
from . import flip, heat, loupe, overlay, shells, slice_plane, worst
from .result import look_of, measured_row
from .units import follow_unit


def follow_row(scene: bpy.types.Scene) -> None:
    """What is shown becomes that of the row just chosen or measured; hidden things stay hidden.

    Raises:
        FMQMError: the row has nothing to show. The list of worst places is empty then.
    """
    look, row = look_of(scene), active_row(scene)
    if row is None or row.uid != look.worst_uid:
        worst.forget_worst(look)
        look.focused = False
    heat.refresh(scene)
    uid, _, measured = measured_row(scene)
    for kind in (slice_plane, shells):
        kind.refresh(scene)
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
    look.focused = False
    follow_row(scene)


def follow_place(scene: bpy.types.Scene) -> None:
    """Moves what is shown to the place that the look says."""
    heat.refresh(scene)
    follow_unit(scene)


def show_heat_map(scene: bpy.types.Scene) -> None:
    """After measuring: the heat map of the chosen row, unless the user wants none or sees something already."""
    look = look_of(scene)
    if look.show_after and look.show == heat.OFF:
        look.show = heat.SURFACE
    heat.refresh(scene)


def clear() -> int:
    """Takes all of it away, and the views back to where they were; how many data-blocks there were."""
    put_away()
    overlay.figure = None
    for scene in bpy.data.scenes:
        look = look_of(scene)
        look.focused, look.show = False, heat.OFF
        look.show_slice = look.show_shells = False
    for build_all in (heat.build_all, slice_plane.refresh_all, shells.refresh_all):
        build_all()
    viewport.unframe()
    count = scene_objects.clear()
    viewport.redraw()
    return count


def put_away() -> None:
    """Ends the tools that draw over a view."""
    loupe.close()
    flip.close()


def forget_removed() -> None:
    """Lets go of the arrays of rows that no scene has any more; undo brings such a row back without them. Cheap."""
    uids = {row.uid for scene in bpy.data.scenes for row in scene.fmqm.rows}
    session.keep(uids)
    for kind in (heat, slice_plane, shells):
        kind.keep(uids)
    if overlay.figure is not None and overlay.figure.uid not in uids:
        overlay.figure = None


def anything() -> bool:
    looks = map(look_of, bpy.data.scenes)
    drawn = any(look.show != heat.OFF or look.show_slice or look.show_shells for look in looks)
    return drawn or overlay.figure is not None or scene_objects.anything()
