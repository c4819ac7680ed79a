# SPDX-License-Identifier: GPL-3.0-or-later
"""A surface as the viewer shows it: positions, texture coordinates and normals of 16 bits, and its images."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....comparison.normals import corner_normals
from ....metric.geometry import Floats, Ints
from ....metric.surface import Surface
from .images import encoded
from .packing import ends, packed, quantized
from .skins import coloring

_DIGITS = 9  # of a low end or a span


def mesh_data(surface: Surface, elsewhere: Container[str] = ()) -> dict[str, Any]:
    """Plain values for the viewer, in the metric's frame.

    Args:
        elsewhere: digests of images that the viewer has from another file.

    Returns:
        "positions", "uv" and "normals", each packed, the first two with "low" and "span"; "colors" at the vertices,
        or None; "index", packed, three a triangle; "skins" with their "first" and "count" of triangles; "images" by
        digest.
    """
    colored = coloring(surface)
    order = np.argsort(colored.skin, kind="stable")
    uv = colored.uv[order].reshape(-1, 2)
    of_skin = np.repeat(colored.skin[order], 3)
    skins: list[dict[str, Any]] = []
    steps = np.zeros((len(uv), 2), np.uint16)
    shown = [skin.pixels for skin in colored.skins if skin.pixels is not None]
    images = iter(encoded(shown))
    data: dict[str, str] = {}
    for number, skin in enumerate(colored.skins):
        here = np.flatnonzero(of_skin == number)
        low, span = ends(uv[here])
        steps[here] = quantized(uv[here], low, span)
        image = None
        if skin.pixels is not None:
            image, uri = next(images)
            if image not in elsewhere:
                data[image] = uri
        skins.append(
            {
                "first": int(here[0]) // 3, "count": len(here) // 3, "image": image, "wrap": skin.wrap,
                "smooth": skin.smooth, "shrinks": skin.shrinks, "low": _plain(low), "span": _plain(span),
            }
        )  # fmt: skip
    low, span = ends(surface.vertices)
    corner, vertex = surface.triangles[order].ravel(), quantized(surface.vertices, low, span)
    normals = octahedral(corner_normals(surface)[order].reshape(-1, 3))
    colors = colored.colors[order].reshape(-1, 3)
    first, index = _distinct(corner, steps, normals, colors, of_skin)
    has_colors = any(skin.pixels is None for skin in colored.skins)
    return {
        "name": surface.name,
        "triangles": len(surface.triangles),
        "positions": {"low": _plain(low), "span": _plain(span), "data": packed(vertex[corner[first]])},
        "uv": packed(steps[first]),
        "normals": packed(normals[first]),
        "colors": packed(colors[first]) if has_colors else None,
        "index": packed(index.astype(np.uint32).reshape(-1, 1)),
        "skins": skins,
        "images": data,
    }


def octahedral(normals: Floats) -> NDArray[np.uint16]:
    """(N, 2) steps for (N, 3) unit vectors: the octahedron they point at, unfolded to a square from -1 to 1."""
    flat = normals / np.maximum(np.abs(normals).sum(axis=1, keepdims=True), 1e-12)
    around = np.where(flat[:, :2] >= 0, 1.0, -1.0)
    place = np.where(flat[:, 2:] < 0, (1 - np.abs(flat[:, 1::-1])) * around, flat[:, :2])
    return quantized(place, np.full(2, -1.0), np.full(2, 2.0))


def _distinct(
    corner: Ints, uv: NDArray[np.uint16], normals: NDArray[np.uint16], colors: NDArray[np.uint8], skin: Ints
) -> tuple[Ints, Ints]:
    """Corners that are alike become one vertex: the first of each, in their order, and (3 T,) which each is."""
    parts = [
        skin,
        corner,
        uv[:, 0].astype(np.int64) << 16 | uv[:, 1],
        normals[:, 0].astype(np.int64) << 16 | normals[:, 1],
    ]
    parts.append(colors.astype(np.int64) @ np.array([1 << 16, 1 << 8, 1]))
    order = np.lexsort(parts[::-1])
    new = np.ones(len(order), bool)
    new[1:] = np.any([part[order][1:] != part[order][:-1] for part in parts], axis=0)
    first = order[new]  # the sort is stable
    by_place = np.argsort(first)
    rank = np.empty_like(by_place)
    rank[by_place] = np.arange(len(by_place))
    which = np.empty_like(order)
    which[order] = rank[np.cumsum(new) - 1]
    return first[by_place], which


def _plain(numbers: Floats) -> list[float]:
    return [float(f"{number:.{_DIGITS}g}") for number in numbers.tolist()]
