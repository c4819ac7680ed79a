# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the 3D viewport: legends, the figure of a sample's units, and a mark at the sample.

Drawing computes nothing: what is drawn was built before, a figure is made by its operator.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

from ...blender.display.drawing import for_own_shaders
from ...metric.geometry import Floats
from .. import session
from ..properties.rows import active_row
from . import heat, shells, slice_plane
from .ink import Color, Ink, box, draw_shape, free_corner

_PAD, _LINE, _GAP = 10, 17, 8  # pixels at a UI scale of 1
_BAR_WIDTH, _BAR_HEIGHT, _TICK = 14, 150, 4
_COUNTS = 46  # of the histogram beside the bar
_PANEL = 128  # side of one of the figure's four pictures
_DOT = 2.6


@dataclass(frozen=True)
class UnitPicture:
    """One of the four pictures of a unit.

    Attributes:
        colors: (side, side, 4) encoded RGBA, rows upwards; clear outside of the unit.
        dots: (n, 2) the samples in it, in [-1, 1]. dot_colors: (n, 3) encoded.
    """

    colors: NDArray[np.float32]
    dots: Floats
    dot_colors: Floats


@dataclass
class UnitFigure:
    """The normal and tangent unit of a sample, of both surfaces, side by side.

    Attributes:
        title: which sample. pictures: normal reference, normal compared, tangent reference, tangent compared.
        uid: the row it was made from. scene: the name of the scene it belongs to.
        lines: (m, 2, 3) the mark in the world.
    """

    title: str
    pictures: tuple[UnitPicture, UnitPicture, UnitPicture, UnitPicture]
    uid: str
    scene: str
    lines: Floats
    batches: list[Any] = field(default_factory=list)  # made when first drawn: only there is a GPU context


@dataclass(frozen=True)
class Hint:
    """Lines beside the mouse. area: the pointer of the one it is in. at: pixels of its main region."""

    area: int
    at: tuple[float, float]
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Handle:
    """What can be dragged at a legend's bar: the bar's left end and width, and its height there, in pixels. color: or
    that of texts."""

    x: float
    y: float
    width: float
    color: Color | None


figure: UnitFigure | None = None
hint: Hint | None = None
bars: dict[int, tuple[float, float, float, float]] = {}  # by area: x, y, width and height of the heat map's color bar
handles: dict[int, list[Handle]] = {}  # by area: of this drawing
on_draw: Callable[[], None] | None = None  # called before each drawing: is all as it is wanted?
_handles: list[Any] = []


def register() -> None:
    if bpy.app.background:
        return  # nothing will ever be drawn
    add = bpy.types.SpaceView3D.draw_handler_add
    _handles.append(add(_draw_in_space, (), "WINDOW", "POST_VIEW"))
    _handles.append(add(_draw_legends, (), "WINDOW", "POST_PIXEL"))


def unregister() -> None:
    global figure
    figure = None
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


def legends() -> list[dict[str, Any]]:
    """The legends of what this view shows."""
    space, scene = bpy.context.space_data, bpy.context.scene
    return [legend for kind in (heat, shells, slice_plane) for legend in kind.legends(scene, space)]


def _draw_legends() -> None:
    """The legends from the lower left, and the figure to their right."""
    if on_draw is not None:
        on_draw()
    if not bpy.context.space_data.overlay.show_overlays:
        handles.pop(bpy.context.area.as_pointer(), None)
        return
    ink = Ink()
    x, y = free_corner(ink)
    bars.pop(bpy.context.area.as_pointer(), None)
    for legend in legends():
        x += _draw_legend(ink, legend, x, y) + ink.px(_GAP)
    for handle in handles.pop(bpy.context.area.as_pointer(), ()):
        _draw_handle(ink, handle)
    if figure is not None and belongs_here(figure):
        _draw_figure(ink, figure, x, y)
    if hint is not None and hint.area == bpy.context.area.as_pointer():
        _draw_hint(ink, hint)


def belongs_here(shown: UnitFigure) -> bool:
    """Its row is the chosen one of this scene, and was measured in this file; undo may have taken it away."""
    scene = bpy.context.scene
    row = active_row(scene)
    here = row is not None and row.uid == shown.uid and shown.scene == scene.name
    return here and session.get(shown.uid) is not None


def _draw_legend(ink: Ink, legend: dict[str, Any], x: float, y: float) -> float:
    """One legend with its lower left corner at a place; its width."""
    px, pad, line = ink.px, ink.px(_PAD), ink.px(_LINE)
    bar, swatches = legend["bar"], legend["swatches"]
    marked = [legend["mark"]] if legend["mark"] else []
    texts = [legend["title"], legend["subtitle"], legend["note"]]
    counts = legend.get("histogram", [])
    beside = px(_BAR_WIDTH + _TICK + 5 + (_COUNTS if counts else 0))
    width = max(
        *(ink.width(text) for text in texts),
        *(beside + ink.width(text) for _, text in legend["ticks"]),
        *(beside + ink.width("0.0000") + px(30) + ink.width(text) for _, text in marked),
        *(px(_BAR_WIDTH + 6) + ink.width(text) for _, text in swatches),
        px(110),
    )
    body = px(_BAR_HEIGHT) + line if bar else line * len(swatches)
    height = 2 * line + body + (line if legend["note"] else 0) + 2 * pad
    box(x, y, width + 2 * pad, height, ink.back)

    left, top = x + pad, y + height - pad
    ink.write(legend["title"], left, top - px(12))
    ink.write(legend["subtitle"], left, top - px(12) - line, ink.faint)
    top -= 2 * line
    if bar:
        place = (left + px(_COUNTS if counts else 0), top - line * 0.7 - px(_BAR_HEIGHT))
        if counts:
            _draw_counts(ink, counts, legend["seen_below"], *place)
            bars[bpy.context.area.as_pointer()] = (*place, px(_BAR_WIDTH), px(_BAR_HEIGHT))
        _draw_bar(ink, legend, *place)
    for color, text in swatches:
        box(left, top - px(13), px(_BAR_WIDTH), px(11), (*color, 1.0))
        ink.write(text, left + px(_BAR_WIDTH + 6), top - px(12))
        top -= line
    if legend["note"]:
        ink.write(legend["note"], left, y + pad + px(2), ink.faint)
    return float(width + 2 * pad)


def _draw_counts(ink: Ink, counts: list[float], seen_below: float, x: float, y: float) -> None:
    """How many patches have each value, as bars to the left of the color bar, whose lower left corner is given; those
    that are not shown are pale."""
    step = ink.px(_BAR_HEIGHT) / len(counts)
    for number, count in enumerate(counts):
        length = count * ink.px(_COUNTS - 8)
        color = ink.faint if (number + 0.5) / len(counts) < seen_below else (*ink.faint[:3], 0.25)
        box(x - ink.px(6) - length, y + number * step, length, max(step - 1, 1), color)


def _draw_handle(ink: Ink, shown: Handle) -> None:
    side, thick = ink.px(3), ink.px(4)
    box(shown.x - side - 1, shown.y - thick / 2 - 1, shown.width + 2 * side + 2, thick + 2, (0.0, 0.0, 0.0, 0.8))
    box(shown.x - side, shown.y - thick / 2, shown.width + 2 * side, thick, shown.color or ink.text)


def _draw_hint(ink: Ink, shown: Hint) -> None:
    pad, line = ink.px(_PAD), ink.px(_LINE)
    width, height = max(map(ink.width, shown.lines)) + 2 * pad, len(shown.lines) * line + 2 * pad
    region = bpy.context.region
    x = min(shown.at[0] + ink.px(16), region.width - width)
    y = min(max(shown.at[1] - height, 0), region.height - height)
    box(x, y, width, height, ink.back)
    for number, text in enumerate(shown.lines):
        ink.write(text, x + pad, y + height - pad - line * number - ink.px(12), None if number < 2 else ink.faint)


def _draw_bar(ink: Ink, legend: dict[str, Any], x: float, y: float) -> None:
    """The color bar upwards from a place, its numbers, and the mark at the whole score."""
    px = ink.px
    width, height = px(_BAR_WIDTH), px(_BAR_HEIGHT)
    colors = [(*color, 1.0) for color in legend["bar"]]
    rows = np.linspace(y, y + height, len(colors)).tolist()
    positions = [(at, row) for row in rows for at in (x, x + width)]
    strip_colors = [color for color in colors for _ in (0, 1)]
    draw_shape("TRI_STRIP", positions, strip_colors)
    half = px(4)
    for place, text in legend["ticks"]:
        at = y + place * height
        box(x + width, at, px(_TICK), max(px(1), 1), ink.faint)
        ink.write(text, x + width + px(_TICK + 5), at - half)
    if legend["mark"]:
        place, text = legend["mark"]
        at, tip = y + place * height, x + width + px(_TICK + 10) + ink.width("0.0000")
        corners = [(tip, at), (tip + px(7), at + px(5)), (tip + px(7), at - px(5))]
        draw_shape("TRIS", corners, [ink.text] * 3)
        ink.write(text, tip + px(12), at - half)


def _draw_figure(ink: Ink, shown: UnitFigure, x: float, y: float) -> None:
    px, pad, line, side = ink.px, ink.px(_PAD), ink.px(_LINE), ink.px(_PANEL)
    label = max(ink.width("Normal"), ink.width("Tangent")) + pad
    width, height = label + 2 * side + 3 * pad, 2 * side + 2 * line + 3 * pad
    box(x, y, width, height, ink.back)
    ink.write(shown.title, x + pad, y + height - pad - px(12))
    for column, text in enumerate(("Original", "LOD")):
        ink.write(text, x + pad + label + column * (side + pad), y + height - pad - px(12) - line, ink.faint)
    if not shown.batches:
        shown.batches.extend(_picture_batch(picture) for picture in shown.pictures)
    for row, text in enumerate(("Normal", "Tangent")):
        bottom = y + pad + (1 - row) * (side + pad)
        ink.write(text, x + pad, bottom + side / 2 - px(4), ink.faint)
        for column in (0, 1):
            left = x + pad + label + column * (side + pad)
            with gpu.matrix.push_pop():
                gpu.matrix.translate((left + side / 2, bottom + side / 2))
                gpu.matrix.scale((side / 2, side / 2))
                gpu.state.blend_set("ALPHA")
                shown.batches[2 * row + column].draw(gpu.shader.from_builtin("SMOOTH_COLOR"))
                gpu.state.blend_set("NONE")


def _picture_batch(picture: UnitPicture) -> Any:
    """Squares of one color for the pixels, and diamonds with a dark rim for the samples; in [-1, 1]."""
    side = len(picture.colors)
    visible = picture.colors[:, :, 3] > 0
    row, column = np.nonzero(visible)
    centers = np.stack([column, row], axis=1) * (2 / side) - 1 + 1 / side
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1)]) / side
    diamond = np.array([(-1, 0), (0, -1), (1, 0), (-1, 0), (1, 0), (0, 1)]) * (2 * _DOT / _PANEL)
    rim = np.full((len(picture.dots), 4), (0.05, 0.05, 0.05, 1.0))
    dots = np.column_stack([picture.dot_colors, np.ones(len(picture.dots))])
    positions = np.concatenate(
        [
            (centers[:, None] + square).reshape(-1, 2),
            (picture.dots[:, None] + 1.7 * diamond).reshape(-1, 2),
            (picture.dots[:, None] + diamond).reshape(-1, 2),
        ]
    )
    colors = np.repeat(np.concatenate([picture.colors[row, column], rim, dots]), 6, axis=0)
    colors[:, :3] = for_own_shaders(colors[:, :3])
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    flat = np.column_stack([positions, np.zeros(len(positions))]).astype(np.float32)
    return batch_for_shader(shader, "TRIS", {"pos": flat, "color": colors.astype(np.float32)})


def _draw_in_space() -> None:
    """What stands in the scene's space: heat map, shells and slice, and the marks of the figure over them."""
    heat.draw()
    shells.draw()
    slice_plane.draw()
    _draw_marks()


def _draw_marks() -> None:
    """The chosen sample, its way to the surface and the rim of its tangent unit, seen through everything."""
    if figure is None or not belongs_here(figure) or not bpy.context.space_data.overlay.show_overlays:
        return
    points = figure.lines.reshape(-1, 3).astype(np.float32)
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    region = bpy.context.region
    gpu.state.blend_set("ALPHA")
    for width, color in ((4.0, (0.0, 0.0, 0.0, 0.6)), (1.6, (1.0, 1.0, 1.0, 1.0))):
        shader.uniform_float("viewportSize", (region.width, region.height))
        shader.uniform_float("lineWidth", width * bpy.context.preferences.system.ui_scale)
        shader.uniform_float("color", color)
        batch_for_shader(shader, "LINES", {"pos": points}).draw(shader)
    gpu.state.blend_set("NONE")
