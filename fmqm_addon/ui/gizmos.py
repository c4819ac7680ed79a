# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be dragged in the 3D view: the slice along its axis, the ends of the heat map's legend and its threshold."""

from __future__ import annotations

from typing import ClassVar

import bpy
from mathutils import Matrix

from .view import slice_plane
from .view.result import look_of

_COLOR = (1.0, 0.75, 0.2)


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


CLASSES: tuple[type, ...] = (FMQM_GGT_slice,)
