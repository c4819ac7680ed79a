# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of points around the surface, colored by NCF. As the heat map they are drawn and are no data of the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ...blender.display.colored_mesh import ColoredMesh
from ...metric.geometry import Floats
from ...report.visual import layers
from ...report.visual.shells import SHELLS, fields_at, shell_points
from .. import session
from ..properties.rows import active_row
from . import heat
from .built import Built, Key
from .legends import length_text
from .result import POINT, look_of, measured_row, showable, world_length


@dataclass(frozen=True)
class Shells:
    """What was built for a scene.

    Attributes:
        key: the choices it was built for. uid: its row. positions, normals: (N, 3), metric's frame. size: of a point.
    """

    key: Key
    uid: str
    mesh: ColoredMesh
    positions: Floats
    normals: Floats
    size: float
    legend: dict[str, Any]


def wanted(scene: bpy.types.Scene) -> Key | None:
    """The choices that decide what is drawn; None: nothing is to be. Cheap: it is asked at each drawing."""
    look, row = look_of(scene), showable(scene)
    if not look.show_shells or row is None:
        return None
    unit = scene.unit_settings.system
    return (row.uid, look.shell_field, look.shell_layout, look.shell_distance, look.shell_points, unit)


def _build(scene: bpy.types.Scene, key: Key, _: Shells | None) -> Shells:
    uid, _name, measured = measured_row(scene)
    look = look_of(scene)
    surface = measured.reference if look.shell_field == "REFERENCE" else measured.comparison.distorted
    shells = shell_points(surface, look.shell_points, look.shell_distance / 100)
    positions = shells.positions.copy()
    low, high = positions.min(axis=0), positions.max(axis=0)
    seen = np.ones(len(positions), bool)
    if look.shell_layout == "ROW":  # the world's X may be turned in the frame; the row runs along the frame's
        positions[:, 0] += shells.shell * 1.1 * float(high[0] - low[0])
    else:  # each shell ends before the one below it, so that all five are seen
        across = (positions[:, 0] - low[0]) / max(float(high[0] - low[0]), 1e-12)
        seen = across <= 1 - shells.shell / SHELLS
    area = float(measured.comparison.result.patch_mesh.area)
    size = POINT * float(np.sqrt(area / look.shell_points))
    mesh = heat.points_mesh(positions[seen], size)
    mesh.set_colors(fields_at(surface, shells.positions[seen]).ncf)
    step = world_length(measured) * look.shell_distance / 100
    legend = layers.Legend(
        f"{SHELLS} Shells of {surface.name}",
        f"{length_text(scene, step)} apart",
        note="colors as in the textures",
    )
    return Shells(key, uid, mesh, positions[seen], shells.normals[seen], size, legend.as_dict())


_built: Built[Shells] = Built(wanted, _build)
is_current, shown_in, refresh = _built.is_current, _built.shown_in, _built.refresh
refresh_all, keep = _built.refresh_all, _built.keep


def matrix_of(scene: bpy.types.Scene, shown: Shells) -> Matrix | None:
    """From the metric's frame to where they stand; None: their row is gone."""
    row, measured = active_row(scene), session.get(shown.uid)
    if row is None or measured is None:
        return None
    place = place_of(scene)
    return heat.placed(measured, place, heat.members_at(row, place))


def place_of(scene: bpy.types.Scene) -> str:
    """Around which of the two they stand."""
    return heat.LOD if look_of(scene).place == heat.LOD else heat.ORIGINAL


def draw() -> None:
    """Draws them in the view at hand; from a POST_VIEW handler."""
    shown = _built.latest_in(bpy.context.scene)
    if shown is not None and heat.is_drawn_in(bpy.context.space_data):
        matrix = matrix_of(bpy.context.scene, shown)
        if matrix is not None:
            shown.mesh.draw(matrix, bpy.context.region_data)


def legends(scene: bpy.types.Scene, space: Any) -> Iterator[dict[str, Any]]:
    """The legend of the shells that are drawn."""
    shown = _built.latest_in(scene)
    if shown is not None and heat.is_drawn_in(space):
        yield shown.legend
