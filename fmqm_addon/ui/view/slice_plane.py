# SPDX-License-Identifier: GPL-3.0-or-later
"""A plane on which the fields are drawn, wherever the user puts it."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ...blender.display import scene_objects, viewport
from ...report.visual import layers
from ...report.visual.shells import fields_at, slice_points
from .legends import explain
from .result import UID, look_of, measured_row, world_length, world_matrix

SLICE_SIZE = 1.2  # in the longest side of the reference's box
OUTLINE = 0.05  # encoded grey of the surface's cut in a slice
_SLICE_MATRIX = "fmqm_drawn_at"  # custom property: where it was drawn


def show_slice(scene: bpy.types.Scene) -> bpy.types.Object:
    """The slice plane, upright through the middle of the reference, or where the user has put it.

    Raises:
        FMQMError: nothing to show.
    """
    _, _, measured = measured_row(scene)
    into = world_matrix(measured, "REFERENCE")
    corners = measured.reference.vertices @ into[:3, :3].T + into[:3, 3]
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = SLICE_SIZE * float((high - low).max())
    matrix = np.eye(4)
    matrix[:3, :3] = side * np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # faces the front, -Y
    matrix[:3, 3] = (low + high) / 2
    plane = scene_objects.build_slice(scene, "FMQM Slice", matrix, int(look_of(scene).slice_resolution))
    bpy.context.view_layer.update()
    scene_objects.reveal(plane, bpy.context.view_layer)
    viewport.show_in_local_views(plane)
    draw_slice(scene)
    return plane


def draw_slice(scene: bpy.types.Scene) -> None:
    """Draws the chosen field where the slice is now.

    Raises:
        FMQMError: nothing to show.
    """
    plane = scene_objects.find_object(scene, scene_objects.SLICE)
    if plane is None:
        return
    uid, name, measured = measured_row(scene)
    look = look_of(scene)
    resolution = plane.data.size[0]
    to_frame = np.linalg.inv(world_matrix(measured, "REFERENCE")) @ np.array(plane.matrix_world, np.float64)
    points = slice_points(to_frame, resolution)
    ref = fields_at(measured.reference, points)
    dist = fields_at(measured.comparison.distorted, points)
    length = world_length(measured)
    values = layers.field_values(look.slice_layer, ref, dist, length)
    ends = layers.value_range(look.slice_layer, values, look.range != "FIXED", length)
    colors = layers.layer_colors(look.slice_layer, values, *ends).copy()
    cut = dist.sdf if look.slice_layer.endswith("COMPARED") else ref.sdf
    colors[_borders((cut < 0).reshape(resolution, resolution)).ravel()] = OUTLINE
    scene_objects.draw_slice(plane, colors)
    plane[UID], plane[_SLICE_MATRIX] = uid, _flat(plane)
    which = "LOD" if look.slice_layer.endswith("COMPARED") else "original"
    explain(scene, plane, look.slice_layer, ends, measured.comparison.result, name, f"dark line: {which}")
    viewport.redraw()


def slice_has_moved(scene: bpy.types.Scene) -> bool:
    """Whether the slice is elsewhere than where it was drawn; cheap enough for each drawing of the view."""
    plane = scene_objects.find_object(scene, scene_objects.SLICE)
    return plane is not None and _SLICE_MATRIX in plane and list(plane[_SLICE_MATRIX]) != _flat(plane)


def _flat(object_: bpy.types.Object) -> list[float]:
    return [value for row in object_.matrix_world for value in row]


def _borders(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) the pixels whose right or upper neighbor is on the other side."""
    border = np.zeros_like(inside)
    border[:, :-1] |= inside[:, :-1] != inside[:, 1:]
    border[:-1] |= inside[:-1] != inside[1:]
    return border
