# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be dragged in the 3D view: the slice along its axis, the ends of the heat map's legend and its threshold."""

from __future__ import annotations

from typing import ClassVar

import bpy
from mathutils import Matrix

from ..report.numbers import score_text
from .view import heat, legends, overlay, slice_plane
from .view.legends import BELOW, HIGH, LOW
from .view.result import look_of

_COLOR = (1.0, 0.75, 0.2)
_REACH = 7  # pixels around a handle in which it is taken, at a UI scale of 1
_NAMES = {LOW: "Low", HIGH: "High", BELOW: "Only Below"}


class FMQM_GGT_slice(bpy.types.GizmoGroup):  # noqa: N801 Blender's naming
    """An arrow in the middle of the slice, which drags it along its axis."""

    bl_idname = "FMQM_GGT_slice"
    bl_label = "FMQM Slice"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options: ClassVar = {"3D", "PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return slice_plane.way(context.scene, context.space_data) is not None

    def setup(self, _: bpy.types.Context) -> None:
        arrow = self.gizmos.new("GIZMO_GT_arrow_3d")
        arrow.draw_style = "BOX"
        arrow.color = arrow.color_highlight = _COLOR
        arrow.alpha, arrow.alpha_highlight = 0.7, 1.0
        arrow.target_set_handler("offset", get=_offset, set=_set_offset)

    def draw_prepare(self, context: bpy.types.Context) -> None:
        way = slice_plane.way(context.scene, context.space_data)
        if way is not None:
            middle, step = way
            turn = step.to_track_quat("Z", "Y").to_matrix().to_4x4()
            self.gizmos[0].matrix_basis = Matrix.Translation(middle) @ turn


def _offset() -> float:
    """In scene units, from the middle of its way."""
    way = slice_plane.way(bpy.context.scene, bpy.context.space_data)
    return 0.0 if way is None else way[1].length * look_of(bpy.context.scene).slice_offset / 100


def _set_offset(value: float) -> None:
    way = slice_plane.way(bpy.context.scene, bpy.context.space_data)
    if way is not None and way[1].length > 0:
        look_of(bpy.context.scene).slice_offset = 100 * value / way[1].length


class FMQM_GT_legend(bpy.types.Gizmo):  # noqa: N801
    """A handle at the legend's bar: at one of its ends, or at the score below which patches are shown.

    Attributes:
        end: of view.legends. before: what the three were when the drag began. from_y, to_y: of the mouse, or None.
    """

    bl_idname = "FMQM_GT_legend"
    __slots__ = ("before", "end", "from_y", "range_before", "to_y")

    def setup(self) -> None:
        self.to_y = None

    def draw(self, context: bpy.types.Context) -> None:
        place = self._place(context)
        if place is None:
            return
        is_hot = self.is_highlight or self.to_y is not None
        handle = overlay.Handle(*place, (*_COLOR, 1.0) if is_hot else None)
        overlay.handles.setdefault(context.area.as_pointer(), []).append(handle)  # the legend comes later, and over it

    def test_select(self, context: bpy.types.Context, location: tuple[float, float]) -> int:
        place = self._place(context)
        if place is None:
            return -1
        x, y, width = place
        reach = _REACH * context.preferences.system.ui_scale
        return 0 if abs(location[1] - y) < reach and x - 2 * reach < location[0] < x + width + 2 * reach else -1

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        shown, look = heat.shown_in(context.scene), look_of(context.scene)
        if shown is None:
            return {"CANCELLED"}
        self.before, self.range_before = (*shown.ends, look.below), look.range
        self.from_y = self.to_y = event.mouse_region_y
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event, _: set[str]) -> set[str]:
        bar = overlay.bars.get(context.area.as_pointer())
        if bar is None or event.type != "MOUSEMOVE":
            return {"RUNNING_MODAL"}
        self.to_y = event.mouse_region_y
        values = legends.moved(self.end, self.before, (self.to_y - self.from_y) / bar[3])
        self._set(context, values)
        value = values[(LOW, HIGH, BELOW).index(self.end)]
        context.area.header_text_set(f"{_NAMES[self.end]}: {score_text(value, places=3)}")
        return {"RUNNING_MODAL"}

    def exit(self, context: bpy.types.Context, cancel: bool) -> None:
        context.area.header_text_set(None)
        moved, self.to_y = self.to_y != self.from_y, None
        if cancel:
            self._set(context, self.before)
            look_of(context.scene).range = self.range_before
        elif moved:
            bpy.ops.ed.undo_push(message=f"FMQM Legend: {_NAMES[self.end]}")

    def _set(self, context: bpy.types.Context, values: tuple[float, float, float]) -> None:
        look = look_of(context.scene)
        if self.end == BELOW:
            look.below = values[2]
            return
        look.low, look.high = values[:2]
        if look.range != "CUSTOM":
            look.range = "CUSTOM"

    def _place(self, context: bpy.types.Context) -> tuple[float, float, float] | None:
        """Left end, height and width of the bar where the handle is, in pixels of the region; None: it is nowhere."""
        bar, shown = overlay.bars.get(context.area.as_pointer()), heat.shown_in(context.scene)
        if bar is None or shown is None:
            return None
        x, y, width, height = bar
        if self.to_y is not None:  # below the mouse: the bar's scale changes meanwhile
            return x, self.to_y, width
        if self.end == BELOW:
            look, (low, high) = look_of(context.scene), shown.ends
            share = (look.below - low) / (high - low)
            return (x, y + share * height, width) if look.only_below and 0 <= share <= 1 else None
        return x, y + (height if self.end == HIGH else 0), width


class FMQM_GGT_legend(bpy.types.GizmoGroup):  # noqa: N801
    """The handles of the heat map's legend."""

    bl_idname = "FMQM_GGT_legend"
    bl_label = "FMQM Legend"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options: ClassVar = {"PERSISTENT", "SCALE", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        shown = heat.shown_in(context.scene)
        return shown is not None and shown.values is not None and heat.is_drawn_in(context.space_data)

    def setup(self, _: bpy.types.Context) -> None:
        for end in (BELOW, LOW, HIGH):
            handle = self.gizmos.new(FMQM_GT_legend.bl_idname)
            handle.end = end
            handle.use_draw_modal = True


CLASSES: tuple[type, ...] = (FMQM_GGT_slice, FMQM_GT_legend, FMQM_GGT_legend)
