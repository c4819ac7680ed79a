# SPDX-License-Identifier: GPL-3.0-or-later
"""The heat map of a pair in pictures: the colors of its patches, and the side from which most of the loss is seen."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..comparison.judge import Judge
from ..metric.evaluation import Result
from ..metric.geometry import Floats, Ints
from ..metric.queries import opened
from ..metric.surface import Surface
from .render import AZIMUTH, BACKGROUND, ELEVATION, HIDDEN_BEHIND, direction_towards
from .visual.colormap import score_colors
from .visual.heat_map import UNCOVERED, fitted_range, patches_at
from .visual.worst import patch_view

DIMMED = 0.25  # how much of its own color a place keeps that no scored patch covers; the rest is the background's
FRONT = (AZIMUTH, ELEVATION)
_TURNS, _ELEVATIONS = 8, (ELEVATION, 50.0, -25.0)  # sides that are looked from: so many turns, at each elevation
_ENOUGH = 0.9  # of the loss that can be seen from the best side: then the front is as good
_BEFORE = 2.0  # diagonals; rays to a patch begin so far before it


@dataclass(frozen=True)
class Heat:
    """How a reference is painted by the scores of its patches.

    Attributes:
        surface: the reference. result: of the pair. values: (P,) the judge's scores of the patches.
        low, high: the scores at the ends of the colors, as in the window.
    """

    surface: Surface
    result: Result
    values: Floats
    low: float
    high: float

    @property
    def has_gaps(self) -> bool:
        """Whether only some of the patches were scored, so that places are dimmed."""
        return len(self.result.patches) < self.result.settings.patches

    def paint(self, triangle: Ints, points: Floats, barycentric: Floats) -> Floats:
        """The color of the nearest patch, or the surface's own, dimmed, where none was scored; a render.Paint."""
        patch = patches_at(points, self.result, self.result.ref)
        colors = score_colors((self.values - self.low) / (self.high - self.low))[patch]
        bare = np.flatnonzero(patch == UNCOVERED)
        own = np.clip(self.surface.color_at(triangle[bare], barycentric[bare]), 0, 1)
        colors[bare] = DIMMED * own + (1 - DIMMED) * np.array(BACKGROUND) / 255
        return colors


def heat_of(reference: Surface, result: Result, judge: Judge) -> Heat:
    """The heat map of a pair by a judge's scores."""
    values = result.of_patches(judge.column)
    return Heat(reference, result, values, *fitted_range(values))


def side_of_loss(reference: Surface, result: Result, judge: Judge) -> tuple[float, float]:
    """Azimuth and elevation from which most of the loss can be seen, as Camera.framing has them.

    Loss is what patches lack to 1, by their area as it is seen from there. Where the front shows about as much it is
    FRONT; where a side at its height does, that.
    """
    patches = range(len(result.patches))
    normals = np.array([patch_view(result, patch)[2] for patch in patches])
    loss = np.maximum(1 - result.of_patches(judge.column), 0) * [patch.area for patch in result.patches]
    rings = [[(AZIMUTH + turn * 360 / _TURNS, elevation) for turn in range(_TURNS)] for elevation in _ELEVATIONS]
    sides = sum(rings, [FRONT])
    towards = np.array([direction_towards(*side) for side in sides])
    facing = np.maximum(normals @ towards.T, 0)
    ahead = np.argwhere(facing > 0)
    directions = -towards[ahead[:, 1]]
    with opened(reference.query):
        _, hit = reference.query.first_hit(result.patch_centers[ahead[:, 0]] - _BEFORE * directions, directions)
    seen = np.zeros_like(facing)
    seen[ahead[:, 0], ahead[:, 1]] = hit > _BEFORE - HIDDEN_BEHIND
    shown = loss @ (facing * seen)
    for first, last in pairwise((0, 1, *(1 + _TURNS * number for number in range(1, len(rings) + 1)))):
        best = first + int(shown[first:last].argmax())
        if shown[best] >= _ENOUGH * shown.max():
            break
    return sides[best]
