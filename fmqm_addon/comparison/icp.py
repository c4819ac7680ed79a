# SPDX-License-Identifier: GPL-3.0-or-later
"""Refining a placement by the iterated closest point: rigid, for scans that stand a little askew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..metric.geometry import Floats, cross, dot, triangle_normals
from ..metric.surface import Surface
from .placement import nearest_on

STEPS = 60
TRIMMED = 3.0  # times the median distance; what is farther has no counterpart, and does not pull
ENOUGH = 1e-4  # of the mean distance; a step that gains less is the last
_NONE = 1e-9  # of the diagonal; distances below it are rounding


@dataclass(frozen=True)
class Refined:
    """What became of a placement.

    Attributes:
        matrix: (4, 4) float64, what has to be applied in the reference's world.
        before, after: mean distances of the points that have counterparts, in the reference's diagonals.
        degrees: by how much it turns.
    """

    matrix: Floats
    before: float
    after: float

    @property
    def degrees(self) -> float:
        cosine = (np.trace(self.matrix[:3, :3]) - 1) / 2
        return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def refine(world: Floats, reference: Surface, steps: int = STEPS) -> Refined:
    """The rigid motion that brings (N, 3) points of a world nearest to a reference.

    Each step moves the points to the planes of their nearest triangles (point to plane), or where that is no gain, to
    the nearest points themselves (point to point); it ends where neither is a gain.
    """
    start = reference.frame.enter(world)
    motion, before = np.eye(4), 0.0
    nearest, normals, distance = _nearest(start, reference)
    now = before = _trimmed_mean(distance)
    for _ in range(steps):
        placed = _moved(start, motion)
        use = distance <= TRIMMED * np.median(distance) + _NONE
        for step in (_to_planes(placed[use], nearest[use], normals[use]), _to_points(placed[use], nearest[use])):
            tried = step @ motion
            found = _nearest(_moved(start, tried), reference)
            mean = _trimmed_mean(found[2])
            if mean < now * (1 - ENOUGH):
                break
        else:
            break
        motion, now = tried, mean
        nearest, normals, distance = found
        if now <= _NONE:
            break
    center, scale = reference.frame.center, reference.frame.scale
    motion[:3, 3] = motion[:3, 3] * scale + center - motion[:3, :3] @ center
    return Refined(motion, before, now)


def _nearest(placed: Floats, reference: Surface) -> tuple[Floats, Floats, Floats]:
    """(N, 3) nearest points, (N, 3) the normals there and (N,) distances."""
    nearest, triangle, _ = nearest_on(placed, reference)
    return (
        nearest,
        triangle_normals(reference.vertices, reference.triangles[triangle]),
        np.linalg.norm(nearest - placed, axis=1),
    )


def _trimmed_mean(distance: Floats) -> float:
    return float(np.minimum(distance, TRIMMED * np.median(distance)).mean())


def _moved(points: Floats, motion: Floats) -> Floats:
    return points @ motion[:3, :3].T + motion[:3, 3]


def _to_planes(placed: Floats, nearest: Floats, normals: Floats) -> Floats:
    """(4, 4) small rigid motion that brings points to planes, by least squares; along what they slide it is none."""
    system = np.hstack([cross(placed, normals), normals])
    turn_and_shift = np.linalg.lstsq(system, dot(nearest - placed, normals), rcond=1e-6)[0]
    result = np.eye(4)
    result[:3, :3] = _rotation(turn_and_shift[:3])
    result[:3, 3] = turn_and_shift[3:]
    return result


def _to_points(placed: Floats, nearest: Floats) -> Floats:
    """(4, 4) the rigid motion that brings points to points, by least squares."""
    here, there = placed.mean(axis=0), nearest.mean(axis=0)
    u, _, v = np.linalg.svd((placed - here).T @ (nearest - there))
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v)) or 1.0])
    result = np.eye(4)
    result[:3, :3] = (u @ flip @ v).T
    result[:3, 3] = there - result[:3, :3] @ here
    return result


def _rotation(vector: Floats) -> Floats:
    """(3, 3) turn about a (3,) vector by its length in radians (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-15:
        return np.eye(3)
    x, y, z = vector / angle
    skew = np.array([(0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)])
    rotation: Floats = np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
    return rotation
