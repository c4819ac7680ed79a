# SPDX-License-Identifier: GPL-3.0-or-later
"""The figure of one sample's normal and tangent unit."""

from __future__ import annotations

import bpy
import numpy as np

from ...blender.display import viewport
from ...report.visual.shells import fields_at
from ...report.visual.units import unit_grid, unit_lines, unit_of
from . import overlay
from .result import look_of, measured_row, world_matrix

FIGURE_SIDE = 48  # pixels of one picture of the figure of units


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
    matrix = world_matrix(measured, look.place)
    lines = unit_lines(result, unit) @ matrix[:3, :3].T + matrix[:3, 3]
    title = f"Sample {sample} of {name}"
    overlay.figure = overlay.UnitFigure(title, tuple(pictures), uid, scene.name, lines)  # type: ignore[arg-type]
    look.unit_sample = sample
    viewport.redraw()


def follow_unit(scene: bpy.types.Scene) -> None:
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
    matrix = np.array(view.perspective_matrix, np.float64) @ world_matrix(measured, look_of(scene).place)
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
