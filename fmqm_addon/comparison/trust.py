# SPDX-License-Identifier: GPL-3.0-or-later
"""How far to trust a score: facts about the comparison of two surfaces, each with its unit.

The metric answers with a number whatever it is given. These facts say what it could not see (flipped faces,
geometry that only the distorted mesh has, maps other than base color) and what it had to assume (a side of a
surface that has none, colors of places without texture coordinates). The paper has none of this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..metric.evaluation import Result
from ..metric.fields import Fields, closest_on
from ..metric.geometry import Floats, dot, morton_order
from ..metric.surface import Surface, triangle_areas, triangle_normals
from ..metric.texture import MISSING
from .surface_facts import NO_MATERIAL, Fact, Work, all_images, box_of, surface_facts

# What should stop someone from believing the number. Shares.
SIGN_IN_DOUBT = 0.01  # of samples whose side is doubtful on one mesh and not the same on both: the SDF's sign is noise
LEAST_COVERED = 0.6  # of the reference's area; the gaps between round patches alone leave out up to 0.25 (measured)
FLIPPED = 0.01  # of samples; a renderer that culls back faces shows holes there
ADDED = 0.005  # of the distorted mesh's area; floating junk that the score leaves out
MAGENTA = 0.01  # of samples; images or tiles of UDIM sets are missing there
UV_MISSING = 0.01  # of the textured area; it is painted with a single pixel

FLIPPED_COSINE = -0.5  # between the faces nearest to a sample, which noise and decimation turn by less. The metric
# squares cosines and cannot see it
ADDED_DISTANCE = 0.1  # of the median patch diagonal: far beyond what an LOD moves its surface
ADDED_POINTS = 20_000  # over the distorted mesh; a share of 0.5 % is known to 0.05 %
OPAQUE = 0.5  # a lower alpha is see-through
_SEEN = 1 << 14  # samples of a step
_BATCH = 2048  # nearest points of a step


@dataclass(frozen=True)
class Trust:
    """The facts of a comparison.

    Attributes:
        reference, distorted: of the meshes. pair: of the two together.
        warnings: the few that should stop someone from believing the score.
    """

    reference: tuple[Fact, ...]
    distorted: tuple[Fact, ...]
    pair: tuple[Fact, ...]
    warnings: tuple[str, ...]


def assessing(reference: Surface, distorted: Surface, result: Result, known: Sequence[Fact]) -> Work[Trust]:
    """All facts of a comparison; yields the share done.

    Args:
        known: surface_facts of the reference, which serve all its comparisons.
    """
    own = yield from surface_facts(distorted)
    yield 0.4
    compared = ((reference, result.ref), (distorted, result.dist))
    normals = []
    for surface, fields in compared:
        normals.append(triangle_normals(surface.vertices, surface.triangles.take(fields.triangle, axis=0)))
        yield 0.5
    doubtful = [
        in_doubt(fields, result.samples.positions, normal)
        for (_, fields), normal in zip(compared, normals, strict=True)
    ]
    differs = (result.ref.sdf < 0) != (result.dist.sdf < 0)
    yield 0.6
    see_through = []
    for surface, fields in compared:
        see_through.append((yield from _see_through(surface, fields)))
    reach = ADDED_DISTANCE * float(np.median([patch.diagonal for patch in result.patches]))
    added = yield from added_share(reference, distorted, reach, result.settings.seed)
    sides = [
        (
            Fact("sign_in_doubt", _share(doubt), "share of samples"),
            Fact("samples_by_material", _samples_by_material(surface, fields), "share of samples"),
            Fact("see_through", share, "share of samples"),
            Fact("magenta", _magenta_share(surface, fields), "share of samples"),
        )
        for (surface, fields), doubt, share in zip(compared, doubtful, see_through, strict=True)
    ]
    pair = (
        *_patch_facts(result),
        Fact("sign_in_doubt_and_different", _share((doubtful[0] | doubtful[1]) & differs), "share of samples"),
        Fact("flipped", _share(dot(*normals) < FLIPPED_COSINE), "share of samples"),
        Fact("added", added, "share of the distorted mesh's area"),
        Fact("added_beyond", reach * result.frame.scale, "scene units"),
        Fact("size", _diagonal(distorted) / _diagonal(reference), "of the reference's box diagonal"),
        Fact("maps_not_seen", differing_maps(reference, distorted), "maps that differ"),
    )
    facts = ((*known, *sides[0]), (*own, *sides[1]))
    return Trust(*facts, pair, _warnings(reference.name, distorted.name, result, facts, pair))


def in_doubt(fields: Fields, points: Floats, normals: Floats) -> NDArray[np.bool_]:
    """(N,) points whose sign, by parity, is not that of the nearest face's normal.

    Args:
        normals: (N, 3) of the faces fields.triangle. On edges and vertices that is the face that faces the
            point most, which tells the side there.
    """
    facing = dot(points - fields.nearest, normals)
    return (fields.sdf != 0) & ((facing < 0) != (fields.sdf < 0))


def covered_share(result: Result) -> float:
    """Share of the reference's area that lies in some scored patch."""
    covered = np.zeros(len(result.patch_mesh.areas), bool)
    for patch in result.patches:
        covered[patch.faces] = True
    return float(min(result.patch_mesh.areas[covered].sum() / result.patch_mesh.area, 1.0))


def spread_points(surface: Surface, count: int, seed: int) -> Floats:
    """(count, 3) points on a surface, even over its area: one drawn in each of count equal shares of it."""
    areas = np.cumsum(triangle_areas(surface.vertices, surface.triangles))
    rng = np.random.default_rng(seed)
    place = (np.arange(count) + rng.random(count)) * (areas[-1] / count)
    corners = surface.triangles[np.minimum(np.searchsorted(areas, place, side="right"), len(areas) - 1)]
    root, second = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1 - root, root * (1 - second), root * second], axis=1)
    return np.asarray(np.einsum("nk,nkc->nc", weights, surface.vertices[corners]))


def added_share(
    reference: Surface, distorted: Surface, reach: float, seed: int, count: int = ADDED_POINTS
) -> Work[float]:
    """Share of the distorted surface's area that is farther than reach from the reference; yields 0.7 to 1.

    A one-way metric looks around the reference only, and cannot see it.
    """
    points = spread_points(distorted, count, seed)
    points = points[morton_order(points)]
    far = 0
    for first in range(0, count, _BATCH):
        batch = points[first : first + _BATCH]
        nearest, _ = closest_on(reference, batch, reference.query.nearest(batch, None))
        away = batch - nearest
        far += int(np.count_nonzero(dot(away, away) > reach * reach))
        yield 0.7 + 0.3 * (first + len(batch)) / count
    return far / count


def differing_maps(reference: Surface, distorted: Surface) -> list[str]:
    """Inputs of shaders, other than what the metric sees, whose images are not the same on both; by name."""
    kept, now = (_maps(surface) for surface in (reference, distorted))
    return sorted(role for role in kept.keys() | now.keys() if kept.get(role) != now.get(role))


def _maps(surface: Surface) -> dict[str, set[str]]:
    """The contents of the images, by the input that they feed, that the metric does not look at."""
    maps: dict[str, set[str]] = {}
    for image in all_images(surface):
        if image.role not in {"base color", "alpha"}:
            maps.setdefault(image.role, set()).add(image.digest)
    return maps


def _patch_facts(result: Result) -> tuple[Fact, ...]:
    mesh = result.patch_mesh
    return (
        Fact("seed", result.settings.seed, "number"),
        Fact("settings", result.settings.as_dict(), "as the flags"),
        Fact("samples", len(result.samples.positions), "samples"),
        Fact("patches", len(result.patches), "patches"),
        Fact("patches_extended", sum(patch.extended for patch in result.patches), "patches"),
        Fact("triangles_after_splitting", len(mesh.triangles), "triangles of the reference"),
        Fact("covered", covered_share(result), "share of the reference's area"),
    )


def _see_through(surface: Surface, fields: Fields) -> Work[float]:
    """Share of samples whose nearest place is transparent; yields 0.6."""
    has_alpha = np.array([material.alpha is not None for material in surface.materials])
    rows = np.flatnonzero(has_alpha[surface.material[fields.triangle]])
    count = 0
    for first in range(0, len(rows), _SEEN):
        batch = rows[first : first + _SEEN]
        triangle = fields.triangle[batch]
        _, weights = closest_on(surface, fields.nearest[batch], triangle)
        count += int(np.count_nonzero(surface.alpha_at(triangle, weights) < OPAQUE))
        yield 0.6
    return count / len(fields.triangle)


def _magenta_share(surface: Surface, fields: Fields) -> float:
    """Share of samples on materials with images that have the color Blender shows for an image that is not there."""
    has_image = np.array([bool(material.images) for material in surface.materials])
    return _share((fields.ncf == np.array(MISSING)).all(axis=1) & has_image[surface.material[fields.triangle]])


def _samples_by_material(surface: Surface, fields: Fields) -> dict[str, float]:
    counts = np.bincount(surface.material[fields.triangle], minlength=len(surface.materials))
    shares: dict[str, float] = {}
    for material, count in zip(surface.materials, counts.tolist(), strict=True):
        name = material.name or NO_MATERIAL
        shares[name] = shares.get(name, 0.0) + count / len(fields.triangle)
    return shares


def _diagonal(surface: Surface) -> float:
    low, high = box_of(surface.vertices)
    longest = float((high - low).max())
    return longest * float(np.linalg.norm((high - low) / longest))  # no square overflows


def _share(mask: NDArray[np.bool_]) -> float:
    return float(np.count_nonzero(mask) / len(mask))


def _warnings(
    reference: str, distorted: str, result: Result, sides: Sequence[Sequence[Fact]], pair: Sequence[Fact]
) -> tuple[str, ...]:
    """The facts that pass their limits, as sentences."""
    values = {fact.name: fact.value for fact in pair}
    warnings = []
    all_scored = len(result.patches) >= min(result.settings.patches, len(result.patch_mesh.vertices))
    if all_scored and values["covered"] < LEAST_COVERED:
        warnings.append(
            f"{reference}: the patches cover {_percent(values['covered'])} of its area; the rest has no say in the "
            "score (more patches cover more)"
        )
    if values["sign_in_doubt_and_different"] > SIGN_IN_DOUBT:
        warnings.append(
            f"{distorted}: at {_percent(values['sign_in_doubt_and_different'])} of the samples inside and outside are "
            "in doubt and differ from the reference's; close the holes, or turn the normals of either mesh outwards"
        )
    if values["flipped"] > FLIPPED:
        warnings.append(
            f"{distorted}: {_percent(values['flipped'])} of its faces, by samples, look the other way than the "
            "reference's; the score cannot see that (recalculate its normals)"
        )
    if values["added"] > ADDED:
        warnings.append(
            f"{distorted}: {_percent(values['added'])} of its area lies far from the reference; the score looks around "
            "the reference only and cannot see that (Both Directions, --both, does)"
        )
    for name, facts in zip((reference, distorted), sides, strict=True):
        of = {fact.name: fact.value for fact in facts}
        if of["magenta"] > MAGENTA:
            warnings.append(
                f"{name}: {_percent(of['magenta'])} of the samples on it are magenta, as Blender shows images and UDIM "
                "tiles that are missing; repair its images"
            )
        missing = of["uv_missing"]
        if missing is not None and missing > UV_MISSING:
            warnings.append(
                f"{name}: {_percent(missing)} of its textured area has no texture coordinates (all are 0, 0) and the "
                "color of one pixel; unwrap it"
            )
    return tuple(dict.fromkeys(warnings))  # a mesh may be compared with itself


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
