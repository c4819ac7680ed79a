# SPDX-License-Identifier: GPL-3.0-or-later
"""Convolution along one axis of an image."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

_NOTHING = 1e-8  # of the largest weight: below what float32 holds


def convolve(
    image: NDArray[np.float32], weights: NDArray[np.float64], axis: int, border: Literal["edge", "symmetric"] = "edge"
) -> NDArray[np.float32]:
    """(H, W) float32 correlated along an axis with an odd number of weights; beyond the border as numpy.pad has it.

    Args:
        weights: the same read backward, or the same with the other sign: one product serves two of them.
    """
    radius = len(weights) // 2
    heavy = np.flatnonzero(np.abs(weights) > _NOTHING * np.abs(weights).max())
    reach = int(np.abs(heavy - radius).max())
    half = weights[radius : radius + reach + 1].astype(np.float32)
    pair = np.subtract if weights[radius + reach] * weights[radius - reach] < 0 else np.add
    widths = [(0, 0), (0, 0)]
    widths[axis] = (reach, reach)
    padded = np.pad(image, widths, mode=border)
    result = image * half[0]
    term = np.empty_like(image)
    length = image.shape[axis]
    for step, weight in enumerate(half[1:], 1):
        before, after = (slice(reach + way, reach + way + length) for way in (-step, step))
        if axis == 0:
            pair(padded[after], padded[before], out=term)
        else:
            pair(padded[:, after], padded[:, before], out=term)
        term *= weight
        result += term
    return result
