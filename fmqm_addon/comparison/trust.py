# SPDX-License-Identifier: GPL-3.0-or-later
"""How far to trust a score: facts about two surfaces and about their comparison, each with its unit.

The metric answers with a number whatever it is given. These facts say what it could not see (flipped faces,
geometry that only the distorted mesh has, maps other than base color) and what it had to assume (a side of a
surface that has none, colors of places without texture coordinates). The paper has none of this.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..metric.evaluation import Result
from ..metric.fields import Fields, closest_on
from ..metric.geometry import Floats, Ints, dot, morton_order, ranges
from ..metric.surface import Surface, triangle_areas, triangle_normals
from ..metric.texture import MISSING, ImageFacts

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
NO_MATERIAL = "(no material)"
OPAQUE = 0.5  # a lower alpha is see-through
UV_EDGE = 1e-5  # texture coordinates this far outside [0, 1] are on its edge, up to float32
UV_GRIDS = (512, 256, 128, 64)  # cells a side of the texture; the first one that costs no more than
UV_CELLS = 700_000  # cells to look at
_UV_SHIFT = (0.3819660113, 0.7236067977)  # of the cells' centers: no edge of a usual UV map runs through these
_CHUNK = 1 << 17  # cells of a step
_BATCH = 2048  # nearest points of a step

T = TypeVar("T")
Work = Generator[float, None, T]


@dataclass(frozen=True)
class Fact:
    """One thing known about a score.

    Attributes:
        name: a key, in words joined by "_". value: what JSON can hold; None where it is not known.
        unit: of the value. why: there is no value; "" where there is.
    """

    name: str
    value: Any
    unit: str
    why: str = ""


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


def surface_facts(surface: Surface) -> Work[tuple[Fact, ...]]:
    """What is known of a surface without a comparison; yields the share done, 0 to 0.4."""
    preparation = surface.preparation
    open_edges, non_manifold = edge_counts(surface.triangles)
    yield 0.1
    areas = triangle_areas(surface.vertices, surface.triangles)
    layers, uv = _textured(surface)
    yield 0.2
    overlapping = yield from overlapping_share(uv, layers[layers >= 0])
    yield 0.3
    return (
        Fact("triangles", preparation.given, "triangles"),
        Fact("triangles_used", len(surface.triangles), "triangles"),
        Fact("triangles_not_finite", preparation.not_finite, "triangles left out"),
        Fact("triangles_flat", preparation.flat, "triangles left out"),
        Fact("triangles_repeated", preparation.repeated, "triangles left out"),
        Fact("vertices_welded", preparation.welded, "vertices"),
        Fact("open_edges", open_edges, "edges"),
        Fact("non_manifold_edges", non_manifold, "edges"),
        Fact("watertight", open_edges == 0 and non_manifold == 0, "yes or no"),
        Fact("box", surface.frame.leave(_box(surface.vertices)).tolist(), "scene units"),
        *_uv_facts(uv, areas[layers >= 0], overlapping),
        Fact(
            "colors_from", {material.name or NO_MATERIAL: material.how for material in surface.materials}, "by material"
        ),
        Fact("images", _images(surface), "pixels"),
    )


def edge_counts(triangles: Ints) -> tuple[int, int]:
    """How many edges of the welded triangles have one face, and how many more than two."""
    first, second = triangles, np.roll(triangles, -1, axis=1)
    keys = np.sort((np.minimum(first, second) * (int(triangles.max()) + 1) + np.maximum(first, second)).ravel())
    start = np.flatnonzero(np.diff(keys, prepend=-1))
    faces = np.diff(start, append=len(keys))
    return int(np.count_nonzero(faces == 1)), int(np.count_nonzero(faces > 2))


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


def overlapping_share(uv: Floats, layers: Ints) -> Work[float | None]:
    """Share of the used texture area that is used more than once; yields 0.3. None where no area is used.

    Tiles lie on one another, as textures that repeat have them. An estimate: of the centers of a grid's cells,
    those in more than one of the triangles, among those in any.

    Args:
        uv: (T, 3, 2) finite texture coordinates. layers: (T,) which texture; only those of one overlap.
    """
    tile = np.floor(_low(uv))
    yield 0.3
    for side in UV_GRIDS:
        first, last = np.ceil((_low(uv) - tile) * side - _UV_SHIFT), np.floor((_high(uv) - tile) * side - _UV_SHIFT)
        width, height = np.maximum(last - first + 1, 0).T
        yield 0.3
        if float((width * height).sum()) <= UV_CELLS:
            break
    else:
        return None
    cells = (width * height).astype(np.int64)
    used = np.flatnonzero(cells)
    used_keys = []
    for group in _groups(used, cells[used]):
        row = np.repeat(np.arange(len(group)), cells[group])
        y, x = np.divmod(ranges(np.zeros_like(group), cells[group]), width[group].astype(np.int64)[row])
        x, y = x + first[group, 0].astype(np.int64)[row], y + first[group, 1].astype(np.int64)[row]
        corners = (uv[group] - tile[group, None]) * side - _UV_SHIFT
        inside = _inside(corners, row, x.astype(np.float64), y.astype(np.float64))
        used_keys.append(((layers[group[row]] * side + y % side) * side + x % side)[inside])
        yield 0.3
    keys, times = np.unique(np.concatenate(used_keys or [np.empty(0, np.int64)]), return_counts=True)
    return float(np.count_nonzero(times > 1) / len(keys)) if len(keys) else None


def differing_maps(reference: Surface, distorted: Surface) -> list[str]:
    """Inputs of shaders, other than what the metric sees, whose images are not the same on both; by name."""
    kept, now = (_maps(surface) for surface in (reference, distorted))
    return sorted(role for role in kept.keys() | now.keys() if kept.get(role) != now.get(role))


def _maps(surface: Surface) -> dict[str, set[str]]:
    """The contents of the images, by the input that they feed, that the metric does not look at."""
    maps: dict[str, set[str]] = {}
    for image in _all_images(surface):
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


def _uv_facts(uv: Floats, areas: Floats, overlapping: float | None) -> tuple[Fact, ...]:
    total = float(areas.sum())
    if not total > 0:
        why = "no material has texture coordinates"
        return (
            Fact("uv_outside", None, "share of the textured area", why),
            Fact("uv_overlapping", None, "share of the used texture area", why),
            Fact("uv_missing", None, "share of the textured area", why),
        )
    low, high = _low(uv), _high(uv)
    outside = (low.min(axis=1) < -UV_EDGE) | (high.max(axis=1) > 1 + UV_EDGE)
    missing = ~(low.any(axis=1) | high.any(axis=1))
    return (
        Fact("uv_outside", float(areas[outside].sum()) / total, "share of the textured area"),
        Fact(
            "uv_overlapping",
            overlapping,
            "share of the used texture area",
            "" if overlapping is not None else "the texture coordinates span no area, or far too much",
        ),
        Fact("uv_missing", float(areas[missing].sum()) / total, "share of the textured area"),
    )


def _textured(surface: Surface) -> tuple[Ints, Floats]:
    """(T,) the material of each triangle that has texture coordinates, else -1; (n, 3, 2) those coordinates."""
    channel = np.array([-1 if material.uv is None else material.uv for material in surface.materials])
    first = channel[surface.material]
    layers = np.where(first >= 0, surface.material, -1)
    rows = np.flatnonzero(first >= 0)
    if not rows.size:
        return layers, np.empty((0, 3, 2))
    uv = np.empty((len(rows), 3, 2))
    for k in range(2):
        uv[:, :, k] = surface.corners[rows, :, first[rows] + k]
    return layers, uv


def _low(uv: Floats) -> Floats:
    """(T, 2) least of the three corners; faster than .min(axis=1)."""
    return np.minimum(np.minimum(uv[:, 0], uv[:, 1]), uv[:, 2])


def _high(uv: Floats) -> Floats:
    return np.maximum(np.maximum(uv[:, 0], uv[:, 1]), uv[:, 2])


def _groups(rows: Ints, cells: Ints) -> list[Ints]:
    """The rows in groups of about _CHUNK cells."""
    number = np.cumsum(cells) // _CHUNK
    return np.split(rows, np.flatnonzero(np.diff(number)) + 1) if rows.size else []


def _inside(corners: Floats, row: Ints, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Whether (n,) points x, y are in the triangles row of (T, 3, 2) corners, whichever way these turn."""
    left, right = np.ones(len(row), bool), np.ones(len(row), bool)
    for k in range(3):
        (ax, ay), (bx, by) = corners[:, k].T, corners[:, (k + 1) % 3].T
        side = (bx - ax).take(row) * (y - ay.take(row)) - (by - ay).take(row) * (x - ax.take(row))
        left &= side > 0
        right &= side < 0
    return left | right


def _see_through(surface: Surface, fields: Fields) -> Work[float]:
    """Share of samples whose nearest place is transparent; yields 0.6."""
    has_alpha = np.array([material.alpha is not None for material in surface.materials])
    rows = np.flatnonzero(has_alpha[surface.material[fields.triangle]])
    count = 0
    for first in range(0, len(rows), _CHUNK // 8):
        batch = rows[first : first + _CHUNK // 8]
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


def _all_images(surface: Surface) -> tuple[ImageFacts, ...]:
    """Each image once for each role."""
    return tuple(dict.fromkeys(image for material in surface.materials for image in material.images))


def _images(surface: Surface) -> list[dict[str, Any]]:
    return [
        {
            "role": image.role,
            "name": image.name,
            "path": image.path,
            "width": image.width,
            "height": image.height,
            "color_space": image.color_space,
            "missing": image.missing,
        }
        for image in _all_images(surface)
    ]


def _diagonal(surface: Surface) -> float:
    low, high = _box(surface.vertices)
    longest = float((high - low).max())
    return longest * float(np.linalg.norm((high - low) / longest))  # no square overflows


def _box(vertices: Floats) -> Floats:
    return np.stack([vertices.min(axis=0), vertices.max(axis=0)])


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
