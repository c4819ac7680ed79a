# SPDX-License-Identifier: GPL-3.0-or-later
"""Aligning a compared mesh with its reference before it is measured. Arrays only.

The reference stays where it stands in the world. The compared mesh is brought to it in one of four ways,
of which LODs set side by side, imports that carry transforms, and pivots moved in the vertices need the others:

    world: as it stands.
    location: turned and scaled as it stands, but with its origin where the reference's is.
    local: its own coordinates under the reference's transform.
    centered: turned and scaled as it stands, but with its box's center where the reference's is.

Boxes decide between the first three. Kinds of files do not agree on which axis is up: where none of these fits, the
first two are tried with a turn about the world's X axis, too. Then points on the surface judge (see placement), and
whatever else fits far better is taken: any of the 24 turns that map axes to axes, centered or not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..metric.errors import MeshError
from ..metric.geometry import Floats, cross
from ..metric.surface import MeshArrays, Surface
from .candidates import AssetMesh, Candidate, box_of, misfit, moved, place, transformed, unit_factor
from .icp import Refined
from .placement import POINTS, fit, points_on
from .search import SUSPICIOUS, Search

__all__ = [
    "SPACES",
    "SPACE_LABELS",
    "Alignment",
    "AssetMesh",
    "align",
    "location_counts",
    "misfit",
    "moved",
    "unit_factor",
]

SPACES = ("auto", "world", "local")
ALIGNS = ("none", "icp")
SPACE_LABELS = {"world": "world", "location": "world without location", "local": "local", "centered": "centered"}

APART = 0.01  # of the diagonal; boxes that differ by less coincide
TIMES_BETTER = 10.0  # Auto leaves the world only for a fit this much better
_TURNS_ABOUT_X = [f"{degrees} degrees about X" for degrees in (90, -90, 180)]  # from one axis that is up to another
_TINY = 1e-6  # of the diagonal; a misfit below it is rounding


@dataclass(frozen=True)
class Alignment:
    """A compared mesh, brought to where it is measured.

    Attributes:
        mesh: in the reference's world.
        space: of SPACE_LABELS. turn: such as "90 degrees about X"; "" leaves it as it is.
        factor: its size was divided by this; 1 leaves it. refined: what ICP did; None: not asked for.
        misfit: how far the boxes' corners are apart, in the reference's box diagonals.
        to_world: (4, 4) float64, from where it is measured to where it stands.
        notes: what Auto or Match Scale did. warnings: what makes it doubtful.
    """

    mesh: MeshArrays
    space: str
    turn: str
    factor: float
    refined: Refined | None
    misfit: float
    to_world: Floats
    notes: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def label(self) -> str:
        """As the reports name it: "world", "local, size / 100", "world, turned by 90 degrees about X"."""
        parts = [SPACE_LABELS[self.space]]
        if self.turn:
            parts.append(f"turned by {self.turn}")
        if self.factor != 1:
            parts.append(f"size / {self.factor:.6g}")
        if self.refined is not None:
            parts.append("refined")
        return ", ".join(parts)


def location_counts(label: str) -> bool:
    """Whether moving an object changes a score that was measured in the space of an Alignment.label."""
    return label.partition(",")[0] == SPACE_LABELS["world"]


def align(
    reference: AssetMesh,
    compared: AssetMesh,
    space: str = "auto",
    match_scale: bool = False,
    surface: Surface | None = None,
    icp: bool = False,
) -> Alignment:
    """Brings the compared mesh to the reference.

    Args:
        space: of SPACES: "world" or "local", or "auto": the world, unless the boxes differ there by more than APART and
            another space fits TIMES_BETTER; a turn is tried where none does; then what points on the surface say.
        match_scale: undo a difference in size: by one of UNIT_FACTORS, or in "auto" by any that fits far better.
        surface: the prepared reference; None leaves the judgment to the boxes.
        icp: refine the placement, rigidly, wherever it is; wants the surface.

    Raises:
        MeshError: a transform that has to be undone has a scale of zero.
    """
    target = box_of(reference.mesh, reference.origin)
    spaces = {"auto": ("world", "location", "local"), "world": ("world",), "local": ("local",)}[space]
    candidates = [place(name, "", reference, compared, target, match_scale) for name in spaces]
    chosen = candidates[0]
    if chosen.misfit > APART:
        best = min(candidates, key=_roughly)  # of equal ones the first
        if best.misfit * TIMES_BETTER <= chosen.misfit:
            chosen = best
    if space == "auto" and chosen.misfit > APART:
        turned = [
            place(name, turn, reference, compared, target, match_scale)
            for name in ("world", "location")
            for turn in _TURNS_ABOUT_X
        ]
        best = _best_turned(turned, reference, compared.mesh)
        candidates += turned
        if best.misfit * TIMES_BETTER <= chosen.misfit:
            chosen = best
    doubts: tuple[str, ...] = ()
    refined = None
    if surface is not None and (space == "auto" or icp):
        points = points_on(compared.mesh, POINTS)
        search = Search(reference, compared, target, surface, points)
        now = fit(points, chosen.matrix, surface)
        if space == "auto" and not now.is_fine:
            chosen, now = search.elsewhere(chosen, now, match_scale)
            doubts = () if now.is_fine else search.doubts(chosen, now, match_scale)
        if icp:
            chosen, refined = search.refined(chosen, now, space)
    warnings = _warnings(compared.mesh.name, chosen, candidates, target, match_scale)
    return Alignment(
        mesh=moved(compared.mesh, chosen.matrix),
        space=chosen.space,
        turn=chosen.turn,
        factor=chosen.factor,
        refined=refined,
        misfit=chosen.misfit,
        to_world=_undo(chosen.matrix, compared.origin, compared.mesh.name),
        notes=_notes(compared.mesh.name, chosen, space, refined),
        warnings=doubts or warnings,
    )


def _roughly(candidate: Candidate) -> float:
    """Its misfit, but for rounding."""
    return float(np.round(candidate.misfit / _TINY))


def _best_turned(turned: list[Candidate], reference: AssetMesh, mesh: MeshArrays) -> Candidate:
    """The best fit. A box may fit as well upside down: then where the surface lies in it decides."""
    best = min(turned, key=_roughly)
    equal = [candidate for candidate in turned if candidate.misfit <= best.misfit + APART]
    if len(equal) == 1:
        return best
    wanted = _lopsidedness(reference.mesh, reference.origin)
    scale = float(np.abs(wanted).max()) or 1.0

    def difference(candidate: Candidate) -> float:
        return float(np.round(np.abs(_lopsidedness(mesh, candidate.matrix) - wanted).max() / (scale * _TINY)))

    return min(equal, key=difference)


def _lopsidedness(mesh: MeshArrays, matrix: Floats) -> Floats:
    """(2, 3) float64: mean of the surface, and cube root of its third central moment along each axis."""
    a, b, c = (transformed(mesh.positions[mesh.triangles[:, k]], matrix) for k in range(3))
    with np.errstate(all="ignore"):  # coordinates that are not finite, or too large for this, are left out
        area, center = np.linalg.norm(cross(b - a, c - a), axis=1), (a + b + c) / 3
        usable = np.isfinite(area) & np.isfinite(center).all(axis=1)
        weight, center = area[usable] / area[usable].sum(), center[usable]
        mean = weight @ center
        return np.nan_to_num(np.stack([mean, np.cbrt(weight @ (center - mean) ** 3)]))


def _undo(matrix: Floats, origin: Floats, name: str) -> Floats:
    if np.array_equal(matrix, origin):
        return np.eye(4)
    try:
        return origin @ np.linalg.inv(matrix)
    except np.linalg.LinAlgError as error:
        raise MeshError(f"{name}: its transform or the original's has a scale of zero; apply or mend it") from error


def _notes(name: str, chosen: Candidate, space: str, refined: Refined | None) -> tuple[str, ...]:
    parts = []
    if chosen.space == "location" and space == "auto":
        parts.append("without its location, since it stands beside the original")
    elif chosen.space == "local" and space == "auto":
        parts.append("in local space, since it fits the original only without its transform")
    elif chosen.space == "centered":
        parts.append("with its center at the original's, since it fits far better there")
    if chosen.turn:
        parts.append(f"turned by {chosen.turn}, since it fits the original far better so")
    if chosen.factor != 1:
        parts.append(f"at its size divided by {chosen.factor:.6g}")
    if refined is not None:
        before, after = (f"{100 * distance:.3g} %" for distance in (refined.before, refined.after))
        parts.append(
            f"refined by ICP: turned by {refined.degrees:.3g} degrees, its points {after} of the diagonal from the "
            f"original in the place of {before}"
        )
    return (f"{name}: compared {', '.join(parts)}",) if parts else ()


def _warnings(
    name: str, chosen: Candidate, candidates: list[Candidate], target: Floats, match_scale: bool
) -> tuple[str, ...]:
    if chosen.misfit <= SUSPICIOUS:
        return ()
    factors = [] if match_scale else [unit_factor(candidate.box, target) for candidate in candidates]
    factor = next((factor for factor in factors if factor != 1), 1.0)
    if factor != 1:
        larger = f"{factor:.6g} times as large" if factor > 1 else f"{1 / factor:.6g} times as small"
        remedy = "are the units different? Match Scale (--match-scale) undoes that"
        return (f"{name}: it is {larger} as the original; {remedy}",)
    scale = np.linalg.norm(chosen.box[1] - chosen.box[0]) / np.linalg.norm(target[1] - target[0])
    return (
        f"{name}: its box and the original's differ by {100 * chosen.misfit:.0f} % of the diagonal (size "
        f"{100 * scale:.0f} %), as if they were placed differently; that lowers the score",
    )
