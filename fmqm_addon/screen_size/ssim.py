# SPDX-License-Identifier: GPL-3.0-or-later
"""SSIM, how alike the structure of two images is.

Wang, Bovik, Sheikh, Simoncelli: Image Quality Assessment: From Error Visibility to Structural Similarity. IEEE Trans.
Image Process. 13(4), 2004. Gaussian windows, and covariances of the population, as there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .convolve import convolve

Image = NDArray[np.float32]

_SIGMA, _RADIUS = 1.5, 5  # pixels: windows of 11 by 11
_C1, _C2 = 0.01**2, 0.03**2  # K1 and K2, for values in [0, 1]
_MIDDLE = np.float32(0.5)  # moments are taken around it: float32 keeps more of small variances
_LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)
_OFFSET = np.arange(-_RADIUS, _RADIUS + 1)
_WINDOW = np.exp(-(_OFFSET**2) / (2 * _SIGMA**2))
_WINDOW /= _WINDOW.sum()


@dataclass(frozen=True)
class Structure:
    """What of an image SSIM compares: (H, W) luma less _MIDDLE, its local mean and variance."""

    luma: Image
    mean: Image
    variance: Image


def structure(encoded: NDArray[Any]) -> Structure:
    """Of an image, (H, W, 3) encoded for display, in [0, 1]."""
    luma = encoded.astype(np.float32) @ _LUMA - _MIDDLE
    mean = _window(luma)
    return Structure(luma, mean, _window(luma * luma) - mean * mean)


def ssim_map(one: Structure, other: Structure) -> Image:
    """(H, W) float32 similarities, 1 where the two are the same."""
    covariance = _window(one.luma * other.luma) - one.mean * other.mean
    first, second = one.mean + _MIDDLE, other.mean + _MIDDLE
    brightness = (2 * first * second + _C1) / (first**2 + second**2 + _C1)
    return np.asarray(brightness * (2 * covariance + _C2) / (one.variance + other.variance + _C2), np.float32)


def _window(image: Image) -> Image:
    return convolve(convolve(image, _WINDOW, 0, "symmetric"), _WINDOW, 1, "symmetric")
