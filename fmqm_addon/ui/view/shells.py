# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of points around the surface, colored by NCF."""

from __future__ import annotations

import json

import bpy
import numpy as np

from ...blender.display import scene_objects, viewport
from ...report.visual import layers
from ...report.visual.shells import SHELLS, fields_at, shell_points
from . import overlay
from .legends import length_text
from .result import POINT, UID, appear, look_of, measured_row, world_length, world_matrix


def show_shells(scene: bpy.types.Scene) -> None:
    """Five layers of points at growing distances, colored by NCF.

    Raises:
        FMQMError: nothing to show.
    """
    appear(build_shells(scene))
    viewport.show_colors()
    viewport.redraw()


def build_shells(scene: bpy.types.Scene) -> bpy.types.Object:
    uid, _, measured = measured_row(scene)
    look = look_of(scene)
    surface = measured.reference if look.shell_field == "REFERENCE" else measured.comparison.distorted
    shells = shell_points(surface, look.shell_points, look.shell_distance / 100)
    positions = shells.positions.copy()
    low, high = positions.min(axis=0), positions.max(axis=0)
    shown = np.ones(len(positions), bool)
    if look.shell_layout == "ROW":  # the world's X may be turned in the frame; the row runs along the frame's
        positions[:, 0] += shells.shell * 1.1 * float(high[0] - low[0])
    else:  # each shell ends before the one below it, so that all five are seen
        place = (positions[:, 0] - low[0]) / max(float(high[0] - low[0]), 1e-12)
        shown = place <= 1 - shells.shell / SHELLS
    colors = fields_at(surface, shells.positions[shown]).ncf
    area = float(measured.comparison.result.patch_mesh.area)
    object_ = scene_objects.build_cloud(
        scene,
        scene_objects.SHELLS,
        "FMQM Shells",
        positions[shown],
        shells.normals[shown],
        world_matrix(measured, look.place),
        POINT * float(np.sqrt(area / look.shell_points)),
    )
    object_[UID] = uid
    object_.hide_select = True
    scene_objects.recolor(object_, colors.astype(np.float64))
    step = world_length(measured) * look.shell_distance / 100
    legend = layers.Legend(
        f"{SHELLS} Shells of {surface.name}",
        f"{length_text(scene, step)} apart",
        note="colors as in the textures",
    )
    object_[overlay.LEGEND] = json.dumps(legend.as_dict())
    return object_
