# SPDX-License-Identifier: GPL-3.0-or-later
"""From where the meshes are looked at."""

from __future__ import annotations

import numpy as np

from ..metric.geometry import Floats

_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def fibonacci_directions(count: int) -> Floats:
    """(count, 3) float64 unit vectors from the center to the viewer, spread evenly over the sphere."""
    index = np.arange(count)
    height = 1 - (2 * index + 1) / count
    radius = np.sqrt(1 - height * height)
    angle = index * _GOLDEN_ANGLE
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=1)


def camera_axes(direction: Floats) -> Floats:
    """(3, 3) float64: rows are right, up, and toward the viewer, orthonormal; up is as near to +Z as can be."""
    toward = direction / np.linalg.norm(direction)
    pole = np.array([0.0, 0.0, 1.0]) if abs(toward[2]) < 0.99 else np.array([0.0, 1.0, 0.0])
    right = np.cross(pole, toward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(toward, right), toward])
