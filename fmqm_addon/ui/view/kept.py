# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the view as objects of the file, for renders and export."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from ...blender.display import scene_objects, viewport
from ...blender.display.scene_objects import CLOUD, CLOUD_LOD, PAINTED, PAINTED_LOD, SHELLS, SLICE, SLICE_LOD
from ...metric.errors import FMQMError
from ...metric.fields import Fields
from ...metric.geometry import Floats, Ints, cross
from ...report.visual import layers
from ...report.visual.heat_map import HeatMesh
from ...report.visual.shells import fields_at, slice_points
from .. import session
from . import heat, shells, slice_plane
from .result import measured_row, world_length, world_matrix

LIFT = 0.002  # a painted copy lies this much above the surface, in diagonals, so as not to flicker
_CLOUDS = {heat.ORIGINAL: CLOUD, heat.LOD: CLOUD_LOD}
_SURFACES = {heat.ORIGINAL: PAINTED, heat.LOD: PAINTED_LOD}
_SLICES = {heat.ORIGINAL: SLICE, heat.LOD: SLICE_LOD}


def keep_as_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Objects that look as what is drawn; those of before are replaced.

    Raises:
        FMQMError: nothing is shown.
    """
    for refresh in (heat.refresh, slice_plane.refresh, shells.refresh):
        refresh(scene)
    _, _, measured = measured_row(scene)
    made = [*_heat(scene, measured), *_slices(scene, measured), *_shells(scene, measured)]
    if not made:
        raise FMQMError("nothing is shown; choose Surface or Points first, a slice or shells")
    bpy.context.view_layer.update()
    for object_ in made:
        scene_objects.reveal(object_, bpy.context.view_layer)
        viewport.show_in_local_views(object_)
    return made


def _heat(scene: bpy.types.Scene, measured: session.Measured) -> Iterator[bpy.types.Object]:
    shown, result = heat.shown_in(scene), measured.comparison.result
    if shown is None:
        return
    for part in shown.parts:
        matrix = world_matrix(measured, part.place)
        if part.heat_mesh is None:
            seen, positions = part.mesh.colors[:, 3] > 0, result.samples.positions
            normals, kind = outwards(positions, result.ref)[seen], _CLOUDS[part.place]
            made = scene_objects.build_cloud(scene, kind, "FMQM Points", positions[seen], normals, matrix, part.size)
            scene_objects.recolor(made, part.mesh.colors[seen, :3].astype(np.float64))
        else:
            mesh, kind = part.heat_mesh, _SURFACES[part.place]
            vertices = mesh.vertices + LIFT * _vertex_normals(mesh)
            made = scene_objects.build_surface(scene, kind, "FMQM Surface", vertices, mesh.triangles, matrix)
            scene_objects.recolor(made, _vertex_colors(shown, part, mesh, measured))
        yield made


def _slices(scene: bpy.types.Scene, measured: session.Measured) -> Iterator[bpy.types.Object]:
    """Grids with a vertex in the middle of each pixel."""
    shown = slice_plane.shown_in(scene)
    if shown is None:
        return
    points, triangles = slice_points(shown.to_frame, shown.picture.side), grid(shown.picture.side)
    for place in heat.places(scene, measured):
        matrix, kind = world_matrix(measured, place), _SLICES[place]
        made = scene_objects.build_surface(scene, kind, "FMQM Slice", points, triangles, matrix)
        scene_objects.recolor(made, shown.picture.colors)
        yield made


def _shells(scene: bpy.types.Scene, measured: session.Measured) -> Iterator[bpy.types.Object]:
    shown = shells.shown_in(scene)
    if shown is None:
        return
    matrix = world_matrix(measured, shells.place_of(scene))
    made = scene_objects.build_cloud(scene, SHELLS, "FMQM Shells", shown.positions, shown.normals, matrix, shown.size)
    scene_objects.recolor(made, shown.mesh.colors[:, :3].astype(np.float64))
    yield made


def grid(side: int) -> Ints:
    """(2 (side - 1)^2, 3) triangles between side * side vertices, row after row."""
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    corners = np.stack([first, first + 1, first + side + 1, first, first + side + 1, first + side], axis=1)
    return corners.reshape(-1, 3)


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
