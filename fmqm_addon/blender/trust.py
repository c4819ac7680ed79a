# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's side adds to a trust report: where the compared mesh was put, how looks were read."""

from __future__ import annotations

from ..comparison.alignment import Placement
from ..comparison.trust import Fact
from .materials.types import Reading


def known_facts(placement: Placement, reading: Reading) -> tuple[Fact, ...]:
    """The facts of a pair that are known before it is measured."""
    return (
        Fact("space", placement.label, "where the two were compared"),
        Fact("size_divided_by", placement.factor, "factor between units"),
        Fact("boxes_apart", placement.misfit, "share of the reference's box diagonal"),
        Fact("baked_at", reading.bake, "pixels a side of what is baked; 0 forbids it"),
    )
