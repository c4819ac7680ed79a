# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of a surface in linear light, with and without a light, from one depth buffer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..metric.colorspace import decode_srgb
from ..metric.geometry import Floats, Ints, dot, triangle_normals, weighted
from ..metric.surface import Surface
from .definition import AMBIENT, BACKGROUND, HEADLIGHT, MARGIN, OPAQUE
from .rasterize import CutOut, rasterize

Image = NDArray[np.float32]
_SOLID = 0.999  # a lower alpha is less than opaque, and not rounding


@dataclass(frozen=True)
class View:
    """What a surface looks like from one side.

    Attributes:
        images: (H, W, 3) float32 linear light, one for each of definition.CONDITIONS, in their order.
        covered: (H, W) float32, the share of each pixel that the surface covers.
        see_through: a part of it is less than opaque: cut out below definition.OPAQUE, and drawn as opaque from there.
    """

    images: tuple[Image, ...]
    covered: Image
    see_through: bool = False

    def halved(self) -> View:
        """Box-filtered: two by two pixels become one."""
        return View(tuple(map(_halved, self.images)), _halved(self.covered), self.see_through)


def image_side(size: int) -> int:
    """Pixels of a square image on which the reference's diagonal spans size."""
    return size + 2 * int(MARGIN * size)


def render(surface: Surface, normals: Floats, axes: Floats, size: int, factor: int = 1) -> View:
    """A surface in an orthographic view, a sample in the middle of each pixel.

    Args:
        surface: in the reference's frame, its textures made for this size. normals: (T, 3, 3) at its corners.
        axes: (3, 3) rows right, up, toward the viewer. size: pixels that the reference's box diagonal spans.
        factor: so many pixels along each axis are one of the result, box-filtered; it divides the image's side.
    """
    side = image_side(size)
    see_through = False

    def kept(triangle: Ints, place: Floats) -> NDArray[np.bool_]:
        nonlocal see_through
        alpha = surface.alpha_at(triangle, place)
        see_through = see_through or bool((alpha < _SOLID).any())
        return alpha >= OPAQUE

    has_alpha = np.array([material.alpha is not None for material in surface.materials])[surface.material]
    cut_out = CutOut(has_alpha, kept) if has_alpha.any() else None
    seen = rasterize(surface.vertices, surface.triangles, axes, float(size), side, cut_out)
    color = decode_srgb(surface.color_at(seen.triangles, seen.barycentric))
    toward = axes[2]
    shaded = normals.take(seen.triangles, axis=0)
    normal = weighted(seen.barycentric, shaded[:, 0], shaded[:, 1], shaded[:, 2])
    length = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(np.float64).tiny)
    # Two-sided: of a face that is seen from behind, the normal is turned round. Which side that is, normals say that
    # stand on the other side than the order of the corners.
    flat = triangle_normals(surface.vertices, surface.triangles).take(seen.triangles, axis=0)
    facing = np.sign(flat @ toward) * np.where(dot(flat, normal) < 0, -1, 1)
    shade = AMBIENT + HEADLIGHT * np.maximum(0, facing * (normal @ toward) / length)
    row, column = np.divmod(seen.pixels, side)
    place = row // factor * (side // factor) + column // factor

    def filtered(light: Floats | None, background: float) -> Image:
        share = np.bincount(place, light, (side // factor) ** 2) / factor**2
        return np.asarray(share + background * (1 - covered), np.float32).reshape(side // factor, -1)

    covered = np.bincount(place, None, (side // factor) ** 2) / factor**2
    images = tuple(
        np.stack([filtered(channel, BACKGROUND) for channel in light.T], axis=2)
        for light in (color, color * shade[:, None])
    )
    return View(images, filtered(None, 0), see_through)


def _halved(image: Image) -> Image:
    total = image[::2, ::2] + image[1::2, ::2]
    total += image[::2, 1::2]
    total += image[1::2, 1::2]
    total /= 4
    return total
