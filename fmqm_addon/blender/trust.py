# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender's side adds to a trust report: where the compared mesh was put."""

from __future__ import annotations

from ..metric.trust import Fact
from .space import Placement


def place_facts(placement: Placement) -> tuple[Fact, ...]:
    return (
        Fact("space", placement.label, "where the two were compared"),
        Fact("size_divided_by", placement.factor, "factor between units"),
        Fact("boxes_apart", placement.misfit, "share of the reference's box diagonal"),
    )
