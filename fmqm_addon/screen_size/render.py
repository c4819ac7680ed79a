# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of a surface in linear light, with and without a light, from one depth buffer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..metric.colorspace import decode_srgb
from ..metric.geometry import Floats, dot
from ..metric.surface import Surface, triangle_normals
from .definition import AMBIENT, BACKGROUND, HEADLIGHT, MARGIN
from .rasterize import rasterize


@dataclass(frozen=True)
class View:
    """What a surface looks like from one side.

    Attributes:
        images: (H, W, 3) float32 linear light, one for each of definition.CONDITIONS, in their order.
        covered: (H, W) float32, the share of each pixel that the surface covers.
    """

    images: tuple[NDArray[np.float32], ...]
    covered: NDArray[np.float32]

    def smaller(self, factor: int) -> View:
        """Box-filtered: factor by factor pixels become one."""
        if factor == 1:
            return self
        return View(tuple(_box(image, factor) for image in self.images), _box(self.covered, factor))


def image_side(size: int) -> int:
    """Pixels of a square image on which the reference's diagonal spans size."""
    return size + 2 * int(MARGIN * size)


def render(surface: Surface, normals: Floats, axes: Floats, size: int) -> View:
    """A surface in an orthographic view, a sample in the middle of each pixel.

    Args:
        surface: in the reference's frame, its textures made for this size. normals: (T, 3, 3) at its corners.
        axes: (3, 3) rows right, up, toward the viewer. size: pixels that the reference's box diagonal spans.
    """
    side = image_side(size)
    seen = rasterize(surface.vertices, surface.triangles, axes, float(size), side)
    color = decode_srgb(surface.color_at(seen.triangles, seen.barycentric))
    toward = axes[2]
    normal = np.einsum("nk,nkc->nc", seen.barycentric, normals[seen.triangles])
    length = np.maximum(np.linalg.norm(normal, axis=1), np.finfo(np.float64).tiny)
    # Two-sided: of a face that is seen from behind, the normal is turned round. Which side that is, normals say that
    # stand on the other side than the order of the corners.
    flat = triangle_normals(surface.vertices, surface.triangles)[seen.triangles]
    facing = np.sign(flat @ toward) * np.where(dot(flat, normal) < 0, -1, 1)
    shade = AMBIENT + HEADLIGHT * np.maximum(0, facing * (normal @ toward) / length)
    images = []
    for light in (color, color * shade[:, None]):
        image = np.full((side * side, 3), BACKGROUND, np.float32)
        image[seen.pixels] = light
        images.append(image.reshape(side, side, 3))
    covered = np.zeros(side * side, np.float32)
    covered[seen.pixels] = 1
    return View(tuple(images), covered.reshape(side, side))


def _box(image: NDArray[np.float32], factor: int) -> NDArray[np.float32]:
    height, width = image.shape[0] // factor, image.shape[1] // factor
    parts = image.reshape(height, factor, width, factor, *image.shape[2:])
    return np.asarray(parts.mean(axis=(1, 3)), np.float32)
