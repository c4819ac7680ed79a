# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes built in memory at the limits of numbers, sizes and shapes: a score of 1 against themselves, or a refusal."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.target import asset_mesh
from fmqm_addon.comparison.alignment import align
from fmqm_addon.comparison.measurement import Measurement
from fmqm_addon.metric.errors import MeshError
from fmqm_addon.metric.settings import Settings
from tests.blender import scenes

SMALL = Settings(samples=1600, patches=20, color_units=20)
Shape = tuple[NDArray[np.float64], NDArray[np.int64]]


def build(shape: Shape, image: Path | None = None, uv: float = 1.0) -> bpy.types.Object:
    """An object of triangles; Blender's own checks of coordinates are not asked."""
    positions, triangles = shape
    mesh = bpy.data.meshes.new("Extreme")
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.astype(np.float32).ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", triangles.astype(np.int32).ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    mesh.update()
    if image is not None:
        corners = positions[triangles.ravel(), :2] * uv
        mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", corners.astype(np.float32).ravel())
        mesh.materials.append(scenes.textured(image))
    made = bpy.data.objects.new("Extreme", mesh)
    bpy.context.scene.collection.objects.link(made)
    return made


def grid(size: float = 1.0, away: float = 0.0, cells: int = 12) -> Shape:
    """A bent sheet."""
    x, y = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1))
    positions = np.stack([x, y, 0.2 * np.sin(5 * x) * np.cos(4 * y)], axis=2).reshape(-1, 3)
    corner = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]))
    return positions * size + away, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def loose(count: int, size: float) -> Shape:
    """Triangles that share no vertex, strewn over a cube."""
    rng = np.random.default_rng(0)
    positions = rng.random((count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    return positions.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def with_strange(value: float, rows: int) -> Shape:
    positions, triangles = grid()
    positions[:rows] = value
    return positions, triangles


def coincident(extra: bool) -> Shape:
    """A million vertices at one place; and, or not, a triangle elsewhere."""
    positions = np.zeros((1_000_002, 3))
    if extra:
        positions[-3:] = np.eye(3)
    return positions, np.arange(1_000_002).reshape(-1, 3)


def self_scores(object_: bpy.types.Object, settings: Settings = SMALL) -> list[float]:
    before = scenes.blocks()
    try:
        reference = asset_mesh([object_], "extreme")
        measurement = Measurement(reference.world(), BVHQuery, settings)
        measurement.prepare().run()
        return list(measurement.compare(align(reference, asset_mesh([object_], "extreme")).mesh).run().scores)
    finally:
        assert scenes.blocks() == before


MEASURABLE: dict[str, Callable[[], Shape]] = {
    "one face": lambda: (np.eye(3), np.array([[0, 1, 2]])),
    "a needle": lambda: (np.array([[0, 0, 0], [1, 0, 0], [0, 1e-6, 0]]), np.array([[0, 1, 2]])),
    "some coordinates are NaN": lambda: with_strange(np.nan, 20),
    "some coordinates are infinite": lambda: with_strange(np.inf, 20),
    "extent of 1e-9": lambda: grid(1e-9),
    "extent of 1e-30": lambda: grid(1e-30),
    "extent of 1e9": lambda: grid(1e9),
    "extent of 1e37": lambda: grid(1e37),
    "1e7 from the origin": lambda: grid(1000.0, 1e7),
    "1e7 from the origin, of the size of a float32 step": lambda: grid(1.0, 1e7),
    "large loose triangles": lambda: loose(300, 0.5),
    "a million coincident vertices and a triangle": lambda: coincident(True),
    "a large face among dust": lambda: (
        np.concatenate([np.array([[0, 0, 0], [1e6, 0, 0], [0, 1e6, 0]]), loose(300, 0.1)[0]]),
        np.arange(903).reshape(-1, 3),
    ),
}


@pytest.mark.parametrize("name", MEASURABLE)
def test_measurable(name: str) -> None:
    assert self_scores(build(MEASURABLE[name]())) == [1.0] * 5


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        ((np.zeros((0, 3)), np.zeros((0, 3), np.int64)), "no faces"),
        ((np.eye(3), np.zeros((0, 3), np.int64)), "no faces"),
        (with_strange(np.nan, 169), "not finite"),
        (with_strange(-np.inf, 169), "not finite"),
        ((np.outer(np.arange(30), [1, 2, 3]), np.arange(30).reshape(-1, 3)), "zero area"),
        (coincident(False), "zero area"),
        (with_strange(3e38, 1), "zero area"),  # beside it the others are at one place
    ],
)
def test_refused(shape: Shape, words: str) -> None:
    with pytest.raises(MeshError, match=words) as caught:
        self_scores(build(shape))
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.once
def test_10000_loose_triangles_at_full_settings() -> None:
    """About 6 s on a free core. A patch of each takes in its neighbors by distance."""
    assert self_scores(build(loose(10_000, 0.01)), Settings()) == [1.0] * 5


@pytest.mark.parametrize("size", [(1, 1), (2, 16384), (16384, 2)], ids=str)
@pytest.mark.parametrize("uv", [1.0, 1e6, -1e30, np.inf, np.nan])
def test_images_and_uvs(tmp_path: Path, size: tuple[int, int], uv: float) -> None:
    """Rows and columns of the image; the factor on the UVs."""
    pixels = np.random.default_rng(0).integers(0, 256, (*size, 3), np.uint8)
    with np.errstate(all="ignore"):
        object_ = build(grid(), scenes.write_png(tmp_path / "image.png", pixels), uv)
    assert self_scores(object_) == [1.0] * 5


@pytest.mark.parametrize(
    ("collection", "name", "value"),
    [("loops", "vertex_index", -7), ("loops", "vertex_index", 5000), ("polygons", "loop_start", 10**8)],
)
def test_corrupt_faces_are_refused(collection: str, name: str, value: int) -> None:
    """Blender trusts its meshes, and would end the process."""
    square = scenes.square()
    items = getattr(square.data, collection)
    items.foreach_set(name, [value] * len(items))
    with pytest.raises(MeshError, match="its faces name corners or vertices that it has not"):
        self_scores(square)
