# SPDX-License-Identifier: GPL-3.0-or-later
"""Local patches of the reference (V-B): centres, ring growth, and the rules for coarse and loose meshes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .geometry import Floats, Ints, dot, morton_order, ranges
from .settings import Settings
from .stepper import Progress, Work
from .surface import Surface, triangle_areas

FPS_TIE = 1e-5  # V-B: distances this close, relatively, are equal; the lowest vertex index wins
SPLIT_BELOW = 4  # V-B: once split, no triangle is above S_global / (SPLIT_BELOW n_patches)
AREA_ROUNDING = 1e-9  # relative: an area that reaches its target up to rounding has reached it

_FPS_BLOCK = 256  # vertices that share a bounding box in farthest point sampling


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
    points = vertices[order]  # (blocks, _FPS_BLOCK, 3)
    low, high = points.min(axis=1), points.max(axis=1)

    def farthest(squared: Floats, block_max: Floats) -> int:
        tie = block_max.max() * (1 - FPS_TIE) ** 2
        blocks = np.flatnonzero(block_max >= tie)
        return int(order[blocks][squared[blocks] >= tie].min())

    from_mean = ((points - vertices.mean(axis=0)) ** 2).sum(axis=2)
    latest = farthest(from_mean, from_mean.max(axis=1))
    yield latest
    squared = np.full(order.shape, np.inf)
    block_max = np.full(len(order), np.inf)
    for _ in range(count - 1):
        center = vertices[latest]
        gap = np.maximum(np.maximum(low - center, center - high), 0)
        touched = np.flatnonzero((gap * gap).sum(axis=1) < block_max)
        offset = points[touched] - center
        squared[touched] = np.minimum(squared[touched], np.einsum("bpc,bpc->bp", offset, offset))
        block_max[touched] = squared[touched].max(axis=1)
        latest = farthest(squared, block_max)
        yield latest


def grow_patches(mesh: PatchMesh, centers: Ints, n_patches: int) -> Iterator[Patch]:
    """One patch a centre: its one-ring, then whole rings while S_local < S_global / n_patches.

    A patch whose neighbours run out goes on with the triangles not yet in it, nearest centroid to the
    centre first.
    """
    incident, start = _incident_faces(mesh)
    seen_face = np.full(len(mesh.triangles), -1)
    seen_vertex = np.full(len(mesh.vertices), -1)
    scratch = np.empty(max(len(seen_face), len(seen_vertex)), np.int64)
    centroids: Floats | None = None
    target = mesh.area / n_patches * (1 - AREA_ROUNDING)
    for number, center in enumerate(centers.tolist()):
        rings: list[Ints] = []
        area = 0.0
        frontier = np.array([center])
        seen_vertex[center] = number
        while area < target and frontier.size:
            faces = incident[ranges(start[frontier], start[frontier + 1])]
            faces = _once(faces[seen_face[faces] != number], scratch)
            seen_face[faces] = number
            rings.append(faces)
            area += float(mesh.areas[faces].sum())
            around = mesh.triangles[faces].ravel()
            frontier = _once(around[seen_vertex[around] != number], scratch)
            seen_vertex[frontier] = number
        extended = area < target
        if extended:
            if centroids is None:
                centroids = mesh.vertices[mesh.triangles].mean(axis=1)
            rest = np.flatnonzero(seen_face != number)
            offset = centroids - mesh.vertices[center]
            squared = dot(offset, offset)
            rings.append(rest[_nearest(squared[rest], mesh.areas[rest], target - area)])
        patch_faces = np.sort(np.concatenate(rings))
        corners = mesh.vertices[mesh.triangles[patch_faces].ravel()]
        yield Patch(
            center=center,
            faces=patch_faces,
            area=float(mesh.areas[patch_faces].sum()),
            diagonal=float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0))),
            extended=extended,
        )


def _incident_faces(mesh: PatchMesh) -> tuple[Ints, Ints]:
    """The faces around vertex v are incident[start[v] : start[v + 1]]."""
    corners = mesh.triangles.ravel()
    incident = np.argsort(corners, kind="stable") // 3
    start = np.zeros(len(mesh.vertices) + 1, np.int64)
    np.cumsum(np.bincount(corners, minlength=len(mesh.vertices)), out=start[1:])
    return incident, start


def _once(values: Ints, scratch: Ints) -> Ints:
    """Each of the values once, without sorting; scratch is any array that they index."""
    place = np.arange(len(values))
    scratch[values] = place
    return values[scratch[values] == place]


def _nearest(squared: Floats, areas: Floats, wanted: float) -> Ints:
    """The rows of least squared distance whose areas together reach the wanted area; all if they never do."""
    farthest = squared.max(initial=0.0)
    reach = wanted
    while True:  # sort no more of them than are needed
        near = np.flatnonzero(squared <= reach)
        if reach >= farthest or float(areas[near].sum()) >= wanted:
            break
        reach *= 4
    near = near[np.argsort(squared[near], kind="stable")]
    total = np.cumsum(areas[near])
    return near[: int(np.searchsorted(total, wanted)) + 1]
