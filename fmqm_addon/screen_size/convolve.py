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
    """(H, W) float32 correlated along an axis with an odd number of weights; beyond the border as numpy.pad has it."""
    radius = len(weights) // 2
    heavy = np.flatnonzero(np.abs(weights) > _NOTHING * np.abs(weights).max())
    reach = int(np.abs(heavy - radius).max())
    kept = weights[radius - reach : radius + reach + 1].astype(np.float32)
    widths = [(0, 0), (0, 0)]
    widths[axis] = (reach, reach)
    padded = np.pad(image, widths, mode=border)
    result = np.zeros_like(image)
    term = np.empty_like(image)
    length = image.shape[axis]
    for step, weight in enumerate(kept):
        part = padded[step : step + length] if axis == 0 else padded[:, step : step + length]
        np.multiply(part, weight, out=term)
        result += term
    return result
