# SPDX-License-Identifier: GPL-3.0-or-later
"""Aligning a compared mesh with its reference before it is measured. Arrays only.

The reference stays where it stands in the world. The compared mesh is brought to it in one of three ways,
of which LODs set side by side, and imports that carry transforms, need the second or third:

    world: as it stands.
    location: turned and scaled as it stands, but with its origin where the reference's is.
    local: its own coordinates under the reference's transform.

Kinds of files do not agree on which axis is up. Where none of these fits, the first two are tried with a turn about
the world's X axis, too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..metric.errors import MeshError
from ..metric.geometry import Floats, cross
from ..metric.surface import MeshArrays
from .pose import Pose

SPACES = ("auto", "world", "local")
SPACE_LABELS = {"world": "world", "location": "world without location", "local": "local"}

APART = 0.01  # of the diagonal; boxes that differ by less coincide
TIMES_BETTER = 10.0  # Auto leaves the world only for a fit this much better
SUSPICIOUS = 0.05  # of the diagonal; boxes that differ by more get a warning
# Factors between units: metric prefixes, inch, foot, and their inverses. No yard: artists scale by 1.1, too.
UNIT_FACTORS = (10.0, 100.0, 1000.0, 2.54, 25.4, 1 / 0.0254, 12.0, 1 / 0.3048, 30.48)
FACTOR_TOLERANCE = 0.01  # relative; decimation moves the box a little

TURNS = (90, -90, 180)  # degrees about X; from one axis that is up to another
_TURNED = {  # exact, by degrees
    90: np.array([(1.0, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)]),
    -90: np.array([(1.0, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)]),
    180: np.array([(1.0, 0, 0, 0), (0, -1, 0, 0), (0, 0, -1, 0), (0, 0, 0, 1)]),
}

_TINY = 1e-6  # of the diagonal; a misfit below it is rounding


@dataclass(frozen=True)
class AssetMesh:
    """An asset's mesh in its own frame, with the transform to its world.

    Attributes:
        mesh: positions in the asset's own frame.
        origin: (4, 4) float64, from that frame to the world.
        pose: in which it stood.
    """

    mesh: MeshArrays
    origin: Floats
    pose: Pose = Pose()

    def world(self) -> MeshArrays:
        """The mesh in its world."""
        return moved(self.mesh, self.origin)


@dataclass(frozen=True)
class Alignment:
    """A compared mesh, brought to where it is measured.

    Attributes:
        mesh: in the reference's world.
        space: "world", "location" or "local". turn: degrees about X; 0 leaves it as it is.
        factor: its size was divided by this; 1 leaves it.
        misfit: how far the boxes' corners are apart, in the reference's box diagonals.
        to_world: (4, 4) float64, from where it is measured to where it stands.
        notes: what Auto or Match Scale did. warnings: what makes it doubtful.
    """

    mesh: MeshArrays
    space: str
    turn: int
    factor: float
    misfit: float
    to_world: Floats
    notes: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def label(self) -> str:
        """As the reports name it: "world", "local, size / 100", "world, turned by 90 degrees about X"."""
        parts = [SPACE_LABELS[self.space]]
        if self.turn:
            parts.append(f"turned by {self.turn} degrees about X")
        if self.factor != 1:
            parts.append(f"size / {self.factor:.6g}")
        return ", ".join(parts)


def location_counts(label: str) -> bool:
    """Whether moving an object changes a score that was measured in the space of an Alignment.label."""
    return label.partition(",")[0] == SPACE_LABELS["world"]


@dataclass(frozen=True)
class _Candidate:
    space: str
    turn: int
    matrix: Floats  # (4, 4), from the compared mesh's own frame
    box: Floats  # (2, 3)
    factor: float
    misfit: float


def align(reference: AssetMesh, compared: AssetMesh, space: str = "auto", match_scale: bool = False) -> Alignment:
    """Brings the compared mesh to the reference.

    Args:
        space: of SPACES: "world" or "local", or "auto": the world, unless the boxes differ there by more than APART and
            another space fits TIMES_BETTER; a turn is tried where none does.
        match_scale: undo a difference in size by one of UNIT_FACTORS.

    Raises:
        MeshError: a transform that has to be undone has a scale of zero.
    """
    target = _box(reference.mesh, reference.origin)
    spaces = {"auto": ("world", "location", "local"), "world": ("world",), "local": ("local",)}[space]
    candidates = [_candidate(name, 0, reference, compared, target, match_scale) for name in spaces]
    chosen = candidates[0]
    if chosen.misfit > APART:
        best = min(candidates, key=_roughly)  # of equal ones the first
        if best.misfit * TIMES_BETTER <= chosen.misfit:
            chosen = best
    if space == "auto" and chosen.misfit > APART:
        turned = [
            _candidate(name, turn, reference, compared, target, match_scale)
            for name in ("world", "location")
            for turn in TURNS
        ]
        best = _best_turned(turned, reference, compared.mesh)
        candidates += turned
        if best.misfit * TIMES_BETTER <= chosen.misfit:
            chosen = best
    return Alignment(
        mesh=moved(compared.mesh, chosen.matrix),
        space=chosen.space,
        turn=chosen.turn,
        factor=chosen.factor,
        misfit=chosen.misfit,
        to_world=_undo(chosen.matrix, compared.origin, compared.mesh.name),
        notes=_notes(compared.mesh.name, chosen, space),
        warnings=_warnings(compared.mesh.name, chosen, candidates, target, match_scale),
    )


def moved(mesh: MeshArrays, matrix: Floats) -> MeshArrays:
    """The mesh with a (4, 4) matrix applied."""
    return replace(mesh, positions=_transformed(mesh.positions, matrix))


def unit_factor(box: Floats, target: Floats) -> float:
    """The factor between units by which a (2, 3) box is larger than the target; 1 if there is none."""
    size, wanted = box[1] - box[0], target[1] - target[0]
    diagonal = float(np.linalg.norm(wanted))
    ratio = float(np.linalg.norm(size)) / diagonal if diagonal > 0 else 1.0
    for factor in (*UNIT_FACTORS, *(1 / factor for factor in UNIT_FACTORS)):
        same_shape = np.abs(size / factor - wanted).max() <= 2 * FACTOR_TOLERANCE * diagonal
        if abs(ratio / factor - 1) <= FACTOR_TOLERANCE and same_shape:
            return factor
    return 1.0


def misfit(box: Floats, target: Floats) -> float:
    """How far the farther of two corners of a (2, 3) box is from the target's, in the target's diagonals."""
    diagonal = float(np.linalg.norm(target[1] - target[0]))
    if not diagonal > 0:
        return 0.0  # the reference has no size; the measurement says so
    return float(np.linalg.norm(box - target, axis=1).max()) / diagonal


def _matrix(name: str, turn: int, reference: Floats, compared: Floats) -> Floats:
    """(4, 4), from the compared mesh's own frame to the space of that name."""
    if name == "local":
        return reference.copy()
    matrix = _TURNED[turn] @ compared if turn else compared.copy()
    if name == "location":
        matrix[:3, 3] = reference[:3, 3]
    return matrix


def _candidate(
    name: str, turn: int, reference: AssetMesh, compared: AssetMesh, target: Floats, match_scale: bool
) -> _Candidate:
    mesh, matrix = compared.mesh, _matrix(name, turn, reference.origin, compared.origin)
    box = _box(mesh, matrix)
    factor = unit_factor(box, target) if match_scale else 1.0
    if factor != 1:
        # In the world, units scale all there is; elsewhere the origins already are at one place.
        matrix[:3, : 4 if name == "world" else 3] /= factor
        box = _box(mesh, matrix)
    return _Candidate(name, turn, matrix, box, factor, misfit(box, target))


def _roughly(candidate: _Candidate) -> float:
    """Its misfit, but for rounding."""
    return float(np.round(candidate.misfit / _TINY))


def _best_turned(turned: list[_Candidate], reference: AssetMesh, mesh: MeshArrays) -> _Candidate:
    """The best fit. A box may fit as well upside down: then where the surface lies in it decides."""
    best = min(turned, key=_roughly)
    equal = [candidate for candidate in turned if candidate.misfit <= best.misfit + APART]
    if len(equal) == 1:
        return best
    wanted = _lopsidedness(reference.mesh, reference.origin)
    scale = float(np.abs(wanted).max()) or 1.0

    def difference(candidate: _Candidate) -> float:
        return float(np.round(np.abs(_lopsidedness(mesh, candidate.matrix) - wanted).max() / (scale * _TINY)))

    return min(equal, key=difference)


def _lopsidedness(mesh: MeshArrays, matrix: Floats) -> Floats:
    """(2, 3) float64: mean of the surface, and cube root of its third central moment along each axis."""
    a, b, c = (_transformed(mesh.positions[mesh.triangles[:, k]], matrix) for k in range(3))
    with np.errstate(all="ignore"):  # coordinates that are not finite, or too large for this, are left out
        area, center = np.linalg.norm(cross(b - a, c - a), axis=1), (a + b + c) / 3
        usable = np.isfinite(area) & np.isfinite(center).all(axis=1)
        weight, center = area[usable] / area[usable].sum(), center[usable]
        mean = weight @ center
        return np.nan_to_num(np.stack([mean, np.cbrt(weight @ (center - mean) ** 3)]))


def _transformed(positions: Floats, matrix: Floats) -> Floats:
    """The one arithmetic for all meshes, so that the same mesh has the same bits."""
    with np.errstate(all="ignore"):  # coordinates that are not finite are dealt with by the metric
        return positions @ matrix[:3, :3].T + matrix[:3, 3]


def _box(mesh: MeshArrays, matrix: Floats) -> Floats:
    """(2, 3) lowest and highest corner of the faces' finite vertices."""
    used = np.zeros(len(mesh.positions), bool)
    used[mesh.triangles] = True
    positions = _transformed(mesh.positions[used], matrix)
    positions = positions[np.isfinite(positions).all(axis=1)]
    if not len(positions):
        return np.zeros((2, 3))
    return np.stack([positions.min(axis=0), positions.max(axis=0)])


def _undo(matrix: Floats, origin: Floats, name: str) -> Floats:
    if np.array_equal(matrix, origin):
        return np.eye(4)
    try:
        return origin @ np.linalg.inv(matrix)
    except np.linalg.LinAlgError as error:
        raise MeshError(f"{name}: its transform or the reference's has a scale of zero; apply or mend it") from error


def _notes(name: str, chosen: _Candidate, space: str) -> tuple[str, ...]:
    parts = []
    if chosen.space == "location" and space == "auto":
        parts.append("without its location, since it stands beside the reference")
    elif chosen.space == "local" and space == "auto":
        parts.append("in local space, since it fits the reference only without its transform")
    if chosen.turn:
        parts.append(f"turned by {chosen.turn} degrees about X, since its axes differ from the reference's")
    if chosen.factor != 1:
        parts.append(f"at its size divided by {chosen.factor:.6g}")
    return (f"{name}: compared {', '.join(parts)}",) if parts else ()


def _warnings(
    name: str, chosen: _Candidate, candidates: list[_Candidate], target: Floats, match_scale: bool
) -> tuple[str, ...]:
    if chosen.misfit <= SUSPICIOUS:
        return ()
    factors = [] if match_scale else [unit_factor(candidate.box, target) for candidate in candidates]
    factor = next((factor for factor in factors if factor != 1), 1.0)
    if factor != 1:
        larger = f"{factor:.6g} times as large" if factor > 1 else f"{1 / factor:.6g} times as small"
        remedy = "are the units different? Match Scale (--match-scale) undoes that"
        return (f"{name}: it is {larger} as the reference; {remedy}",)
    scale = np.linalg.norm(chosen.box[1] - chosen.box[0]) / np.linalg.norm(target[1] - target[0])
    return (
        f"{name}: its box and the reference's differ by {100 * chosen.misfit:.0f} % of the diagonal (size "
        f"{100 * scale:.0f} %), as if they were placed differently; that lowers the score",
    )
