# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole of D against a slow, plain version of its definition, in float64, with other people's FLIP and SSIM."""

from __future__ import annotations

import flip_evaluator
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from skimage.metrics import structural_similarity

from fmqm_addon.metric.surface import MeshArrays
from fmqm_addon.metric.texture import Texture
from fmqm_addon.screen_size.measure import ScreenSizes
from tests.metric.meshes import mesh_arrays, shaken, sphere, texture

Array = NDArray[np.float64]
GOLDEN = np.pi * (3 - np.sqrt(5))
# What is rendered at which size, and the views that are looked at there.
FIRST, SECOND = (256, (16, 32, 64), (0, 1, 2, 3, 4, 5)), (1024, (128, 256, 512), (1,))


@pytest.mark.once
def test_d_is_what_its_definition_says() -> None:
    """A ball with a texture against one that is shaken; its corners' normals are those of smoothing, all blunt."""
    reference = mesh_arrays(sphere(), (texture(0, 512),))
    lod = shaken(reference, 0.001)
    sizes = ScreenSizes(reference)
    sizes.prepare().run()
    curve = sizes.measure(lod).run().curve
    low, high = reference.positions.min(axis=0), reference.positions.max(axis=0)
    center, diagonal = (low + high) / 2, float(np.linalg.norm(high - low))
    assert curve[-1].size > 64, "both renderings are compared"
    for rendered, at, views in (FIRST, SECOND):
        images = [
            [rendering(mesh, center, diagonal, axes_of(view), rendered) for view in views] for mesh in (reference, lod)
        ]
        for found in (each for each in curve if each.size in at):
            wanted = [compared(one, other, rendered // found.size) for one, other in zip(*images, strict=True)]
            assert np.abs(found.flip.T[[*views]] - [flip for flip, _ in wanted]).max() < 2e-5
            assert np.abs(found.dissimilarity.T[[*views]] - [unlike for _, unlike in wanted]).max() < 2e-5
            assert found.flip.min() > 1e-3, "there is something to compare"


def axes_of(view: int) -> Array:
    """The k-th of six points on a Fibonacci spiral: right, up, toward it; +Z is up."""
    z = 1 - (2 * view + 1) / 6
    toward = np.array([np.sqrt(1 - z * z) * np.cos(view * GOLDEN), np.sqrt(1 - z * z) * np.sin(view * GOLDEN), z])
    right = np.cross([0, 0, 1], toward) / np.linalg.norm(np.cross([0, 0, 1], toward))
    return np.array([right, np.cross(toward, right), toward])


def rendering(mesh: MeshArrays, center: Array, diagonal: float, axes: Array, size: int) -> tuple[Array, Array, Array]:
    """Unlit and lit in linear light, and what is covered: triangle by triangle, its pixels one box at a time."""
    side = size + 2 * (size // 16)
    points = (mesh.positions - center) / diagonal @ axes.T
    corners = points[mesh.triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    smooth = np.zeros_like(points)
    for triangle, corner, face in zip(mesh.triangles, corners, area, strict=True):
        for k in range(3):
            one, other = (corner[(k + step) % 3] - corner[k] for step in (1, 2))
            angle = np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other))
            smooth[triangle[k]] += angle * face / np.linalg.norm(face)
    smooth /= np.linalg.norm(smooth, axis=1, keepdims=True)
    pixels = level(mesh, np.linalg.norm(area, axis=1), size)
    depth, light, shade = np.full((side, side), -np.inf), np.full((side, side, 3), 0.18), np.ones((side, side))
    for triangle, uv, (a, b, c) in zip(mesh.triangles, mesh.corners, corners, strict=True):
        x, y = (a[0], b[0], c[0]), (a[1], b[1], c[1])
        left, right = (int(np.clip(side / 2 + size * end + more, 0, side)) for end, more in ((min(x), 0), (max(x), 1)))
        top, bottom = (int(np.clip(side / 2 - size * end + more, 0, side)) for end, more in ((max(y), 0), (min(y), 1)))
        px = (np.arange(left, right) + 0.5 - side / 2) / size
        py = (side / 2 - np.arange(top, bottom)[:, None] - 0.5) / size
        whole = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        v = ((px - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (py - a[1])) / whole
        w = ((b[0] - a[0]) * (py - a[1]) - (px - a[0]) * (b[1] - a[1])) / whole
        weights = np.stack([1 - v - w, v, w], axis=2)
        box = np.s_[top:bottom, left:right]
        z = weights @ [a[2], b[2], c[2]]
        here = (weights >= 0).all(axis=2) & (z > depth[box])
        normal = weights[here] @ smooth[triangle]
        depth[box][here] = z[here]
        light[box][here] = linear(bilinear(pixels, weights[here] @ uv))
        cosine = normal[:, 2] / np.linalg.norm(normal, axis=1)
        shade[box][here] = 0.2 + 0.8 * np.maximum(0, np.sign(whole) * cosine)  # two-sided: from behind, turned round
    return light, light * shade[:, :, None], np.isfinite(depth).astype(float)


def level(mesh: MeshArrays, area: Array, size: int) -> Array:
    """Encoded pixels of the mip level nearest to the density, the median over the area; each is half of the last."""
    color = mesh.materials[0].color
    assert isinstance(color, Texture)
    pixels = color.pixels / 255
    uv = mesh.corners[:, 1:] - mesh.corners[:, :1]
    density = np.sqrt(np.abs(np.linalg.det(uv)) / area) * pixels.shape[0]
    order = np.argsort(density)
    middle = density[order[np.searchsorted(np.cumsum(area[order]), area.sum() / 2)]]
    for _ in range(max(0, round(np.log2(middle / size)))):
        pixels = np.round(255 * encoded(boxed(linear(pixels), 2))) / 255
    return pixels


def bilinear(pixels: Array, uv: Array) -> Array:
    """Between the four nearest centers, the image repeated; row 0 is the top."""
    height, width = pixels.shape[:2]
    i, j = uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5
    total = np.zeros((len(uv), 3))
    for row in (0, 1):
        for column in (0, 1):
            x, y = np.floor(i) + column, np.floor(j) + row
            weight = (1 - np.abs(i - x)) * (1 - np.abs(j - y))
            total += weight[:, None] * pixels[(y % height).astype(int), (x % width).astype(int), :3]
    return total


def boxed(image: Array, factor: int) -> Array:
    height, width = image.shape[0] // factor, image.shape[1] // factor
    return np.asarray(image.reshape(height, factor, width, factor, -1).mean(axis=(1, 3)))


def linear(color: Array) -> Array:
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


def encoded(light: Array) -> Array:
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)


def compared(one: tuple[Array, ...], other: tuple[Array, ...], factor: int) -> tuple[list[float], list[float]]:
    """Mean FLIP and 1 - mean SSIM by condition, over the union of both silhouettes grown by a pixel."""
    covered = (boxed(one[2], factor) + boxed(other[2], factor))[:, :, 0] > 0
    mask = binary_dilation(covered, np.ones((3, 3)))
    flips, unlike = [], []
    for first, second in zip(one[:2], other[:2], strict=True):
        pair = [encoded(boxed(image, factor)) for image in (first, second)]
        options = {"inputsRGB": True, "applyMagma": False, "parameters": {"ppd": 67.0}}
        error, _, _ = flip_evaluator.evaluate(*(each.astype(np.float32) for each in pair), "LDR", **options)
        luma = [each @ [0.2126, 0.7152, 0.0722] for each in pair]
        _, similar = structural_similarity(
            *luma, gaussian_weights=True, sigma=1.5, use_sample_covariance=False, data_range=1.0, full=True
        )
        flips.append(float(np.asarray(error).reshape(mask.shape)[mask].mean()))
        unlike.append(1 - float(similar[mask].mean()))
    return flips, unlike
