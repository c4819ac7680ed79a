# SPDX-License-Identifier: GPL-3.0-or-later
"""Places where a compared mesh may be put, and how its box fits the reference's there."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..metric.geometry import Floats
from ..metric.surface import MeshArrays
from .placement import TURNS
from .pose import Pose

# Factors between units: metric prefixes, inch, foot, and their inverses. No yard: artists scale by 1.1, too.
UNIT_FACTORS = (10.0, 100.0, 1000.0, 2.54, 25.4, 1 / 0.0254, 12.0, 1 / 0.3048, 30.48)
FACTOR_TOLERANCE = 0.01  # relative; decimation moves the box a little


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
class Candidate:
    """A place of a compared mesh.

    Attributes:
        space, turn, factor, misfit: as of an Alignment.
        matrix: (4, 4) float64, from the compared mesh's own frame. box: (2, 3) of the mesh there.
    """

    space: str
    turn: str
    matrix: Floats
    box: Floats
    factor: float
    misfit: float


def moved(mesh: MeshArrays, matrix: Floats) -> MeshArrays:
    """The mesh with a (4, 4) matrix applied."""
    scale = float(np.linalg.norm(matrix[:3, :3], axis=0).max())
    normals = None if mesh.normals is None else _turned(mesh.normals, matrix)
    positions = transformed(mesh.positions, matrix)
    return replace(mesh, positions=positions, rounding=mesh.rounding * scale, normals=normals)


def _turned(normals: NDArray[Any], matrix: Floats) -> Floats:
    """(T, 3, 3) normals under a matrix: times its cofactors, which are finite where it has no inverse."""
    x, y, z = matrix[:3, :3]
    with np.errstate(all="ignore"):
        return np.asarray(normals @ np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)]).T, np.float64)


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


def _matrix(name: str, turn: str, reference: Floats, compared: Floats) -> Floats:
    """(4, 4), from the compared mesh's own frame to the space of that name; "centered" is not centered yet."""
    if name == "local":
        return reference.copy()
    matrix = compared.copy()
    if turn:
        matrix[:3] = TURNS[turn] @ compared[:3]
    if name == "location":
        matrix[:3, 3] = reference[:3, 3]
    return matrix


def place(
    name: str, turn: str, reference: AssetMesh, compared: AssetMesh, target: Floats, match_scale: bool
) -> Candidate:
    found = place_scaled(name, turn, reference, compared, target, 1.0)
    factor = unit_factor(found.box, target) if match_scale else 1.0
    return found if factor == 1 else place_scaled(name, turn, reference, compared, target, factor)


def place_scaled(
    name: str, turn: str, reference: AssetMesh, compared: AssetMesh, target: Floats, factor: float
) -> Candidate:
    mesh, matrix = compared.mesh, _matrix(name, turn, reference.origin, compared.origin)
    if factor != 1:
        # In the world, units scale all there is; elsewhere the origins already are at one place.
        matrix[:3, : 4 if name == "world" else 3] /= factor
    box = box_of(mesh, matrix)
    if name == "centered":
        shift = target.mean(axis=0) - box.mean(axis=0)
        matrix[:3, 3] += shift
        box = box + shift
    return Candidate(name, turn, matrix, box, factor, misfit(box, target))


def transformed(positions: Floats, matrix: Floats) -> Floats:
    """The one arithmetic for all meshes, so that the same mesh has the same bits."""
    with np.errstate(all="ignore"):  # coordinates that are not finite are dealt with by the metric
        return positions @ matrix[:3, :3].T + matrix[:3, 3]


def box_of(mesh: MeshArrays, matrix: Floats) -> Floats:
    """(2, 3) lowest and highest corner of the faces' finite vertices."""
    positions = transformed(mesh.on_faces, matrix)
    if not np.isfinite(positions).all():
        positions = positions[np.isfinite(positions).all(axis=1)]
    if not len(positions):
        return np.zeros((2, 3))
    columns = positions.T  # the least of each in turn: along the rows takes several times as long
    return np.array([[column.min() for column in columns], [column.max() for column in columns]])
