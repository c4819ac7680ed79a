# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside the program, started by test_look.py: measures two objects, looks at them, takes pictures.

FMQM_ZIP is the built extension, FMQM_OUT a folder for what is not a picture. The command that FMQM_SCREENSHOT
names gives shot(name) and done().
"""

from __future__ import annotations

import builtins
import json
import os
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np

DRAWN = 6  # seconds until a change is on the screen, drawn by software
OUT = Path(os.environ["FMQM_OUT"])
REPORT: dict[str, object] = {}


def view() -> tuple[bpy.types.Window, bpy.types.Area]:
    window = bpy.context.window_manager.windows[0]
    return window, next(area for area in window.screen.areas if area.type == "VIEW_3D")


def texture() -> bpy.types.Material:
    image = bpy.data.images.new("Checks", 64, 64)
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(0).random((8, 8, 3)).repeat(8, axis=0).repeat(8, axis=1)
    image.pixels.foreach_set(pixels.ravel())
    material = bpy.data.materials.new("Checks")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    node = nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    links.new(node.outputs["Color"], shader.inputs["Base Color"])
    return material


def build() -> None:
    """A monkey, and beside it the same one of which the left half has lost many of its triangles."""
    for object_ in [o for o in bpy.data.objects if o.type == "MESH"]:
        bpy.data.objects.remove(object_)
    material = texture()
    objects = []
    for name, x in (("Monkey_LOD0", 0.0), ("Monkey_LOD1", 2.6)):
        bpy.ops.mesh.primitive_monkey_add(location=(x, 0, 0))
        object_ = bpy.context.object
        object_.name = name
        object_.data.materials.append(material)
        object_.modifiers.new("Fine", "SUBSURF").levels = 2
        objects.append(object_)
    left = objects[1].vertex_groups.new(name="Left")
    left.add([v.index for v in objects[1].data.vertices if v.co.x < 0], 1.0, "REPLACE")
    decimate = objects[1].modifiers.new("Coarse", "DECIMATE")
    decimate.ratio, decimate.vertex_group = 0.55, "Left"
    fmqm = bpy.context.scene.fmqm
    fmqm.reference = objects[0]
    fmqm.compared.add().object = objects[1]
    fmqm.settings.samples, fmqm.settings.patches = 60_000, 150


def start() -> None:
    bpy.ops.extensions.package_install_files(
        filepath=os.environ["FMQM_ZIP"], repo="user_default", enable_on_install=True
    )
    build()
    _, area = view()
    area.spaces.active.show_region_ui = True
    bpy.ops.view3d.view_all()
    bpy.ops.view3d.view_axis(type="FRONT")
    region = area.spaces.active.region_3d
    region.view_distance *= 0.55
    region.view_location = (1.6, 0, 0)
    for object_ in bpy.context.selected_objects:
        object_.select_set(False)


def measure() -> None:
    _, area = view()
    for region in area.regions:
        if region.type == "UI":
            region.active_panel_category = "FMQM"
    REPORT["blocks"] = blocks()
    bpy.ops.fmqm.measure("INVOKE_DEFAULT")
    REPORT["modal"] = session().job is not None
    rectangles = {r.type: (r.x, r.y, r.width, r.height) for r in area.regions}
    (OUT / "regions.json").write_text(json.dumps(rectangles))


def session() -> ModuleType:
    """The installed add-on's module."""
    return sys.modules["bl_ext.user_default.fmqm.fmqm_addon.ui.session"]


def blocks() -> int:
    """Data-blocks of the file; images and screens of the window itself do not count."""
    kinds = ("objects", "meshes", "materials", "images", "collections", "node_groups")
    return sum(len(getattr(bpy.data, kind)) for kind in kinds)


def clear() -> None:
    rows = bpy.context.scene.fmqm.rows
    bpy.ops.fmqm.clear()
    REPORT["blocks after"] = blocks()
    REPORT["rows"] = [(row.name, json.loads(row.scores)["scores"], row.error) for row in rows]
    REPORT["longest tick"] = session().longest_tick
    (OUT / "report.json").write_text(json.dumps(REPORT))


def look() -> None:
    bpy.context.scene.fmqm.look.range = "FITTED"
    bpy.ops.fmqm.look()


def other_layer() -> None:
    bpy.context.scene.fmqm.look.layer = "SDF_COMPARED"


STEPS: list[tuple[Callable[[], object], str]] = [
    (start, ""),
    (measure, "before"),
    (look, "look"),
    (other_layer, "layer"),
    (lambda: bpy.ops.fmqm.worst_step(step=1), "worst"),
    (clear, "cleared"),
]


def step() -> float | None:
    if "modal" in REPORT and session().job is not None:
        return 0.5  # the modal operator is still measuring; its own timer drives it
    if not STEPS:
        builtins.done()
        return None
    act, name = STEPS.pop(0)
    window, area = view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    try:
        with bpy.context.temp_override(window=window, area=area, region=region):
            act()
    except Exception:
        (OUT / "error.txt").write_text(traceback.format_exc())
        builtins.done()
        return None
    bpy.app.timers.register(lambda: picture(name), first_interval=DRAWN)
    return None


def picture(name: str) -> None:
    if name:
        builtins.shot(name)
    bpy.app.timers.register(step, first_interval=0.1)


bpy.app.timers.register(step, first_interval=3)
