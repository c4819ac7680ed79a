# SPDX-License-Identifier: GPL-3.0-or-later
"""Other places for a compared mesh, where the one that the boxes choose does not fit by points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..metric.geometry import Floats
from ..metric.surface import Surface
from .candidates import FACTOR_TOLERANCE, AssetMesh, Candidate, box_of, misfit, place_scaled, transformed
from .icp import Refined, refine
from .placement import TURNS, Fit, Points, best_place, mirrored, points_on

BOXES_AGREE = 0.1  # of the diagonal; places with boxes farther apart are not tried
SUSPICIOUS = 0.05  # of the diagonal; boxes that differ by more get a warning
_REFINING = 2000  # points
_FEW_REFINING = 200  # points, of each start
_FEW_STEPS = 15
_SAME = 0.001  # of the diagonal; starts whose ends differ by less will end at one place


@dataclass(frozen=True)
class Search:
    """What is tried where the boxes' choice does not fit by points."""

    reference: AssetMesh
    compared: AssetMesh
    target: Floats  # (2, 3) the reference's box
    surface: Surface
    points: Points

    def elsewhere(self, chosen: Candidate, now: Fit, match_scale: bool) -> tuple[Candidate, Fit]:
        """What fits far better than the chosen one, which it is if nothing does."""
        tried = self._tried(chosen, match_scale)
        found = best_place([each.matrix for each in tried], now, self.points, self.surface)
        return (chosen, now) if found is None else (tried[found[0]], found[1])

    def doubts(self, chosen: Candidate, now: Fit, match_scale: bool) -> tuple[str, ...]:
        """What would fit far better, and is not done: another size that was not asked for, a mirror."""
        name, warnings = self.compared.mesh.name, []
        if not match_scale and chosen.misfit > SUSPICIOUS:
            scaled, there = self.elsewhere(chosen, now, True)
            if there is not now:
                chosen, now = scaled, there
                size = (
                    f"{scaled.factor:.6g} times as large"
                    if scaled.factor > 1
                    else (f"{1 / scaled.factor:.6g} times as small")
                )
                remedy = "are the units different, or was it normalized? Match Scale (--match-scale) undoes that"
                warnings.append(f"{name}: it is {size} as the original; {remedy}")
        centered = [each.matrix for each in self._turned(("centered",), chosen.factor)]
        mirrors = mirrored(centered, self.target.mean(axis=0))
        found = best_place([matrix for _, matrix in mirrors], now, self.points, self.surface)
        if found is not None:
            axis = mirrors[found[0]][0]
            how = f"mirrored along {axis}" if axis else "mirrored and turned"
            warnings.append(
                f"{name}: it fits the original far better {how}; a mirrored asset is another one, and measured as it "
                "stands: mirror it back if that was not meant"
            )
        return tuple(warnings)

    def refined(self, chosen: Candidate, now: Fit, space: str) -> tuple[Candidate, Refined]:
        """The chosen place refined by ICP; in Auto, where it is far off, the best of all turns refined."""
        starts = [chosen]
        if space == "auto" and not now.is_fine:
            starts += self._turned(("centered",), chosen.factor)
        few = self.points.positions[:_FEW_REFINING]
        ends = [refine(transformed(few, each.matrix), self.surface, _FEW_STEPS) for each in starts]
        least = min(end.after for end in ends)
        best = next(number for number, end in enumerate(ends) if end.after <= 2 * least + _SAME)
        start = starts[best]
        rough = ends[best].matrix @ start.matrix
        many = transformed(points_on(self.compared.mesh, _REFINING).positions, rough)
        end = refine(many, self.surface)
        matrix = end.matrix @ rough
        box = box_of(self.compared.mesh, matrix)
        whole = Refined(end.matrix @ ends[best].matrix, ends[best].before, end.after)
        return replace(start, matrix=matrix, box=box, misfit=misfit(box, self.target)), whole

    def _tried(self, chosen: Candidate, match_scale: bool) -> list[Candidate]:
        """Every turn, where it stands, with its origin or its center at the reference's; the simplest first."""
        # A little beside its place is a loss, not another place.
        spaces = ("world", "location", "centered") if chosen.misfit > SUSPICIOUS else ("world", "location")
        factors = [chosen.factor]
        if match_scale:
            factors.append(self._ratio())
        tried = [each for factor in dict.fromkeys(factors) for each in self._turned(spaces, factor)]
        return [each for each in tried if each.misfit <= BOXES_AGREE]

    def _ratio(self) -> float:
        """The compared box's diagonal, in the reference's; no turn of TURNS changes it."""
        box = box_of(self.compared.mesh, self.compared.origin)
        ratio = float(np.linalg.norm(box[1] - box[0]) / np.linalg.norm(self.target[1] - self.target[0]))
        return ratio if ratio > 0 and abs(ratio - 1) > FACTOR_TOLERANCE else 1.0

    def _turned(self, spaces: Sequence[str], factor: float) -> list[Candidate]:
        return [
            place_scaled(space, turn, self.reference, self.compared, self.target, factor)
            for turn in TURNS
            for space in spaces
        ]
