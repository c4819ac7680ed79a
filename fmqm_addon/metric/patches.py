# SPDX-License-Identifier: GPL-3.0-or-later
"""Local patches of the reference (V-B): centres, ring growth, and the rules for coarse and loose meshes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .geometry import Floats, Ints, dot, morton_order, ranges, triangle_areas
from .settings import Settings
from .stepper import Progress, Work
from .surface import Surface

FPS_TIE = 1e-5  # V-B: distances this close, relatively, are equal; the lowest vertex index wins
SPLIT_BELOW = 4  # V-B: once split, no triangle is above S_global / (SPLIT_BELOW n_patches)
AREA_ROUNDING = 1e-9  # relative: an area that reaches its target up to rounding has reached it

_FPS_BLOCK = 256  # vertices that share a bounding box in farthest point sampling
_TOGETHER = 16  # patches that grow side by side, at most
_MARKS = 1 << 24  # of faces and vertices of these


@dataclass(frozen=True)
class PatchMesh:
    """The reference as patches see it: the same surface, with vertices enough to be their centres.

    Attributes:
        vertices: (V, 3), metric's frame. triangles: (T, 3) into vertices. areas: (T,).
        parent: (T,) the triangle of the Surface that each one was cut from, or is.
        was_split: triangles were cut.
    """

    vertices: Floats
    triangles: Ints
    areas: Floats
    parent: Ints
    was_split: bool

    @property
    def area(self) -> float:
        """S_global."""
        return float(self.areas.sum())


@dataclass(frozen=True)
class Patch:
    """One local patch.

    Attributes:
        center: vertex index in the PatchMesh.
        faces: ascending triangle indices in the PatchMesh.
        area: S_local. diagonal: L, of the bounding box of the patch's vertices.
        extended: its neighbours ran out, and it went on with the nearest triangles.
    """

    center: int
    faces: Ints
    area: float
    diagonal: float
    extended: bool


def build_patch_mesh(surface: Surface, n_patches: int) -> Work[PatchMesh]:
    """Triangles of the reference; the edges of large ones are split where there are fewer vertices than patches.

    Then the edges of all triangles above S_global / (4 n_patches) are halved until none is; otherwise nothing
    changes, however large a triangle is: centres are vertices, and those stand where a mesh has its detail.
    Yields the share done, about.
    """
    vertices, triangles = surface.vertices, surface.triangles
    parent = np.arange(len(triangles))
    areas = surface.areas
    yield Progress("", 0.2)
    was_split = False
    if len(vertices) < n_patches:
        limit = float(areas.sum()) / n_patches / SPLIT_BELOW * (1 + AREA_ROUNDING)
        while (areas > limit).any():
            was_split = True
            vertices, triangles, cut_from = split_edges(vertices, triangles, areas > limit)
            parent = parent[cut_from]
            yield Progress("", 0.5)
            areas = triangle_areas(vertices, triangles)
    return PatchMesh(vertices, triangles, areas, parent, was_split)


def split_edges(vertices: Floats, triangles: Ints, large: NDArray[np.bool_]) -> tuple[Floats, Ints, Ints]:
    """Halve all edges of the large triangles; their neighbours are cut along the same new vertices.

    Returns:
        The new vertices and triangles, and for each new triangle the row of the one it was cut from, or was.
    """
    touched = np.zeros(len(vertices), bool)
    touched[triangles[large]] = True
    a, b, c = touched[triangles].T
    near = (a & b) | (b & c) | (c & a)  # the others have no edge that could be halved
    rest, near = np.flatnonzero(~near), np.flatnonzero(near)

    first, second = triangles[near], np.roll(triangles[near], -1, axis=1)  # edge k joins corners k and k + 1
    keys = np.minimum(first, second) * len(vertices) + np.maximum(first, second)
    split_keys = np.unique(keys[large[near]])
    place = np.searchsorted(split_keys, keys).clip(max=len(split_keys) - 1)
    halved = split_keys[place] == keys
    middle = len(vertices) + place
    ends = np.stack([split_keys // len(vertices), split_keys % len(vertices)], axis=1)
    vertices = np.concatenate([vertices, vertices[ends].mean(axis=1)])

    count = halved.sum(axis=1)
    whole = np.concatenate([rest, near[count == 0]])
    pieces, cut_from = [triangles[whole]], [whole]
    for n in (1, 2, 3):
        rows = np.flatnonzero(count == n)
        # Turn each triangle so that its halved edges come first; for three any turn will do.
        if n == 3:
            turn = np.zeros(len(rows), np.int64)
        elif n == 1:
            turn = halved[rows].argmax(axis=1)
        else:
            turn = (halved[rows].argmin(axis=1) + 1) % 3
        corners = (turn[:, None] + np.arange(3)) % 3
        a, b, c = first[rows[:, None], corners].T
        ab, bc, ca = middle[rows[:, None], corners].T
        if n == 1:
            parts = [(a, ab, c), (ab, b, c)]
        elif n == 2:
            parts = [(a, ab, c), (ab, bc, c), (ab, b, bc)]
        else:
            parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        pieces += [np.stack(part, axis=1) for part in parts]
        cut_from += [near[rows]] * len(parts)
    return vertices, np.concatenate(pieces), np.concatenate(cut_from)


def choose_centers(vertices: Floats, settings: Settings) -> Iterator[int]:
    """The vertices that are the scored patches' centres, in their order; every vertex if there are fewer."""
    count = min(settings.patches, len(vertices))
    scored = count if settings.scored_patches is None else min(settings.scored_patches, count)
    if settings.centers == "random":
        rng = np.random.default_rng(np.random.SeedSequence(settings.seed, spawn_key=(0,)))
        yield from rng.choice(len(vertices), count, replace=False)[:scored].tolist()
    else:
        yield from farthest_points(vertices, scored)


def farthest_points(vertices: Floats, count: int) -> Iterator[int]:
    """Farthest point sampling (V-B), deterministic: starts at the vertex farthest from the mean.

    Vertices lie in blocks along a space-filling curve; a new centre touches only blocks whose box it
    could bring nearer, so that the cost hardly grows with the number of centres.
    """
    order = morton_order(vertices)
    padding = -len(order) % _FPS_BLOCK
    order = np.concatenate([order, np.full(padding, order[-1])]).reshape(-1, _FPS_BLOCK)
    points = vertices.T.take(order, axis=1)  # (3, blocks, _FPS_BLOCK)
    low, high = points.min(axis=2), points.max(axis=2)

    def farthest(squared: Floats, block_max: Floats) -> int:
        tie = block_max.max() * (1 - FPS_TIE) ** 2
        blocks = np.flatnonzero(block_max >= tie)
        return int(order[blocks][squared[blocks] >= tie].min())

    from_mean = ((points - vertices.mean(axis=0)[:, None, None]) ** 2).sum(axis=0)
    latest = farthest(from_mean, from_mean.max(axis=1))
    yield latest
    squared = np.full(order.shape, np.inf)
    block_max = np.full(len(order), np.inf)
    for _ in range(count - 1):
        center = vertices[latest][:, None]
        gap = np.maximum(np.maximum(low - center, center - high), 0)
        touched = np.flatnonzero((gap * gap).sum(axis=0) < block_max)
        x, y, z = points.take(touched, axis=1) - center[:, None]
        nearest = np.minimum(squared.take(touched, axis=0), x * x + z * z + y * y)
        squared[touched] = nearest
        block_max[touched] = nearest.max(axis=1)
        latest = farthest(squared, block_max)
        yield latest


def grow_patches(mesh: PatchMesh, centers: Ints, n_patches: int) -> Iterator[Patch]:
    """One patch a centre: its one-ring, then whole rings while S_local < S_global / n_patches.

    A patch whose neighbours run out goes on with the triangles not yet in it, nearest centroid to the
    centre first.
    """
    incident, start = _incident_faces(mesh)
    target = mesh.area / n_patches * (1 - AREA_ROUNDING)
    size = len(mesh.triangles) + len(mesh.vertices)
    together = max(1, min(_TOGETHER, len(centers), _MARKS // max(1, size)))
    marks = np.full(together * size, -1, np.int32)
    centroids: _Centroids | None = None
    for first in range(0, len(centers), together):
        group = centers[first : first + together]
        areas, found = _grow_rings(mesh, group, target, incident, start, marks)
        for center, area, faces in zip(group.tolist(), areas, found, strict=True):
            extended = area < target
            if extended:
                centroids = centroids or _Centroids(mesh)
                more = centroids.nearest(mesh.vertices[center], faces, target - area)
                faces = np.sort(np.concatenate([faces, more]))
            corners = mesh.vertices.take(mesh.triangles.take(faces, axis=0).ravel(), axis=0)
            yield Patch(
                center=center,
                faces=faces,
                area=float(mesh.areas.take(faces).sum()),
                diagonal=float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0))),
                extended=extended,
            )


def _grow_rings(
    mesh: PatchMesh, centers: Ints, target: float, incident: Ints, start: Ints, marks: NDArray[np.int32]
) -> tuple[list[float], list[Ints]]:
    """Areas and ascending faces of several patches, each grown until it has the target or no neighbours.

    They grow side by side, a ring at a time: most rings are small, and numpy's calls cost more than their faces.

    Args:
        marks: -1 everywhere, for each face and vertex of each patch; and so again at the end.
    """
    n_faces, n_vertices = len(mesh.triangles), len(mesh.vertices)
    face_marks, vertex_marks = marks[: len(centers) * n_faces], marks[len(marks) - len(centers) * n_vertices :]
    areas = [0.0] * len(centers)
    growing = np.ones(len(centers), bool)
    patch, vertex = np.arange(len(centers)), centers
    vertex_marks[patch * n_vertices + vertex] = 0
    faces, vertices = [], [patch * n_vertices + vertex]
    while patch.size:
        first, last = start.take(vertex), start.take(vertex + 1)
        key = incident.take(ranges(first, last))
        key += (patch * n_faces).repeat(last - first)
        key = _once(key, face_marks)
        faces.append(key)
        patch, face = np.divmod(key, n_faces)
        of_faces = mesh.areas.take(face)
        ends = np.searchsorted(patch, np.arange(len(centers) + 1)).tolist()
        for k, (begin, end) in enumerate(zip(ends[:-1], ends[1:], strict=True)):
            if end > begin:
                areas[k] += float(of_faces[begin:end].sum())
                growing[k] = areas[k] < target
        grows = np.flatnonzero(growing.take(patch))
        key = mesh.triangles.take(face.take(grows), axis=0).ravel()
        key += (patch.take(grows) * n_vertices).repeat(3)
        key = _once(key, vertex_marks)
        vertices.append(key)
        patch, vertex = np.divmod(key, n_vertices)
    found = np.sort(np.concatenate(faces))
    face_marks[found] = -1
    vertex_marks[np.concatenate(vertices)] = -1
    ends = np.searchsorted(found, np.arange(len(centers) + 1) * n_faces).tolist()
    return areas, [found[a:b] - k * n_faces for k, (a, b) in enumerate(zip(ends[:-1], ends[1:], strict=True))]


def _once(keys: Ints, marks: NDArray[np.int32]) -> Ints:
    """Each of the keys without a mark once, without sorting; then they have one."""
    keys = keys.take(np.flatnonzero(marks.take(keys) < 0))
    place = np.arange(len(keys), dtype=np.int32)
    marks[keys] = place
    return keys.take(np.flatnonzero(marks.take(keys) == place))


class _Centroids:
    """The centroids of all triangles, sorted along an axis, so that few are looked at to find the nearest ones."""

    def __init__(self, mesh: PatchMesh) -> None:
        a, b, c = (mesh.vertices.take(mesh.triangles[:, k], axis=0) for k in range(3))
        self._areas, self._places = mesh.areas, (a + b + c) / 3
        self._axis = int(np.argmax(np.ptp(self._places, axis=0)))
        self._order = np.argsort(self._places[:, self._axis])
        self._along = self._places[self._order, self._axis]
        self._taken = np.zeros(len(self._areas), bool)

    def nearest(self, center: Floats, taken: Ints, wanted: float) -> Ints:
        """Those nearest to the center, but for those taken, whose areas together reach the wanted one, or all."""
        self._taken[taken] = True
        left = len(self._areas) - len(taken)
        reach = wanted
        while True:
            width = np.sqrt(reach) * (1 + AREA_ROUNDING)
            first, last = np.searchsorted(self._along, (center[self._axis] - width, center[self._axis] + width))
            near = np.sort(self._order[first:last])
            near = near[~self._taken.take(near)]
            offset = self._places.take(near, axis=0) - center
            squared = dot(offset, offset)
            inside = np.flatnonzero(squared <= reach)
            near, squared = near.take(inside), squared.take(inside)
            if len(near) == left or float(self._areas.take(near).sum()) >= wanted:
                break
            reach *= 4
        self._taken[taken] = False
        near = near.take(np.argsort(squared, kind="stable"))
        total = np.cumsum(self._areas.take(near))
        return np.asarray(near[: int(np.searchsorted(total, wanted)) + 1])


def _incident_faces(mesh: PatchMesh) -> tuple[Ints, Ints]:
    """The faces around vertex v are incident[start[v] : start[v + 1]]."""
    corners = mesh.triangles.ravel()
    incident = np.argsort(corners, kind="stable") // 3
    start = np.zeros(len(mesh.vertices) + 1, np.int64)
    np.cumsum(np.bincount(corners, minlength=len(mesh.vertices)), out=start[1:])
    return incident, start
