# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of points around the surface, colored by NCF. They are drawn and are no data of the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix

from ...blender.display import viewport
from ...blender.display.colored_mesh import ColoredMesh
from ...metric.geometry import Floats
from ...report.visual import layers
from ...report.visual.shells import SHELLS, fields_at, shell_points
from . import heat
from .legends import length_text
from .result import POINT, look_of, measured_row, world_length, world_matrix


@dataclass
class Shells:
    """The shells of a scene. matrix: to the world. uid: the row that they were made from."""

    mesh: ColoredMesh
    positions: Floats
    matrix: Matrix
    uid: str
    legend: dict[str, Any]


shown: dict[str, Shells] = {}  # by the scene's name


def show_shells(scene: bpy.types.Scene) -> None:
    """Five layers of points at growing distances, colored by NCF.

    Raises:
        FMQMError: nothing to show.
    """
    uid, _, measured = measured_row(scene)
    look = look_of(scene)
    surface = measured.reference if look.shell_field == "REFERENCE" else measured.comparison.distorted
    shells = shell_points(surface, look.shell_points, look.shell_distance / 100)
    positions = shells.positions.copy()
    low, high = positions.min(axis=0), positions.max(axis=0)
    seen = np.ones(len(positions), bool)
    if look.shell_layout == "ROW":  # the world's X may be turned in the frame; the row runs along the frame's
        positions[:, 0] += shells.shell * 1.1 * float(high[0] - low[0])
    else:  # each shell ends before the one below it, so that all five are seen
        place = (positions[:, 0] - low[0]) / max(float(high[0] - low[0]), 1e-12)
        seen = place <= 1 - shells.shell / SHELLS
    positions = positions[seen]
    area = float(measured.comparison.result.patch_mesh.area)
    mesh = heat.points_mesh(positions, POINT * float(np.sqrt(area / look.shell_points)))
    mesh.set_colors(fields_at(surface, shells.positions[seen]).ncf)
    step = world_length(measured) * look.shell_distance / 100
    legend = layers.Legend(
        f"{SHELLS} Shells of {surface.name}",
        f"{length_text(scene, step)} apart",
        note="colors as in the textures",
    )
    matrix = Matrix(world_matrix(measured, look.place).tolist())
    shown[scene.name] = Shells(mesh, positions, matrix, uid, legend.as_dict())
    viewport.redraw()


def follow_shells(scene: bpy.types.Scene) -> None:
    """The shells, if they are shown, become those of the chosen row and place."""
    if scene.name in shown:
        show_shells(scene)


def keep(uids: set[str]) -> None:
    """Lets go of what belongs to other rows."""
    for name in [name for name, each in shown.items() if each.uid not in uids]:
        del shown[name]


def draw() -> None:
    """Draws them in the view at hand; from a POST_VIEW handler."""
    here = shown.get(bpy.context.scene.name)
    if here is not None and heat.is_drawn_in(bpy.context.space_data):
        here.mesh.draw(here.matrix, bpy.context.region_data)


def legends(scene: bpy.types.Scene, space: Any) -> Iterator[dict[str, Any]]:
    """The legend of the shells that are drawn."""
    here = shown.get(scene.name)
    if here is not None and heat.is_drawn_in(space):
        yield here.legend
