# SPDX-License-Identifier: GPL-3.0-or-later
"""The loupe: Original, LOD and heat map of one place side by side, drawn over a 3D view.

Its pictures are made by a timer, in slices of some milliseconds: a coarse one at once, then finer ones, until the
place changes. It is no data of the file: opening, moving and closing it changes nothing there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy

from ...blender.display import viewport
from ...blender.display.inset import Inset
from ...metric.stepper import Progress, Stepper, Work, as_part
from .. import session
from ..properties.rows import active_row
from . import heat, panes, sight
from .ink import Ink, box, free_part
from .result import look_of, showable, why_not
from .tool import Tool, soon

_SIDE, _LEAST_SIDE = 400, 48  # pixels of a picture at a UI scale of 1, where there is room
_HEIGHT = 0.55  # of the view's, at most
_PAD, _LINE = 10, 18


@dataclass
class Loupe(Tool):
    """What is shown of which place.

    Attributes:
        follows: the mouse; else it stays. below: it stands at the lower edge of the view.
        key: the choices that its pictures were made for. sight: the place. pictures: of it, none or three.
        place: x, y, width and height of what is covered, in pixels of the region, once it was drawn.
    """

    follows: bool = False
    below: bool = False
    key: tuple[Any, ...] | None = None
    sight: sight.Sight | None = None
    pictures: list[Inset] = field(default_factory=list)
    caption: str = ""
    side: int = panes.SECOND
    place: tuple[float, float, float, float] | None = None


shown: Loupe | None = None


def open_in(area: bpy.types.Area, scene: bpy.types.Scene) -> Loupe:
    """Opens it in a view: at the chosen worst place where one is shown alone, else under the mouse."""
    global shown
    close()
    shown = Loupe(area.as_pointer(), scene.name, follows=heat.focused_patch(scene) is None)
    shown.open(_draw)
    refresh()
    return shown


def close() -> None:
    """Takes it away, if it is there."""
    global shown
    if shown is not None:
        shown.close(_tick, refresh)
    shown = None


def wanted(scene: bpy.types.Scene) -> tuple[Any, ...]:
    """The choices that decide what is seen, but for the place under the mouse. Cheap: it is asked at each drawing."""
    row, look = showable(scene), look_of(scene)
    uid = "" if row is None else row.uid
    colors = (sight.heat_layer(scene), look.range, look.low, look.high, len(scene.fmqm.rows))
    return (uid, heat.focused_patch(scene), *colors)


def watch() -> None:
    """Called at each drawing of a view: what has changed is followed by a timer, outside of the drawing."""
    if shown is not None and shown.is_here() and shown.key != wanted(bpy.context.scene):
        soon(refresh)


def refresh() -> None:
    """Follows the chosen row, the chosen worst place and the colors of the heat map."""
    scene = None if shown is None else bpy.data.scenes.get(shown.scene)
    if shown is None or scene is None:
        close()
        return
    before, shown.key = shown.key, wanted(scene)
    uid, patch = shown.key[:2]
    measured = session.get(uid)
    if measured is None:
        shown.stop()
        shown.pictures, shown.sight = [], None
        viewport.redraw()
        return
    if patch is not None and (before is None or before[:2] != (uid, patch)):
        shown.follows = False
        shown.sight = sight.worst_sight(scene, measured)
    elif before is not None and before[0] != uid and not _same_frame(before[0], measured):
        shown.pictures, shown.sight = [], None
        shown.follows = True
    _begin(scene)


def aim(scene: bpy.types.Scene, place: sight.Sight | None) -> None:
    """Looks at another place; None: nothing is there, and what is shown stays."""
    if shown is not None and place is not None:
        shown.sight = place
        _begin(scene)


def _same_frame(uid: str, measured: session.Measured) -> bool:
    """Whether a place of another row's is one of this one's: they have the same original."""
    before = session.get(uid)
    return before is not None and before.reference is measured.reference


def _begin(scene: bpy.types.Scene) -> None:
    """Makes the pictures anew, from coarse to fine."""
    row = active_row(scene)
    measured = None if row is None else session.get(row.uid)
    if shown is None or shown.sight is None or measured is None:
        return
    shown.stop()
    shown.side = _side_now() or shown.side
    shown.work = Stepper(_refining(shown, scene, measured, shown.sight))
    soon(_tick)


def _refining(loupe: Loupe, scene: bpy.types.Scene, measured: session.Measured, place: sight.Sight) -> Work[None]:
    colors, caption = sight.heat_colors(scene, measured), sight.heat_text(scene, measured, place.patch)
    yield Progress("", 0.0)
    sides = panes.sides(loupe.side)
    for number, side in enumerate(sides):
        drawing = panes.drawing(measured, place.camera, side, colors)
        found = yield from as_part(drawing, number / len(sides), 1 / len(sides))
        loupe.pictures, loupe.caption = [Inset(pixels) for pixels in found], caption
        viewport.redraw()


def _tick() -> float | None:
    return None if shown is None else shown.work_on()


# --- Drawing


def covers(at: tuple[float, float]) -> bool:
    """Whether it hides a place of the region."""
    if shown is None or shown.place is None:
        return False
    x, y, width, height = shown.place
    return x <= at[0] <= x + width and y <= at[1] <= y + height


def side_in(width: float, height: float, px: Callable[[float], float]) -> int:
    """Pixels a side of the pictures in a view that has so much room; 0: there is too little."""
    side = min((width - 6 * px(_PAD)) / 3, _HEIGHT * height - 2 * px(_LINE) - 3 * px(_PAD), px(_SIDE))
    return int(side) if side >= px(_LEAST_SIDE) else 0


def _side_now() -> int:
    """Pixels a side of the pictures in the view as it is; 0: it is not there, or too small."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if shown is not None and area.as_pointer() == shown.area:
                region = next(each for each in area.regions if each.type == "WINDOW")
                left, bottom, right, top = free_part(area, region)
                return side_in(right - left, top - bottom, Ink().px)
    return 0


def _draw() -> None:
    area, scene = bpy.context.area, bpy.context.scene
    if shown is None or not shown.is_here():
        return
    ink = Ink()
    left, bottom, right, top = free_part(area, bpy.context.region)
    px, pad, line = ink.px, ink.px(_PAD), ink.px(_LINE)
    side = side_in(right - left, top - bottom, px)
    reason = why_not(scene)
    if not side or reason or not shown.pictures or shown.sight is None:
        text = reason or ("Move the mouse over the Original or the LOD" if side else "The view is too small")
        width, height = ink.width(text) + 2 * pad, line + 2 * pad
    else:
        text, width, height = shown.sight.title, 3 * side + 4 * pad, side + 2 * line + 3 * pad
    x = left + max(round((right - left - width) / 2), 0)  # on whole pixels, as the pictures
    y = bottom + pad if shown.below else top - pad - height
    shown.place = (x, y, width, height)
    box(x, y, width, height, (*ink.back[:3], 1.0))  # Blender writes there, too
    ink.write(text, x + pad, y + height - pad - px(13))
    if not side or reason or not shown.pictures or shown.sight is None:
        return
    if side != shown.side:
        soon(refresh)  # which makes them as large
    for number, (picture, label) in enumerate(zip(shown.pictures, _labels(), strict=True)):
        at = x + pad + number * (side + pad)
        ink.write(label, at, y + side + pad + px(6), ink.faint)
        picture.draw(at, y + pad, side, side)


def _labels() -> tuple[str, str, str]:
    caption = "" if shown is None else shown.caption
    return "Original", "LOD", f"Heat Map: {caption}"
