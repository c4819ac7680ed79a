# SPDX-License-Identifier: GPL-3.0-or-later
"""Perceived quality: a second reading of the samples that FMQM is computed from. Lengths are in patch diagonals L.

Not the paper's: four features in the place of its four, with constants that no setting changes (docs/perceived.md).
Equal inputs cancel exactly, as in the paper's features: both sides of a ratio come from the same sums.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .features import Around, FieldValues, Pairs, means, moments
from .geometry import Floats, Ints, cross, dot


class Perceived(NamedTuple):
    """Perceived quality of a pair and what it is made of, each in [0, 1]; 1 is a mesh against itself."""

    score: float
    shape: float
    facing: float
    color: float
    detail: float
    p10: float  # of the score, over the patches


PERCEIVED_COLUMNS = ("shape", "facing", "color", "detail", "perceived")  # of a patch

RADIUS = 0.125  # of the color units, in L: about 96 samples, enough for moments
C1, C2 = 0.01**2, 0.03**2  # SSIM's constants for colors in [0, 1]: contrast below them is not seen
K = 4 * C2 / RADIUS**2  # C2 as a squared slope over a disc of that radius
RIDGE = 1e-5  # L^2, added to the variances of positions: a unit that lies in a plane has no slope across it
LOW_PERCENTILE = 10


def perceived_of_patches(
    positions: Floats, start: Ints, ref: FieldValues, dist: FieldValues, units: Ints, near: Pairs, around: Around
) -> Floats:
    """(G, 5) shape, facing, color, detail and perceived of some patches, each in [0, 1].

    Args:
        positions: (n, 3) samples, patch after patch, each in its own patch's diagonals.
        start: (G + 1,) patch k is start[k] : start[k + 1].
        ref, dist: the fields there; their channels are sRGB in [0, 1]. dist.sdf counts without its sign.
        units: ascending indices of the drawn color units.
        near: all pairs within RADIUS, each unit with itself among them. around: colors_around them.
    """
    to_ref, to_dist = ref.nearest - positions, dist.nearest - positions
    sdf_d = side(ref.sdf) * side(dot(to_ref, to_dist)) * np.abs(dist.sdf)
    facing = facing_similarity(to_ref, to_dist)
    color, detail = color_similarities(near, around)

    drawn = np.searchsorted(units, start)
    table = np.empty((len(start) - 1, 5))
    table[:, 0] = shape_similarity(ref.sdf, sdf_d, start)
    table[:, 1] = means(facing, start)
    for column, of_units in ((2, color), (3, detail)):
        table[:, column] = np.add.reduce(means(of_units, drawn), axis=0) / len(of_units)
    table[:, 4] = table[:, :4].prod(axis=1) ** 0.25
    return table


def perceived_of_pair(table: Floats) -> Perceived:
    """Means over the patches of perceived_of_patches' (P, 5) table."""
    shape, facing, color, detail, score = table.mean(axis=0).tolist()
    return Perceived(score, shape, facing, color, detail, low_percentile(table[:, -1]))


def low_percentile(of_patches: Floats) -> float:
    """The 10th percentile of (P,) scores, linear between ranks: worst places count for people."""
    return float(np.percentile(of_patches, LOW_PERCENTILE))


def side(values: Floats) -> Floats:
    """(n,) -1.0 below 0, else 1.0."""
    return np.where(values < 0, -1.0, 1.0)


def likeness(product: Any, squares: Any, constant: Any) -> Any:
    """max(0, (2 a b + c) / (a^2 + b^2 + c)), from a b and a^2 + b^2; moments of second order count as these."""
    return np.clip((2 * product + constant) / (squares + constant), 0.0, 1.0)


def shape_similarity(sdf_r: Floats, sdf_d: Floats, start: Ints) -> Floats:
    """(G,) cube root of M S C over the samples of each patch: a mean counts on the scale of the spread.

    S C = 2 sqrt(v_r v_d) / (v_r + v_d) max(0, cov / sqrt(v_r v_d)) is a likeness too: the roots cancel. Where either
    has no spread, they are alike if they are equal.
    """
    (mean_r, mean_d), (var_r, var_d, cov) = moments(sdf_r, sdf_d, start)
    flat, equal = (var_r == 0) | (var_d == 0), (var_r == var_d) & (mean_r == mean_d)
    spread = np.where(flat, 1.0, var_r + var_d)
    mean = likeness(mean_r * mean_d, mean_r * mean_r + mean_d * mean_d, spread)
    return np.where(flat, equal, np.cbrt(mean * likeness(cov, spread, 0.0)))


def facing_similarity(to_ref: Floats, to_dist: Floats) -> Floats:
    """(n,) 1 for the same line towards both surfaces, 0 for lines at right angles, linear in the angle between.

    Args:
        to_ref, to_dist: (n, 3) p_n - p. A sample on either surface counts 1.
    """
    across = cross(to_ref, to_dist)
    angle = np.arctan2(np.sqrt(dot(across, across)), np.abs(dot(to_ref, to_dist)))
    return 1 - angle / (np.pi / 2)


def color_similarities(near: Pairs, around: Around) -> tuple[Floats, Floats]:
    """(C, units) color, from the moments of colors over each unit, and (C, units) detail, from their slopes.

    Args:
        near: pairs, each unit with itself among them. around: colors_around them.
    """
    count, n_units = near.count, len(near.count)
    first = np.cumsum(count) - count
    scratch = np.empty(len(near.other))  # products come and go in one place, which stays in the cache

    def mean(rows: Sequence[Floats] | Floats, times: Sequence[Floats] | Floats) -> Floats:
        """(k, units) means over each unit of (k, m) values times others."""
        sums = np.empty((len(rows), n_units))
        for total, row, other in zip(sums, rows, times, strict=True):
            np.add.reduceat(np.multiply(row, other, out=scratch), first, out=total)
        return sums / count

    offset = near.offset.T
    mean_offset = np.add.reduceat(offset, first, axis=1) / count
    seconds = mean([offset[i] for i, _ in _HALF], [offset[j] for _, j in _HALF])
    fit = _inverse(
        {
            (i, j): second - mean_offset[i] * mean_offset[j] + RIDGE * (i == j)
            for (i, j), second in zip(_HALF, seconds, strict=True)
        }
    )

    def slope(values: Floats, mean_value: Floats) -> list[Floats]:
        cov = [
            mean(values, [axis] * len(values)) - mean_axis * mean_value
            for axis, mean_axis in zip(offset, mean_offset, strict=True)
        ]
        return [a * cov[0] + b * cov[1] + c * cov[2] for a, b, c in fit]

    r, d = around.ref, around.dist
    mean_r, mean_d = (np.add.reduceat(values, first, axis=1) / count for values in (r, d))
    variances = (mean(r, r) - mean_r * mean_r) + (mean(d, d) - mean_d * mean_d)
    contrast = likeness(mean(r, d) - mean_r * mean_d, variances, C2)
    color = _of_vectors([around.center_ref + mean_r], [around.center_dist + mean_d], C1) * contrast
    return color, _of_vectors(slope(r, mean_r), slope(d, mean_d), K)


def _of_vectors(a: list[Floats], b: list[Floats], constant: float) -> Floats:
    """Likeness of vectors, given by their components."""

    def product(u: list[Floats], v: list[Floats]) -> Any:
        return sum(x * y for x, y in zip(u, v, strict=True))

    return likeness(product(a, b), product(a, a) + product(b, b), constant)


_HALF = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def _inverse(entry: dict[tuple[int, int], Floats]) -> list[tuple[Floats, Floats, Floats]]:
    """The rows of the inverses of symmetric positive definite 3 x 3 matrices, from their entries in _HALF."""
    xx, xy, xz, yy, yz, zz = (entry[place] for place in _HALF)
    a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy  # cofactors
    d, e, f = xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy
    det = xx * a + xy * b + xz * c
    return [(a / det, b / det, c / det), (b / det, d / det, e / det), (c / det, e / det, f / det)]
