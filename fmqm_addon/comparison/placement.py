# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a mesh fits its reference, judged by points on it: how far they are from the reference, and in which colors.

Boxes tell when something stands elsewhere, not which way it faces. The points are few, and the reference's index is
there anyway, so that all quarter turns can be tried in a fraction of a measurement's time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..metric.geometry import Floats, Ints, closest_on_triangles, cross
from ..metric.surface import MeshArrays, Surface

POINTS = 400  # that decide; the first FEW of them leave out what cannot be it
FEW = 80
SEED = 0
FINE_DISTANCE = 0.004  # mean, in the reference's diagonals; nothing is looked for where distance and color are below
FINE_COLOR = 0.04  # mean absolute difference of channels in [0, 1]
NEARER = 4.0  # times, for a far better place by distance
LIKER = 3.0  # times, for one by color
WORSE_COLOR = 0.02  # by which the colors may differ more where the distance is far better
WORSE_DISTANCE = 1.25  # times, the other way round
TIE = 0.1  # of the cost; within it the first of the candidates is taken
_KEPT = 8  # candidates that all points are asked about
_DISTANCE_WEIGHT = 10.0  # a tenth of the diagonal costs as much as black for white


@dataclass(frozen=True)
class Points:
    """Points of a mesh.

    Attributes:
        positions: (N, 3) float64 in the mesh's own frame. colors: (N, 3) float64 sRGB in [0, 1].
    """

    positions: Floats
    colors: Floats


@dataclass(frozen=True)
class Fit:
    """How well a mesh fits its reference: mean distance in the reference's diagonals, mean difference in color."""

    distance: float
    color: float

    @property
    def is_fine(self) -> bool:
        return self.distance <= FINE_DISTANCE and self.color <= FINE_COLOR

    @property
    def cost(self) -> float:
        return _DISTANCE_WEIGHT * self.distance + self.color

    def is_far_better_than(self, other: Fit) -> bool:
        """Whether one of the two is far better, and the other not worse."""
        nearer = other.distance > FINE_DISTANCE and self.distance * NEARER <= other.distance
        liker = other.color > FINE_COLOR and self.color * LIKER <= other.color
        return (nearer and self.color <= other.color + WORSE_COLOR) or (
            liker and self.distance <= max(other.distance * WORSE_DISTANCE, FINE_DISTANCE)
        )


def turns() -> dict[str, Floats]:
    """The 24 turns that map axes to axes as (3, 3) exact matrices, the simplest names first; "" is none."""
    quarter = {
        "X": np.array([(1.0, 0, 0), (0, 0, -1), (0, 1, 0)]),
        "Y": np.array([(0.0, 0, 1), (0, 1, 0), (-1, 0, 0)]),
        "Z": np.array([(0.0, -1, 0), (1, 0, 0), (0, 0, 1)]),
    }
    single = {
        f"{degrees} degrees about {axis}": np.linalg.matrix_power(quarter[axis], power).round() + 0.0
        for degrees, power in ((90, 1), (-90, 3), (180, 2))
        for axis in "XYZ"
    }
    found = {"": np.eye(3), **single}
    for (first, one), (second, other) in product(single.items(), single.items()):
        if not any(np.array_equal(other @ one, known) for known in found.values()):
            found[f"{first}, then {second}"] = other @ one
    return found


TURNS = turns()
MIRRORS = {axis: np.diag([-1.0 if axis == each else 1.0 for each in "XYZ"]) for axis in "XYZ"}


def points_on(mesh: MeshArrays, count: int) -> Points:
    """Points spread over a mesh's area, the same ones each time; none where it has no area."""
    generator = np.random.default_rng(SEED)
    a, b, c = (mesh.positions[mesh.triangles[:, k]] for k in range(3))
    with np.errstate(all="ignore"):  # what is not finite is left out
        area = np.linalg.norm(cross(b - a, c - a), axis=1)
        area[~np.isfinite(area)] = 0.0
        total = area.sum()
    if not 0 < total < np.inf:
        return Points(np.zeros((0, 3)), np.zeros((0, 3)))
    # At even steps of the area, so that no part gets too few; then mixed, so that the first few are spread as well.
    steps = (generator.permutation(count) + generator.random(count)) / count
    chosen = np.searchsorted(np.cumsum(area), steps * total).clip(max=len(area) - 1)
    chosen = chosen[area[chosen] > 0]
    u, v = np.sqrt(generator.random(len(chosen))), generator.random(len(chosen))
    weights = np.stack([1 - u, u * (1 - v), u * v], axis=1)
    positions = np.einsum("nk,nkc->nc", weights, mesh.positions[mesh.triangles[chosen]])
    values = np.einsum("nk,nkc->nc", weights, np.nan_to_num(np.asarray(mesh.corners[chosen], np.float64)))
    colors = np.zeros((len(chosen), 3))
    for index in np.unique(mesh.material[chosen]):
        here = mesh.material[chosen] == index
        colors[here] = mesh.materials[index].color.lookup(values[here])
    return Points(positions, colors)


def fit(points: Points, matrix: Floats, reference: Surface, count: int | None = None) -> Fit:
    """How the first points fit the prepared reference where a (4, 4) matrix takes them to its world."""
    positions, colors = points.positions[:count], points.colors[:count]
    if not len(positions):
        return Fit(0.0, 0.0)
    placed = reference.frame.enter(positions @ matrix[:3, :3].T + matrix[:3, 3])
    nearest, triangle, weights = nearest_on(placed, reference)
    distance = np.linalg.norm(nearest - placed, axis=1)
    return Fit(float(distance.mean()), float(np.abs(reference.color_at(triangle, weights) - colors).mean()))


def nearest_on(placed: Floats, reference: Surface) -> tuple[Floats, Ints, Floats]:
    """(N, 3) nearest points of a surface, (N,) their triangles and (N, 3) their places there; all in its frame."""
    triangle = reference.query.nearest(placed, None)
    corners = reference.vertices[reference.triangles[triangle]]
    nearest, weights = closest_on_triangles(placed, corners[:, 0], corners[:, 1], corners[:, 2])
    return nearest, triangle, weights


def best_place(candidates: Sequence[Floats], now: Fit, points: Points, reference: Surface) -> tuple[int, Fit] | None:
    """The candidate that fits far better than what there is now, by its number; None if none does.

    Args:
        candidates: (4, 4) matrices to the reference's world, what is preferred among equals first.
    """
    roughly = [fit(points, matrix, reference, FEW).cost for matrix in candidates]
    kept = sorted(np.argsort(roughly, kind="stable")[:_KEPT].tolist())
    fits = {number: fit(points, candidates[number], reference) for number in kept}
    better = {number: found for number, found in fits.items() if found.is_far_better_than(now)}
    if not better:
        return None
    least = min(found.cost for found in better.values())
    return next((number, found) for number, found in better.items() if found.cost <= least * (1 + TIE) + 1e-6)


def mirrored(matrices: Sequence[Floats], center: Floats) -> list[tuple[str, Floats]]:
    """What (4, 4) matrices place, mirrored about a (3,) center: the first along each axis, the others along one.

    A mirror along another axis is one along X and a turn; a matrix for each turn gives them all.
    """
    found = []
    for axis, mirror in MIRRORS.items():
        for matrix in matrices if axis == "X" else matrices[:1]:
            result = matrix.copy()
            result[:3] = mirror @ matrix[:3]
            result[:3, 3] += center - mirror @ center
            found.append((axis if matrix is matrices[0] else "", result))
    return sorted(found, key=lambda each: not each[0])
