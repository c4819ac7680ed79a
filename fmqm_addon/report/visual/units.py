# SPDX-License-Identifier: GPL-3.0-or-later
"""The units that the metric draws around a sample: their samples, and pictures through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...metric.evaluation import Result
from ...metric.features import find_pairs, unit_cosine
from ...metric.geometry import Floats, Ints, dot
from .axes import plane_axes


@dataclass(frozen=True)
class Unit:
    """The normal unit and the tangent unit of one sample.

    Attributes:
        sample: its index. normal, tangent: (n,) indices of the samples in its units, itself first.
        axis: (3,) unit vector along p - p_n (Z where p = p_n).
        radius: of the units, in the metric's frame.
    """

    sample: int
    normal: Ints
    tangent: Ints
    axis: Floats
    radius: float


def unit_of(result: Result, sample: int) -> Unit:
    """Equations (10) and (11): the units that the metric draws around a sample."""
    samples, settings = result.samples, result.settings
    row = int(samples.patch[sample])
    first, last = samples.start[row : row + 2].tolist()
    diagonal = result.patches[row].diagonal
    positions = samples.positions[first:last] / diagonal
    towards = result.ref.nearest[first:last] / diagonal - positions
    drawn = np.array([sample - first])
    pairs = find_pairs(positions, drawn, settings.radius)
    along = unit_cosine(pairs, drawn, towards)
    itself = np.array([sample])
    away = -towards[sample - first]
    length = float(np.linalg.norm(away))
    axis = away / length if length > 0 else np.array([0.0, 0.0, 1.0])
    return Unit(
        sample=sample,
        normal=np.concatenate([itself, pairs.other[along > settings.normal_threshold] + first]),
        tangent=np.concatenate([itself, pairs.other[along < settings.tangent_threshold] + first]),
        axis=axis,
        radius=float(settings.radius * diagonal),
    )


def unit_grid(result: Result, unit: Unit, tangent: bool, side: int) -> tuple[Floats, NDArray[np.bool_], Floats, Ints]:
    """A picture through a unit: the tangent plane seen from above, or a cut along the normal, which points up.

    Args:
        side: pixels of the square picture, which the unit's radius fills.

    Returns:
        (side^2, 3) places of the pixels, rows upwards, metric's frame; (side^2,) which lie in the unit;
        (n, 2) the unit's samples in the picture, in [-1, 1], and their (n,) indices.
    """
    right, up = plane_axes(unit.axis)
    members = unit.tangent if tangent else unit.normal
    across = up if tangent else unit.axis
    place = (np.arange(side) + 0.5) * (2 / side) - 1
    x, y = (grid.ravel() for grid in np.meshgrid(place, place))
    center = result.samples.positions[unit.sample]
    pixels = center + unit.radius * (x[:, None] * right + y[:, None] * across)
    distance = np.hypot(x, y)
    inside = distance < 1
    offset = (result.samples.positions[members] - center) / unit.radius
    if tangent:
        return pixels, inside, np.stack([offset @ right, offset @ up], axis=1), members
    inside &= np.abs(y) > result.settings.normal_threshold * distance
    height = offset @ unit.axis
    sideways = np.sqrt(np.maximum(dot(offset, offset) - height * height, 0)) * np.where(offset @ right < 0, -1, 1)
    return pixels, inside, np.stack([sideways, height], axis=1), members


def unit_lines(result: Result, unit: Unit, steps: int = 48) -> Floats:
    """(m, 2, 3) lines that mark a unit: the rim of its tangent disc, and the way from p to p_n."""
    right, up = plane_axes(unit.axis)
    center = result.samples.positions[unit.sample]
    angle = np.linspace(0, 2 * np.pi, steps + 1)[:, None]
    rim = center + unit.radius * (np.cos(angle) * right + np.sin(angle) * up)
    lines = np.stack([rim[:-1], rim[1:]], axis=1)
    way = np.stack([center, result.ref.nearest[unit.sample]])[None]
    return np.concatenate([lines, way])
