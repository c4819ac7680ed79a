# SPDX-License-Identifier: GPL-3.0-or-later
"""The loupe's three pictures: Original, LOD and heat map from one camera, as the report is drawn."""

from __future__ import annotations

from typing import NamedTuple

from ...metric.geometry import Floats, Ints
from ...metric.stepper import Work, as_part
from ...report.render import Camera, Pixels, rendering
from ...report.visual.heat_map import patches_at
from .. import session

FIRST, SECOND = 64, 256  # pixels a side of the pictures that are there soon; the last are as large as on the screen


class Panes(NamedTuple):
    """(side, side, 3) uint8 pictures of one place."""

    original: Pixels
    lod: Pixels
    heat: Pixels


def sides(last: int) -> list[int]:
    """Pixels a side of the pictures that are drawn one after the other, coarse to fine."""
    return [side for side in (FIRST, SECOND) if side < last] + [last]


def drawing(measured: session.Measured, camera: Camera, side: int, colors: Floats) -> Work[Panes]:
    """The pictures of a place, in steps of some milliseconds.

    Args:
        camera: in the metric's frame. side: pixels.
        colors: (P + 1, 3) encoded, of the patches, and of what none covers.
    """
    reference, lod, result = measured.reference, measured.comparison.distorted, measured.comparison.result

    def paint(_: Ints, points: Floats, __: Floats) -> Floats:
        return colors[patches_at(points, result, result.ref)]

    size = (side, side)
    original, heat = yield from as_part(rendering(reference, camera, size, (None, paint)), 0.0, 0.6)
    (other,) = yield from as_part(rendering(lod, camera, size, (None,)), 0.6, 0.4)
    return Panes(original, other, heat)
