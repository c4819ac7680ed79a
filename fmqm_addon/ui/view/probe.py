# SPDX-License-Identifier: GPL-3.0-or-later
"""What the heat map says below the mouse."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from bpy_extras.view3d_utils import region_2d_to_origin_3d, region_2d_to_vector_3d

from ...comparison.judge import Judge
from ...report.numbers import score_text
from ...report.visual import layers
from ...report.visual.heat_map import UNCOVERED, patches_at
from .. import session
from ..properties.rows import active_row
from . import heat


@dataclass(frozen=True)
class Probed:
    """A place of one of the two surfaces. patch: the nearest, or heat_map.UNCOVERED."""

    on_original: bool
    patch: int


def probe(
    scene: bpy.types.Scene, region: bpy.types.Region, view: bpy.types.RegionView3D, at: tuple[float, float]
) -> Probed | None:
    """The foremost place of the two surfaces at a place of a view; None beside them, or where nothing is shown."""
    shown, row = heat.shown_in(scene), active_row(scene)
    measured = None if shown is None else session.get(shown.uid)
    if shown is None or row is None or measured is None:
        return None
    origin, direction = region_2d_to_origin_3d(region, view, at), region_2d_to_vector_3d(region, view, at)
    found: list[tuple[float, Probed]] = []
    for part in shown.parts:
        surface, result, fields = heat.surface_at(measured, part.place)
        matrix = heat.placed(measured, part.place, heat.members_at(row, part.place))
        back = matrix.inverted_safe()
        start, towards = back @ origin, back.to_3x3() @ direction
        towards.normalize()
        triangle, distance = surface.query.first_hit(np.array([start]), np.array([towards]))
        if triangle[0] < 0:
            continue
        hit = start + towards * float(distance[0])
        patch = int(patches_at(np.array([hit]), result, fields)[0])
        depth = (matrix @ hit - origin).dot(direction)
        found.append((depth, Probed(part.place == heat.ORIGINAL, patch)))
    return min(found, key=lambda each: each[0])[1] if found else None


def lines_of(scene: bpy.types.Scene, probed: Probed) -> list[str]:
    """What to say of a place: its score by the judge, and the four features."""
    shown = heat.shown_in(scene)
    measured = None if shown is None else session.get(shown.uid)
    if measured is None:
        return []
    where = "Original" if probed.on_original else "LOD"
    if probed.patch == UNCOVERED:
        return [f"{where}: not measured here"]
    result, judge = measured.comparison.result, Judge[scene.fmqm.judge]
    values = {name: result.of_patches(name)[probed.patch] for name in (judge.column, *judge.features)}
    scores = [f"{layers.LAYERS[name].label} {score_text(value, places=3)}" for name, value in values.items()]
    return [f"{where}, patch {probed.patch}", *scores]
