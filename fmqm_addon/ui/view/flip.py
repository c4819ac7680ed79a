# SPDX-License-Identifier: GPL-3.0-or-later
"""The LOD where the Original stands, and back: both drawn over a 3D view from images of their own.

Both are drawn by the same means, in the colors that are measured and with the report's light, or what differs would be
Blender's way to draw. So the view shows these two alone, on its plain background: drawing the rest of the scene with
another object in it would need another scene. Nothing of the file is moved, hidden or touched.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import bpy
import gpu
from mathutils import Matrix

from ...blender.display import viewport
from ...blender.display.inset import draw_texture
from ...blender.display.sampled_mesh import SampledMesh
from ...metric.stepper import Stepper, Work, as_part
from ...report.render import AMBIENT, LIGHT
from ...report.visual.mesh_colors import sampling_colors
from .. import session
from ..properties.rows import active_row
from . import heat
from .ink import Ink, box, free_part
from .result import showable, why_not
from .tool import Tool, soon

PLACES = (60_000, 2_000_000)  # at which each of the two is colored: soon, and then
FINER = 2  # pixels of the images for one of the view, along each side: edges are smooth
_MOST_PIXELS = 1 << 23  # of an image; beyond, it is as large as the view
_PAD, _LINE = 10, 18


@dataclass
class Flip(Tool):
    """What is shown of the two.

    Attributes:
        uid: the row.
        showing: heat.ORIGINAL or heat.LOD. wipe: the share of the view's width at which the Original ends and the LOD
            begins; None: one of them is shown alone.
        meshes: by place, as far as they are made. images: by place, what they were drawn for and the image.
    """

    showing: str = heat.LOD
    wipe: float | None = None
    uid: str = ""
    meshes: dict[str, SampledMesh] = field(default_factory=dict)
    images: dict[str, tuple[Any, Any]] = field(default_factory=dict)


shown: Flip | None = None


def open_in(area: bpy.types.Area, scene: bpy.types.Scene, wipe: float | None = None) -> Flip:
    """Shows the LOD where the Original stands, or both with a wipe between them."""
    global shown
    close()
    shown = Flip(area.as_pointer(), scene.name, wipe=wipe)
    shown.open(_draw)
    refresh()
    return shown


def close() -> None:
    """Takes it away, if it is there."""
    global shown
    if shown is not None:
        shown.close(_tick, refresh)
    shown = None


def turn() -> None:
    """Shows the other one, alone."""
    if shown is not None:
        shown.showing = heat.ORIGINAL if shown.showing == heat.LOD else heat.LOD
        shown.wipe = None
        viewport.redraw()


def wipe_to(share: float | None) -> None:
    """Moves the border between the two to a share of the view's width."""
    if shown is not None:
        shown.wipe = share
        viewport.redraw()


def watch() -> None:
    """Called at each drawing of a view: another row is followed by a timer, outside of the drawing."""
    if shown is not None and shown.is_here() and shown.uid != _wanted(bpy.context.scene):
        soon(refresh)


def refresh() -> None:
    """Follows the chosen row."""
    scene = None if shown is None else bpy.data.scenes.get(shown.scene)
    if shown is None or scene is None:
        close()
        return
    shown.stop()
    shown.uid = _wanted(scene)
    shown.meshes.clear()
    shown.images.clear()
    measured = session.get(shown.uid)
    if measured is not None:
        shown.work = Stepper(_making(shown, measured))
        soon(_tick)
    viewport.redraw()


def _wanted(scene: bpy.types.Scene) -> str:
    row = showable(scene)
    return "" if row is None else row.uid


def _making(flip: Flip, measured: session.Measured) -> Work[None]:
    parts = [(places, place) for places in PLACES for place in (heat.LOD, heat.ORIGINAL)]
    for number, (places, place) in enumerate(parts):
        surface, _, _ = heat.surface_at(measured, place)
        sampling = sampling_colors(surface, places)
        found = yield from as_part(sampling, number / len(parts), 1 / len(parts))
        flip.meshes[place] = SampledMesh(found.positions, found.normals, found.first, found.cells, found.colors)
        flip.images.pop(place, None)
        viewport.redraw()


def _tick() -> float | None:
    return None if shown is None else shown.work_on()


# --- Drawing


def _draw() -> None:
    region, scene = bpy.context.region, bpy.context.scene
    if shown is None or not shown.is_here():
        return
    ink, row = Ink(), active_row(scene)
    reason, measured = why_not(scene), session.get(shown.uid)
    if row is None or measured is None or reason or shown.uid != row.uid:
        _say(ink, region, reason or "One moment", 0.5)
        return
    places = [shown.showing] if shown.wipe is None else [heat.ORIGINAL, heat.LOD]
    if any(place not in shown.meshes for place in places):
        _say(ink, region, "One moment", 0.5)
        return
    matrix = heat.placed(measured, heat.ORIGINAL, heat.members_at(row, heat.ORIGINAL))
    border = None if shown.wipe is None else round(shown.wipe * region.width)
    for place in places:
        image = _image(place, matrix, region)
        left, right = 0, region.width
        if border is not None:
            left, right = (0, border) if place == heat.ORIGINAL else (border, region.width)
        part = (left / region.width, right / region.width)
        draw_texture(image.texture_color, left, 0, right - left, region.height, part, image.width // region.width)
    names = {heat.ORIGINAL: f"Original: {row.reference_name}", heat.LOD: f"LOD: {row.name}"}
    if border is None:
        _say(ink, region, names[shown.showing], 0.5)
        return
    box(border - ink.px(1), 0, max(ink.px(2), 1), region.height, ink.text)
    _say(ink, region, names[heat.ORIGINAL], 0.25)
    _say(ink, region, names[heat.LOD], 0.75)


def _image(place: str, matrix: Matrix, region: bpy.types.Region) -> Any:
    """The image of one of the two as the view is now: the last one, where nothing has changed."""
    view = bpy.context.region_data
    finer = FINER if FINER * FINER * region.width * region.height <= _MOST_PIXELS else 1
    size = (finer * region.width, finer * region.height)
    ground = tuple(bpy.context.preferences.themes[0].view_3d.space.gradients.high_gradient)
    key = (size, ground, *(tuple(map(tuple, each)) for each in (matrix, view.view_matrix, view.window_matrix)))
    assert shown is not None
    before, image = shown.images.get(place, (None, None))
    if before == key:
        return image
    if image is None or before[0] != size:
        image = gpu.types.GPUOffScreen(*size, format="RGBA8")
    with image.bind():
        gpu.state.active_framebuffer_get().clear(color=(*ground, 1.0), depth=1.0)
        shown.meshes[place].draw(view.view_matrix @ matrix, view.window_matrix, LIGHT, AMBIENT)
    shown.images[place] = (key, image)
    return image


def _say(ink: Ink, region: bpy.types.Region, text: str, share: float) -> None:
    """A line at the upper edge of the view, its middle at a share of the free width."""
    left, _, right, top = free_part(bpy.context.area, region)
    pad, height = ink.px(_PAD), ink.px(_LINE + _PAD)
    width = ink.width(text) + 2 * pad
    x = min(max(left, left + share * (right - left) - width / 2), max(right - width, left))
    box(x, top - pad - height, width, height, (*ink.back[:3], 1.0))
    ink.write(text, x + pad, top - pad - height + ink.px(9))
