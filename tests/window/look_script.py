# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside the program, started by test_look.py: measures two objects, looks at them, takes pictures.

FMQM_ZIP is the built extension, FMQM_OUT a folder for what is not a picture, FMQM_ROOT the checkout. The command that
FMQM_SCREENSHOT names gives shot(name) and done().
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

sys.path[:0] = [os.path.join(os.environ["FMQM_ROOT"], *parts) for parts in (("scripts",), ("tests", "window"))]
from monkeys import build
from window_steps import play, view

OUT = Path(os.environ["FMQM_OUT"])
REPORT: dict[str, object] = {}


def start() -> None:
    bpy.ops.extensions.package_install_files(
        filepath=os.environ["FMQM_ZIP"], repo="user_default", enable_on_install=True
    )
    build(samples=60_000, patches=150)
    _, area = view()
    area.spaces.active.show_region_ui = True
    bpy.ops.view3d.view_all()
    bpy.ops.view3d.view_axis(type="FRONT")
    region = area.spaces.active.region_3d
    region.view_distance *= 0.75
    region.view_location = (3.2, 0, 0)
    for object_ in bpy.context.selected_objects:
        object_.select_set(False)
    bpy.context.view_layer.objects.active = None  # whose origin would be drawn


def measure() -> None:
    _, area = view()
    REPORT["rendered"] = rendered("before")
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


def shown() -> None:
    """Measuring has painted the objects. What of it gets anywhere?"""
    names = {object_.name for object_ in bpy.data.objects}
    REPORT["blocks shown"] = blocks()
    look = bpy.context.scene.fmqm.look
    REPORT["show"], look.show = look.show, "OFF"
    REPORT["size"] = saved("off")
    look.show = "SURFACE"
    REPORT["size shown"] = saved("shown")
    cube = bpy.data.objects["Cube"]
    region, space = next(r for r in view()[1].regions if r.type == "WINDOW"), view()[1].spaces.active
    corners = [cube.matrix_world @ Vector(corner) for corner in cube.bound_box]
    places = [location_3d_to_region_2d(region, space.region_3d, corner) for corner in corners]
    REPORT["cube"] = [round(f(p[k] for p in places)) for f in (min, max) for k in (0, 1)]
    REPORT["rendered shown"] = rendered("shown")
    path = OUT / "shown.obj"
    bpy.ops.wm.obj_export(filepath=str(path), export_materials=False)
    lines = path.read_text().splitlines()
    REPORT["exported"] = [line.removeprefix("o ") for line in lines if line.startswith("o ")]
    _, area = view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    picked: set[str] = set()
    for x in range(0, region.width, 60):
        for y in range(0, region.height, 60):
            bpy.ops.view3d.select(deselect_all=True, location=(x, y))
            picked |= {object_.name for object_ in bpy.context.selected_objects}
    bpy.ops.object.select_all(action="DESELECT")
    bpy.context.view_layer.objects.active = None
    REPORT["picked"] = sorted(picked)
    REPORT["not ours"] = sorted(names)


def saved(name: str) -> int:
    """Bytes of the file with the scene's results and without the undo of them."""
    path = OUT / f"{name}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=False)
    return path.stat().st_size


def rendered(name: str) -> str:
    """A digest of a render's pixels."""
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = 160, 120
    path = OUT / f"rendered_{name}.png"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(4 * 160 * 120, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return hashlib.sha256(pixels.tobytes()).hexdigest()


def xray() -> None:
    view()[1].spaces.active.shading.show_xray = True


def overlays_off() -> None:
    view()[1].spaces.active.shading.show_xray = False
    view()[1].spaces.active.overlay.show_overlays = False


def points() -> None:
    view()[1].spaces.active.overlay.show_overlays = True
    bpy.context.scene.fmqm.look.show = "POINTS"


def worst() -> None:
    REPORT["place before"] = list(view()[1].spaces.active.region_3d.view_location)
    bpy.ops.fmqm.worst_step(step=1)


def clear() -> None:
    rows = bpy.context.scene.fmqm.rows
    bpy.ops.fmqm.clear()
    REPORT["place after"] = list(view()[1].spaces.active.region_3d.view_location)
    REPORT["blocks after"] = blocks()
    REPORT["rows"] = [(row.name, json.loads(row.scores)["scores"], row.error) for row in rows]
    REPORT["longest tick"] = session().longest_tick
    (OUT / "report.json").write_text(json.dumps(REPORT))


def other_layer() -> None:
    bpy.context.scene.fmqm.look.layer = "SDF_COMPARED"


def mouse(kind: str, value: str, x: float, y: float) -> None:
    """Something that the mouse does, in pixels of the view's main region."""
    window, area = view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    window.event_simulate(type=kind, value=value, x=round(region.x + x), y=round(region.y + y))


def drag(x: float, y: float, up: float) -> None:
    mouse("MOUSEMOVE", "NOTHING", x + 1, y + 25)
    mouse("MOUSEMOVE", "NOTHING", x, y)
    mouse("LEFTMOUSE", "PRESS", x, y)
    for share in (0.25, 0.5, 0.75, 1.0):
        mouse("MOUSEMOVE", "NOTHING", x, y + share * up)
    mouse("LEFTMOUSE", "RELEASE", x, y + up)


def module(name: str) -> ModuleType:
    return sys.modules[f"bl_ext.user_default.fmqm.fmqm_addon.ui.view.{name}"]


def in_view(place: Vector) -> Vector:
    """Pixels of the view's main region."""
    _, area = view()
    region = next(region for region in area.regions if region.type == "WINDOW")
    return location_3d_to_region_2d(region, area.spaces.active.region_3d, place)


def drag_legend() -> None:
    """The lower end of the color bar, by half of its height; no operator runs."""
    x, y, width, height = module("overlay").bars[view()[1].as_pointer()]
    REPORT["ends"] = module("heat").shown_in(bpy.context.scene).ends
    drag(x + width / 2, y, height / 2)


def show_slice() -> None:
    look = bpy.context.scene.fmqm.look
    REPORT["ends dragged"], REPORT["range"] = module("heat").shown_in(bpy.context.scene).ends, look.range
    look.range, look.show_slice, look.slice_axis = "FITTED", True, "Z"


def drag_slice() -> None:
    """By its arrow, upwards from the middle."""
    middle, _ = module("slice_plane").way(bpy.context.scene, view()[1].spaces.active)
    x, y = in_view(middle)
    drag(x, y + 40, 30)


def slice_in_front() -> None:
    look = bpy.context.scene.fmqm.look
    REPORT["offset"], REPORT["blocks slice"] = look.slice_offset, blocks()
    look.slice_axis, look.slice_offset = "Y", -100


def probe() -> None:
    bpy.context.scene.fmqm.look.show_slice = False
    bpy.ops.fmqm.probe("INVOKE_DEFAULT")


def point() -> None:
    """At the LOD's forehead."""
    mouse("MOUSEMOVE", "NOTHING", *in_view(Vector((2.6, -0.7, 0.4))))


def pointed() -> None:
    hint = module("overlay").hint
    REPORT["hint"] = None if hint is None else hint.lines
    for value in ("PRESS", "RELEASE"):
        mouse("ESC", value, 300, 300)


STEPS: list[tuple[Callable[[], object], str]] = [
    (start, ""),
    (lambda: None, "before"),
    (measure, ""),
    (shown, "look"),
    (drag_legend, ""),
    (show_slice, ""),
    (drag_slice, ""),
    (slice_in_front, "slice"),
    (probe, ""),
    (point, ""),
    (pointed, ""),
    (xray, "xray"),
    (overlays_off, "overlays off"),
    (points, "points"),
    (other_layer, "layer"),
    (worst, "worst"),
    (clear, "cleared"),
]


play(STEPS, lambda: "modal" in REPORT and session().job is not None, (OUT / "error.txt").write_text)
