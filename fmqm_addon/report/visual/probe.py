# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking closer at a result: its worst patches, values on the surface, shells, units and slices of the fields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...metric.evaluation import COLUMNS, Result
from ...metric.features import find_pairs, unit_cosine
from ...metric.fields import Fields, evaluate_fields
from ...metric.geometry import Floats, Ints, dot, morton_order
from ...metric.surface import Surface, triangle_areas, triangle_normals
from .layers import LAYERS, NUMBER

SHELLS = 5  # as in the supplement's figure
_CHUNK = 1 << 22  # elements of a distance table at once


@dataclass(frozen=True)
class WorstPatch:
    """One of the lowest patches.

    Attributes:
        patch: its row. score: its FMQM. blame: the feature that falls furthest below its own mean over
            the patches. value: that feature's.
    """

    patch: int
    score: float
    blame: str
    value: float


def worst_patches(result: Result, count: int) -> list[WorstPatch]:
    """The patches of the lowest FMQM, worst first."""
    score = result.patch_scores[:, COLUMNS.index("FMQM")]
    usual = np.maximum(result.scores[:4], 1e-12)
    worst = []
    for patch in np.argsort(score, kind="stable")[:count].tolist():
        features = result.patch_scores[patch, :4]
        # Features have levels of their own; where all are at theirs, the lowest is named.
        feature = int(np.lexsort((features, np.round(features / usual, 6)))[0])
        worst.append(WorstPatch(patch, float(score[patch]), COLUMNS[feature], float(features[feature])))
    return worst


def patch_view(result: Result, patch: int) -> tuple[Floats, float, Floats]:
    """Center (3,) of a patch's box, its diagonal, and its mean normal (3,), unit or zero; metric's frame."""
    mesh = result.patch_mesh
    triangles = mesh.triangles[result.patches[patch].faces]
    corners = mesh.vertices[triangles.ravel()]
    low, high = corners.min(axis=0), corners.max(axis=0)
    normals = triangle_normals(mesh.vertices, triangles)
    normal = (normals * triangle_areas(mesh.vertices, triangles)[:, None]).sum(axis=0)
    length = float(np.linalg.norm(normal))
    return (low + high) / 2, float(np.linalg.norm(high - low)), normal / length if length > 0 else normal


def blended_scores(result: Result, name: str) -> Floats:
    """A layer that is per patch on the reference's surface, at the (V,) vertices of result.patch_mesh.

    Scores go smoothly from patch to patch: a Gaussian mean of the patches around, by the distance to
    their centers in their own size. For the number of the patch, it is the one that weighs most.
    """
    vertices = result.patch_mesh.vertices
    scores = None if LAYERS[name].kind == NUMBER else result.patch_scores[:, COLUMNS.index(name)].astype(np.float32)
    centers = result.patch_centers.astype(np.float32)
    width = np.array([patch.diagonal for patch in result.patches], np.float32) / 4
    values = np.empty(len(vertices))
    step = max(1, _CHUNK // len(centers))
    for first in range(0, len(vertices), step):
        here = vertices[first : first + step].astype(np.float32)
        squared = np.zeros((len(here), len(centers)), np.float32)
        for k in range(3):
            gap = here[:, k, None] - centers[:, k]
            squared += gap * gap
        squared /= 2 * width * width
        if scores is None:
            values[first : first + step] = squared.argmin(axis=1)
            continue
        squared -= squared.min(axis=1, keepdims=True)  # far from every center the nearest still counts
        weight = np.exp(-squared)
        values[first : first + step] = weight @ scores / weight.sum(axis=1)
    return values


def fields_at(surface: Surface, points: Floats) -> Fields:
    """The fields of a surface at (N, 3) points of the metric's frame, at once."""
    work = evaluate_fields(surface, points, morton_order(points))
    while True:
        try:
            next(work)
        except StopIteration as end:
            fields: Fields = end.value
            return fields


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
    areas = np.cumsum(triangle_areas(surface.vertices, surface.triangles))
    rng = np.random.default_rng(seed)
    place = (np.arange(count) + rng.random()) * (areas[-1] / count)
    triangle = np.minimum(np.searchsorted(areas, place, side="right"), len(areas) - 1)
    root, second = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1 - root, root * (1 - second), root * second], axis=1)
    corners = surface.triangles[triangle]
    base = np.einsum("nk,nkc->nc", weights, surface.vertices[corners])
    normals = triangle_normals(surface.vertices, corners)
    positions = np.concatenate([base + k * distance * normals for k in range(SHELLS)])
    return Shells(positions, np.repeat(np.arange(SHELLS), count), np.tile(normals, (SHELLS, 1)))


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


def plane_axes(axis: Floats) -> tuple[Floats, Floats]:
    """Right and up, unit (3,) vectors across an axis; up is as near to Z as can be."""
    up = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, axis)
    right /= np.linalg.norm(right)
    return right, np.cross(axis, right)


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
