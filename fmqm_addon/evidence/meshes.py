# SPDX-License-Identifier: GPL-3.0-or-later
"""Positions and texture coordinates made worse: plain arrays."""

from __future__ import annotations

import numpy as np

from ..metric.geometry import Floats


def shaken(positions: Floats, deviation: float, rng: np.random.Generator) -> Floats:
    """(N, 3) positions with Gaussian noise on each axis; those that are equal stay so, or seams would tear open."""
    _, place = np.unique(positions, axis=0, return_inverse=True)
    place = place.reshape(-1)  # numpy 2.0 alone gives it another shape
    return positions + rng.normal(0.0, deviation, (int(place.max(initial=-1)) + 1, 3))[place]


def rounded(values: Floats, bits: int) -> Floats:
    """(N, D) values on a grid of 2^bits places an axis, over a box of their longest side, as mesh coders do."""
    low = values.min(axis=0)
    step = float((values - low).max()) / (2**bits - 1)
    return values if step == 0 else low + np.round((values - low) / step) * step


def diagonal(positions: Floats) -> float:
    """Of the box around (N, 3) positions."""
    return float(np.linalg.norm(positions.max(axis=0) - positions.min(axis=0)))
