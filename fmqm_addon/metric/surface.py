# SPDX-License-Identifier: GPL-3.0-or-later
"""A mesh as the metric sees it: welded triangles in one frame, what their colors are, and its spatial query."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .errors import MeshError
from .geometry import Floats, Ints, cross, dot, lengths, triangle_edges, weighted
from .stepper import Progress, Work, as_part, finish
from .texture import Material

# Heights of triangles below this many float64 roundings of the position count as zero area.
FLAT_ROUNDINGS = 8
_BATCH = 1 << 16  # triangles of a step


@dataclass(frozen=True)
class MeshArrays:
    """A mesh as an adapter delivers it; nothing is assumed about its quality.

    Attributes:
        name: what messages call it.
        positions: (V, 3) float64, world frame, scene units.
        triangles: (T, 3) integers into positions.
        corners: (T, 3, K) float, K values at each corner that the triangle's material asks for: texture
            coordinates, vertex colors (linear light). What they mean, each material knows.
        material: (T,) integers into materials.
        materials: what the triangles look like.
        warnings: what the adapter had to leave out or assume, so that a score may mislead. notes: what it did that
            misleads nobody.
        objects: names of what it was joined from; none: it is one object, of the name of the mesh.
        object: (T,) integers into objects.
        rounding: the positions were rounded to about this much where they were stored, in scene units.
        normals: (T, 3, 3) float at the corners, for who renders the mesh; zero at those that have none of their own.
            None: none were read. The metric does not see them.
    """

    name: str
    positions: Floats
    triangles: NDArray[Any]
    corners: NDArray[Any]
    material: NDArray[Any]
    materials: tuple[Material, ...]
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    object: NDArray[Any] | None = None
    rounding: float = 0.0
    normals: NDArray[Any] | None = None

    @cached_property
    def on_faces(self) -> Floats:
        """(n, 3) the positions that triangles use, in their order."""
        used = np.zeros(len(self.positions), bool)
        used[self.triangles] = True
        return self.positions if used.all() else self.positions[used]


def join_meshes(parts: Sequence[MeshArrays], name: str) -> MeshArrays:
    """Several meshes as one, in their order; a material that they share stays one, and each is an object."""
    objects = tuple(part.name for part in parts)
    if len(parts) == 1:
        return replace(parts[0], name=name, objects=objects)
    materials: dict[int, Material] = {}
    for part in parts:
        materials.update((id(material), material) for material in part.materials)
    place = {key: index for index, key in enumerate(materials)}
    vertex_start = np.cumsum([0] + [len(part.positions) for part in parts[:-1]])
    width = max(part.corners.shape[2] for part in parts)
    corners = np.zeros((sum(len(part.triangles) for part in parts), 3, width), parts[0].corners.dtype)
    row = 0
    for part in parts:
        corners[row : row + len(part.triangles), :, : part.corners.shape[2]] = part.corners
        row += len(part.triangles)
    return MeshArrays(
        name=name,
        positions=np.concatenate([part.positions for part in parts]),
        triangles=np.concatenate([part.triangles + start for part, start in zip(parts, vertex_start, strict=True)]),
        corners=corners,
        material=np.concatenate(
            [np.array([place[id(material)] for material in part.materials])[part.material] for part in parts]
        ),
        materials=tuple(materials.values()),
        warnings=tuple(dict.fromkeys(warning for part in parts for warning in part.warnings)),
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        objects=objects,
        object=np.repeat(np.arange(len(parts), dtype=np.int32), [len(part.triangles) for part in parts]),
        rounding=max(part.rounding for part in parts),
        normals=_joined_normals(parts),
    )


def _joined_normals(parts: Sequence[MeshArrays]) -> NDArray[Any] | None:
    if all(part.normals is None for part in parts):
        return None
    return np.concatenate(
        [np.zeros((len(part.triangles), 3, 3)) if part.normals is None else part.normals for part in parts]
    )


@dataclass(frozen=True)
class Frame:
    """Scene units to the metric's own: (position - center) / scale. Scale is the reference's box diagonal."""

    center: Floats
    scale: float

    @property
    def offset(self) -> float:
        """How far from the world's origin the frame lies, in its own units: what float64 rounds off there."""
        return float(np.abs(self.center).max() / self.scale)

    def enter(self, world: Floats) -> Floats:
        return (world - self.center) / self.scale

    def leave(self, positions: Floats) -> Floats:
        return positions * self.scale + self.center


class SurfaceQuery(Protocol):
    """What a spatial index of a surface must answer; positions are in the metric's frame, (N, 3) float64."""

    def nearest(self, points: Floats, bounds: Floats | None) -> Ints:
        """(N,) index of the triangle nearest to each point; bounds (N,) are upper bounds of the distances."""

    def first_hit(self, origins: Floats, directions: Floats) -> tuple[Ints, Floats]:
        """(N,) first triangle on each ray, -1 for none, and (N,) distance to it; directions have unit length."""


QueryBuilder = Callable[[Floats, Ints], SurfaceQuery]


@dataclass(frozen=True)
class Preparation:
    """What preparing a surface did.

    Attributes:
        given: triangles of the mesh. not_finite, flat, repeated: of these left out, by reason, in this order.
        welded: vertices that became one with another at the same position.
    """

    given: int
    not_finite: int
    flat: int
    repeated: int
    welded: int


@dataclass(frozen=True)
class Surface:
    """A prepared surface (docs/metric.md, "The two surfaces").

    Attributes:
        vertices: (V, 3) float64 in the metric's frame; no two are equal, each is used.
        triangles: (T, 3) int64; none is degenerate, none repeats another.
        corners: (T, 3, K) float64, finite; material: (T,) int64; materials: as in MeshArrays.
        source: (T,) int64, the row of each triangle in MeshArrays.
        objects: names, at least one. object: (T,) into objects. rounding: as in MeshArrays, in the metric's frame.
        preparation: what was left out and welded. warnings, notes: as in MeshArrays, and what preparing adds to them.
        areas: (T,) of the triangles. normals: (T, 3, 3) float64, as in MeshArrays.
    """

    name: str
    frame: Frame
    vertices: Floats
    triangles: Ints
    areas: Floats
    corners: Floats
    material: Ints
    materials: tuple[Material, ...]
    source: Ints
    objects: tuple[str, ...]
    object: Ints
    rounding: float
    query: SurfaceQuery
    preparation: Preparation
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    normals: Floats | None = None

    def color_at(self, triangle: Ints, barycentric: Floats) -> Floats:
        """Equations (5) to (7): (N, 3) float64 sRGB colors at barycentric (N, 3) places of (N,) triangles."""
        values = self._interpolated(triangle, barycentric)
        if len(self.materials) == 1:
            return self.materials[0].color.lookup(values)
        result = np.empty((len(values), 3))
        for material, here in self._by_material(triangle):
            result[here] = material.color.lookup(values[here])
        return result

    def alpha_at(self, triangle: Ints, barycentric: Floats) -> Floats:
        """(N,) float64 opacities in [0, 1] at such places; 1 where a material has none."""
        values = self._interpolated(triangle, barycentric)
        result = np.ones(len(values))
        for material, here in self._by_material(triangle):
            if material.alpha is not None:
                result[here] = material.alpha.opacity(values[here])
        return result

    def _interpolated(self, triangle: Ints, barycentric: Floats) -> Floats:
        """(N, K) the corners' values at such places."""
        corners = self.corners.take(triangle, axis=0)
        return weighted(barycentric, corners[:, 0], corners[:, 1], corners[:, 2])

    def _by_material(self, triangle: Ints) -> Iterator[tuple[Material, Ints]]:
        """Each material that some of the triangles have, with the rows that have it."""
        material = self.material[triangle]
        for index, each in enumerate(self.materials):
            here = np.flatnonzero(material == index)
            if here.size:
                yield each, here


def prepare_surface(mesh: MeshArrays, build_query: QueryBuilder, frame: Frame | None = None) -> Surface:
    """preparing_surface, run to its end."""
    return finish(preparing_surface(mesh, build_query, frame))


def preparing_surface(mesh: MeshArrays, build_query: QueryBuilder, frame: Frame | None = None) -> Work[Surface]:
    """Weld, drop what cannot be measured, move to the metric's frame, index; yields the share done.

    Args:
        frame: the reference's; None makes the frame from this mesh, which is then the reference.

    Raises:
        MeshError: no usable triangle is left.
    """
    warnings, notes = list(mesh.warnings), list(mesh.notes)
    triangles = np.asarray(mesh.triangles, np.int64).reshape(-1, 3)
    if not len(triangles):
        raise MeshError(f"{mesh.name}: the mesh has no faces; a surface is wanted")
    source, areas = np.arange(len(triangles)), np.zeros(len(triangles))

    def keep(mask: NDArray[np.bool_], why: str, say: list[str]) -> int:
        """Leaves out the others, and says so; returns how many they are."""
        nonlocal triangles, source, areas
        dropped = len(mask) - int(np.count_nonzero(mask))
        if not dropped:
            return 0
        if dropped == len(mask):
            raise MeshError(f"{mesh.name}: all {len(mesh.triangles)} triangles are unusable; the last {dropped} {why}")
        say.append(f"{mesh.name}: {dropped} of {len(mesh.triangles)} triangles left out: they {why}")
        triangles, source, areas = triangles[mask], source[mask], areas[mask]
        return dropped

    not_finite = 0
    world = np.asarray(mesh.positions, np.float64)
    if not np.isfinite(world).all():
        finite = np.isfinite(world).all(axis=1)
        not_finite = keep(finite[triangles].all(axis=1), "have coordinates that are not finite", warnings)
    yield Progress("", 0.1)
    world, triangles = _used_only(world, triangles)
    if frame is None:
        frame = _frame_of(world, mesh.name)
    yield Progress("", 0.2)
    positions, triangles = weld(frame.enter(world), triangles)
    welded = len(world) - len(positions)
    yield Progress("", 0.4)
    areas, is_flat = yield from as_part(_areas(positions, triangles, frame), 0.4, 0.1)
    flat = keep(~is_flat, "have zero area", notes)
    yield Progress("", 0.5)
    repeated = keep(_is_first(triangles), "repeat another triangle", notes)
    yield Progress("", 0.6)
    vertices, triangles = _used_only(positions, triangles)

    kept = slice(None) if len(source) == len(mesh.triangles) else source
    corners = np.asarray(mesh.corners, np.float64)[kept]
    if not np.isfinite(corners).all():
        strange = np.count_nonzero(~np.isfinite(corners).all(axis=(1, 2)))
        warnings.append(f"{mesh.name}: {strange} triangles have UVs or colors that are not finite; taken as 0")
        corners = np.where(np.isfinite(corners), corners, 0.0)
    yield Progress("", 0.7)
    return Surface(
        name=mesh.name,
        frame=frame,
        vertices=vertices,
        triangles=triangles,
        areas=areas,
        corners=corners,
        material=np.asarray(mesh.material, np.int64)[kept],
        materials=mesh.materials,
        source=source,
        objects=mesh.objects or (mesh.name,),
        object=np.zeros(len(source), np.int64) if mesh.object is None else np.asarray(mesh.object, np.int64)[kept],
        rounding=mesh.rounding / frame.scale,
        query=build_query(vertices, triangles),
        preparation=Preparation(len(mesh.triangles), not_finite, flat, repeated, welded),
        warnings=tuple(warnings),
        notes=tuple(notes),
        normals=None if mesh.normals is None else np.asarray(mesh.normals, np.float64)[kept],
    )


def _used_only(positions: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    used = np.zeros(len(positions), bool)
    used[triangles] = True
    if used.all():
        return positions, triangles
    return positions[used], (np.cumsum(used) - 1)[triangles]


def _frame_of(positions: Floats, name: str) -> Frame:
    low, high = positions.min(axis=0), positions.max(axis=0)
    diagonal = float(np.linalg.norm(high - low))
    if not 0 < diagonal < np.inf:
        raise MeshError(f"{name}: all vertices lie at one place, so that the surface has zero area")
    return Frame(low + (high - low) / 2, diagonal)


def weld(positions: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Vertices at equal positions become one; the first of them keeps its place in the order."""
    x, y, z = (positions + 0.0).T.copy().view(np.uint64)  # + 0.0: -0 and 0 are equal
    if _distinct(_mix(_mix(_mix(x) ^ y) ^ z)):
        return positions, triangles
    order = np.lexsort(positions.T)  # stable: of equal positions the first comes first
    ordered = positions[order]
    new = np.ones(len(order), bool)
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    first = order[new]
    by_place = np.argsort(first)
    rank = np.empty_like(by_place)
    rank[by_place] = np.arange(len(by_place))
    which = np.empty_like(order)
    which[order] = rank[np.cumsum(new) - 1]
    return positions[first[by_place]], which[triangles]


def is_closed(triangles: Ints) -> bool:
    """Whether each edge of welded triangles has an even number of faces.

    Edges are mixed to 64 bits each and put together by exclusive or, to which those in an even number add nothing:
    it is 0 for an open mesh once in 2^64 times.
    """
    together = np.uint64(0)
    width = np.uint64(int(triangles.max()) + 1)
    for k in range(3):
        first, second = (triangles[:, corner].astype(np.uint64) for corner in (k, (k + 1) % 3))
        edges = np.minimum(first, second) * width + np.maximum(first, second)
        together ^= np.bitwise_xor.reduce(_mix(edges))
    return bool(together == 0)


def _areas(positions: Floats, triangles: Ints, frame: Frame) -> Work[tuple[Floats, NDArray[np.bool_]]]:
    """Of triangles, and whether they are zero, up to the rounding that the positions carry from their place in the
    world; yields the share done."""
    areas, is_flat = np.empty(len(triangles)), np.empty(len(triangles), bool)
    rounding = FLAT_ROUNDINGS * np.finfo(np.float64).eps * float(np.abs(positions).max() + frame.offset)
    for first in range(0, len(triangles), _BATCH):
        here = slice(first, first + _BATCH)
        ab, ac = triangle_edges(positions, triangles[here])
        normal = cross(ab, ac)
        longest = np.maximum(dot(ab, ab), dot(ac, ac))  # of the two edges, squared: within a factor of the longest
        areas[here] = lengths(normal) / 2
        is_flat[here] = dot(normal, normal) <= rounding * rounding * longest
        yield Progress("", min(1.0, (first + _BATCH) / len(triangles)))
    return areas, is_flat


def _is_first(triangles: Ints) -> NDArray[np.bool_]:
    """False where an earlier triangle has the same three vertices in any order."""
    corners = _mix(np.arange(triangles.max() + 1, dtype=np.uint64))
    a, b, c = (corners.take(triangles[:, k]) for k in range(3))
    keys = a + b + c  # the same in any order
    is_first = np.ones(len(triangles), bool)
    if _distinct(keys):
        return is_first
    _, which, count = np.unique(keys, return_inverse=True, return_counts=True)
    suspects = np.flatnonzero(count[which] > 1)
    _, first = np.unique(np.sort(triangles[suspects], axis=1), axis=0, return_index=True)
    is_first[suspects] = False
    is_first[suspects[first]] = True
    return is_first


def _mix(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Spreads 64-bit values over all of their range (the finalizer of splitmix64)."""
    mixed = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


def _distinct(keys: NDArray[np.uint64]) -> bool:
    """No two are equal: then nothing that they are made of can be. Much faster than sorting rows."""
    ordered = np.sort(keys)
    return not (ordered[1:] == ordered[:-1]).any()
