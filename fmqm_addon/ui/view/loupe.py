# SPDX-License-Identifier: GPL-3.0-or-later
"""The loupe: Original, LOD and heat map of one place side by side, drawn over a 3D view.

Its pictures are made by a timer, in slices of some milliseconds: a coarse one at once, then finer ones, until the
place changes. It is no data of the file: opening, moving and closing it changes nothing there.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy

from ...blender.display.inset import Inset
from ...metric.stepper import Progress, Stepper, Work, as_part
from .. import session
from ..properties.rows import active_row
from . import heat, panes, sight
from .ink import Ink, box, free_part
from .result import look_of, showable, why_not

SLICE = 0.03  # seconds of work of a tick
_SIDE, _LEAST_SIDE = 400, 48  # pixels of a picture at a UI scale of 1, where there is room
_HEIGHT = 0.55  # of the view's, at most
_PAD, _LINE = 10, 18


@dataclass
class Loupe:
    """What is shown of which place.

    Attributes:
        area: the pointer of the one it is in. scene: the name of the scene it was opened in.
        follows: the mouse; else it stays. below: it stands at the lower edge of the view.
        key: the choices that its pictures were made for. sight: the place. pictures: of it, none or three.
        place: x, y, width and height of what is covered, in pixels of the region, once it was drawn.
    """

    area: int
    scene: str
    follows: bool
    below: bool = False
    key: tuple[Any, ...] | None = None
    sight: sight.Sight | None = None
    pictures: list[Inset] = field(default_factory=list)
    caption: str = ""
    side: int = panes.SECOND
    place: tuple[float, float, float, float] | None = None
    work: Stepper[None] | None = None


shown: Loupe | None = None
longest_step = 0.0  # seconds, since it was opened
seconds_to: dict[int, float] = {}  # from the choice of a place to its pictures, by pixels a side
_handles: list[Any] = []


def open_in(area: bpy.types.Area, scene: bpy.types.Scene) -> Loupe:
    """Opens it in a view: at the chosen worst place where one is shown alone, else under the mouse."""
    global shown, longest_step
    close()
    longest_step = 0.0
    shown = Loupe(area.as_pointer(), scene.name, follows=heat.focused_patch(scene) is None)
    if not bpy.app.background:
        _handles.append(bpy.types.SpaceView3D.draw_handler_add(_draw, (), "WINDOW", "POST_PIXEL"))
    refresh()
    return shown


def close() -> None:
    """Takes it away, if it is there."""
    global shown
    if shown is not None and shown.work is not None:
        shown.work.cancel()
    shown = None
    for timer in (_tick, refresh):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")
    _redraw()


def wanted(scene: bpy.types.Scene) -> tuple[Any, ...]:
    """The choices that decide what is seen, but for the place under the mouse. Cheap: it is asked at each drawing."""
    row, look = showable(scene), look_of(scene)
    uid = "" if row is None else row.uid
    colors = (sight.heat_layer(scene), look.range, look.low, look.high, len(scene.fmqm.rows))
    return (uid, heat.focused_patch(scene), *colors)


def watch() -> None:
    """Called at each drawing of a view: what has changed is followed by a timer, outside of the drawing."""
    area, scene = bpy.context.area, bpy.context.scene
    if shown is None or area is None or area.as_pointer() != shown.area or scene.name != shown.scene:
        return
    if shown.key != wanted(scene) and not bpy.app.timers.is_registered(refresh):
        bpy.app.timers.register(refresh, first_interval=0)


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
        _stop()
        shown.pictures, shown.sight = [], None
        _redraw()
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
    _stop()
    shown.side = _side_now() or shown.side
    shown.work = Stepper(_refining(shown, scene, measured, shown.sight))
    if not bpy.app.background and not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=0)


def _stop() -> None:
    if shown is not None and shown.work is not None:
        shown.work.cancel()
        shown.work = None


def _refining(loupe: Loupe, scene: bpy.types.Scene, measured: session.Measured, place: sight.Sight) -> Work[None]:
    began = time.perf_counter()
    colors, caption = sight.heat_colors(scene, measured), sight.heat_text(scene, measured, place.patch)
    yield Progress("", 0.0)
    sides = panes.sides(loupe.side)
    for number, side in enumerate(sides):
        drawing = panes.drawing(measured, place.camera, side, colors)
        found = yield from as_part(drawing, number / len(sides), 1 / len(sides))
        loupe.pictures, loupe.caption = [Inset(pixels) for pixels in found], caption
        seconds_to[side] = time.perf_counter() - began
        _redraw()


def _tick() -> float | None:
    """A slice of the work; then Blender may draw and listen."""
    global longest_step
    if shown is None or shown.work is None:
        return None
    began = last = time.perf_counter()
    more = True
    while more and last - began < SLICE:
        more = shown.work.step()
        now = time.perf_counter()
        longest_step, last = max(longest_step, now - last), now
    if more:
        return 0.0
    shown.work = None
    return None


def _redraw() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


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
    if shown is None or area.as_pointer() != shown.area or scene.name != shown.scene:
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
    if side != shown.side and not bpy.app.timers.is_registered(refresh):
        bpy.app.timers.register(refresh, first_interval=0)  # which makes them as large
    for number, (picture, label) in enumerate(zip(shown.pictures, _labels(), strict=True)):
        at = x + pad + number * (side + pad)
        ink.write(label, at, y + side + pad + px(6), ink.faint)
        picture.draw(at, y + pad, side, side)


def _labels() -> tuple[str, str, str]:
    caption = "" if shown is None else shown.caption
    return "Original", "LOD", f"Heat Map: {caption}"
