# SPDX-License-Identifier: GPL-3.0-or-later
"""The four similarities of a patch (V-E). Positions and distances are in patch diagonals L here.

Equal inputs cancel exactly: sa sb is sqrt(va vb) with variances, a squared cosine is
(a.b)^2 / (a.a b.b); a patch against itself scores 1, not nearly 1.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import Floats, Ints, dot, first_of_each
from .settings import Settings

EPSILON_SDF = 1e-12  # V-E1: decides 0/0 as 1
EPSILON_COLOR = 1e-10  # V-E3: the same
EPSILON_GRADIENT = 1e-10  # V-E4: the paper's epsilon
ROUGH = 1e-5  # relative to the patch: far above float32 rounding of squared distances
SAME_COLOR = 1e-6  # V-E4: color differences up to this count as none
_ALONE = 200_000  # multiplications of a product that no BLAS shares among threads: OpenBLAS does from 262,144 on


@dataclass(frozen=True)
class FieldValues:
    """One mesh's fields at n samples: nearest (n, 3) and sdf (n,) in patch diagonals, channels (n, C)."""

    nearest: Floats
    sdf: Floats
    channels: Floats


def features_of_patches(
    positions: Floats,
    start: Ints,
    ref: FieldValues,
    dist: FieldValues,
    units: Ints,
    pairs: Pairs,
    around: Around,
    weights: Floats,
    settings: Settings,
) -> Floats:
    """(G, 4) geoSSIM, geoGraSSIM, colorSSIM, colorGraSSIM of some patches, each in [0, 1].

    Several patches at once share the cost of numpy's calls; none looks at another's samples.

    Args:
        positions: (n, 3) samples, patch after patch, each in its own patch's diagonals.
        start: (G + 1,) patch k is start[k] : start[k + 1].
        units: ascending indices of the drawn color units. weights: (C,) of the channels.
        pairs: pairs_of_patches within settings.radius; those of p with what lies at its place count for nothing.
        around: colors_around them.
    """
    to_ref, to_dist = ref.nearest - positions, dist.nearest - positions
    along = unit_cosine(pairs, units, to_ref)
    normal = similarity_of_units(pairs, np.flatnonzero(along > settings.normal_threshold), around)
    in_plane = np.flatnonzero(along < settings.tangent_threshold)
    tangent = similarity_of_units(pairs, in_plane, around)

    if settings.gradient_radius != settings.radius:
        pairs = pairs_of_patches(positions, start, units, settings.gradient_radius)
        around = colors_around(pairs, units, ref.channels, dist.channels)
        in_plane = np.flatnonzero(unit_cosine(pairs, units, to_ref) < settings.tangent_threshold)
    gradient_r = color_gradient(pairs, in_plane, around.ref)
    in_plane = np.flatnonzero(unit_cosine(pairs, units, to_dist) < settings.tangent_threshold)
    gradient_d = color_gradient(pairs, in_plane, around.dist)

    drawn = np.searchsorted(units, start)
    columns = (
        geometry_similarity(ref.sdf, dist.sdf, start),
        geometry_gradient_similarity(to_ref, to_dist, start),
        np.sqrt(_pool(means(normal, drawn), weights) * _pool(means(tangent, drawn), weights)),
        gradient_similarity(gradient_r, gradient_d, drawn, weights),
    )
    return np.stack(columns, axis=1)


def means(values: Floats, start: Ints) -> Floats:
    """(..., G) means of (..., n) values over patches, of which the k-th is start[k] : start[k + 1]."""
    sums = [np.add.reduce(values[..., here], axis=-1) for here in _slices(start)]
    return np.asarray(np.stack(sums, axis=-1) / (start[1:] - start[:-1]))


def similarity(mean_r: Any, mean_d: Any, var_r: Any, var_d: Any, cov: Any, epsilon: float) -> Any:
    """Equations (15) to (18), and (22) to (25): cube root of mean, deviation and covariance similarity."""
    std_product = np.sqrt(var_r * var_d)
    mean = np.abs(2 * mean_r * mean_d + epsilon) / (mean_r * mean_r + mean_d * mean_d + epsilon)
    std = (2 * std_product + epsilon) / (var_r + var_d + epsilon)
    covariance = np.minimum(1.0, (np.abs(cov) + epsilon) / (std_product + epsilon))
    return np.cbrt(np.minimum(1.0, mean * std * covariance))


def geometry_similarity(sdf_r: Floats, sdf_d: Floats, start: Ints) -> Floats:
    """(G,) equations (15) to (18) over the samples of each patch, from population moments."""
    (mean_r, mean_d), (var_r, var_d, cov) = moments(sdf_r, sdf_d, start)
    return np.asarray(similarity(mean_r, mean_d, var_r, var_d, cov, EPSILON_SDF))


def moments(sdf_r: Floats, sdf_d: Floats, start: Ints) -> tuple[Floats, Floats]:
    """(2, G) means of two values over the samples of each patch, and (3, G) their variances and covariance."""
    both = np.stack([sdf_r, sdf_d])
    mean = means(both, start)
    r, d = both - mean.repeat(np.diff(start), axis=1)
    return mean, means(np.stack([r * r, d * d, r * d]), start)


def geometry_gradient_similarity(to_ref: Floats, to_dist: Floats, start: Ints) -> Floats:
    """(G,) equations (20) and (21): root mean squared cosine of the SDF gradients; their signs square away.

    Args:
        to_ref, to_dist: (n, 3) p_n - p. A sample on either surface counts 1.
    """
    return np.sqrt(means(_squared_cosine(to_ref, to_dist, 1.0), start))


@dataclass(frozen=True)
class Pairs:
    """Pairs of a color unit p and another sample p' of its patch, unit after unit, p' ascending.

    Attributes:
        count: (units,) pairs of each unit. row: (m,) which unit. other: (m,) p'. distance: (m,) |pp'|.
        offset: (m, 3) p' - p, each axis in one piece of memory.
    """

    count: Ints
    row: Ints
    other: Ints
    offset: Floats
    distance: Floats

    def pick(self, mask: NDArray[np.bool_]) -> Pairs:
        chosen = np.flatnonzero(mask)  # take is several times faster than a mask
        row = self.row.take(chosen)
        return Pairs(
            np.bincount(row, minlength=len(self.count)),
            row,
            self.other.take(chosen),
            self.offset.T.take(chosen, axis=1).T,
            self.distance.take(chosen),
        )


@dataclass(frozen=True)
class Around:
    """The channels of both meshes at the pairs: (C, units) those of p, and (C, m) those of p' less p's.

    Moments of a nearly plain unit do not cancel when they are taken of what differs from p.
    """

    center_ref: Floats
    center_dist: Floats
    ref: Floats
    dist: Floats


def colors_around(pairs: Pairs, units: Ints, channels_r: Floats, channels_d: Floats) -> Around:
    """What both readings, and several features of each, look at, from (n, C) channels of all samples."""
    both = []
    for channels in (channels_r, channels_d):
        rows = channels.T.copy()
        center, relative = rows.take(units, axis=1), np.empty((len(rows), len(pairs.other)))
        for values, of_p, found in zip(rows, center, relative, strict=True):
            np.subtract(values.take(pairs.other), of_p.repeat(pairs.count), out=found)
        both.append((center, relative))
    (center_r, r), (center_d, d) = both
    return Around(center_r, center_d, r, d)


def find_pairs(positions: Floats, units: Ints, radius: float, itself: bool = False) -> Pairs:
    """All pairs with 0 < |pp'| < radius, of one patch. With itself, p and what lies at its very place count too."""
    return pairs_of_patches(positions, np.array([0, len(positions)]), units, radius, itself)


def pairs_of_patches(positions: Floats, start: Ints, units: Ints, radius: float, itself: bool = False) -> Pairs:
    """The pairs within each patch, as find_pairs has them, indexed among all samples and all units."""
    count, other = _roughly_near(positions, start, units, radius)
    offset = np.empty((3, len(other)))
    for along, axis in zip(offset, positions.T.copy(), strict=True):
        np.subtract(axis.take(other), axis.take(units).repeat(count), out=along)
    distance = dot(offset.T, offset.T)
    np.sqrt(distance, out=distance)
    inside = distance < radius
    pairs = Pairs(count, np.arange(len(units)).repeat(count), other, offset.T, distance)
    return pairs.pick(inside if itself else inside & (distance > 0))


def _roughly_near(positions: Floats, start: Ints, units: Ints, radius: float) -> tuple[Ints, Ints]:
    """(units,) how many samples of its patch lie within the radius of each unit, and these, unit after unit.

    In float32, with room for its rounding. Squared distances are inner products: p.p - 2 p.p' + p'.p'.
    """
    centered = positions.T - means(positions.T, start).repeat(np.diff(start), axis=1)
    x, y, z = centered.astype(np.float32)
    squares = x * x + y * y + z * z
    samples = np.stack([x, y, z, squares])
    of_units = np.stack([-2 * x, -2 * y, -2 * z, np.ones_like(x)]).take(units, axis=1).T.copy()
    limits = np.float32(radius * radius + ROUGH * max(1.0, squares.max())) - squares.take(units)
    counts, others = [], []
    for here, drawn in zip(_slices(start), _slices(np.searchsorted(units, start)), strict=True):
        size = here.stop - here.start
        near = np.flatnonzero(_product(of_units[drawn], samples[:, here]) < limits[drawn, None])
        first = np.arange(drawn.stop - drawn.start + 1) * size
        count = np.diff(np.searchsorted(near, first))
        near -= (first[:-1] - here.start).repeat(count)
        counts.append(count)
        others.append(near)
    return np.concatenate(counts), np.concatenate(others)


def _product(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """a @ b in pieces so small that no BLAS hands them to threads, which takes them several times as long."""
    rows = max(1, _ALONE // max(1, b.size))
    if len(a) <= rows:
        return a @ b
    product = np.empty((len(a), b.shape[1]), np.float32)
    for first in range(0, len(a), rows):
        np.matmul(a[first : first + rows], b, out=product[first : first + rows])
    return product


def _slices(start: Ints) -> list[slice]:
    bounds = start.tolist()
    return [slice(first, last) for first, last in zip(bounds[:-1], bounds[1:], strict=True)]


def unit_cosine(pairs: Pairs, units: Ints, towards: Floats) -> Floats:
    """(m,) |cos(pp_n, pp')| of the pairs, equations (10) and (11); 0 where p = p_n, not a number where p = p'.

    Args:
        towards: (n, 3) p_n - p of all samples.
    """
    axis = towards.take(units, axis=0)
    length = np.sqrt(dot(axis, axis))
    product = (axis.T / np.where(length > 0, length, 1.0)).repeat(pairs.count, axis=1)
    product *= pairs.offset.T
    cosine, y, z = product  # added up in dot's order, in the same place
    cosine += z
    cosine += y
    np.abs(cosine, out=cosine)
    with np.errstate(invalid="ignore"):
        cosine /= pairs.distance
    return cosine


def similarity_of_units(pairs: Pairs, chosen: Ints, around: Around) -> NDArray[np.float64]:
    """(C, units) equations (22) to (25) over each unit: p itself and the p' of its chosen pairs."""
    row, n_units = pairs.row.take(chosen), len(pairs.count)
    count = np.bincount(row, minlength=n_units) + 1.0
    r, d = around.ref.take(chosen, axis=1), around.dist.take(chosen, axis=1)

    def mean(values: NDArray[Any]) -> Floats:
        sums = [np.bincount(row, channel, minlength=n_units) for channel in values]
        return np.stack(sums) / count

    mean_r, mean_d = mean(r), mean(d)
    var_r = np.maximum(mean(r * r) - mean_r * mean_r, 0)
    var_d = np.maximum(mean(d * d) - mean_d * mean_d, 0)
    cov = mean(r * d) - mean_r * mean_d
    centers = around.center_ref + mean_r, around.center_dist + mean_d
    return np.asarray(similarity(*centers, var_r, var_d, cov, EPSILON_COLOR))


@dataclass(frozen=True)
class Gradient:
    """Color gradients at the units: magnitude (C, units), and step (C, units, 3) from p to its P_max."""

    magnitude: Floats
    step: Floats


def color_gradient(pairs: Pairs, chosen: Ints, relative: Floats) -> Gradient:
    """Equations (28) and (29): the largest color difference by distance among each unit's chosen pairs.

    The direction's sign is left out: it is squared away. No pair, or no difference: 0.

    Args:
        relative: (C, m) channels of p' less those of p, of all pairs.
    """
    magnitude = np.zeros((len(relative), len(pairs.count)))
    step = np.zeros((*magnitude.shape, 3))
    if not len(chosen):
        return Gradient(magnitude, step)
    row, distance = pairs.row.take(chosen), pairs.distance.take(chosen)
    first = first_of_each(row)
    present, count = row.take(first), np.diff(first, append=len(row))
    for channel, values in enumerate(relative):
        difference = np.abs(values.take(chosen))
        slope = np.where(difference > SAME_COLOR, difference, 0)
        slope /= distance
        steepest = np.maximum.reduceat(slope, first)
        steep = np.flatnonzero(slope == steepest.repeat(count))
        winner = chosen.take(steep.take(first_of_each(row.take(steep))))
        magnitude[channel, present], step[channel, present] = steepest, pairs.offset.T.take(winner, axis=1).T
    step[magnitude == 0] = 0
    return Gradient(magnitude, step)


def gradient_similarity(ref: Gradient, dist: Gradient, drawn: Ints, weights: Floats) -> Floats:
    """(G,) equations (30) to (32): direction and magnitude of the color gradients, the means over the units.

    Args:
        drawn: (G + 1,) units of patch k are drawn[k] : drawn[k + 1].
    """
    flat_r, flat_d = ref.magnitude == 0, dist.magnitude == 0
    direction = np.stack([_squared_cosine(r, d, 0.0) for r, d in zip(ref.step, dist.step, strict=True)])
    direction[flat_r & flat_d] = 1.0
    square_r, square_d = ref.magnitude**2, dist.magnitude**2
    unlike: Floats = np.abs(square_r - square_d) / (square_r + square_d + EPSILON_GRADIENT)
    angular = np.sqrt(means(direction, drawn))
    magnitude = 1.0 - np.sqrt(means(unlike, drawn))
    return np.sqrt(_pool(angular, weights) * _pool(magnitude, weights))


def pool_features(features: Floats, pooling: str) -> NDArray[np.float64]:
    """(P,) FMQM of the patches from their (P, 4) features: equation (33) (arithmetic: supplement)."""
    return features.mean(axis=1) if pooling == "arithmetic" else features.prod(axis=1) ** 0.25


def _squared_cosine(a: Floats, b: Floats, if_zero: float) -> Floats:
    """(n,) squared cosines of the rows; if_zero where either is the zero vector."""
    squared_lengths = dot(a, a) * dot(b, b)
    product = dot(a, b)
    cosine = np.full(len(a), if_zero)
    np.divide(product * product, squared_lengths, out=cosine, where=squared_lengths > 0)
    return np.minimum(1.0, cosine, out=cosine)


def _pool(values: Floats, weights: Floats) -> Floats:
    """(G,) means of (C, G) values over the channels."""
    return np.asarray((values * weights[:, None]).sum(axis=0) / weights.sum())
