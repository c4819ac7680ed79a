# SPDX-License-Identifier: GPL-3.0-or-later
"""The fields of a surface away from the samples: on shells above it and on a plane through it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...metric.fields import Fields, evaluate_fields
from ...metric.geometry import Floats, Ints, morton_order, triangle_normals
from ...metric.sampling import draw_barycentric, triangles_evenly
from ...metric.stepper import finish
from ...metric.surface import Surface

SHELLS = 5  # as in the supplement's figure


def fields_at(surface: Surface, points: Floats) -> Fields:
    """The fields of a surface at (N, 3) points of the metric's frame, at once."""
    return finish(evaluate_fields(surface, points, morton_order(points)))


@dataclass(frozen=True)
class Shells:
    """Points at growing distances above a surface.

    Attributes:
        positions: (SHELLS n, 3), shell after shell, metric's frame. shell: (SHELLS n,) which.
        normals: (SHELLS n, 3) of the surface below.
    """

    positions: Floats
    shell: Ints
    normals: Floats


def shell_points(surface: Surface, count: int, distance: float, seed: int = 0) -> Shells:
    """The supplement's figure of NCF diffusion: the same count places in every shell, even over the area.

    Args:
        count: of each shell. distance: between shells in units of the frame; the first is the surface.
    """
    rng = np.random.default_rng(seed)
    areas = surface.areas
    corners = surface.triangles[triangles_evenly(areas, np.full(count, rng.random()))]
    base = np.einsum("nk,nkc->nc", draw_barycentric(rng, count), surface.vertices[corners])
    normals = triangle_normals(surface.vertices, corners)
    positions = np.concatenate([base + k * distance * normals for k in range(SHELLS)])
    return Shells(positions, np.repeat(np.arange(SHELLS), count), np.tile(normals, (SHELLS, 1)))


def slice_points(to_frame: Floats, resolution: int) -> Floats:
    """(resolution^2, 3) centers of the pixels of a square from -0.5 to 0.5 in its X and Y, rows upwards.

    Args:
        to_frame: (4, 4) from the square's own space to the metric's frame.
    """
    place = (np.arange(resolution) + 0.5) / resolution - 0.5
    x, y = np.meshgrid(place, place)
    local = np.stack([x.ravel(), y.ravel(), np.zeros(x.size), np.ones(x.size)], axis=1)
    points: Floats = local @ to_frame[:3].T
    return points
