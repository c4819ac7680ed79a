# SPDX-License-Identifier: GPL-3.0-or-later
"""What the loupe looks at: the chosen worst place, or the place under the mouse."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from bpy_extras.view3d_utils import region_2d_to_location_3d, region_2d_to_origin_3d, region_2d_to_vector_3d
from mathutils import Matrix, Vector

from ...comparison.judge import Judge
from ...metric.geometry import Floats
from ...report.html.pictures import CLOSE_UP_MARGIN
from ...report.numbers import score_text
from ...report.render import Camera
from ...report.visual import layers
from ...report.visual.colormap import NO_PATCH
from ...report.visual.heat_map import UNCOVERED, patches_at
from ...report.visual.worst import patch_view
from .. import session
from ..properties.rows import FMQMRow
from . import heat
from .result import look_of

MAGNIFIED = 4  # times what the view shows of a place under the mouse
_BEFORE = 4.0  # diagonals of the reference: rays of float32 begin not much farther away


@dataclass(frozen=True)
class Sight:
    """A place, and how it is looked at.

    Attributes:
        camera: in the metric's frame. patch: the one that the place belongs to, or UNCOVERED. title: what to call it.
    """

    camera: Camera
    patch: int
    title: str


def worst_sight(scene: bpy.types.Scene, measured: session.Measured) -> Sight:
    """The chosen one of the worst places, as the report shows it."""
    look = look_of(scene)
    chosen = look.worst[look.worst_index]
    center, diagonal, normal = patch_view(measured.comparison.result, chosen.patch)
    camera = Camera.facing(center, normal, CLOSE_UP_MARGIN * diagonal)
    return Sight(camera, chosen.patch, f"Worst place {look.worst_index + 1} of {len(look.worst)}: {chosen.blame}")


def sight_under(
    row: FMQMRow,
    measured: session.Measured,
    region: bpy.types.Region,
    view: bpy.types.RegionView3D,
    at: tuple[float, float],
    side: int,
) -> Sight | None:
    """The foremost place of the two surfaces at a place of a view, magnified; None beside them.

    Args:
        at: pixels of the region. side: pixels of a picture of it.
    """
    origin, direction = region_2d_to_origin_3d(region, view, at), region_2d_to_vector_3d(region, view, at)
    nearest: tuple[float, str, Matrix, Vector] | None = None
    for place in (heat.ORIGINAL, heat.LOD):
        surface, _, _ = heat.surface_at(measured, place)
        matrix = heat.placed(measured, place, heat.members_at(row, place))
        back = matrix.inverted_safe()
        start, towards = back @ origin, (back.to_3x3() @ direction).normalized()
        start += towards * max(-start.dot(towards) - _BEFORE, 0.0)  # an orthographic view begins at its far clip
        triangle, distance = surface.query.first_hit(np.array([start]), np.array([towards]))
        if triangle[0] < 0:
            continue
        point = start + towards * float(distance[0])
        depth = (matrix @ point - origin).dot(direction)
        if nearest is None or depth < nearest[0]:
            nearest = depth, place, matrix, point
    if nearest is None:
        return None
    _, place, matrix, point = nearest
    _, result, fields = heat.surface_at(measured, place)
    seen = matrix @ point
    beside = region_2d_to_location_3d(region, view, (at[0] + 1, at[1]), seen)
    back = matrix.inverted_safe().to_3x3()
    width = (back @ (beside - seen)).length * side / MAGNIFIED
    rows = view.view_matrix.to_3x3()
    axes = _upright(*(np.array(back @ axis, np.float64) for axis in (rows[0], rows[1], direction)))
    center = np.array(point, np.float64)
    patch = int(patches_at(center[None], result, fields)[0])
    return Sight(Camera.close_up(center, axes, width), patch, "Under the mouse")


def _upright(right: Floats, up: Floats, forward: Floats) -> Floats:
    """(3, 3) unit rows at right angles, forward as it is given; mirrored where the three are."""
    forward = forward / np.linalg.norm(forward)
    up = up - forward * (up @ forward)
    up /= np.linalg.norm(up)
    side = np.cross(forward, up)
    return np.stack([side if side @ right > 0 else -side, up, forward])


def heat_layer(scene: bpy.types.Scene) -> str:
    """What the heat map means in the loupe: what it does in the view, or the judge's score."""
    name: str = look_of(scene).layer
    return name if layers.LAYERS[name].per_patch else Judge[scene.fmqm.judge].column


def heat_colors(scene: bpy.types.Scene, measured: session.Measured) -> Floats:
    """(P + 1, 3) encoded colors of the patches, as in the view, and of what none covers."""
    layer = heat_layer(scene)
    values = layers.patch_values(measured.comparison.result, layer)
    colors = layers.layer_colors(layer, values, *heat.score_range(scene, layer))
    return np.vstack([colors, NO_PATCH])


def heat_text(scene: bpy.types.Scene, measured: session.Measured, patch: int) -> str:
    """What the heat map says of a place."""
    if patch == UNCOVERED:
        return "not measured here"
    layer = heat_layer(scene)
    value = layers.patch_values(measured.comparison.result, layer)[patch]
    label = layers.LAYERS[layer].label
    return f"{label} {score_text(value, places=3)}" if layers.LAYERS[layer].kind == layers.SCORE else f"patch {patch}"
