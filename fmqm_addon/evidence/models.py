# SPDX-License-Identifier: GPL-3.0-or-later
"""The models that the study looks at: three that are looked for, and two that are made from formulas."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..metric.geometry import Floats, Ints
from .textures import png_bytes

REAL = ("spot", "egyptian_cat", "bob")  # triangles with one texture, of other people
GENERATED = ("rock", "crate")
_SUFFIXES = (".obj", ".glb", ".gltf", ".fbx")
_TILE = 256  # texels of a side of a cube's face
_GUTTER = 0.02  # around a face in the texture, in faces
_OUTWARD = ((0, 1, 2), (0, 2, 1))  # the axes across the face, along u and along v: of its positive and negative side


@dataclass(frozen=True)
class Model:
    """A model, or why it is not there.

    Attributes:
        path: None where it is absent. why: then.
    """

    name: str
    path: Path | None
    why: str = ""


def find_models(folder: Path | None) -> list[Model]:
    """The three real ones, as FOLDER/NAME.obj or FOLDER/NAME/NAME.obj, or another kind of file."""
    found = []
    for name in REAL:
        places = [] if folder is None else [folder / name, folder / name / name]
        paths = [place.with_suffix(suffix) for place in places for suffix in _SUFFIXES]
        path = next((path for path in paths if path.is_file()), None)
        why = "no folder of models was given" if folder is None else f"no {name}.obj or {name}/{name}.obj among them"
        found.append(Model(name, path, "" if path else why))
    return found


def make_models(folder: Path, cells: int = 24) -> list[Model]:
    """Writes the two generated ones as OBJ with a PNG: a rock, all bumps and shades, and a crate, plain and angular.

    Args:
        cells: along each edge of the cube that they are made of.
    """
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    looks = ((_rock_shape, _rock_color), (_crate_shape, _crate_color))
    for name, (shape, color) in zip(GENERATED, looks, strict=True):
        positions, faces, coordinates = _cube(cells)
        _write_obj(folder / f"{name}.obj", shape(positions), faces, coordinates)
        (folder / f"{name}.png").write_bytes(png_bytes(_paint(color)))
        made.append(Model(name, folder / f"{name}.obj"))
    return made


def _corner(face: int, u: Floats, v: Floats) -> Floats:
    """(..., 3) places on a face of the cube [-1, 1]^3, u and v in [0, 1]."""
    axis, negative = divmod(face, 2)
    across, along_u, along_v = ((axis + step) % 3 for step in _OUTWARD[negative])
    place = np.empty((*np.broadcast(u, v).shape, 3))
    place[..., across] = -1.0 if negative else 1.0
    place[..., along_u], place[..., along_v] = 2 * u - 1, 2 * v - 1
    return place


def _cube(cells: int) -> tuple[Floats, Ints, Floats]:
    """(V, 3) vertices, shared by the faces; (T, 3) triangles; (T, 3, 2) texture coordinates, an island a face."""
    rows, columns = (grid.ravel() for grid in np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"))
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1)])  # two triangles of a cell, along u and v
    u = (columns[:, None] + corners[:, 0]).reshape(-1, 3) / cells
    v = (rows[:, None] + corners[:, 1]).reshape(-1, 3) / cells
    places = np.concatenate([_corner(face, u, v) for face in range(6)])
    whole = np.rint((places + 1) * cells / 2).astype(np.int64)  # on a grid, so that neighbors share exactly
    grid, which = np.unique(whole.reshape(-1, 3), axis=0, return_inverse=True)
    coordinates = np.concatenate([np.stack(_in_atlas(face, u, v), axis=2) for face in range(6)])
    return grid * 2 / cells - 1, which.reshape(-1, 3), coordinates


def _in_atlas(face: int, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    row, column = divmod(face, 3)
    inside = 1 - 2 * _GUTTER
    return (column + _GUTTER + u * inside) / 3, (row + _GUTTER + v * inside) / 2


def _paint(color: Callable[[Floats], Floats]) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    """(2 _TILE, 3 _TILE, 3), row 0 at the top, from a color in [0, 1] for each place on the cube."""
    centers = ((np.arange(_TILE) + 0.5) / _TILE - _GUTTER) / (1 - 2 * _GUTTER)  # beyond [0, 1] in the gutter
    u, v = np.meshgrid(centers, centers)
    tiles = [np.round(color(_corner(face, u, v)) * 255).astype(np.uint8) for face in range(6)]
    image = np.concatenate([np.concatenate(tiles[:3], axis=1), np.concatenate(tiles[3:], axis=1)])
    return image[::-1].copy()


def _waves(places: Floats, seed: int, slowest: float, fastest: float) -> Floats:
    """Sums of sines over directions and frequencies that a seed draws; about 1 at most."""
    rng = np.random.default_rng(seed)
    total = np.zeros(places.shape[:-1])
    frequencies = np.geomspace(slowest, fastest, 24)
    for frequency in frequencies:
        direction = rng.normal(size=3)
        direction *= frequency / np.linalg.norm(direction)
        total += np.sin(places @ direction + rng.uniform(0, 2 * np.pi)) * (slowest / frequency) ** 0.5
    return total / np.sqrt(len(frequencies))


def _on_sphere(places: Floats) -> Floats:
    return places / np.linalg.norm(places, axis=-1, keepdims=True)


def _rock_shape(places: Floats) -> Floats:
    sphere = _on_sphere(places)
    return sphere * (1 + 0.25 * _waves(sphere, 1, 2, 25))[..., None] * (1.0, 0.8, 0.7)


def _rock_color(places: Floats) -> Floats:
    sphere = _on_sphere(places)
    shade, moss = _waves(sphere, 2, 3, 90), _waves(sphere, 3, 2, 20)
    stone = 0.5 + 0.28 * shade[..., None] * np.array([1.0, 0.95, 0.9])
    green = np.array([0.28, 0.4, 0.16]) * (1 + 0.4 * shade[..., None])
    share = 1 / (1 + np.exp(-8 * (moss - 0.2)))[..., None]
    return np.clip(stone * (1 - share) + green * share, 0, 1)


def _crate_shape(places: Floats) -> Floats:
    """Each side's panel lies deeper than its frame."""
    shape = places.copy()
    for axis in range(3):
        others = np.abs(np.delete(places, axis, axis=-1)).max(axis=-1)
        on_side = np.abs(np.abs(places[..., axis]) - 1) < 1e-9
        shape[..., axis] *= np.where(on_side & (others < 0.76), 0.9, 1.0)
    return shape * (1.0, 0.7, 0.8)


def _crate_color(places: Floats) -> Floats:
    """Plain colors, white and nearly black among them, with hard edges; a few stripes."""
    side = np.abs(places).argmax(axis=-1)
    negative = np.take_along_axis(places, side[..., None], axis=-1)[..., 0] < 0
    second = np.sort(np.abs(places), axis=-1)[..., 1]
    panels = np.array([[0.8, 0.3, 0.2], [0.95, 0.95, 0.95], [0.2, 0.35, 0.6], [0.9, 0.75, 0.2], [0.1, 0.1, 0.1]])
    color = panels[(2 * side + negative) % len(panels)]
    stripes = np.sin(places.sum(axis=-1) * 14) > 0.6
    color = np.where((stripes & (side == 0))[..., None], panels[1], color)
    return np.where((second > 0.79)[..., None], np.array([0.35, 0.25, 0.16]), color)


def _write_obj(path: Path, positions: Floats, faces: Ints, coordinates: Floats) -> None:
    unique, which = np.unique(coordinates.reshape(-1, 2), axis=0, return_inverse=True)
    lines = [f"mtllib {path.stem}.mtl", "usemtl surface"]
    lines += [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in positions.tolist()]
    lines += [f"vt {u:.7f} {v:.7f}" for u, v in unique.tolist()]
    corners = np.stack([faces, which.reshape(-1, 3)], axis=2) + 1
    lines += ["f " + " ".join(f"{v}/{t}" for v, t in corner) for corner in corners.tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    path.with_suffix(".mtl").write_text(f"newmtl surface\nmap_Kd {path.stem}.png\n", encoding="utf-8")
