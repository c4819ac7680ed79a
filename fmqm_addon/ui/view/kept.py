# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat map as objects of the file, for renders and export."""

from __future__ import annotations

import bpy
import numpy as np

from ...blender.display import scene_objects, viewport
from ...metric.errors import FMQMError
from ...metric.fields import Fields
from ...metric.geometry import Floats, cross
from ...report.visual import layers
from ...report.visual.heat_map import HeatMesh
from ...report.visual.shells import fields_at
from .. import session
from . import heat
from .result import measured_row, world_length, world_matrix

LIFT = 0.002  # a painted copy lies this much above the surface, in diagonals, so as not to flicker
_KINDS = {heat.ORIGINAL: scene_objects.PAINTED, heat.LOD: scene_objects.PAINTED_LOD}


def keep_as_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Objects that look as what is drawn; those of before are replaced.

    Raises:
        FMQMError: nothing is shown.
    """
    heat.refresh(scene)
    shown = heat.shown_in(scene)
    if shown is None:
        raise FMQMError("nothing is shown; choose Surface or Points first")
    _, _, measured = measured_row(scene)
    made = [_object(scene, shown, part, measured) for part in shown.parts]
    bpy.context.view_layer.update()
    for object_ in made:
        scene_objects.reveal(object_, bpy.context.view_layer)
        viewport.show_in_local_views(object_)
    return made


def _object(scene: bpy.types.Scene, shown: heat.Shown, part: heat.Part, measured: session.Measured) -> bpy.types.Object:
    matrix = world_matrix(measured, part.place)
    result = measured.comparison.result
    if part.heat_mesh is None:
        positions, normals = result.samples.positions, outwards(result.samples.positions, result.ref)
        seen = part.mesh.colors[:, 3] > 0
        kind = scene_objects.CLOUD if part.place == heat.ORIGINAL else scene_objects.CLOUD_LOD
        made = scene_objects.build_cloud(scene, kind, "FMQM Points", positions[seen], normals[seen], matrix, part.size)
        scene_objects.recolor(made, part.mesh.colors[seen, :3].astype(np.float64))
        return made
    mesh = part.heat_mesh
    vertices = mesh.vertices + LIFT * _vertex_normals(mesh)
    made = scene_objects.build_surface(scene, _KINDS[part.place], "FMQM Surface", vertices, mesh.triangles, matrix)
    scene_objects.recolor(made, _vertex_colors(shown, part, mesh, measured))
    return made


def _vertex_colors(shown: heat.Shown, part: heat.Part, mesh: HeatMesh, measured: session.Measured) -> Floats:
    """(V, 3): of one of the triangles around each vertex, or of the fields there."""
    if layers.LAYERS[shown.layer].per_patch:
        colors = np.ones((len(mesh.vertices), 3))
        colors[mesh.triangles.ravel()] = np.repeat(part.mesh.colors[:, :3], 3, axis=0)
        return colors
    ref, dist = (fields_at(surface, mesh.vertices) for surface in (measured.reference, measured.comparison.distorted))
    values = layers.field_values(shown.layer, ref, dist, world_length(measured))
    return layers.layer_colors(shown.layer, values, *shown.ends)


def outwards(positions: Floats, ref: Fields) -> Floats:
    """(N, 3) unit normals of the reference below the samples: along p - p_n, away from the inside."""
    away = (positions - ref.nearest) * np.where(ref.sdf < 0, -1.0, 1.0)[:, None]
    length = np.linalg.norm(away, axis=1)
    away[length == 0] = (0.0, 0.0, 1.0)
    length[length == 0] = 1.0
    normals: Floats = away / length[:, None]
    return normals


def _vertex_normals(mesh: HeatMesh) -> Floats:
    """(V, 3) area-weighted unit normals; zero where they cancel."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    face, count = cross(b - a, c - a), len(mesh.vertices)
    corners = mesh.triangles.ravel()
    normals = np.stack([np.bincount(corners, np.repeat(face[:, k], 3), count) for k in range(3)], axis=1)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: Floats = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    return unit
