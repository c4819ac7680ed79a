# SPDX-License-Identifier: GPL-3.0-or-later
"""Axes across a direction: of a picture's plane, or of a camera's image."""

from __future__ import annotations

import numpy as np

from ...metric.geometry import Floats


def plane_axes(axis: Floats) -> tuple[Floats, Floats]:
    """Right and up, unit (3,) vectors across an axis; up is as near to Z as can be."""
    up = np.array([0.0, 0.0, 1.0]) if abs(axis[2]) < 0.9 else np.array([0.0, 1.0, 0.0])
    right = np.cross(up, axis)
    right /= np.linalg.norm(right)
    return right, np.cross(axis, right)
