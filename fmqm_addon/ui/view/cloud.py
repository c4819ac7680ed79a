# SPDX-License-Identifier: GPL-3.0-or-later
"""The samples as a cloud of points; all of them, or those of one patch."""

from __future__ import annotations

import bpy
import numpy as np

from ...blender.display import scene_objects, viewport
from ...metric.errors import FMQMError
from ...metric.evaluation import Result
from ...metric.geometry import Floats
from ...report.visual import layers
from ...report.visual.worst import patch_view
from . import worst
from .legends import explain
from .result import POINT, UID, appear, look_of, measured_of, measured_row, world_length, world_matrix

_SPACING = "fmqm_spacing"  # custom property: the mean distance between neighbors


def show_cloud(scene: bpy.types.Scene) -> bpy.types.Object:
    """The chosen row's samples as a cloud, colored by the chosen layer; replaces the one that is there.

    Raises:
        FMQMError: nothing to show.
    """
    cloud = build_cloud(scene)
    appear(cloud)
    viewport.show_colors()
    return cloud


def build_cloud(scene: bpy.types.Scene) -> bpy.types.Object:
    uid, _, measured = measured_row(scene)
    look = look_of(scene)
    result = measured.comparison.result
    spacing = float(np.sqrt(sum(patch.area for patch in result.patches) / len(result.samples.positions)))
    cloud = scene_objects.build_cloud(
        scene,
        scene_objects.CLOUD,
        "FMQM Cloud",
        result.samples.positions,
        _outwards(result),
        world_matrix(measured, look.place),
        look.point_size * POINT * spacing,
    )
    cloud.hide_select = True  # clicks go to the user's own objects
    cloud[UID], cloud[_SPACING] = uid, spacing
    look.focused = False
    worst.fill_worst(look, result, uid)
    recolor_cloud(scene)
    return cloud


def recolor_cloud(scene: bpy.types.Scene) -> None:
    """Gives the cloud the colors and the legend of the chosen layer, unless its samples are gone."""
    cloud = scene_objects.find_object(scene, scene_objects.CLOUD)
    measured = measured_of(cloud)
    if cloud is None or measured is None:
        return
    look = look_of(scene)
    result = measured.comparison.result
    length = world_length(measured)
    colors, ends = layers.sample_colors(result, look.layer, look.range == "FITTED", length)
    scene_objects.recolor(cloud, colors)
    explain(scene, cloud, look.layer, ends, result, measured.comparison.distorted.name)
    viewport.redraw()


def resize_cloud(scene: bpy.types.Scene) -> None:
    cloud = scene_objects.find_object(scene, scene_objects.CLOUD)
    if cloud is not None:
        scene_objects.resize(cloud, look_of(scene).point_size * POINT * cloud.get(_SPACING, 0.0))


def focus_patch(scene: bpy.types.Scene, area: bpy.types.Area | None) -> None:
    """Frames the chosen one of the worst patches and shows only its points.

    Raises:
        FMQMError: nothing to show.
    """
    look = look_of(scene)
    uid, _, measured = measured_row(scene)
    cloud = scene_objects.find_object(scene, scene_objects.CLOUD)
    if cloud is None or cloud.get(UID) != uid:
        cloud = show_cloud(scene)
    else:
        appear(cloud)
    if not 0 <= look.worst_index < len(look.worst):
        raise FMQMError("the result has no patches")
    patch = look.worst[look.worst_index].patch
    result = measured.comparison.result
    size = look.point_size * POINT * cloud[_SPACING]
    scene_objects.resize(cloud, size, result.samples.patch == patch)
    look.focused = True
    center, diameter, normal = patch_view(result, patch)
    matrix = world_matrix(measured, look.place)
    turned = np.linalg.inv(matrix[:3, :3]).T @ normal
    length = float(np.linalg.norm(turned))
    viewport.frame_place(
        area,
        matrix[:3, :3] @ center + matrix[:3, 3],
        diameter * world_length(measured),
        turned / length if length > 0 else turned,
    )


def show_all_patches(scene: bpy.types.Scene) -> None:
    look = look_of(scene)
    look.focused = False
    cloud = scene_objects.find_object(scene, scene_objects.CLOUD)
    if cloud is not None:
        shown = np.ones(len(cloud.data.vertices) // 4, bool)
        scene_objects.resize(cloud, look.point_size * POINT * cloud.get(_SPACING, 0.0), shown)


def _outwards(result: Result) -> Floats:
    """(N, 3) unit normals of the reference below the samples: along p - p_n, away from the inside."""
    away = (result.samples.positions - result.ref.nearest) * np.where(result.ref.sdf < 0, -1.0, 1.0)[:, None]
    length = np.linalg.norm(away, axis=1)
    away[length == 0] = (0.0, 0.0, 1.0)
    length[length == 0] = 1.0
    normals: Floats = away / length[:, None]
    return normals
