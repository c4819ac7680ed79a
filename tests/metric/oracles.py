# SPDX-License-Identifier: GPL-3.0-or-later
"""Slow, plain versions of what the metric does fast, written from its definition and not from its code."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from fmqm_addon.metric.features import FieldValues
from fmqm_addon.metric.geometry import Floats, Ints
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.texture import Texture

Row = Sequence[float] | Floats

# --- geometry ---------------------------------------------------------------------------------------------


class NaiveQuery:
    """A metric.surface.SurfaceQuery that looks at every triangle, in float64.

    It also holds the caller to the protocol: bounds must be true upper bounds, directions must have unit length.
    """

    def __init__(self, vertices: Floats, triangles: Ints) -> None:
        self.a, self.b, self.c = (vertices[triangles[:, k]] for k in range(3))

    def nearest(self, points: Floats, bounds: Floats | None) -> Ints:
        squared = squared_distances(points, self.a, self.b, self.c)
        found = squared.argmin(axis=1)
        if bounds is not None:
            distance = np.sqrt(squared[np.arange(len(points)), found])
            assert (distance <= bounds).all(), "a bound is below the distance"
        return np.asarray(found, np.int64)

    def first_hit(self, origins: Floats, directions: Floats) -> tuple[Ints, Floats]:
        assert np.allclose(np.linalg.norm(directions, axis=1), 1), "a direction is not of unit length"
        distance = ray_distances(origins, directions, self.a, self.b, self.c)
        first = distance.argmin(axis=1)
        distance = distance[np.arange(len(origins)), first]
        return np.where(np.isfinite(distance), first, -1), distance


def squared_distances(points: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    """(N, T) squared distances of points and triangles: by the regions of Ericson, Real-Time Collision Detection."""
    p = points[:, None]
    ab, ac = b - a, c - a
    ap, bp, cp = p - a, p - b, p - c
    d1, d2 = (ap * ab).sum(2), (ap * ac).sum(2)
    d3, d4 = (bp * ab).sum(2), (bp * ac).sum(2)
    d5, d6 = (cp * ab).sum(2), (cp * ac).sum(2)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2

    def ratio(x: Floats, y: Floats) -> Floats:
        quotient: Floats = x / np.where(y == 0, 1, y)
        return quotient

    regions = [
        ((d1 <= 0) & (d2 <= 0), 0 * d1, 0 * d1),
        ((d3 >= 0) & (d4 <= d3), 1 + 0 * d1, 0 * d1),
        ((d6 >= 0) & (d5 <= d6), 0 * d1, 1 + 0 * d1),
        ((vc <= 0) & (d1 >= 0) & (d3 <= 0), ratio(d1, d1 - d3), 0 * d1),
        ((vb <= 0) & (d2 >= 0) & (d6 <= 0), 0 * d1, ratio(d2, d2 - d6)),
        ((va <= 0) & (d4 >= d3) & (d5 >= d6), 1 - ratio(d4 - d3, d4 - d3 + d5 - d6), ratio(d4 - d3, d4 - d3 + d5 - d6)),
    ]
    v = np.select([r[0] for r in regions], [r[1] for r in regions], ratio(vb, va + vb + vc))
    w = np.select([r[0] for r in regions], [r[2] for r in regions], ratio(vc, va + vb + vc))
    gap = p - a - v[..., None] * ab - w[..., None] * ac
    squared: Floats = (gap * gap).sum(2)
    return squared


def ray_distances(origins: Floats, directions: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    """(N, T) distances along the rays (Moeller and Trumbore), inf for a miss; edges belong to their triangles."""
    d, ab, ac = directions[:, None], b - a, c - a
    h = np.cross(d, ac)
    det = (h * ab).sum(2)
    parallel = np.abs(det) < 1e-14
    inverse = 1 / np.where(parallel, 1, det)
    s = origins[:, None] - a
    u = (s * h).sum(2) * inverse
    q = np.cross(s, ab)
    v = (d * q).sum(2) * inverse
    t = (ac * q).sum(2) * inverse
    edge = 1e-12
    hit: NDArray[np.bool_] = ~parallel & (u >= -edge) & (v >= -edge) & (u + v <= 1 + edge) & (t > 0)
    return np.where(hit, t, np.inf)


def exact_distance(point: Row, a: Row, b: Row, c: Row) -> float:
    """Distance of a point and a triangle with area, in exact rational arithmetic until the last square root."""
    p, q, r, s = ([Fraction(float(x)) for x in row] for row in (point, a, b, c))

    def minus(x: list[Fraction], y: list[Fraction]) -> list[Fraction]:
        return [i - j for i, j in zip(x, y, strict=True)]

    def inner(x: list[Fraction], y: list[Fraction]) -> Fraction:
        return sum((i * j for i, j in zip(x, y, strict=True)), Fraction(0))

    ab, ac, ap = minus(r, q), minus(s, q), minus(p, q)
    uu, uv, vv, pu, pv = inner(ab, ab), inner(ab, ac), inner(ac, ac), inner(ap, ab), inner(ap, ac)
    det = uu * vv - uv * uv
    beta, gamma = (vv * pu - uv * pv) / det, (uu * pv - uv * pu) / det
    if beta >= 0 and gamma >= 0 and beta + gamma <= 1:
        gap = [x - beta * y - gamma * z for x, y, z in zip(ap, ab, ac, strict=True)]
        return math.sqrt(inner(gap, gap))
    best = None
    for start, end in ((q, r), (r, s), (s, q)):
        edge, offset = minus(end, start), minus(p, start)
        t = min(max(inner(offset, edge) / inner(edge, edge), Fraction(0)), Fraction(1))
        gap = [x - t * y for x, y in zip(offset, edge, strict=True)]
        best = inner(gap, gap) if best is None else min(best, inner(gap, gap))
    assert best is not None
    return math.sqrt(best)


def winding_number(point: Floats, vertices: Floats, triangles: Ints) -> float:
    """How often a closed surface goes around a point (van Oosterom and Strackee)."""
    total = 0.0
    for triangle in triangles:
        a, b, c = vertices[triangle] - point
        la, lb, lc = (float(np.linalg.norm(x)) for x in (a, b, c))
        numerator = float(np.dot(a, np.cross(b, c)))
        total += 2 * math.atan2(numerator, la * lb * lc + np.dot(a, b) * lc + np.dot(b, c) * la + np.dot(c, a) * lb)
    return total / (4 * math.pi)


# --- surfaces and patches ---------------------------------------------------------------------------------


def weld_with_dict(positions: Floats, triangles: Ints) -> tuple[list[tuple[float, ...]], list[list[int]]]:
    """Equal positions are one vertex; the first of them keeps its place in the order."""
    rows = [tuple(float(x) for x in row) for row in positions]
    number = {row: k for k, row in enumerate(dict.fromkeys(rows))}
    return list(number), [[number[rows[v]] for v in triangle] for triangle in triangles.tolist()]


def first_of_each(triangles: Ints) -> list[bool]:
    seen: set[frozenset[int]] = set()
    result = []
    for triangle in triangles.tolist():
        result.append(frozenset(triangle) not in seen)
        seen.add(frozenset(triangle))
    return result


def heron(a: Row, b: Row, c: Row) -> float:
    x, y, z = sorted((math.dist(a, b), math.dist(b, c), math.dist(c, a)), reverse=True)
    return math.sqrt(max((x + (y + z)) * (z - (x - y)) * (z + (x - y)) * (x + (y - z)), 0)) / 4  # Kahan's order


def farthest_points_by_loop(vertices: Floats, count: int, tie: float = 1e-5) -> list[int]:
    """Farthest point sampling: ties up to a relative difference go to the lowest index."""

    def farthest(distance: Floats) -> int:
        return next(i for i, d in enumerate(distance.tolist()) if d >= distance.max() * (1 - tie))

    centers = [farthest(np.linalg.norm(vertices - vertices.mean(axis=0), axis=1))]
    nearest = np.full(len(vertices), np.inf)
    while len(centers) < count:
        nearest = np.minimum(nearest, np.linalg.norm(vertices - vertices[centers[-1]], axis=1))
        centers.append(farthest(nearest))
    return centers


def grow_with_sets(
    vertices: Floats, triangles: Ints, areas: Floats, center: int, n_patches: int
) -> tuple[set[int], bool]:
    """Faces of a patch by whole rings; then, if those run out, the nearest centroids. And whether they ran out."""
    target = areas.sum() / n_patches * (1 - 1e-9)
    faces: set[int] = set()
    inside = {center}
    while True:
        ring = {f for f, corners in enumerate(triangles.tolist()) if inside & set(corners)}
        grown = faces | ring
        ran_out = grown == faces
        faces = grown
        inside |= {v for f in faces for v in triangles[f].tolist()}
        if ran_out or sum(areas[list(faces)]) >= target:
            break
    if not ran_out:
        return faces, False
    centroid = vertices[triangles].mean(axis=1)
    rest = sorted(set(range(len(triangles))) - faces, key=lambda f: (math.dist(centroid[f], vertices[center]), f))
    for face in rest:
        if sum(areas[list(faces)]) >= target:
            break
        faces.add(face)
    return faces, True


# --- color ------------------------------------------------------------------------------------------------


def basis(distance: Fraction, reach: int) -> Fraction:
    """The hat of bilinear interpolation (reach 1) or the uniform cubic B-spline (reach 2), around 0."""
    x = abs(distance)
    if reach == 1:
        return max(1 - x, Fraction(0))
    if x < 1:
        return Fraction(2, 3) - x**2 + x**3 / 2
    return max(2 - x, Fraction(0)) ** 3 / 6


def texture_color(texture: Texture, u: float, v: float) -> list[float]:
    """One lookup, in exact rational arithmetic: i = u W - 0.5, j = (1 - v) H - 0.5."""
    height, width = texture.pixels.shape[:2]
    i, j = Fraction(u) * width - Fraction(1, 2), (1 - Fraction(v)) * height - Fraction(1, 2)

    def pixel(column: int, row: int) -> list[Fraction]:
        if texture.extension == "clip" and not (0 <= column < width and 0 <= row < height):
            return [Fraction(0)] * 3

        def wrap(index: int, size: int) -> int:
            if texture.extension == "repeat":
                return index % size
            if texture.extension == "mirror":
                index %= 2 * size
                return index if index < size else 2 * size - 1 - index
            return min(max(index, 0), size - 1)

        full = 255 if texture.pixels.dtype == np.uint8 else 1
        return [Fraction(float(x)) / full for x in texture.pixels[wrap(row, height), wrap(column, width)]]

    if texture.interpolation == "closest":
        return [float(x) for x in pixel(math.floor(i + Fraction(1, 2)), math.ceil(j + Fraction(1, 2)) - 1)]
    reach = 1 if texture.interpolation == "linear" else 2
    color = [Fraction(0)] * 3
    for column in range(math.floor(i) - reach, math.floor(i) + reach + 2):
        for row in range(math.floor(j) - reach, math.floor(j) + reach + 2):
            weight = basis(i - column, reach) * basis(j - row, reach)
            color = [x + weight * y for x, y in zip(color, pixel(column, row), strict=True)]
    return [float(x) for x in color]


# --- features ---------------------------------------------------------------------------------------------


def unit_members(
    positions: Floats, towards: Floats, unit: int, radius: float, above: float | None = None, below: float | None = None
) -> list[int]:
    """p' of the unit of p, without p: 0 < |pp'| < r and |cos(pp_n, pp')| above or below its threshold."""
    members = []
    for other in range(len(positions)):
        offset = positions[other] - positions[unit]
        distance = math.hypot(*offset)
        if not 0 < distance < radius:
            continue
        length = math.hypot(*towards[unit])
        cosine = abs(float(np.dot(towards[unit], offset))) / (length * distance) if length else 0.0
        if (above is not None and cosine > above) or (below is not None and cosine < below):
            members.append(other)
    return members


def s_of(a: Row, b: Row, e: float) -> float:
    """Equations (15) to (18), as docs/metric.md has them: s(a, b) from population moments."""
    n = len(a)
    mean_a, mean_b = math.fsum(a) / n, math.fsum(b) / n
    dev_a = math.sqrt(math.fsum((x - mean_a) ** 2 for x in a) / n)
    dev_b = math.sqrt(math.fsum((x - mean_b) ** 2 for x in b) / n)
    together = math.fsum((x - mean_a) * (y - mean_b) for x, y in zip(a, b, strict=True)) / n
    mean = abs(2 * mean_a * mean_b + e) / (mean_a**2 + mean_b**2 + e)
    std = (2 * dev_a * dev_b + e) / (dev_a**2 + dev_b**2 + e)
    cov = min(1.0, (abs(together) + e) / (dev_a * dev_b + e))
    return math.cbrt(mean * std * cov)


def steepest(positions: Floats, channel: Floats, unit: int, members: list[int]) -> tuple[float, Floats]:
    """Equations (28) and (29): gradient magnitude and signed unit direction; zeros for no gradient."""
    best, direction = 0.0, np.zeros(3)
    for other in members:
        difference = float(channel[other] - channel[unit])
        offset = positions[other] - positions[unit]
        slope = abs(difference) / math.hypot(*offset) if abs(difference) > 1e-6 else 0.0
        if slope > best:
            best, direction = slope, math.copysign(1, difference) * offset / math.hypot(*offset)
    return best, direction


def weighted_mean(values: Row, weights: Row) -> float:
    return math.fsum(v * w for v, w in zip(values, weights, strict=True)) / math.fsum(weights)


def color_gradient_similarity(
    ref: list[list[tuple[float, Floats]]], dist: list[list[tuple[float, Floats]]], weights: Row
) -> float:
    """Equations (30) to (32) from [channel][unit] gradients."""
    angular, magnitude = [], []
    for channel_r, channel_d in zip(ref, dist, strict=True):
        cosines, unlike = [], []
        for (a, dir_a), (b, dir_b) in zip(channel_r, channel_d, strict=True):
            cosines.append(1.0 if a == 0 and b == 0 else float(np.dot(dir_a, dir_b)) ** 2)
            unlike.append(abs(a * a - b * b) / (a * a + b * b + 1e-10))
        angular.append(math.sqrt(math.fsum(cosines) / len(cosines)))
        magnitude.append(1 - math.sqrt(math.fsum(unlike) / len(unlike)))
    return math.sqrt(weighted_mean(angular, weights) * weighted_mean(magnitude, weights))


def gradient_cosines(positions: Floats, nearest_r: Floats, nearest_d: Floats) -> float:
    """Equation (21): root mean square of g_r . g_d; a sample on either surface counts 1."""
    total = []
    for p, r, d in zip(positions, nearest_r, nearest_d, strict=True):
        to_r, to_d = p - r, p - d
        length = math.hypot(*to_r) * math.hypot(*to_d)
        total.append((float(np.dot(to_r, to_d)) / length) ** 2 if length else 1.0)
    return math.sqrt(math.fsum(total) / len(total))


def features_by_loop(
    positions: Floats, ref: FieldValues, dist: FieldValues, units: Ints, weights: Floats, settings: Settings
) -> list[float]:
    """The four features of a patch (V-E, docs/metric.md), sentence by sentence; lengths in patch diagonals."""
    normal: list[float] = []
    tangent: list[float] = []
    for unit in units.tolist():
        towards = ref.nearest - positions
        along = [unit, *unit_members(positions, towards, unit, settings.radius, above=settings.normal_threshold)]
        across = [unit, *unit_members(positions, towards, unit, settings.radius, below=settings.tangent_threshold)]
        for members, into in ((along, normal), (across, tangent)):
            s = [s_of(ref.channels[members, c].tolist(), dist.channels[members, c].tolist(), 1e-10) for c in range(3)]
            into.append(weighted_mean(s, weights))

    def gradients(field: FieldValues) -> list[list[tuple[float, Floats]]]:
        towards, radius, below = field.nearest - positions, settings.gradient_radius, settings.tangent_threshold
        members = {unit: unit_members(positions, towards, unit, radius, below=below) for unit in units.tolist()}
        return [[steepest(positions, field.channels[:, c], unit, members[unit]) for unit in members] for c in range(3)]

    return [
        s_of(ref.sdf.tolist(), dist.sdf.tolist(), 1e-12),
        gradient_cosines(positions, ref.nearest, dist.nearest),
        math.sqrt(np.mean(normal) * np.mean(tangent)),
        color_gradient_similarity(gradients(ref), gradients(dist), weights),
    ]


# --- perceived quality ------------------------------------------------------------------------------------


def alike(product: float, squares: float, constant: float) -> float:
    """max(0, (2 a b + c) / (a^2 + b^2 + c))."""
    return max(0.0, (2 * product + constant) / (squares + constant))


def moments(a: Row, b: Row) -> tuple[float, float, float, float, float]:
    """Population means, variances and covariance."""
    n = len(a)
    mean_a, mean_b = math.fsum(a) / n, math.fsum(b) / n
    var_a, var_b = math.fsum((x - mean_a) ** 2 for x in a) / n, math.fsum((x - mean_b) ** 2 for x in b) / n
    cov = math.fsum((x - mean_a) * (y - mean_b) for x, y in zip(a, b, strict=True)) / n
    return mean_a, mean_b, var_a, var_b, cov


def perceived_shape(r: Row, d: Row) -> float:
    """cbrt(min(1, M S C))."""
    mean_r, mean_d, var_r, var_d, cov = moments(r, d)
    if var_r == 0 or var_d == 0:
        return float(var_r == var_d and mean_r == mean_d)
    mean = alike(mean_r * mean_d, mean_r**2 + mean_d**2, var_r + var_d)
    spread = 2 * math.sqrt(var_r * var_d) / (var_r + var_d)
    return math.cbrt(min(1.0, mean * spread * max(0.0, cov / math.sqrt(var_r * var_d))))


def perceived_color(positions: Floats, colors_r: Floats, colors_d: Floats, unit: int) -> list[tuple[float, float]]:
    """Color and detail of one unit, a channel a row."""
    members = [k for k, p in enumerate(positions) if math.fsum((p - positions[unit]) ** 2) < 0.125**2]
    offset = positions[members] - positions[members].mean(axis=0)
    spread = np.array([[math.fsum(a * b) / len(members) for b in offset.T] for a in offset.T])

    def slope(values: Floats) -> Floats:
        centered = values - math.fsum(values) / len(values)
        cov = np.array([math.fsum(axis * centered) / len(values) for axis in offset.T])
        fitted: Floats = np.linalg.solve(spread + 1e-5 * np.eye(3), cov)
        return fitted

    rows = []
    for r, d in zip(colors_r[members].T, colors_d[members].T, strict=True):
        mean_r, mean_d, var_r, var_d, cov = moments(r.tolist(), d.tolist())
        color = alike(mean_r * mean_d, mean_r**2 + mean_d**2, 0.01**2) * alike(cov, var_r + var_d, 0.03**2)
        g, h = slope(r), slope(d)
        rows.append((color, alike(float(g @ h), float(g @ g + h @ h), 0.2304)))
    return rows


def perceived_by_loop(positions: Floats, ref: FieldValues, dist: FieldValues, units: Ints) -> list[float]:
    """Shape, facing, color, detail and perceived of a patch; lengths in patch diagonals, colors in sRGB."""
    sdf_d, facing = [], []
    for p, sdf_r, near_r, near_d in zip(positions, ref.sdf.tolist(), ref.nearest, dist.nearest, strict=True):
        inside = (-1 if sdf_r < 0 else 1) * (-1 if np.dot(p - near_r, p - near_d) < 0 else 1)
        sdf_d.append(inside * math.dist(p, near_d))
        u, w = near_r - p, near_d - p
        theta = math.atan2(math.hypot(*np.cross(u, w)), abs(float(np.dot(u, w))))
        facing.append(1.0 if not u.any() or not w.any() else 1 - 2 * theta / math.pi)
    of_units = [row for unit in units.tolist() for row in perceived_color(positions, ref.channels, dist.channels, unit)]
    color, detail = (math.fsum(column) / len(of_units) for column in zip(*of_units, strict=True))
    features = [perceived_shape(ref.sdf.tolist(), sdf_d), math.fsum(facing) / len(facing), color, detail]
    return [*features, math.prod(features) ** 0.25]
