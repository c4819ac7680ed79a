# SPDX-License-Identifier: GPL-3.0-or-later
"""Which samples lie on one side of a surface, so that a ray of one of them tells the sign of all (III-B).

On a closed surface, each of whose edges has an even number of faces, the number of crossings of a ray from p to
infinity is odd or even whatever its direction, and p can only change from one to the other by passing through the
surface. No point of the surface lies in the open ball around p with radius |sdf(p)|. So two samples have one sign when
|pp'| < max(|sdf(p)|, |sdf(p')|).

That counts crossings and asks nothing else of a mesh: shells in shells and faces turned either way change the parity
where they are passed, and where four faces meet at an edge, or the mesh cuts itself, that is as true. A sample on the
surface (sdf 0) has no sign and its ball no inside; it lies in no other ball either, since none holds a point of the
surface. Samples at one place lie in each other's balls. Where a surface is open the ray's direction decides, and each
sample has a ray of its own: on its closed parts too, since rays meet all of it.
"""

from __future__ import annotations

import numpy as np

from .geometry import Floats, Ints
from .stepper import Progress, Work

# Samples before each one, along a curve, that are looked at: with 16 a quarter is left that needs a ray.
PREDECESSORS = 16
# Balls are taken smaller by this much, relative and absolute, for the float32 of the tree that found their radius.
BALL_SLACK, BALL_MARGIN = 1e-4, 1e-6
_BATCH = 1 << 14  # samples of a step


def followers(points: Floats, distances: Floats) -> Work[Ints]:
    """(N,) for each of (N, 3) points the one whose sign it has, itself where it needs a ray; yields the share done.

    Args:
        points: in an order in which neighbours are near in space, none on the surface, which is closed.
        distances: (N,) from the surface, not negative.
    """
    radius = np.maximum(distances * (1 - BALL_SLACK) - BALL_MARGIN, 0.0)
    squares = radius * radius
    x, y, z = points.T.copy()
    leader = np.arange(len(points))
    for first in range(0, len(points), _BATCH):
        alone = np.arange(first, min(first + _BATCH, len(points)))
        for back in range(1, PREDECESSORS + 1):
            if first == 0:
                alone = alone[alone >= back]
            before = alone - back
            reach = squares.take(alone)
            np.maximum(reach, squares.take(before), out=reach)
            apart = np.zeros(len(alone))
            for axis in (x, z, y):
                along = axis.take(alone)
                along -= axis.take(before)
                along *= along
                apart += along
            together = apart < reach
            following = np.flatnonzero(together)
            leader[alone.take(following)] = before.take(following)
            alone = alone.take(np.flatnonzero(~together))
        yield Progress("", min(1.0, (first + _BATCH) / len(points)))
    while True:  # the leader's leader, until there is none above
        above = leader.take(leader)
        if np.array_equal(above, leader):
            return leader
        leader = above
