# SPDX-License-Identifier: GPL-3.0-or-later
"""Facts about one surface, each with its unit: what was left out of it, its edges, its texture coordinates, its images.

The metric answers with a number whatever it is given; these facts say what it was given. The paper has none of this.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..metric.geometry import Floats, Ints, ranges
from ..metric.stepper import Progress, Work
from ..metric.surface import Surface
from ..metric.texture import ImageFacts

NO_MATERIAL = "(no material)"
UV_EDGE = 1e-5  # texture coordinates this far outside [0, 1] are on its edge, up to float32
UV_GRIDS = (512, 256, 128, 64)  # cells a side of the texture; the first one that costs no more than
UV_CELLS = 700_000  # cells to look at
_UV_SHIFT = (0.3819660113, 0.7236067977)  # of the cells' centers: no edge of a usual UV map runs through these
_CHUNK = 1 << 17  # cells of a step


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


def surface_facts(surface: Surface) -> Work[tuple[Fact, ...]]:
    """What is known of a surface without a comparison; yields the share done, 0 to 0.4."""
    preparation = surface.preparation
    open_edges, non_manifold = edge_counts(surface.triangles)
    yield Progress("", 0.1)
    areas = surface.areas
    layers, uv = _textured(surface)
    yield Progress("", 0.2)
    overlapping = yield from overlapping_share(uv, layers[layers >= 0])
    yield Progress("", 0.3)
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
        Fact("box", surface.frame.leave(box_of(surface.vertices)).tolist(), "scene units"),
        *_uv_facts(uv, areas[layers >= 0], overlapping),
        Fact(
            "colors_from", {material.name or NO_MATERIAL: material.how for material in surface.materials}, "by material"
        ),
        Fact("images", _images(surface), "pixels"),
    )


def edge_counts(triangles: Ints) -> tuple[int, int]:
    """How many edges of the welded triangles have one face, and how many more than two."""
    a, b, c = triangles.T
    width = int(triangles.max()) + 1
    keys = np.concatenate([np.minimum(x, y) * width + np.maximum(x, y) for x, y in ((a, b), (b, c), (c, a))])
    keys.sort()
    changes = np.concatenate([[True], keys[1:] != keys[:-1], [True]])
    is_first, is_last = changes[:-1], changes[1:]
    more = is_first[:-2] & (keys[2:] == keys[:-2])
    return int(np.count_nonzero(is_first & is_last)), int(np.count_nonzero(more))


def overlapping_share(uv: Floats, layers: Ints) -> Work[float | None]:
    """Share of the used texture area that is used more than once; yields 0.3. None where no area is used.

    Tiles lie on one another, as textures that repeat have them. An estimate: of the centers of a grid's cells,
    those in more than one of the triangles, among those in any.

    Args:
        uv: (T, 3, 2) finite texture coordinates. layers: (T,) which texture; only those of one overlap.
    """
    low = _low(uv)
    tile = np.floor(low)
    low -= tile
    yield Progress("", 0.3)
    high = _high(uv) - tile
    shift = np.array(_UV_SHIFT)[:, None]
    yield Progress("", 0.3)
    for side in UV_GRIDS:
        first, last = np.ceil(low * side - shift), np.floor(high * side - shift)
        width, height = np.maximum(last - first + 1, 0)
        yield Progress("", 0.3)
        if float((width * height).sum()) <= UV_CELLS:
            break
    else:
        return None
    cells = (width * height).astype(np.int64)
    used = np.flatnonzero(cells)
    used_keys = []
    for group in _groups(used, cells[used]):
        row = np.repeat(np.arange(len(group)), cells[group])
        y, x = np.divmod(ranges(np.zeros_like(group), cells[group]), width[group].astype(np.int64).take(row))
        x, y = (at + first[k].take(group).astype(np.int64).take(row) for k, at in enumerate((x, y)))
        corners = (uv.take(group, axis=0) - tile.T.take(group, axis=0)[:, None]) * side - _UV_SHIFT
        inside = _inside(corners, row, x.astype(np.float64), y.astype(np.float64))
        used_keys.append(((layers.take(group).take(row) * side + y % side) * side + x % side)[inside])
        yield Progress("", 0.3)
    keys, times = np.unique(np.concatenate(used_keys or [np.empty(0, np.int64)]), return_counts=True)
    return float(np.count_nonzero(times > 1) / len(keys)) if len(keys) else None


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
    outside = (np.minimum(*low) < -UV_EDGE) | (np.maximum(*high) > 1 + UV_EDGE)
    missing = (low == 0).all(axis=0) & (high == 0).all(axis=0)
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
    if channel[0] >= 0 and (channel == channel[0]).all():  # as nearly always, and many times as fast
        return surface.material, np.ascontiguousarray(surface.corners[:, :, channel[0] : channel[0] + 2])
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
    """(2, T) least of the three corners; many times as fast as .min(axis=1)."""
    a, b, c = uv.transpose(1, 2, 0)
    low = np.minimum(a, b, order="C")
    return np.minimum(low, c, out=low)


def _high(uv: Floats) -> Floats:
    a, b, c = uv.transpose(1, 2, 0)
    high = np.maximum(a, b, order="C")
    return np.maximum(high, c, out=high)


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


def all_images(surface: Surface) -> tuple[ImageFacts, ...]:
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
        for image in all_images(surface)
    ]


def box_of(vertices: Floats) -> Floats:
    """(2, 3) lowest and highest corner of (V, 3) vertices."""
    axes = vertices.T  # one after the other: several times as fast as .min(axis=0)
    return np.array([[axis.min() for axis in axes], [axis.max() for axis in axes]])
