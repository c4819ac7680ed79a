# SPDX-License-Identifier: GPL-3.0-or-later
"""Whose loss it is, geometry's or the texture's: two more scores of a pair, each with only one of them distorted.

    geometry: the distorted mesh, painted as the reference.
    texture: the reference's mesh, painted as the distorted.

Painting is exchanging materials where the two meshes lie on their textures alike. Where they do not (unwrapped anew,
repacked, baked) a point has the color of the other surface's nearest point. The paper has none of this.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from ..metric.geometry import Floats, Ints
from ..metric.queries import closest_on
from ..metric.stepper import Progress, Stepper, Work, as_part
from ..metric.surface import MeshArrays, Surface
from ..metric.texture import Material
from .measurement import Comparison, Measurement

How = Literal["materials", "nearest points"]
Mostly = Literal["nothing", "geometry", "texture", "both"]

AGREES = 0.02  # of the texture's side: what noise and decimation shift texture coordinates by at most
MOST = 0.8  # of the samples or triangles; seams and far-moved parts are the rest
LITTLE = 0.02  # loss of FMQM that is not worth asking whose it is
CLEARLY = 2.0  # one loss is this many times the other: it is most of it


@dataclass(frozen=True)
class Attribution:
    """Parts of the loss 1 - FMQM of a pair; they do not add up to it, since both lower the color features.

    Attributes:
        geometry_loss, texture_loss: 1 - FMQM with only geometry or only texture distorted, in [0, 1].
        how: what painting was: exchanging materials, or taking colors from nearest points.
    """

    geometry_loss: float
    texture_loss: float
    how: How

    @property
    def mostly(self) -> Mostly:
        """Whose most of the loss is."""
        geometry, texture = self.geometry_loss, self.texture_loss
        if max(geometry, texture) < LITTLE:
            return "nothing"
        if geometry >= CLEARLY * texture:
            return "geometry"
        return "texture" if texture >= CLEARLY * geometry else "both"

    @property
    def phrase(self) -> str:
        """The finding in words."""
        return {
            "nothing": "there is hardly any loss",
            "geometry": "most of the loss is the geometry",
            "texture": "most of the loss is the texture",
            "both": "geometry and texture share the loss",
        }[self.mostly]

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON: the attributes, "mostly" and the phrase."""
        return {**asdict(self), "mostly": self.mostly, "phrase": self.phrase}


def attribute(
    measurement: Measurement, reference: MeshArrays, distorted: MeshArrays, compared: Comparison
) -> Stepper[Attribution]:
    """A stepper over two more comparisons on the same samples.

    Args:
        measurement: that reference was prepared in.
        reference, distorted: as they were measured, in the reference's world.
        compared: their comparison.
    """
    return Stepper(_attribute(measurement, reference, distorted, compared))


def _attribute(
    measurement: Measurement, reference: MeshArrays, distorted: MeshArrays, compared: Comparison
) -> Work[Attribution]:
    yield Progress("prepare", 0.0)
    theirs, own = _counterparts(distorted, reference), _counterparts(reference, distorted)
    how: How = "nearest points"
    if (
        theirs is not None
        and own is not None
        and (_unwrapped_alike(reference, distorted) or _lie_alike(measurement.reference, compared))
    ):
        how = "materials"
        painted = replace(distorted, materials=theirs), replace(reference, materials=own)
    else:
        painted = (
            _painted_from(distorted, measurement.reference),
            _painted_from(reference, compared.distorted),
        )
    losses: list[float] = []
    for mesh in painted:
        painting = yield from as_part(measurement.compare(mesh), 0.5 * len(losses), 0.5)
        losses.append(max(0.0, 1.0 - painting.scores.FMQM))
    return Attribution(losses[0], losses[1], how)


def _counterparts(mesh: MeshArrays, other: MeshArrays) -> tuple[Material, ...] | None:
    """For each material of the mesh the other's of its name, or the one at its place where there are equally many."""
    if mesh.corners.shape[2] != other.corners.shape[2]:
        return None
    by_name = {material.name: material for material in other.materials}
    if len(by_name) == len(other.materials) and all(material.name in by_name for material in mesh.materials):
        return tuple(by_name[material.name] for material in mesh.materials)
    return other.materials if len(mesh.materials) == len(other.materials) else None


def _unwrapped_alike(reference: MeshArrays, distorted: MeshArrays) -> bool:
    """Whether the two have the same triangles with about the same corner values, wherever their vertices are."""
    if reference.corners.shape != distorted.corners.shape:
        return False
    apart = np.abs(reference.corners - distorted.corners).max(axis=(1, 2), initial=0.0)
    return float(np.mean(apart <= AGREES)) >= MOST


def _lie_alike(reference: Surface, compared: Comparison) -> bool:
    """Whether texture coordinates, and what else materials read, agree between the points nearest to a sample."""
    result = compared.result
    values = [
        _values_at(surface, fields.nearest, fields.triangle)
        for surface, fields in ((reference, result.ref), (compared.distorted, result.dist))
    ]
    apart = np.abs(values[0] - values[1]).max(axis=1, initial=0.0)
    return float(np.mean(apart <= AGREES)) >= MOST


def _values_at(surface: Surface, points: Floats, triangle: Ints) -> Floats:
    """(N, K) corner values at points on (N,) triangles."""
    _, weights = closest_on(surface, points, triangle)
    return np.einsum("nk,nkc->nc", weights, surface.corners[triangle])


def _painted_from(mesh: MeshArrays, other: Surface) -> MeshArrays:
    """The mesh with the colors of another surface's nearest points."""
    material = Material(mesh.name, NearestColor(other))
    corners = np.asarray(mesh.positions, np.float64)[mesh.triangles]
    return replace(mesh, corners=corners, material=np.zeros(len(mesh.triangles), np.int64), materials=(material,))


@dataclass(frozen=True)
class NearestColor:
    """The color of a surface at the point nearest to a place, which the three corner values are, in its world."""

    surface: Surface

    def lookup(self, values: Floats) -> Floats:
        """(N, 3) encoded colors at (N, 3) places; a metric.color.Color."""
        points = self.surface.frame.enter(values)
        triangle = self.surface.query.nearest(points, None)
        _, weights = closest_on(self.surface, points, triangle)
        return self.surface.color_at(triangle, weights)
