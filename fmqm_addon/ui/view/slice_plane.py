# SPDX-License-Identifier: GPL-3.0-or-later
"""A plane through the original and the LOD on which a field is drawn, across an axis or the view, at any place.

As the heat map it is drawn and is no data of the file; it is built when something asks for it, never while drawing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector
from numpy.typing import NDArray

from ...blender.display.picture import Picture
from ...metric.geometry import Floats
from ...report.visual import layers
from ...report.visual.shells import fields_at, slice_points
from .. import session
from ..properties.rows import active_row
from ..properties.view import FMQMLook
from . import heat
from .built import Built, Key
from .legends import legend_of
from .result import look_of, measured_row, showable, world_length, world_matrix

SIZE = 1.2  # in the longest side of the original's box
ROUGH = 48  # pixels along a side while it is being moved
OUTLINE = 0.05  # encoded grey of the surface's cut
# The directions to the right, upwards and towards the viewer of a plane across an axis, and where its offset goes to.
_AXES = {
    "X": ((0, 1, 0), (0, 0, 1), (1, 0, 0), 1),
    "Y": ((1, 0, 0), (0, 0, 1), (0, -1, 0), -1),  # seen from the front
    "Z": ((1, 0, 0), (0, 1, 0), (0, 0, 1), 1),
}


@dataclass(frozen=True)
class Slice:
    """What was built for a scene.

    Attributes:
        key: the choices it was built for. uid: its row. to_frame: (4, 4) from the square to the metric's frame.
        middle: (3,) of the way that its offset goes, and step: (3,) from there to an offset of 100 %; metric's frame.
    """

    key: Key
    uid: str
    picture: Picture
    to_frame: Floats
    middle: Floats
    step: Floats
    legend: dict[str, Any]


moving: set[str] = set()  # names of scenes where it is being moved: it is rough meanwhile


def wanted(scene: bpy.types.Scene) -> Key | None:
    """The choices that decide what is drawn; None: nothing is to be. Cheap: it is asked at each drawing."""
    look, row = look_of(scene), showable(scene)
    if not look.show_slice or row is None:
        return None
    turn = tuple(look.slice_turn) if look.slice_axis == "VIEW" else ()
    fixed = look.range == "FIXED"
    return (row.uid, look.slice_layer, fixed, side_of(scene), look.slice_axis, look.slice_offset, turn)


def side_of(scene: bpy.types.Scene) -> int:
    """Pixels along each side."""
    side = int(look_of(scene).slice_resolution)
    return min(ROUGH, side) if scene.name in moving else side


def _build(scene: bpy.types.Scene, key: Key, _: Slice | None) -> Slice:
    uid, name, measured = measured_row(scene)
    look, length, side = look_of(scene), world_length(measured), side_of(scene)
    into = world_matrix(measured, heat.ORIGINAL)
    back = np.linalg.inv(into)
    square, middle, step = plane(look, measured.reference.vertices @ into[:3, :3].T + into[:3, 3])
    to_frame = back @ square
    points = slice_points(to_frame, side)
    ref, dist = (fields_at(surface, points) for surface in (measured.reference, measured.comparison.distorted))
    values = layers.field_values(look.slice_layer, ref, dist, length)
    ends = layers.value_range(look.slice_layer, values, look.range != "FIXED", length)
    colors = layers.layer_colors(look.slice_layer, values, *ends).copy()
    of_lod = look.slice_layer.endswith("COMPARED")
    inside = ((dist if of_lod else ref).sdf < 0).reshape(side, side)
    colors[_borders(inside).ravel()] = OUTLINE
    legend = legend_of(scene, look.slice_layer, ends, measured.comparison.result, name)
    legend["note"] = f"dark line: {'LOD' if of_lod else 'original'}"
    middle, step = back[:3, :3] @ middle + back[:3, 3], back[:3, :3] @ step
    return Slice(key, uid, Picture(colors), to_frame, middle, step, legend)


_built: Built[Slice] = Built(wanted, _build)
is_current, shown_in, latest_in, refresh = _built.is_current, _built.shown_in, _built.latest_in, _built.refresh
refresh_all, keep = _built.refresh_all, _built.keep


def plane(look: FMQMLook, vertices: Floats) -> tuple[Floats, Floats, Floats]:
    """(4, 4) from the square to the world; the middle of its way and the step to an offset of 100 %, as in Slice.

    Args:
        vertices: (V, 3) of the original, world.
    """
    right, up, towards, sign = directions(look)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    center, along = (low + high) / 2, vertices @ towards
    middle = center + ((along.min() + along.max()) / 2 - center @ towards) * towards
    step = sign * (along.max() - along.min()) / 2 * towards
    matrix = np.eye(4)
    matrix[:3, :3] = SIZE * float((high - low).max()) * np.stack([right, up, towards], axis=1)
    matrix[:3, 3] = middle + look.slice_offset / 100 * step
    return matrix, middle, step


def directions(look: FMQMLook) -> tuple[Floats, Floats, Floats, int]:
    """Unit vectors to the right, up and towards the viewer, and whether an offset goes along the last or against it."""
    if look.slice_axis == "VIEW":
        turn = np.array(Quaternion(look.slice_turn).normalized().to_matrix(), np.float64)
        return turn[:, 0], turn[:, 1], turn[:, 2], 1
    right, up, towards, sign = _AXES[look.slice_axis]
    return np.array(right, float), np.array(up, float), np.array(towards, float), sign


def _borders(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) the pixels whose right or upper neighbor is on the other side."""
    border = np.zeros_like(inside)
    border[:, :-1] |= inside[:, :-1] != inside[:, 1:]
    border[:-1] |= inside[:-1] != inside[1:]
    return border


# --- Drawing


def draw() -> None:
    """Draws it in the view at hand, at the original and at the LOD; from a POST_VIEW handler."""
    scene, space = bpy.context.scene, bpy.context.space_data
    shown = latest_in(scene)
    if shown is not None and space.overlay.show_overlays:
        for matrix in placed(scene, shown, space):
            shown.picture.draw(matrix @ Matrix(shown.to_frame.tolist()), bpy.context.region_data)


def placed(scene: bpy.types.Scene, shown: Slice, space: Any) -> Iterator[Matrix]:
    """From the metric's frame to the world, at each of the places where the look wants it and a view sees it."""
    row, measured = active_row(scene), session.get(shown.uid)
    if row is None or measured is None:
        return
    for place in heat.places(scene, measured):
        members = heat.members_at(row, place)
        if space.local_view is None or any(member.local_view_get(space) for member in members):
            yield heat.placed(measured, place, members)


def legends(scene: bpy.types.Scene, space: Any) -> Iterator[dict[str, Any]]:
    """The legend of the slice that is drawn."""
    shown = latest_in(scene)
    if shown is not None and space.overlay.show_overlays:
        yield shown.legend


def way(scene: bpy.types.Scene, space: Any) -> tuple[Vector, Vector] | None:
    """The middle of the way that the offset goes, and the step to 100 %, in the world; None: nothing is drawn there."""
    shown = latest_in(scene)
    if shown is None or not space.overlay.show_overlays:
        return None
    for matrix in placed(scene, shown, space):
        return matrix @ Vector(shown.middle), matrix.to_3x3() @ Vector(shown.step)
    return None
