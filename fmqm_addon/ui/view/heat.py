# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat map: the chosen row's values on the original and the LOD themselves, or at the samples as points.

It is drawn and is no data of the file. Drawing builds nothing: it draws what was built for the present choices, and
asks for it to be built where these have changed, by whatever way: a click, undo, another scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...blender.display.colored_mesh import SAME, SIMILAR, ColoredMesh, from_faces
from ...blender.display.scene_objects import tetrahedra
from ...blender.scene.triangle_count import triangle_count
from ...metric.evaluation import Result
from ...metric.fields import Fields
from ...metric.geometry import Floats, Ints
from ...metric.surface import Surface
from ...report.visual import layers
from ...report.visual.colormap import NO_PATCH
from ...report.visual.heat_map import UNCOVERED, HeatMesh, fitted_range, heat_mesh, histogram
from ...report.visual.shells import fields_at
from .. import session
from ..properties.rows import FMQMRow, active_row, row_targets
from .built import Built
from .legends import legend_of
from .result import POINT, look_of, measured_row, showable, world_length, world_matrix

OFF, SURFACE, POINTS = "OFF", "SURFACE", "POINTS"
ORIGINAL, LOD, BOTH = "REFERENCE", "COMPARED", "BOTH"
PLACES = {ORIGINAL: (ORIGINAL,), LOD: (LOD,), BOTH: (ORIGINAL, LOD)}


@dataclass
class Part:
    """What is drawn at one of the two places.

    Attributes:
        patch: (E,) of each triangle or point, or UNCOVERED. centers: (E, 3) of the triangles; None for points.
    """

    place: str
    mesh: ColoredMesh
    patch: Ints
    heat_mesh: HeatMesh | None = None
    size: float = 0.0


@dataclass
class Shown:
    """What was built for a scene.

    Attributes:
        key: the choices it was built for. uid: its row. values: (P,) of the patches, where there is one a patch.
    """

    key: tuple[Any, ...]
    uid: str
    show: str
    layer: str
    parts: tuple[Part, ...]
    ends: tuple[float, float]
    legend: dict[str, Any] | None
    values: Floats | None = None
    fields: dict[int, Any] = field(default_factory=dict)


def wanted(scene: bpy.types.Scene) -> tuple[Any, ...] | None:
    """The choices that decide what is drawn; None: nothing is to be. Cheap: it is asked at each drawing."""
    look, row = look_of(scene), showable(scene)
    if look.show == OFF or row is None:
        return None
    size = look.point_size if look.show == POINTS else 0.0
    rows = tuple(each.uid for each in scene.fmqm.rows)
    custom = (look.low, look.high) if look.range == "CUSTOM" else ()
    below = look.below if look.only_below else None
    return (row.uid, look.show, look.layer, look.range, look.place, size, focused_patch(scene), below, custom, rows)


def focused_patch(scene: bpy.types.Scene) -> int | None:
    """The one patch that is shown alone."""
    look = look_of(scene)
    return look.worst[look.worst_index].patch if look.focused and look.worst_index < len(look.worst) else None


def _build(scene: bpy.types.Scene, key: tuple[Any, ...], before: Shown | None) -> Shown:
    uid, _, measured = measured_row(scene)
    look, result = look_of(scene), measured.comparison.result
    where = places(scene, measured) if look.show == POINTS else PLACES[look.place]
    old = before if before is not None and (before.uid, before.show) == (uid, look.show) else None
    reusable = {part.place: part for part in old.parts} if old is not None else {}
    parts = tuple(_part(look, measured, place, reusable.get(place)) for place in where)
    layer, length = layers.LAYERS[look.layer], world_length(measured)
    values = layers.patch_values(result, look.layer) if layer.per_patch else None
    fields = old.fields if old is not None else {}
    if values is not None:
        ends = score_range(scene, look.layer)
        table = layers.layer_colors(look.layer, values, *ends)
        colors = [np.vstack([table, NO_PATCH])[part.patch] for part in parts]  # UNCOVERED is the last
    else:
        of_parts = [_field_values(measured, look.layer, part, fields, length) for part in parts]
        ends = layers.value_range(look.layer, np.concatenate(of_parts), look.range != "FIXED", length)
        colors = [layers.layer_colors(look.layer, each, *ends) for each in of_parts]
    only = seen_patches(scene, values)
    for part, color in zip(parts, colors, strict=True):
        part.mesh.set_colors(color, only[part.patch])
    legend = legend_of(scene, look.layer, ends, result, measured.comparison.distorted.name)
    if any((part.patch == UNCOVERED).any() for part in parts):
        legend["note"] = f"grey: not among the {len(result.patches)} patches"
    if values is not None and layers.LAYERS[look.layer].kind == layers.SCORE:
        counts = histogram(values, *ends)
        legend["histogram"] = (counts / max(int(counts.max()), 1)).tolist()
        legend["seen_below"] = (look.below - ends[0]) / (ends[1] - ends[0]) if look.only_below else 1.0
    return Shown(key, uid, look.show, look.layer, parts, ends, legend, values, fields)


# Their state, scene by scene.
_built: Built[Shown] = Built(wanted, _build)
is_current, shown_in, refresh = _built.is_current, _built.shown_in, _built.refresh
build_all, keep = _built.refresh_all, _built.keep


def places(scene: bpy.types.Scene, measured: session.Measured) -> tuple[str, ...]:
    """Where the look wants things; the original alone, where the LOD was measured at the same place."""
    where = PLACES[look_of(scene).place]
    same = np.array_equal(measured.reference_to_world, measured.distorted_to_world)
    return where[:1] if same else where


def seen_patches(scene: bpy.types.Scene, values: Floats | None) -> NDArray[np.bool_]:
    """(P + 1,) which patches are shown, the last one being what no patch covers.

    Args:
        values: (P,) of the layer, where it has one a patch.
    """
    look, only = look_of(scene), focused_patch(scene)
    _, _, measured = measured_row(scene)
    count = len(measured.comparison.result.patches)
    seen = np.ones(count + 1, bool)
    if only is not None:
        seen[:] = np.arange(count + 1) == only
    if look.only_below and values is not None and layers.LAYERS[look.layer].kind == layers.SCORE:
        seen[:-1] &= values < look.below
        seen[-1] = False
    return seen


def score_range(scene: bpy.types.Scene, layer: str) -> tuple[float, float]:
    """The ends of the colors of a layer with a value a patch; fitted ones hold for all rows, so that these compare."""
    look = look_of(scene)
    if look.range == "CUSTOM" and layers.LAYERS[layer].kind == layers.SCORE:
        return min(look.low, look.high - 0.001), look.high
    if look.range == "FIXED" or layers.LAYERS[layer].kind != layers.SCORE:
        return 0.0, 1.0
    known = [measured for row in scene.fmqm.rows if (measured := session.get(row.uid)) is not None]
    return fitted_range(np.concatenate([layers.patch_values(each.comparison.result, layer) for each in known]))


def _part(look: Any, measured: session.Measured, place: str, old: Part | None) -> Part:
    result = measured.comparison.result
    if look.show == SURFACE:
        if old is not None:
            return old
        heat = heat_mesh(*surface_at(measured, place))
        mesh = from_faces(heat.vertices, heat.triangles, np.arange(len(heat.triangles)))
        return Part(place, mesh, heat.patch, heat)
    size = look.point_size * POINT * spacing(measured)
    if old is not None and old.size == size:
        return old
    return Part(place, points_mesh(result.samples.positions, size), result.samples.patch.astype(np.int64), None, size)


def surface_at(measured: session.Measured, place: str) -> tuple[Surface, Result, Fields]:
    """The original or the LOD, with the result, and its own fields at the samples."""
    result = measured.comparison.result
    if place == LOD:
        return measured.comparison.distorted, result, result.dist
    return measured.reference, result, result.ref


def points_mesh(positions: Floats, size: float) -> ColoredMesh:
    """Points as small tetrahedra, a row of the table for each."""
    corners, triangles = tetrahedra(positions, size)
    return ColoredMesh(corners.reshape(-1, 3), triangles, np.repeat(np.arange(len(positions)), 4))


def spacing(measured: session.Measured) -> float:
    """The mean distance between neighboring samples, in the metric's frame."""
    result = measured.comparison.result
    return float(np.sqrt(sum(patch.area for patch in result.patches) / len(result.samples.positions)))


def _field_values(
    measured: session.Measured, layer: str, part: Part, fields: dict[int, Any], length: float
) -> NDArray[np.float64]:
    """A layer that is not per patch, at the samples or at the middles of the triangles."""
    result = measured.comparison.result
    if part.heat_mesh is None:
        return layers.field_values(layer, result.ref, result.dist, length)
    if id(part) not in fields:
        surfaces = (measured.reference, measured.comparison.distorted)
        fields[id(part)] = tuple(fields_at(surface, part.heat_mesh.centers) for surface in surfaces)
    ref, dist = fields[id(part)]
    return layers.field_values(layer, ref, dist, length)


# --- Drawing


def draw() -> None:
    """Draws what was built in the view at hand; from a POST_VIEW handler."""
    scene, space = bpy.context.scene, bpy.context.space_data
    shown = shown_in(scene)
    if shown is None or not is_drawn_in(space):
        return
    row, measured = active_row(scene), session.get(shown.uid)
    if row is None or measured is None:
        return
    for part in shown.parts:
        members = members_at(row, part.place)
        if shown.show == SURFACE and not any(_is_seen(member, space) for member in members):
            continue
        if space.local_view is not None and not any(member.local_view_get(space) for member in members):
            continue
        nearer = SAME if shown.show == POINTS or _is_as_measured(row, part.place) else SIMILAR
        part.mesh.draw(placed(measured, part.place, members), bpy.context.region_data, nearer)


def _is_as_measured(row: FMQMRow, place: str) -> bool:
    """Whether as many triangles are shown as were measured: modifiers may have other levels in renders."""
    target = row_targets(row)[1 if place == LOD else 0]
    count = triangle_count(target, bpy.context.view_layer.depsgraph)
    measured = row.triangles if place == LOD else row.triangles * 100 / max(row.share, 1e-9)
    return count is None or abs(count - measured) <= 0.01 * measured


def is_drawn_in(space: Any) -> bool:
    """Whether a view has room for it: overlays are on, and surfaces hide what is behind them."""
    shading = space.shading
    is_clear = shading.type == "WIREFRAME" or (shading.type == "SOLID" and shading.show_xray)
    return space.overlay.show_overlays and not is_clear


def _is_seen(member: bpy.types.Object, space: Any) -> bool:
    try:
        return member.mode != "EDIT" and member.visible_get(viewport=space)
    except RuntimeError:  # in none of the scene's layers
        return False


def members_at(row: FMQMRow, place: str) -> list[bpy.types.Object]:
    """The objects of the row's original, or of its LOD."""
    return row_targets(row)[1 if place == LOD else 0].members()


def placed(measured: session.Measured, place: str, members: list[bpy.types.Object]) -> Matrix:
    """From the metric's frame to where the asset stands now: a single object takes its colors along."""
    matrix = Matrix(world_matrix(measured, place).tolist())
    stood = measured.reference_stood if place == ORIGINAL else measured.distorted_stood
    if stood is None or len(members) != 1:
        return matrix
    return members[0].matrix_world @ Matrix(stood.tolist()).inverted_safe() @ matrix


def legends(scene: bpy.types.Scene, space: Any) -> Iterator[dict[str, Any]]:
    """The legend of what is drawn."""
    shown = shown_in(scene)
    if shown is not None and shown.legend is not None and is_drawn_in(space):
        yield shown.legend
