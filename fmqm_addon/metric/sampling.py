# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample points near the reference's surface (V-C) and the color units drawn among them (V-E3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .geometry import Floats, Ints, cross, lengths, weighted
from .patches import Patch, PatchMesh
from .settings import Settings

PATCH_CAP = 1.1  # V-C: no patch takes more than this many times its even share of the samples
COUNT_ROUNDING = 1e-6  # a count that reaches a whole number up to rounding has reached it


@dataclass(frozen=True)
class PatchSamples:
    """Samples of one patch.

    Attributes:
        positions: (n, 3), metric's frame. offset: (n,) signed distance from the face it was drawn on.
        face: (n,) that face in the PatchMesh. units: ascending indices of the drawn color units.
    """

    positions: Floats
    offset: Floats
    face: Ints
    units: Ints


def sample_count(patch: Patch, total_area: float, settings: Settings) -> int:
    """N_local = floor(S_local / S_global N_target), at most floor(1.1 N_target / N_patch)."""
    share = patch.area / total_area * settings.samples
    cap = PATCH_CAP * settings.samples / settings.patches
    return int(np.floor(min(share, cap) + COUNT_ROUNDING))


def draw_samples(
    mesh: PatchMesh, patches: Sequence[Patch], total_area: float, settings: Settings
) -> list[PatchSamples]:
    """Samples of each patch: they depend on the seed, the settings and this patch alone.

    Face f gets N_f = S_f / S_local N_local samples, floor or ceiling, by systematic resampling; uniform
    barycentric coordinates; offsets along the face normal from N(0, (sigma L)^2): equations (12) and (13).
    """
    drawn = [_draw(mesh, patch, sample_count(patch, total_area, settings), settings) for patch in patches]
    # Several patches at once share the cost of numpy's calls.
    face, first, second, offset = (np.concatenate([each[k] for each in drawn]) for k in range(4))
    corners = mesh.triangles.take(face, axis=0)
    a, b, c = (mesh.vertices.take(corners[:, k], axis=0) for k in range(3))
    positions = weighted(_barycentric(first, second), a, b, c)
    normals = cross(np.subtract(b, a, order="F"), np.subtract(c, a, order="F"))
    positions += (offset * (normals.T / lengths(normals))).T
    ends = np.cumsum([0, *(len(each[0]) for each in drawn)]).tolist()
    return [
        PatchSamples(positions[start:end], offset[start:end], face[start:end], each[4])
        for each, start, end in zip(drawn, ends[:-1], ends[1:], strict=True)
    ]


def _draw(mesh: PatchMesh, patch: Patch, count: int, settings: Settings) -> tuple[Ints, Floats, Floats, Floats, Ints]:
    """Face, two numbers in [0, 1) and offset of each sample, and the units."""
    rng = np.random.default_rng([settings.seed, patch.center])
    expected = np.cumsum(mesh.areas.take(patch.faces))
    expected *= count / expected[-1]
    expected[-1] = count
    upto = np.minimum(np.floor(expected + rng.random()).astype(np.int64), count)
    face = np.repeat(patch.faces, np.diff(upto, prepend=0))
    first, second = rng.random(count), rng.random(count)
    offset = rng.normal(0.0, settings.sigma * patch.diagonal, count)
    units = np.sort(rng.choice(count, min(settings.color_units, count), replace=False))
    return face, first, second, offset, units


def draw_barycentric(rng: np.random.Generator, count: int) -> Floats:
    """(count, 3) barycentric coordinates, uniform over a triangle."""
    return _barycentric(rng.random(count), rng.random(count))


def _barycentric(first: Floats, second: Floats) -> Floats:
    """(n, 3) from two numbers in [0, 1) each."""
    root = np.sqrt(first)
    return np.stack([1 - root, root * (1 - second), root * second]).T


def triangles_evenly(areas: Floats, within: Floats) -> Ints:
    """(n,) triangles, one for each of n equal shares of their area.

    Args:
        areas: (T,) of the triangles. within: (n,) where in its share each lies, in [0, 1).
    """
    total, count = np.cumsum(areas), len(within)
    place = (np.arange(count) + within) * (total[-1] / count)
    return np.minimum(np.searchsorted(total, place, side="right"), len(total) - 1)


@dataclass(frozen=True)
class Samples:
    """All samples, patch after patch.

    Attributes:
        positions: (N, 3) float64, metric's frame. offset: (N,) as in PatchSamples.
        patch: (N,) int32 row of the patch. start: (P + 1,) patch k is start[k] : start[k + 1].
        unit: (N,) bool, the drawn color units.
    """

    positions: Floats
    offset: Floats
    patch: NDArray[np.int32]
    start: Ints
    unit: NDArray[np.bool_]


def join_samples(parts: list[PatchSamples]) -> Samples:
    counts = np.array([len(part.positions) for part in parts])
    start = np.concatenate([[0], np.cumsum(counts)])
    unit = np.zeros(start[-1], bool)
    for part, first in zip(parts, start.tolist(), strict=False):
        unit[first + part.units] = True
    return Samples(
        positions=np.concatenate([part.positions for part in parts], out=np.empty((len(unit), 3))),
        offset=np.concatenate([part.offset for part in parts]),
        patch=np.repeat(np.arange(len(parts), dtype=np.int32), counts),
        start=start,
        unit=unit,
    )
