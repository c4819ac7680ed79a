# SPDX-License-Identifier: GPL-3.0-or-later
"""How many triangles an asset has, as far as that can be told at each redraw of a panel."""

from __future__ import annotations

import bpy

from .target import Target

_MOST_MEMBERS = 200  # of an asset whose triangles are counted


def triangle_count(target: Target, depsgraph: bpy.types.Depsgraph | None) -> int | None:
    """Triangles of an asset as it is shown, without its instances; None where only making meshes would tell."""
    members = target.members()
    if depsgraph is None or not members or len(members) > _MOST_MEMBERS:
        return None
    count = 0
    for member in members:
        if member.type == "EMPTY":
            continue
        if member.type != "MESH":
            return None
        mesh = member.data if target.bare else member.evaluated_get(depsgraph).data
        if mesh is None:
            return None
        count += len(mesh.loops) - 2 * len(mesh.polygons)
    return count
