# SPDX-License-Identifier: GPL-3.0-or-later
"""Small meshes for the tests."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fmqm_addon.metric.evaluation import Evaluation, Result
from fmqm_addon.metric.geometry import Floats, Ints
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.surface import Frame, MeshArrays, Surface, prepare_surface
from fmqm_addon.metric.texture import Color, Material, PlainColor, Texture

from .oracles import NaiveQuery

TETRAHEDRON = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float64),
    np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]),
)
TRIANGLE = (np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0]], np.float64), np.array([[0, 1, 2]]))
SMALL = Settings(samples=640, patches=10, color_units=20)


@dataclass(frozen=True)
class ImageAlpha:
    """The alpha of an image."""

    image: Texture

    def opacity(self, values: Floats) -> Floats:
        return self.image.alpha_at(values)


def grid(columns: int, rows: int) -> tuple[Floats, Ints]:
    """An open rectangle in the xy plane, made of unit squares of two triangles each."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0))
    corner = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    right, up = corner + 1, corner + columns + 1
    triangles = np.concatenate([np.stack([corner, right, up], 1), np.stack([right, up + 1, up], 1)])
    return np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1), triangles


def cube(cuts: int = 1) -> tuple[Floats, Ints]:
    """The closed unit cube, faces cut into squares; its vertices are welded."""
    flat, triangles = grid(cuts, cuts)
    u, v, zero = (flat / cuts).T
    one = zero + 1
    faces = [(v, u, zero), (u, v, one), (u, zero, v), (v, one, u), (zero, v, u), (one, u, v)]
    positions = np.concatenate([np.stack(face, axis=1) for face in faces])
    _, first, which = np.unique(positions, axis=0, return_index=True, return_inverse=True)
    all_triangles = np.concatenate([triangles + k * len(flat) for k in range(6)])
    return positions[first], which.reshape(-1)[all_triangles]


def icosahedron() -> tuple[Floats, Ints]:
    golden = (1 + 5**0.5) / 2
    positions = np.array([np.roll([0, i, j * golden], k) for k in range(3) for i in (-1, 1) for j in (-1, 1)])
    near = np.linalg.norm(positions[:, None] - positions, axis=2) < 2.1
    triangles = []
    for a in range(12):
        for b in range(a + 1, 12):
            for c in range(b + 1, 12):
                if near[a, b] and near[b, c] and near[a, c]:
                    outward = np.dot(positions[a], np.cross(positions[b], positions[c])) > 0
                    triangles.append((a, b, c) if outward else (a, c, b))
    return positions, np.array(triangles)


def sphere() -> tuple[Floats, Ints]:
    """80 triangles on the unit sphere."""
    positions, triangles = icosahedron()
    number: dict[tuple[int, int], int] = {}
    points = list(positions)

    def middle(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in number:
            number[key] = len(points)
            points.append(points[a] + points[b])
        return number[key]

    parts = []
    for a, b, c in triangles.tolist():
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        parts += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    on_sphere = np.array(points)
    return on_sphere / np.linalg.norm(on_sphere, axis=1, keepdims=True), np.array(parts)


def texture(seed: int = 0, size: int = 8) -> Texture:
    return Texture(np.random.default_rng(seed).integers(0, 256, (size, size, 3), np.uint8))


def materials(*colors: Color) -> tuple[Material, ...]:
    return tuple(Material(f"material {index}", color) for index, color in enumerate(colors))


def mesh_arrays(
    shape: tuple[Floats, Ints], colors: tuple[Color, ...] = (PlainColor((0.8, 0.4, 0.2)),), name: str = "mesh"
) -> MeshArrays:
    """A mesh whose UVs are its x + z / 3 and y - z / 4, scaled to the box; materials take turns."""
    positions, triangles = shape
    low = positions.min(axis=0)
    x, y, z = ((positions - low) / max(np.ptp(positions), 1e-300)).T
    uv = np.stack([x + z / 3, y - z / 4], axis=1)[triangles]
    return MeshArrays(name, positions, triangles, uv, np.arange(len(triangles)) % len(colors), materials(*colors))


def surface(
    shape: tuple[Floats, Ints], colors: tuple[Color, ...] = (PlainColor((0.8, 0.4, 0.2)),), frame: Frame | None = None
) -> Surface:
    return prepare_surface(mesh_arrays(shape, colors), NaiveQuery, frame)


def evaluate(reference: MeshArrays, distorted: MeshArrays, settings: Settings = SMALL) -> Result:
    """A whole comparison."""
    ref = prepare_surface(reference, NaiveQuery)
    evaluation = Evaluation(ref, settings)
    evaluation.prepare().run()
    return evaluation.compare(prepare_surface(distorted, NaiveQuery, ref.frame)).run()


def moved(mesh: MeshArrays, scale: float, shift: Floats) -> MeshArrays:
    return replace(mesh, positions=mesh.positions * scale + shift)


def shaken(mesh: MeshArrays, amount: float, seed: int = 0) -> MeshArrays:
    noise = np.random.default_rng(seed).normal(0, amount, mesh.positions.shape)
    return replace(mesh, positions=mesh.positions + noise * np.ptp(mesh.positions))
