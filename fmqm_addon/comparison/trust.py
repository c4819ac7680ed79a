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
from ..metric.fields import Fields
from ..metric.geometry import Floats, dot
from ..metric.queries import closest_on, normals_at
from ..metric.stepper import Progress, Work, as_part
from ..metric.surface import Surface
from ..metric.texture import MISSING, ImageFacts, Material
from .color_shift import color_shifts
from .distances import POINTS, Apart, apart
from .doubts import doubts
from .parts import Grouping, Part, groupings, parts_report
from .surface_facts import NO_MATERIAL, Fact, all_images, box_of, surface_facts

FLIPPED_COSINE = -0.5  # between the faces nearest to a sample, which noise and decimation turn by less. The metric
# squares cosines and cannot see it
ADDED_DISTANCE = 0.1  # of the median patch diagonal: far beyond what an LOD moves its surface
POINTS_SHARE, LEAST_POINTS = 10, 2000  # points spread over each mesh: a tenth of the samples, at least so many
WIDE = 0.5  # of the reference's box diagonal
OPAQUE = 0.5  # a lower alpha is see-through
COLOR_UNIT = "CIE 1976 difference, 2.3 is just noticeable"
_SEEN = 1 << 14  # samples of a step
_SEEN_ROLES = {"base color", "alpha"}


@dataclass(frozen=True)
class Trust:
    """The facts of a comparison.

    Attributes:
        reference, distorted: of the meshes. pair: of the two together.
        parts: scores of the reference's parts, and which of them are gone.
        warnings: the few that should stop someone from believing the score. notes: what is good to know.
    """

    reference: tuple[Fact, ...]
    distorted: tuple[Fact, ...]
    pair: tuple[Fact, ...]
    parts: tuple[Part, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]


def assessing(
    reference: Surface,
    distorted: Surface,
    result: Result,
    known: Sequence[Fact],
    groups: Sequence[Grouping] | None = None,
) -> Work[Trust]:
    """All facts of a comparison; yields the share done.

    Args:
        known: surface_facts of the reference. groups: groupings of it. They serve all its comparisons; None: made here.
    """
    own = yield from surface_facts(distorted)
    yield Progress("", 0.3)
    if groups is None:
        groups = yield from as_part(groupings(reference), 0.3, 0.1)
    compared = ((reference, result.ref), (distorted, result.dist))
    normals = []
    for surface, fields in compared:
        normals.append(normals_at(surface, fields.triangle))
        yield Progress("", 0.4)
    doubtful = [
        in_doubt(fields, result.samples.positions, normal)
        for (_, fields), normal in zip(compared, normals, strict=True)
    ]
    differs = (result.ref.sdf < 0) != (result.dist.sdf < 0)
    yield Progress("", 0.4)
    alphas = []
    for surface, fields in compared:
        alphas.append((yield from _alphas(surface, fields)))
    lost, gained = ((alphas[k] < OPAQUE) & (alphas[1 - k] >= OPAQUE) for k in (0, 1))
    reach = ADDED_DISTANCE * float(np.median([patch.diagonal for patch in result.patches]))
    seed, count = result.settings.seed, min(POINTS, max(LEAST_POINTS, len(result.samples.positions) // POINTS_SHARE))
    moved = result.ref.nearest - result.dist.nearest  # by more than reach: what it faced is gone
    there = yield from as_part(apart(reference, distorted, reach, seed, count), 0.5, 0.2)
    back = yield from as_part(apart(distorted, reference, reach, seed, count), 0.7, 0.2)
    parts = yield from as_part(parts_report(groups, reference, distorted, result), 0.9, 0.1)
    shifts = color_shifts(result)
    sides = [
        (
            Fact("sign_in_doubt", _share(doubt), "share of samples"),
            Fact("samples_by_material", _samples_by_material(surface, fields), "share of samples"),
            Fact("see_through", _share(alpha < OPAQUE), "share of samples"),
            Fact("alpha_zero", _alpha_zero(surface, fields, alpha), "materials whose alpha is 0 everywhere"),
            Fact("magenta", _magenta_share(surface, fields), "share of samples"),
            Fact("rounding", surface.rounding, "share of the original's box diagonal"),
            Fact("collapsed", _collapsed(surface), "share of triangles"),
        )
        for (surface, fields), doubt, alpha in zip(compared, doubtful, alphas, strict=True)
    ]
    scale, diagonals = result.frame.scale, (_diagonal(reference), _diagonal(distorted))
    maps_lost, maps_added = one_sided_maps(reference, distorted), one_sided_maps(distorted, reference)
    pair = (
        *_patch_facts(result),
        *_width_facts(result),
        Fact("sign_in_doubt_and_different", _share((doubtful[0] | doubtful[1]) & differs), "share of samples"),
        Fact(
            "flipped",
            _share((dot(*normals) < FLIPPED_COSINE) & (dot(moved, moved) < reach * reach)),
            "share of samples",
        ),
        Fact("color_shift", float(shifts.mean()), COLOR_UNIT),
        Fact("color_shift_largest", float(shifts.max()), f"{COLOR_UNIT}, of a patch"),
        Fact("transparency_lost", _share(lost), "share of samples"),
        Fact("transparency_gained", _share(gained), "share of samples"),
        Fact("missing", there.beyond, "share of the original's area"),
        Fact("missing_parts", list(parts.missing), "parts of the original"),
        Fact("missing_parts_count", parts.missing_count, "parts"),
        Fact("added", back.beyond, "share of the LOD's area"),
        Fact("added_beyond", reach * scale, "scene units"),
        *_distance_facts("distance_to_distorted", there, scale, diagonals[0]),
        *_distance_facts("distance_to_reference", back, scale, diagonals[0]),
        Fact("size", diagonals[1] / diagonals[0], "of the original's box diagonal"),
        Fact("triangle_ratio", len(distorted.triangles) / len(reference.triangles), "times the original's"),
        _images_fact(same_images(reference, distorted)),
        Fact("maps_lost", maps_lost, "maps that only the original has"),
        Fact("maps_added", maps_added, "maps that only the LOD has"),
        Fact("maps_not_seen", differing_maps(reference, distorted), "maps that differ"),
    )
    facts = ((*known, *sides[0]), (*own, *sides[1]))
    warnings, notes = doubts((reference.name, distorted.name), result, facts, pair)
    return Trust(*facts, pair, parts.parts, warnings, notes)


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


def differing_maps(reference: Surface, distorted: Surface) -> list[str]:
    """Inputs of shaders, other than what the metric sees, whose images are not the same on both; by name."""
    kept, now = (_maps(surface) for surface in (reference, distorted))
    return sorted(role for role in kept.keys() | now.keys() if kept.get(role) != now.get(role))


def one_sided_maps(surface: Surface, other: Surface) -> list[str]:
    """Inputs of shaders that images feed on a surface and none on the other; "Normal of Leaves" where another material
    of the other has one. None where the other's images are not known: a texture was given for all of it."""
    if any(material.how == "given" for material in (*surface.materials, *other.materials)):
        return []
    kept, now = _maps(surface), _maps(other)
    lost = sorted(kept.keys() - now.keys())
    theirs = {material.name: _roles(material.images) for material in other.materials}
    for material in surface.materials:
        missing = _roles(material.images) - theirs.get(material.name, _roles(material.images)) - set(lost)
        lost += [f"{role} of {material.name or NO_MATERIAL}" for role in sorted(missing)]
    return list(dict.fromkeys(lost))


def _images_fact(same: bool | None) -> Fact:
    return Fact("same_images", same, "yes or no", "" if same is not None else "not both have images that are known")


def same_images(reference: Surface, distorted: Surface) -> bool | None:
    """Whether base colors come from images of the same contents; None where a mesh has none that are known."""
    contents = [
        {image.digest for image in all_images(surface) if "base color" in (image.role, *image.roles)}
        for surface in (reference, distorted)
    ]
    return contents[0] == contents[1] if all(contents) else None


def _maps(surface: Surface) -> dict[str, set[str]]:
    """The contents of the images, by the input that they feed, that the metric does not look at."""
    maps: dict[str, set[str]] = {}
    for image in all_images(surface):
        for role in _roles((image,)):
            maps.setdefault(role, set()).add(image.digest)
    return maps


def _roles(images: Sequence[ImageFacts]) -> set[str]:
    """The inputs that the images feed and that the metric does not look at."""
    return {role for image in images for role in image.roles or (image.role,)} - _SEEN_ROLES


def _patch_facts(result: Result) -> tuple[Fact, ...]:
    mesh = result.patch_mesh
    return (
        Fact("seed", result.settings.seed, "number"),
        Fact("settings", result.settings.as_dict(), "as the flags"),
        Fact("samples", len(result.samples.positions), "samples"),
        Fact("patches", len(result.patches), "patches"),
        Fact("patches_extended", sum(patch.extended for patch in result.patches), "patches"),
        Fact("triangles_after_splitting", len(mesh.triangles), "triangles of the original"),
        Fact("covered", covered_share(result), "share of the original's area"),
    )


def _width_facts(result: Result) -> tuple[Fact, Fact]:
    """Of the patches that grew without a jump: where triangles are as long as the box, they decide the score."""
    width = np.array([0.0 if patch.extended else patch.diagonal for patch in result.patches])
    return (
        Fact("widest_patch", min(float(width.max()), 1.0), "share of the original's box diagonal"),
        Fact("wide_patches", _share(width > WIDE), "share of patches that span half of it"),
    )


def _distance_facts(name: str, found: Apart, scale: float, box: float) -> tuple[Fact, Fact]:
    """In scene units and as shares of the reference's box, of the points that are spread over one mesh."""
    values = {"mean": found.mean, "rms": found.rms, "largest": found.largest}
    return (
        Fact(name, {key: value * scale for key, value in values.items()}, "scene units"),
        Fact(
            f"{name}_of_box",
            {key: value / box for key, value in values.items()},
            "share of the original's box diagonal",
        ),
    )


def _collapsed(surface: Surface) -> float:
    """Share of the triangles given that have become lines or points, or lie on one another."""
    preparation = surface.preparation
    return (preparation.flat + preparation.repeated) / preparation.given


def _alphas(surface: Surface, fields: Fields) -> Work[Floats]:
    """(N,) opacity at each sample's nearest place; yields 0.5."""
    has_alpha = np.array([material.alpha is not None for material in surface.materials])
    alphas = np.ones(len(fields.triangle))
    if not has_alpha.any():
        return alphas
    rows = np.flatnonzero(has_alpha[surface.material.take(fields.triangle)])
    for first in range(0, len(rows), _SEEN):
        batch = rows[first : first + _SEEN]
        triangle = fields.triangle[batch]
        _, weights = closest_on(surface, fields.nearest[batch], triangle)
        alphas[batch] = surface.alpha_at(triangle, weights)
        yield Progress("", 0.5)
    return alphas


def _alpha_zero(surface: Surface, fields: Fields, alpha: Floats) -> list[str]:
    """Names of the materials that have samples and no opacity at any of them."""
    samples = np.bincount(surface.material.take(fields.triangle), minlength=len(surface.materials))
    shown = np.bincount(surface.material.take(fields.triangle[alpha > 0]), minlength=len(surface.materials))
    return [
        _with_image(material)
        for material, count, some in zip(surface.materials, samples.tolist(), shown.tolist(), strict=True)
        if count and not some
    ]


def _with_image(material: Material) -> str:
    """A material's name, and that of the image which its alpha comes from."""
    image = next((image.name for image in material.images if "alpha" in (image.role, *image.roles)), "")
    return f"{material.name or NO_MATERIAL} ({image})" if image else material.name or NO_MATERIAL


def _magenta_share(surface: Surface, fields: Fields) -> float:
    """Share of samples on materials with images that have the color Blender shows for an image that is not there."""
    has_image = np.array([bool(material.images) for material in surface.materials])
    (red, green, blue), missing = fields.ncf.T, MISSING
    magenta = fields.triangle[(red == missing[0]) & (green == missing[1]) & (blue == missing[2])]
    return float(np.count_nonzero(has_image[surface.material.take(magenta)]) / len(fields.triangle))


def _samples_by_material(surface: Surface, fields: Fields) -> dict[str, float]:
    counts = np.bincount(surface.material.take(fields.triangle), minlength=len(surface.materials))
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
