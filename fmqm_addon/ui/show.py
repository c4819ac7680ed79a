# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts what is remembered of a result row into the scene."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ..blender.display import scene_objects, viewport
from ..metric.errors import FMQMError
from ..metric.evaluation import Result
from ..metric.fields import Fields
from ..metric.geometry import Floats, Ints, cross
from ..report.visual import layers
from ..report.visual.shells import SHELLS, fields_at, shell_points, slice_points
from ..report.visual.units import unit_grid, unit_lines, unit_of
from ..report.visual.worst import patch_view, worst_patches
from . import overlay, properties, session

if TYPE_CHECKING:
    from .look import FMQMLook

WORST_COUNT = 20
POINT = 1.1  # usual radius of a point, in mean distances between neighbors
LIFT = 0.002  # the painted copy lies this much above the surface, in diagonals, so as not to flicker
SLICE_SIZE = 1.2  # in the longest side of the reference's box
OUTLINE = 0.05  # encoded grey of the surface's cut in a slice
FIGURE_SIDE = 48  # pixels of one picture of the figure of units
AGAIN = "the samples are not in memory any longer; press Measure Quality again"

choosing = False  # the index of the worst places is being set from here
_painted_fields: dict[str, tuple[Fields, Fields]] = {}

_UID = "fmqm_uid"  # custom properties of our objects: the row, the layer's patch, the usual point size
_SPACING = "fmqm_spacing"
_SLICE_MATRIX = "fmqm_drawn_at"


def look_of(scene: bpy.types.Scene) -> FMQMLook:
    look: FMQMLook = scene.fmqm.look
    return look


def measured_row(scene: bpy.types.Scene) -> tuple[str, str, session.Measured]:
    """Identifier and name of the chosen row, and what it was computed from.

    Raises:
        FMQMError: no row, or its samples are gone.
    """
    row = properties.active_row(scene)
    if row is None:
        raise FMQMError("there is no result yet; press Measure Quality first")
    measured = session.get(row.uid)
    if measured is None:
        raise FMQMError(f"{row.name}: {'it could not be measured' if row.error else AGAIN}")
    return row.uid, row.name, measured


def follow_row(scene: bpy.types.Scene) -> None:
    """What is shown becomes that of the row just chosen or measured; hidden things stay hidden.

    Raises:
        FMQMError: the row has nothing to show. The list of worst places is empty then, the rest stays.
    """
    look, row = look_of(scene), properties.active_row(scene)
    if row is None or row.uid != look.worst_uid:
        look.worst.clear()
        look.worst_uid = ""
    uid, _, measured = measured_row(scene)
    builders = {
        scene_objects.CLOUD: _build_cloud,
        scene_objects.PAINTED: _build_painted,
        scene_objects.SHELLS: _build_shells,
        scene_objects.SLICE: draw_slice,
    }
    for kind, build in builders.items():
        shown = scene_objects.find_object(scene, kind)
        if shown is not None and shown.get(_UID) != uid:
            build(scene)
    _fill_worst(look, measured.comparison.result, uid)
    _follow_unit(scene)


def move_shown(scene: bpy.types.Scene) -> None:
    """Moves what is shown to the place that the look says."""
    for kind in (scene_objects.CLOUD, scene_objects.PAINTED, scene_objects.SHELLS):
        shown = scene_objects.find_object(scene, kind)
        measured = _measured_of(shown)
        if shown is not None and measured is not None:
            shown.matrix_world = Matrix(cloud_matrix(measured, look_of(scene).place).tolist())
    _follow_unit(scene)


def _measured_of(shown: bpy.types.Object | None) -> session.Measured | None:
    """What an object of ours was made from, if that is still in memory."""
    return None if shown is None else session.get(shown.get(_UID, ""))


# --- The cloud


def show_cloud(scene: bpy.types.Scene) -> bpy.types.Object:
    """The chosen row's samples as a cloud, colored by the chosen layer; replaces the one that is there.

    Raises:
        FMQMError: nothing to show.
    """
    cloud = _build_cloud(scene)
    _appear(cloud)
    viewport.show_colors()
    return cloud


def _build_cloud(scene: bpy.types.Scene) -> bpy.types.Object:
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
        cloud_matrix(measured, look.place),
        look.point_size * POINT * spacing,
    )
    cloud.hide_select = True  # clicks go to the user's own objects
    cloud[_UID], cloud[_SPACING] = uid, spacing
    look.focused = False
    _fill_worst(look, result, uid)
    recolor_cloud(scene)
    return cloud


def recolor_cloud(scene: bpy.types.Scene) -> None:
    """Gives the cloud the colors and the legend of the chosen layer, unless its samples are gone."""
    cloud = scene_objects.find_object(scene, scene_objects.CLOUD)
    measured = _measured_of(cloud)
    if cloud is None or measured is None:
        return
    look = look_of(scene)
    result = measured.comparison.result
    length = world_length(measured)
    colors, ends = layers.sample_colors(result, look.layer, look.range == "FITTED", length)
    scene_objects.recolor(cloud, colors)
    _explain(scene, cloud, look.layer, ends, result, measured.comparison.distorted.name)
    viewport.redraw()


def resize_cloud(scene: bpy.types.Scene) -> None:
    cloud = scene_objects.find_object(scene, scene_objects.CLOUD)
    if cloud is not None:
        scene_objects.resize(cloud, look_of(scene).point_size * POINT * cloud.get(_SPACING, 0.0))


def cloud_matrix(measured: session.Measured, place: str) -> Floats:
    """(4, 4) from the metric's frame to where a row's reference, or its compared object, stands."""
    frame = measured.reference.frame
    into = np.eye(4)
    into[:3, :3] *= frame.scale
    into[:3, 3] = frame.center
    to_world = measured.reference_to_world if place == "REFERENCE" else measured.distorted_to_world
    matrix: Floats = np.asarray(to_world, np.float64) @ into
    return matrix


def world_length(measured: session.Measured) -> float:
    """Scene units of the metric's unit, the reference's diagonal."""
    matrix = cloud_matrix(measured, "REFERENCE")
    return float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))


def _outwards(result: Result) -> Floats:
    """(N, 3) unit normals of the reference below the samples: along p - p_n, away from the inside."""
    away = (result.samples.positions - result.ref.nearest) * np.where(result.ref.sdf < 0, -1.0, 1.0)[:, None]
    length = np.linalg.norm(away, axis=1)
    away[length == 0] = (0.0, 0.0, 1.0)
    length[length == 0] = 1.0
    normals: Floats = away / length[:, None]
    return normals


def _appear(object_: bpy.types.Object) -> None:
    bpy.context.view_layer.update()
    scene_objects.reveal(object_, bpy.context.view_layer)
    viewport.show_in_local_views(object_)


def _explain(
    scene: bpy.types.Scene,
    object_: bpy.types.Object,
    layer: str,
    ends: tuple[float, float],
    result: Result,
    name: str,
    note: str = "",
) -> None:
    """Stores the legend on the object, where drawing, saving and undo find it."""
    legend = layers.legend(layer, ends, name, result, lambda length: _length_text(scene, length))
    object_[overlay.LEGEND] = json.dumps(replace(legend, note=note or legend.note).as_dict())


def _length_text(scene: bpy.types.Scene, length: float) -> str:
    """A length in scene units as the scene's unit settings want it."""
    units = scene.unit_settings
    if units.system == "NONE":
        return f"{length:.3g}"
    text: str = bpy.utils.units.to_string(
        units.system, "LENGTH", length * units.scale_length, precision=3, split_unit=False
    )
    return text


# --- The painted surface


def paint_surface(scene: bpy.types.Scene) -> None:
    """A copy of the reference's surface in the colors of the chosen layer.

    Raises:
        FMQMError: nothing to show.
    """
    _appear(_build_painted(scene))
    viewport.show_colors()


def _build_painted(scene: bpy.types.Scene) -> bpy.types.Object:
    uid, _, measured = measured_row(scene)
    mesh = measured.comparison.result.patch_mesh
    painted = scene_objects.build_surface(
        scene,
        scene_objects.PAINTED,
        "FMQM Painted",
        mesh.vertices + LIFT * _vertex_normals(mesh.vertices, mesh.triangles),
        mesh.triangles,
        cloud_matrix(measured, look_of(scene).place),
    )
    painted[_UID] = uid
    recolor_painted(scene)
    return painted


def recolor_painted(scene: bpy.types.Scene) -> None:
    """Gives the painted copy, if there is one, the colors and the legend of the chosen layer."""
    painted = scene_objects.find_object(scene, scene_objects.PAINTED)
    measured = _measured_of(painted)
    if painted is None or measured is None:
        return
    look = look_of(scene)
    result, distorted = measured.comparison.result, measured.comparison.distorted
    length = world_length(measured)
    if layers.LAYERS[look.layer].per_patch:
        values = layers.blended_scores(result, look.layer)
    else:
        values = layers.field_values(look.layer, *_fields_of_vertices(painted[_UID], measured), length)
    fitted_to = layers.layer_values(result, look.layer) if layers.LAYERS[look.layer].per_patch else values
    ends = layers.value_range(look.layer, fitted_to, look.range == "FITTED", length)
    scene_objects.recolor(painted, layers.layer_colors(look.layer, values, *ends))
    _explain(scene, painted, look.layer, ends, result, distorted.name)
    viewport.redraw()


def _fields_of_vertices(uid: str, measured: session.Measured) -> tuple[Fields, Fields]:
    """The fields of both surfaces at the painted copy's vertices; of the last row only, since they are large."""
    if uid not in _painted_fields:
        _painted_fields.clear()
        vertices = measured.comparison.result.patch_mesh.vertices
        surfaces = (measured.reference, measured.comparison.distorted)
        _painted_fields[uid] = (fields_at(surfaces[0], vertices), fields_at(surfaces[1], vertices))
    return _painted_fields[uid]


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


# --- Worst places


def focus_patch(scene: bpy.types.Scene, area: bpy.types.Area | None) -> None:
    """Frames the chosen one of the worst patches and shows only its points.

    Raises:
        FMQMError: nothing to show.
    """
    look = look_of(scene)
    uid, _, measured = measured_row(scene)
    cloud = scene_objects.find_object(scene, scene_objects.CLOUD)
    if cloud is None or cloud.get(_UID) != uid:
        cloud = show_cloud(scene)
    else:
        _appear(cloud)
    if not 0 <= look.worst_index < len(look.worst):
        raise FMQMError("the result has no patches")
    patch = look.worst[look.worst_index].patch
    result = measured.comparison.result
    size = look.point_size * POINT * cloud[_SPACING]
    scene_objects.resize(cloud, size, result.samples.patch == patch)
    look.focused = True
    center, diameter, normal = patch_view(result, patch)
    matrix = cloud_matrix(measured, look.place)
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


def choose_worst(look: FMQMLook, index: int) -> None:
    """Sets the index of the list without framing the view, which a click in the list does."""
    global choosing
    choosing = True
    try:
        look.worst_index = index
    finally:
        choosing = False


def _fill_worst(look: FMQMLook, result: Result, uid: str) -> None:
    if look.worst_uid == uid and len(look.worst):
        return
    look.worst.clear()
    for worst in worst_patches(result, WORST_COUNT):
        item = look.worst.add()
        item.name = f"Patch {worst.patch}"
        item.patch, item.score, item.value = worst.patch, worst.score, worst.value
        item.blame = f"{layers.LAYERS[worst.blame].label} {worst.value:.2f}"
    look.worst_uid = uid
    choose_worst(look, 0)


# --- Shells, units, slices


def show_shells(scene: bpy.types.Scene) -> None:
    """Five layers of points at growing distances, colored by NCF.

    Raises:
        FMQMError: nothing to show.
    """
    _appear(_build_shells(scene))
    viewport.show_colors()
    viewport.redraw()


def _build_shells(scene: bpy.types.Scene) -> bpy.types.Object:
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
        cloud_matrix(measured, look.place),
        POINT * float(np.sqrt(area / look.shell_points)),
    )
    object_[_UID] = uid
    object_.hide_select = True
    scene_objects.recolor(object_, colors.astype(np.float64))
    step = world_length(measured) * look.shell_distance / 100
    legend = layers.Legend(
        f"{SHELLS} Shells of {surface.name}",
        f"{_length_text(scene, step)} apart",
        note="colors as in the textures",
    )
    object_[overlay.LEGEND] = json.dumps(legend.as_dict())
    return object_


def show_slice(scene: bpy.types.Scene) -> bpy.types.Object:
    """The slice plane, upright through the middle of the reference, or where the user has put it.

    Raises:
        FMQMError: nothing to show.
    """
    _, _, measured = measured_row(scene)
    into = cloud_matrix(measured, "REFERENCE")
    corners = measured.reference.vertices @ into[:3, :3].T + into[:3, 3]
    low, high = corners.min(axis=0), corners.max(axis=0)
    side = SLICE_SIZE * float((high - low).max())
    matrix = np.eye(4)
    matrix[:3, :3] = side * np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])  # faces the front, -Y
    matrix[:3, 3] = (low + high) / 2
    plane = scene_objects.build_slice(scene, "FMQM Slice", matrix, int(look_of(scene).slice_resolution))
    _appear(plane)
    draw_slice(scene)
    return plane


def draw_slice(scene: bpy.types.Scene) -> None:
    """Draws the chosen field where the slice is now.

    Raises:
        FMQMError: nothing to show.
    """
    plane = scene_objects.find_object(scene, scene_objects.SLICE)
    if plane is None:
        return
    uid, name, measured = measured_row(scene)
    look = look_of(scene)
    resolution = plane.data.size[0]
    to_frame = np.linalg.inv(cloud_matrix(measured, "REFERENCE")) @ np.array(plane.matrix_world, np.float64)
    points = slice_points(to_frame, resolution)
    ref = fields_at(measured.reference, points)
    dist = fields_at(measured.comparison.distorted, points)
    length = world_length(measured)
    values = layers.field_values(look.slice_layer, ref, dist, length)
    ends = layers.value_range(look.slice_layer, values, look.range == "FITTED", length)
    colors = layers.layer_colors(look.slice_layer, values, *ends).copy()
    cut = dist.sdf if look.slice_layer.endswith("COMPARED") else ref.sdf
    colors[_borders((cut < 0).reshape(resolution, resolution)).ravel()] = OUTLINE
    scene_objects.draw_slice(plane, colors)
    plane[_UID], plane[_SLICE_MATRIX] = uid, _flat(plane)
    which = "compared" if look.slice_layer.endswith("COMPARED") else "reference"
    _explain(scene, plane, look.slice_layer, ends, measured.comparison.result, name, f"dark line: {which}")
    viewport.redraw()


def slice_has_moved(scene: bpy.types.Scene) -> bool:
    """Whether the slice is elsewhere than where it was drawn; cheap enough for each drawing of the view."""
    plane = scene_objects.find_object(scene, scene_objects.SLICE)
    return plane is not None and _SLICE_MATRIX in plane and list(plane[_SLICE_MATRIX]) != _flat(plane)


def _flat(object_: bpy.types.Object) -> list[float]:
    return [value for row in object_.matrix_world for value in row]


def _borders(inside: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """(H, W) the pixels whose right or upper neighbor is on the other side."""
    border = np.zeros_like(inside)
    border[:, :-1] |= inside[:, :-1] != inside[:, 1:]
    border[:-1] |= inside[:-1] != inside[1:]
    return border


def show_unit(scene: bpy.types.Scene, sample: int) -> None:
    """The figure of one sample's units, over the viewport.

    Raises:
        FMQMError: nothing to show.
    """
    uid, name, measured = measured_row(scene)
    result = measured.comparison.result
    sample %= len(result.samples.positions)
    unit = unit_of(result, sample)
    pictures = []
    for tangent in (False, True):
        for surface, fields in ((measured.reference, result.ref), (measured.comparison.distorted, result.dist)):
            pixels, inside, dots, members = unit_grid(result, unit, tangent, FIGURE_SIDE)
            colors = np.zeros((FIGURE_SIDE * FIGURE_SIDE, 4), np.float32)
            colors[inside, :3] = fields_at(surface, pixels[inside]).ncf
            colors[inside, 3] = 1.0
            shape = (FIGURE_SIDE, FIGURE_SIDE, 4)
            pictures.append(overlay.UnitPicture(colors.reshape(shape), dots, fields.ncf[members].astype(np.float64)))
    look = look_of(scene)
    matrix = cloud_matrix(measured, look.place)
    lines = unit_lines(result, unit) @ matrix[:3, :3].T + matrix[:3, 3]
    title = f"Sample {sample} of {name}"
    overlay.figure = overlay.UnitFigure(title, tuple(pictures), uid, scene.name, lines)  # type: ignore[arg-type]
    look.unit_sample = sample
    viewport.redraw()


def _follow_unit(scene: bpy.types.Scene) -> None:
    """The figure, if one is shown, becomes that of the chosen row and place."""
    if overlay.figure is not None and overlay.figure.scene == scene.name:
        show_unit(scene, look_of(scene).unit_sample)


def step_unit(scene: bpy.types.Scene, step: int) -> None:
    """The figure of the sample so many of the metric's color units after the last one; in the patch that is
    shown alone, if one is.

    Raises:
        FMQMError: nothing to show.
    """
    _, _, measured = measured_row(scene)
    samples, look = measured.comparison.result.samples, look_of(scene)
    wanted = samples.unit
    if look.focused and look.worst_index < len(look.worst):
        wanted = wanted & (samples.patch == look.worst[look.worst_index].patch)
    units = np.flatnonzero(wanted)
    place = int(np.searchsorted(units, look.unit_sample))
    if overlay.figure is None or place == len(units) or units[place] != look.unit_sample:
        step = min(step, 0)  # nothing of these is shown yet: the next one is the one at this place
    show_unit(scene, int(units[(place + step) % len(units)]))


def nearest_sample(
    scene: bpy.types.Scene,
    region: bpy.types.Region,
    view: bpy.types.RegionView3D,
    at: tuple[float, float],
    reach: float,
) -> int | None:
    """The sample below a place of a view: of those within reach, in pixels, the foremost."""
    _, _, measured = measured_row(scene)
    matrix = np.array(view.perspective_matrix, np.float64) @ cloud_matrix(measured, look_of(scene).place)
    positions = measured.comparison.result.samples.positions
    projected = positions @ matrix[:, :3].T + matrix[:, 3]
    depth = projected[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (projected[:, 0] / depth + 1) / 2 * region.width - at[0]
        y = (projected[:, 1] / depth + 1) / 2 * region.height - at[1]
        near = np.flatnonzero((depth > 0) & (x * x + y * y < reach * reach))
    if not near.size:
        return None
    front = projected[near, 2] / depth[near]
    return int(near[front.argmin()])


# --- Away with it


def clear() -> int:
    """Removes all of it from the file and gives the views their settings back; how many data-blocks there were."""
    overlay.figure = None
    _painted_fields.clear()
    for scene in bpy.data.scenes:
        look_of(scene).focused = False
    count = scene_objects.clear()
    viewport.restore_colors()
    viewport.redraw()
    return count


def settle_colors() -> None:
    """After undo and redo, which leave the views' settings as they are: these follow what is shown now."""
    if not scene_objects.anything_colored():
        viewport.restore_colors()
    elif not viewport.colors_changed():  # else they are what they were, but for what the user has chosen since
        viewport.show_colors()


def anything() -> bool:
    return overlay.figure is not None or scene_objects.anything() or viewport.colors_changed()
