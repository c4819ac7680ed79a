# SPDX-License-Identifier: GPL-3.0-or-later
"""The one function that looks through a file before Blender imports it, whatever its kind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from .preflight import check_alembic, check_ply
from .preflight_gltf import check_gltf
from .preflight_packed import check_blend, check_fbx
from .preflight_usd import check_usd

_USD = (".usd", ".usda", ".usdc", ".usdz")


def check_file(path: str) -> tuple[str, ...]:
    """Counts what a file promises, before it is expanded.

    What cannot be told cheaply is left to the limits of a watched worker: values that compress well in binary USD
    layers, what Draco decodes to, samples that many objects of an Alembic archive share, modifiers.

    Returns:
        What it refers to and Blender cannot find, as far as that must be asked before.

    Raises:
        FileError: Blender would crash, never come back, or take all memory.
    """
    check = _CHECKS.get(Path(path).suffix.lower())
    return () if check is None else check(path)


_CHECKS: dict[str, Callable[[str], tuple[str, ...]]] = {
    ".abc": check_alembic,
    ".blend": check_blend,
    ".fbx": check_fbx,
    ".ply": check_ply,
    **dict.fromkeys((".glb", ".gltf"), check_gltf),
    **dict.fromkeys(_USD, check_usd),
}
