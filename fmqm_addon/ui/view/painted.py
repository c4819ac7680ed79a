# SPDX-License-Identifier: GPL-3.0-or-later
"""A copy of the reference's surface, painted."""

from __future__ import annotations

import bpy
import numpy as np

from ...blender.display import scene_objects, viewport
from ...metric.fields import Fields
from ...metric.geometry import Floats, Ints, cross
from ...report.visual import layers
from ...report.visual.shells import fields_at
from .. import session
from .legends import explain
from .result import UID, appear, look_of, measured_of, measured_row, world_length, world_matrix

LIFT = 0.002  # the painted copy lies this much above the surface, in diagonals, so as not to flicker
_painted_fields: dict[str, tuple[Fields, Fields]] = {}


def paint_surface(scene: bpy.types.Scene) -> None:
    """A copy of the reference's surface in the colors of the chosen layer.

    Raises:
        FMQMError: nothing to show.
    """
    appear(build_painted(scene))
    viewport.show_colors()


def build_painted(scene: bpy.types.Scene) -> bpy.types.Object:
    uid, _, measured = measured_row(scene)
    mesh = measured.comparison.result.patch_mesh
    painted = scene_objects.build_surface(
        scene,
        scene_objects.PAINTED,
        "FMQM Painted",
        mesh.vertices + LIFT * _vertex_normals(mesh.vertices, mesh.triangles),
        mesh.triangles,
        world_matrix(measured, look_of(scene).place),
    )
    painted[UID] = uid
    recolor_painted(scene)
    return painted


def recolor_painted(scene: bpy.types.Scene) -> None:
    """Gives the painted copy, if there is one, the colors and the legend of the chosen layer."""
    painted = scene_objects.find_object(scene, scene_objects.PAINTED)
    measured = measured_of(painted)
    if painted is None or measured is None:
        return
    look = look_of(scene)
    result, distorted = measured.comparison.result, measured.comparison.distorted
    length = world_length(measured)
    if layers.LAYERS[look.layer].per_patch:
        values = layers.blended_scores(result, look.layer)
    else:
        values = layers.field_values(look.layer, *_fields_of_vertices(painted[UID], measured), length)
    fitted_to = layers.layer_values(result, look.layer) if layers.LAYERS[look.layer].per_patch else values
    ends = layers.value_range(look.layer, fitted_to, look.range == "FITTED", length)
    scene_objects.recolor(painted, layers.layer_colors(look.layer, values, *ends))
    explain(scene, painted, look.layer, ends, result, distorted.name)
    viewport.redraw()


def _fields_of_vertices(uid: str, measured: session.Measured) -> tuple[Fields, Fields]:
    """The fields of both surfaces at the painted copy's vertices; of the last row only, since they are large."""
    if uid not in _painted_fields:
        _painted_fields.clear()
        vertices = measured.comparison.result.patch_mesh.vertices
        surfaces = (measured.reference, measured.comparison.distorted)
        _painted_fields[uid] = (fields_at(surfaces[0], vertices), fields_at(surfaces[1], vertices))
    return _painted_fields[uid]


def keep_fields(uids: set[str]) -> None:
    """Lets go of the fields that were kept for recoloring other rows than these."""
    for uid in _painted_fields.keys() - uids:
        del _painted_fields[uid]


def _vertex_normals(vertices: Floats, triangles: Ints) -> Floats:
    """(V, 3) area-weighted unit normals; zero where they cancel."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    face = cross(b - a, c - a)
    normals = np.stack(
        [np.bincount(triangles.ravel(), np.repeat(face[:, k], 3), len(vertices)) for k in range(3)], axis=1
    )
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit: Floats = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    return unit
