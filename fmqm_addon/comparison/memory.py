# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory a measurement takes, told before it starts."""

from __future__ import annotations

from ..metric.settings import Settings
from ..metric.surface import MeshArrays
from ..metric.texture import image_arrays

# Fitted to the peaks of score.py on pairs of 0.5 and 2 million triangles, with 2 and 4 values a corner.
_BLENDER = 320e6  # bytes of an empty session with numpy
_PER_TRIANGLE = 175.0  # of either mesh: Blender's copy while it is read, arrays, tree
_PER_CORNER_VALUE = 70.0  # a triangle's three corners, as read and as prepared
_PER_SAMPLE = 300.0  # positions and both meshes' fields

WORTH_SAYING = 1e9  # bytes: from here on users want to know beforehand


def peak_bytes(
    reference: MeshArrays, settings: Settings, repeats: int = 1, distorted: MeshArrays | None = None
) -> float:
    """About how many bytes a comparison takes at its peak.

    Args:
        distorted: None is one as large as the reference.
    """
    meshes = [reference, distorted or reference]
    triangles = sum(
        len(mesh.triangles) * (_PER_TRIANGLE + _PER_CORNER_VALUE * mesh.corners.shape[2]) for mesh in meshes
    )
    images = {id(array): array.nbytes for mesh in meshes for look in mesh.materials for array in image_arrays(look)}
    return _BLENDER + triangles + sum(images.values()) + _PER_SAMPLE * settings.samples * repeats


def peak_text(reference: MeshArrays, settings: Settings, repeats: int = 1) -> str:
    """The estimate as a line for people."""
    size = peak_bytes(reference, settings, repeats) / 1e9
    return (
        f"{reference.name}: {len(reference.triangles):,} triangles; about {size:.1f} GB of memory for two such meshes"
    )
