# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside the program, started by test_work.py: Live through edits, undo, deletion and file load; LOD Chain, the
Report button and their ends.

FMQM_ZIP is the built extension, FMQM_OUT a folder for what is found. done() of builtins closes the program.
"""

from __future__ import annotations

import builtins
import json
import os
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import bpy

OUT = Path(os.environ["FMQM_OUT"])
FILE = str(OUT / "rock.blend")
LONGEST = 120  # seconds that something may take
REPORT: dict[str, object] = {}


def module(name: str) -> ModuleType:
    return sys.modules[f"bl_ext.user_default.fmqm.fmqm_addon.{name}"]


def blocks() -> list[str]:
    kinds = ("objects", "meshes", "materials", "images", "scenes", "node_groups")
    return sorted(f"{kind} {block.name}" for kind in kinds for block in getattr(bpy.data, kind))


def build() -> None:
    for object_ in [o for o in bpy.data.objects if o.type == "MESH"]:
        bpy.data.objects.remove(object_)
    for level in range(2):
        bpy.ops.mesh.primitive_monkey_add()
        bpy.context.object.name = f"Rock_LOD{level}"
    bpy.context.object.modifiers.new("Decimate", "DECIMATE").ratio = 0.5
    fmqm = bpy.context.scene.fmqm
    fmqm.reference = bpy.data.objects["Rock_LOD0"]
    fmqm.compared.add().object = bpy.data.objects["Rock_LOD1"]
    fmqm.settings.samples, fmqm.settings.patches, fmqm.settings.color_units = 3200, 50, 20
    bpy.ops.ed.undo_push(message="Built")
    bpy.ops.wm.save_as_mainfile(filepath=FILE)


def ratio() -> bpy.types.Modifier:
    return bpy.data.objects["Rock_LOD1"].modifiers["Decimate"]


def up_to_date() -> bool:
    """Whether the corner shows the LOD as it is now."""
    current, lod = module("ui.live").current, bpy.data.objects["Rock_LOD1"]
    if current is None or current.is_busy or current.reading is None:
        return False
    mesh = lod.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    return bool(current.reading.triangles == sum(len(polygon.vertices) - 2 for polygon in mesh.polygons))


def work() -> Iterator[Callable[[], object]]:
    """What is done; yields what is waited for."""
    bpy.ops.extensions.package_install_files(
        filepath=os.environ["FMQM_ZIP"], repo="user_default", enable_on_install=True
    )
    build()
    live, session = module("ui.live"), module("ui.session")
    live.MOST = 100.0  # that it stops where a pair takes long is not shown here, however slow the machine is
    yield lambda: not bpy.data.is_dirty
    bpy.ops.fmqm.live()
    yield up_to_date
    REPORT["shown"], REPORT["dirty"] = live.texts(bpy.context.scene), bpy.data.is_dirty

    reading, worked = live.current.reading, []
    for step in range(10):  # a drag
        ratio().ratio = 0.5 - 0.03 * step
        bpy.context.view_layer.update()
        touched = time.monotonic()
        yield lambda until=touched + 0.1: time.monotonic() > until
        if live.current.reading is not reading and time.monotonic() - touched < live.REST:
            worked.append(step)  # a busy window may be slower, and what rests is measured
        reading = live.current.reading
    REPORT["worked while dragged"] = bool(worked)
    yield up_to_date
    bpy.ops.ed.undo_push(message="Ratio")
    ratio().ratio = 0.1
    bpy.ops.ed.undo_push(message="Ratio")
    yield up_to_date
    bpy.ops.ed.undo()
    REPORT["ratio after undo"] = round(ratio().ratio, 3)
    yield up_to_date

    bpy.data.objects.remove(bpy.data.objects["Rock_LOD1"])
    bpy.ops.ed.undo_push(message="Delete")
    yield lambda: live.current.error
    REPORT["deleted"] = live.texts(bpy.context.scene)
    bpy.ops.ed.undo()
    yield up_to_date
    bpy.ops.wm.open_mainfile(filepath=FILE)
    yield up_to_date
    REPORT["ratio after loading"], REPORT["dirty after loading"] = round(ratio().ratio, 3), bpy.data.is_dirty
    ratio().ratio = 0.3
    yield lambda: live.current.is_busy
    bpy.ops.fmqm.live()
    ratio().ratio = 0.4
    until = time.monotonic() + 1
    yield lambda: time.monotonic() > until
    lists = [getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)]
    handlers = [handler for each in lists if isinstance(each, list) for handler in each]
    REPORT["left of live"] = [live.texts(bpy.context.scene), bpy.app.timers.is_registered(live._run)]
    REPORT["handlers of live"] = [repr(h) for h in handlers if getattr(h, "__module__", "").endswith("ui.live")]

    bpy.ops.object.select_all(action="DESELECT")
    rock = bpy.context.view_layer.objects.active = bpy.data.objects["Rock_LOD0"]
    bpy.data.objects.remove(bpy.data.objects["Rock_LOD1"])
    rock.name = "Rock"
    fmqm = bpy.context.scene.fmqm
    fmqm.chain.levels, fmqm.chain.qualities[:2], fmqm.chain.name_original = 2, (0.8, 0.6), True
    bpy.ops.ed.undo_push(message="Chain")
    before = blocks()
    bpy.ops.fmqm.lod_chain("INVOKE_DEFAULT")
    yield lambda: session.job.progress > 0.05
    bpy.ops.fmqm.cancel()
    yield lambda: session.job is None
    REPORT["left of a cancelled chain"] = sorted(set(blocks()) ^ set(before))
    bpy.ops.fmqm.lod_chain("INVOKE_DEFAULT")
    yield lambda: session.job is None
    REPORT["made"] = sorted(set(blocks()) - set(before))
    REPORT["rows"] = [[row.name, row.error] for row in fmqm.rows]

    before, pictures = blocks(), module("report.html.pictures")
    for name in ("VIEW_AREA", "LONG_SIDE", "CLOSE_UP", "THUMBNAIL"):  # small ones are as good here
        setattr(pictures, name, 1600 if name == "VIEW_AREA" else 40)
    bpy.ops.fmqm.write_report("INVOKE_DEFAULT", folder=str(OUT / "page"))
    yield lambda: session.job is None
    REPORT["left of the report"] = sorted(set(blocks()) ^ set(before))
    bpy.ops.ed.undo()
    REPORT["after undo"] = sorted(object_.name for object_ in bpy.data.objects if object_.type == "MESH")


def run(steps: Iterator[Callable[[], object]]) -> None:
    waiting: list[Callable[[], object]] = [lambda: True]
    since = [time.monotonic()]

    def tick() -> float | None:
        try:
            window = bpy.context.window_manager.windows[0]
            area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
            region = next(region for region in area.regions if region.type == "WINDOW")
            with bpy.context.temp_override(window=window, area=area, region=region):
                if waiting[0]():
                    waiting[0], since[0] = next(steps), time.monotonic()
                elif time.monotonic() - since[0] > LONGEST:
                    raise RuntimeError(f"waited for {waiting[0].__code__.co_firstlineno}")
        except StopIteration:
            (OUT / "report.json").write_text(json.dumps(REPORT))
            builtins.done()
            return None
        except Exception:
            (OUT / "error.txt").write_text(traceback.format_exc() + json.dumps(REPORT))
            builtins.done()
            return None
        return 0.05

    bpy.app.timers.register(tick, first_interval=2, persistent=True)


bpy.context.preferences.system.viewport_aa = "OFF"  # drawn by software, sample after sample
run(work())
