# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside Blender's window, started by pictures.py: measures the demo's urns and takes pictures of the add-on."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Callable
from pathlib import Path

import bpy
from mathutils import Euler

ROOT = os.environ["FMQM_ROOT"]
sys.path[:0] = [ROOT, os.path.join(ROOT, "scripts")]
from window_steps import play, view

DISTANCE = 1.5  # between the two urns
SCALE = 0.8  # of the interface, so that the sidebar shows what is below the results
REST = 1  # seconds from the drawing to the picture
WIPES = tuple(0.5 + 0.025 * step for step in range(-9, 10, 2))  # of the view's width, from left to right
UNIT = 9000  # how many of the metric's color units into the list: an edge in the ornament


def look_from(turn: float, center: tuple[float, float, float], distance: float) -> None:
    region = view()[1].spaces.active.region_3d
    region.view_rotation = Euler((math.radians(80), 0, math.radians(turn))).to_quaternion()
    region.view_location, region.view_distance = center, distance


def start() -> None:
    import fmqm_addon

    fmqm_addon.register()
    bpy.context.preferences.view.ui_scale = SCALE
    for object_ in list(bpy.data.objects):
        bpy.data.objects.remove(object_)
    for level, path in enumerate(json.loads(os.environ["FMQM_URNS"])):
        bpy.ops.import_scene.gltf(filepath=path)
        urn = next(o for o in bpy.context.selected_objects if o.type == "MESH")
        urn.name = f"Urn_LOD{level}"
        urn.location.x += level * DISTANCE
    view()[1].spaces.active.show_region_ui = True
    look_from(0, (0.9, 0, 0.8), 4.2)


def measure() -> None:
    _, area = view()
    next(region for region in area.regions if region.type == "UI").active_panel_category = "FMQM"
    Path(os.environ["FMQM_RECTANGLE"]).write_text(json.dumps([area.x, area.y, area.width, area.height]))
    bpy.ops.fmqm.find_lods()
    bpy.context.scene.fmqm.settings.attribution = True
    bpy.ops.object.select_all(action="DESELECT")
    bpy.ops.fmqm.measure("INVOKE_DEFAULT")


def look() -> None:
    """Measuring has painted both urns."""


def units() -> None:
    shown = bpy.context.scene.fmqm.look
    shown.show, shown.range = "POINTS", "FIXED"
    look_from(25, (0.6, 0, 0.7), 4.0)
    bpy.ops.fmqm.unit_step(step=1)
    bpy.ops.fmqm.unit_step(step=UNIT)


def slice_() -> None:
    bpy.ops.fmqm.clear()
    bpy.context.scene.fmqm.look.slice_layer = "NCF_REFERENCE"
    bpy.context.scene.fmqm.look.slice_resolution = "256"
    look_from(25, (0.6, 0, 0.7), 4.0)
    bpy.ops.fmqm.slice()


def loupe() -> None:
    bpy.ops.fmqm.worst_step(step=1)
    bpy.ops.fmqm.loupe("INVOKE_DEFAULT")


def flip() -> None:
    bpy.ops.fmqm.loupe("INVOKE_DEFAULT")  # closes it
    look_from(0, (0, 0, 0.6), 1.45)
    area = view()[1]
    area.spaces.active.show_region_ui = area.spaces.active.show_region_toolbar = False
    bpy.ops.fmqm.flip("INVOKE_DEFAULT")


def turn() -> None:
    bpy.ops.fmqm.flip("INVOKE_DEFAULT")


def wipe_to(share: float) -> Callable[[], None]:
    def wipe() -> None:
        from fmqm_addon.ui.view import flip

        flip.wipe_to(share)

    return wipe


SETS: dict[str, list[tuple[Callable[[], object], str]]] = {
    "look": [(look, "look"), (units, "units"), (slice_, "slice")],
    "compare": [
        *((loupe, "loupe"), (flip, "flip-lod"), (turn, "flip-original")),
        *((wipe_to(share), f"wipe-{number}") for number, share in enumerate(WIPES)),
    ],
}


def measuring() -> bool:
    """Whether there is work that has its own timer."""
    modules = [sys.modules.get(f"fmqm_addon.ui.{name}") for name in ("session", "view.loupe", "view.flip")]
    if None in modules:
        return False
    session, *tools = modules
    return session.job is not None or any(tool.shown is not None and tool.shown.work is not None for tool in tools)


play([(start, ""), (measure, ""), *SETS[os.environ["FMQM_SET"]]], measuring, print, rest=REST)
