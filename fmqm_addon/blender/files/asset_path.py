# SPDX-License-Identifier: GPL-3.0-or-later
"""How an asset is named on a command line. Needs no bpy."""

from __future__ import annotations

import os
import re

SUFFIXES = (".obj", ".ply", ".stl", ".glb", ".gltf", ".fbx", ".usd", ".usda", ".usdc", ".usdz", ".abc", ".blend")

# Two letters or more before the colon: a drive's letter stays with its path.
_OBJECT_IN_FILE = re.compile(
    rf"(.*?(?:{'|'.join(re.escape(suffix) for suffix in SUFFIXES)})):(.+)", re.IGNORECASE | re.DOTALL
)


def split_spec(spec: str) -> tuple[str, str]:
    """Path and object name ("" for the whole file); drive letters stay with the path."""
    match = None if os.path.isfile(spec) else _OBJECT_IN_FILE.fullmatch(spec)
    return (match[1], match[2]) if match else (spec, "")
