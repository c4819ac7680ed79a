# SPDX-License-Identifier: GPL-3.0-or-later
"""FLIP, how different two images look when one replaces the other.

Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom, Fairchild: FLIP: A Difference Evaluator for Alternating Images.
Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020. The names of the constants are the paper's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .convolve import convolve

Image = NDArray[np.float32]

# Section 4.1.1: contrast sensitivity, sums of Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b) of x in degrees.
_ACHROMATIC = ((1.0, 0.0047),)
_RED_GREEN = ((1.0, 0.0053),)
_BLUE_YELLOW = ((34.1, 0.04), (13.5, 0.025))
_WIDEST = 0.04
# Section 4.1.3: the exponent of color differences, and where they are bent.
_Q_C, _P_C, _P_T = 0.7, 0.4, 0.95
# Section 4.2: the width of features, in degrees, and the exponent of their differences.
_WIDTH, _Q_F = 0.082, 0.5

_RGB_TO_XYZ = np.array(  # sRGB's primaries under D65, as the paper's authors take them
    [
        [10135552 / 24577794, 8788810 / 24577794, 4435075 / 24577794],
        [2613072 / 12288897, 8788810 / 12288897, 887015 / 12288897],
        [1425312 / 73733382, 8788810 / 73733382, 70074185 / 73733382],
    ]
)
_WHITE = _RGB_TO_XYZ.sum(axis=1)
_TO_WHITE = _RGB_TO_XYZ / _WHITE[:, None]  # so that white is (1, 1, 1)
_FROM_WHITE = np.linalg.inv(_TO_WHITE)


@dataclass(frozen=True)
class Appearance:
    """All of an image that FLIP compares.

    Attributes:
        color: (H, W, 3) Hunt-adjusted L*a*b* of the image as the eye filters it.
        edges, points: (H, W) strengths of features of the two kinds.
    """

    color: Image
    edges: Image
    points: Image


def appearance(linear: NDArray[Any], pixels_per_degree: float) -> Appearance:
    """How an image, (H, W, 3) linear light in [0, 1], is seen from where a degree spans so many pixels."""
    x, y, z = np.moveaxis(linear.astype(np.float32) @ _TO_WHITE.T.astype(np.float32), 2, 0)
    luminance, red_green, blue_yellow = 116 * y - 16, 500 * (x - y), 200 * (y - z)
    radius = int(np.ceil(3 * np.sqrt(_WIDEST / (2 * np.pi**2)) * pixels_per_degree))
    offset = np.arange(-radius, radius + 1) / pixels_per_degree
    seen = [
        _filtered(channel, gaussians, offset)
        for channel, gaussians in ((luminance, _ACHROMATIC), (red_green, _RED_GREEN), (blue_yellow, _BLUE_YELLOW))
    ]
    middle = (seen[0] + 16) / 116
    xyz = np.stack([middle + seen[1] / 500, middle, middle - seen[2] / 200], axis=2)
    color = _hunt_lab(np.clip(xyz @ _FROM_WHITE.T.astype(np.float32), 0, 1))
    edges, points = _features((luminance + 16) / 116, pixels_per_degree)
    return Appearance(color, edges, points)


def flip_map(reference: Appearance, test: Appearance) -> Image:
    """(H, W) float32 differences in [0, 1]: color differences, larger where features differ too (Section 4.3)."""
    color = _bent(_hyab(reference.color, test.color))
    feature = np.maximum(np.abs(reference.edges - test.edges), np.abs(reference.points - test.points))
    feature = np.clip(feature / np.float32(np.sqrt(2)), 0, 1) ** np.float32(_Q_F)
    return np.asarray(color ** (1 - feature), np.float32)


def _filtered(channel: Image, gaussians: tuple[tuple[float, float], ...], offset: NDArray[np.float64]) -> Image:
    """A channel under its contrast sensitivity: one pass along each axis for each Gaussian."""
    lines = [np.exp(-(np.pi**2) * offset**2 / b) for _, b in gaussians]
    heights = [a * np.sqrt(np.pi / b) for a, b in gaussians]
    total = sum(height * line.sum() ** 2 for height, line in zip(heights, lines, strict=True))
    result = np.zeros_like(channel)
    for height, line in zip(heights, lines, strict=True):
        result += np.float32(height / total) * convolve(convolve(channel, line, 0), line, 1)
    return result


def _hunt_lab(linear: Image) -> Image:
    """Linear light to L*a*b*, its chroma scaled by lightness: the Hunt effect (Section 4.1.2)."""
    white = linear @ _TO_WHITE.T.astype(np.float32)
    f = np.where(white > (6 / 29) ** 3, np.cbrt(white), white / np.float32(3 * (6 / 29) ** 2) + np.float32(4 / 29))
    lightness = 116 * f[..., 1] - 16
    hunt = lightness / 100
    return np.stack(
        [lightness, hunt * 500 * (f[..., 0] - f[..., 1]), hunt * 200 * (f[..., 1] - f[..., 2])], axis=2
    ).astype(np.float32)


def _hyab(one: Image, other: Image) -> Image:
    """A city-block distance of lightness, and a Euclidean one of chroma."""
    gap = one - other
    return np.asarray(np.abs(gap[..., 0]) + np.hypot(gap[..., 1], gap[..., 2]), np.float32)


def _bent(distance: Image) -> Image:
    """Differences to [0, 1]: those below p_c of the largest one get [0, p_t], those beyond it the rest."""
    power = distance ** np.float32(_Q_C)
    bend = np.float32(_P_C * _LARGEST)
    return np.where(
        power < bend,
        np.float32(_P_T) / bend * power,
        np.float32(_P_T) + (power - bend) / (np.float32(_LARGEST) - bend) * np.float32(1 - _P_T),
    ).astype(np.float32)


def _features(luminance: Image, pixels_per_degree: float) -> tuple[Image, Image]:
    """Strengths of edges and of points: lengths of first and second derivatives along both axes."""
    deviation = 0.5 * _WIDTH * pixels_per_degree
    radius = int(np.ceil(3 * deviation))
    offset = np.arange(-radius, radius + 1)
    smooth = np.exp(-(offset**2) / (2 * deviation**2))
    smooth /= smooth.sum()
    smoothed = [convolve(luminance, smooth, axis) for axis in (0, 1)]
    strengths = []
    for weights in (-offset * smooth, (offset**2 / deviation**2 - 1) * smooth):
        line = np.where(weights > 0, weights / weights[weights > 0].sum(), weights / -weights[weights < 0].sum())
        strengths.append(np.hypot(convolve(smoothed[0], line, 1), convolve(smoothed[1], line, 0)))
    return strengths[0], strengths[1]


# The largest difference there is, between green and blue.
_LARGEST = float(
    _hyab(*(_hunt_lab(np.array([[primary]], np.float32)) for primary in ((0, 1, 0), (0, 0, 1)))).item() ** _Q_C
)
