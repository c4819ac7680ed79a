# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs inside the program, started by test_compare.py: opens the loupe, flips and wipes, and takes pictures.

Beside each picture it writes what the report's rays see from there.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from bpy_extras.view3d_utils import region_2d_to_location_3d
from mathutils import Matrix, Vector

sys.path[:0] = [os.path.join(os.environ["FMQM_ROOT"], *parts) for parts in (("scripts",), ("tests", "window"))]
from monkeys import build
from window_steps import play, view

OUT = Path(os.environ["FMQM_OUT"])
CROP = 240  # pixels in the middle of the view that the flip's pictures are compared in
SQUARE = 20  # pixels a side
REPORT: dict[str, Any] = {}
EXPECTED: dict[str, np.ndarray] = {}


def ours(name: str) -> Any:
    """A module of the installed add-on."""
    return import_module(f"bl_ext.user_default.fmqm.fmqm_addon.{name}")


def at_work() -> bool:
    if "bl_ext.user_default.fmqm.fmqm_addon.ui.session" not in sys.modules:
        return False
    tools = [ours("ui.view.loupe").shown, ours("ui.view.flip").shown]
    return ours("ui.session").job is not None or any(tool is not None and tool.work is not None for tool in tools)


def region() -> bpy.types.Region:
    return next(each for each in view()[1].regions if each.type == "WINDOW")


def start() -> None:
    bpy.ops.extensions.package_install_files(
        filepath=os.environ["FMQM_ZIP"], repo="user_default", enable_on_install=True
    )
    build(samples=3000, patches=30)
    bpy.ops.fmqm.measure("INVOKE_DEFAULT")


def open_loupe() -> None:
    space = view()[1].spaces.active.region_3d
    bpy.ops.fmqm.worst_step(step=1)
    space.view_location, space.view_distance = (0, 0, 0), 4.5
    bpy.ops.wm.save_as_mainfile(filepath=str(OUT / "scene.blend"))
    bpy.context.window_manager.print_undo_steps()
    REPORT["blocks"] = blocks()
    REPORT["file"] = saved()
    REPORT["file again"] = saved()
    bpy.ops.fmqm.loupe("INVOKE_DEFAULT")


def loupe_seen() -> None:
    """The pictures of the loupe by the report's own call, and where they stand."""
    loupe, render = ours("ui.view.loupe"), ours("report.render").render
    measured = ours("ui.view.result").measured_row(bpy.context.scene)[2]
    shown, size = loupe.shown, (loupe.shown.side, loupe.shown.side)
    camera = ours("ui.view.sight").worst_sight(bpy.context.scene, measured).camera
    EXPECTED["loupe original"] = render(measured.reference, camera, size)
    EXPECTED["loupe lod"] = render(measured.comparison.distorted, camera, size)
    EXPECTED["loupe heat"] = shown.pictures[2].pixels
    REPORT["loupe"] = {"place": shown.place, "side": shown.side, "pad": ours("ui.view.ink").Ink().px(loupe._PAD)}
    REPORT["longest step"] = shown.longest_step


def open_flip() -> None:
    bpy.ops.fmqm.loupe("INVOKE_DEFAULT")  # closes it
    REPORT["loupe closed"] = ours("ui.view.loupe").shown is None
    bpy.ops.fmqm.flip("INVOKE_DEFAULT")


def flip_seen() -> None:
    """Both surfaces where the original stands, through the middle of the view, by the report's rays."""
    heat, render = ours("ui.view.heat"), ours("report.render")
    _, _, measured = ours("ui.view.result").measured_row(bpy.context.scene)
    row = ours("ui.properties.rows").active_row(bpy.context.scene)
    window, space = region(), view()[1].spaces.active.region_3d
    back = (space.view_matrix @ heat.placed(measured, "REFERENCE", heat.members_at(row, "REFERENCE"))).inverted()
    axes = np.array(back.to_3x3(), float).T * np.array([[1], [1], [-1]])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    eye = np.array(back.translation, float)
    size = (CROP + window.width % 2, CROP + window.height % 2)
    half = tuple(size[k] / (window.width, window.height)[k] / space.window_matrix[k][k] for k in (0, 1))
    camera = render.Camera(eye, axes, half)
    EXPECTED["original"] = render.render(measured.reference, camera, size)
    EXPECTED["lod"] = render.render(measured.comparison.distorted, camera, size)
    REPORT["region"] = [window.x, window.y, window.width, window.height]
    REPORT["crop"] = [window.x + (window.width - size[0]) // 2, window.y + (window.height - size[1]) // 2, *size]


def turn() -> None:
    bpy.ops.fmqm.flip("INVOKE_DEFAULT")
    REPORT["showing"] = ours("ui.view.flip").shown.showing


def wipe() -> None:
    bpy.ops.fmqm.flip("INVOKE_DEFAULT", wipe=True)
    REPORT["wipe"] = ours("ui.view.flip").shown.wipe


def close() -> None:
    ours("ui.view.flip").close()
    bpy.context.window_manager.print_undo_steps()
    REPORT["dirty"] = bpy.data.is_dirty
    REPORT["blocks after"] = blocks()
    REPORT["file after"] = saved()


def ramps() -> None:
    """Colors from black to white by each of the means that draw over a view: a row of squares each."""
    window, display, space = region(), "blender.display", view()[1].spaces.active.region_3d
    space.view_perspective, space.view_rotation = "ORTHO", (0.5**0.5, 0.5**0.5, 0, 0)  # from the front
    space.update()  # what faces the viewer is in its full color
    colors = np.repeat(np.linspace(0, 1, 12)[:, None], 3, axis=1) * (1.0, 0.8, 0.6)
    REPORT["ramp"] = {"x": window.x + window.width // 2, "y": window.y + 60, "side": SQUARE}

    def corners(row: int, number: int) -> list[Vector]:
        left, low = window.width // 2 + number * SQUARE, 60 + row * SQUARE
        at = [(left, low), (left + SQUARE, low), (left + SQUARE, low + SQUARE), (left, low + SQUARE)]
        return [region_2d_to_location_3d(window, space, place, Vector((0, -8, 0))) for place in at]

    squares = np.array([corners(0, number) for number in range(len(colors))]).reshape(-1, 3)
    faces = np.arange(0, len(squares), 4)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])
    mesh = ours(f"{display}.colored_mesh").from_faces(squares, faces.reshape(-1, 3), np.arange(len(colors)).repeat(2))
    mesh.set_colors(colors)
    pictures = []
    for number, color in enumerate(colors):
        a, b, _, d = corners(1, number)
        matrix = Matrix((b - a, d - a, (0, 0, 0))).transposed().to_4x4()
        matrix.translation = (b + d) / 2
        pictures.append((ours(f"{display}.picture").Picture(color[None]), matrix))
    inset = ours(f"{display}.inset").Inset(np.rint(255 * colors)[None].astype(np.uint8))

    def in_space() -> None:
        mesh.draw(Matrix(), bpy.context.region_data)
        for picture, matrix in pictures:
            picture.draw(matrix, bpy.context.region_data)

    def over_it() -> None:
        left, low = window.width // 2, 60 + 2 * SQUARE
        inset.draw(left, low, len(colors) * SQUARE, SQUARE)
        for number, color in enumerate(colors.tolist()):
            ours("ui.view.ink").box(left + number * SQUARE, low + SQUARE, SQUARE, SQUARE, (*color, 1.0))

    for draw, when in ((in_space, "POST_VIEW"), (over_it, "POST_PIXEL")):
        bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when)
    EXPECTED["ramp"] = np.rint(255 * colors)
    np.savez(OUT / "expected.npz", **EXPECTED)
    (OUT / "report.json").write_text(json.dumps(REPORT))


def blocks() -> int:
    """Data-blocks of the file, of all kinds."""
    kinds = [name for name, each in bpy.data.bl_rna.properties.items() if each.type == "COLLECTION"]
    return sum(len(getattr(bpy.data, kind)) for kind in kinds)


def saved() -> str:
    """A digest of the file as it would be saved, but for windows, their screens and workspaces.

    Byte for byte, but for addresses: those that blocks have in it, and what is near them. They differ each time.
    """
    path = OUT / "copy.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=False)
    data, found = path.read_bytes(), []
    large = data[7:9] == b"17"  # Blender 5; before, a block's length stood elsewhere
    head, at = struct.Struct("<4siQqq" if large else "<4siQii"), 17 if large else 12
    while data[at : at + 4] != b"ENDB":
        code, second, address, third, _ = head.unpack_from(data, at)
        start, at = at + head.size, at + head.size + (third if large else second)
        found.append((code, address, data[start:at]))
    near = np.array([address for _, address, _ in found], np.uint64) >> np.uint64(16)
    digest, kept = hashlib.sha256(), True
    for code, _, body in found:
        if code != b"DATA":  # what follows an ID up to the next one is a part of it
            kept = code[:2] not in (b"WM", b"SN", b"WS")
        if kept:
            words = np.frombuffer(body[: len(body) // 8 * 8], np.uint64)
            digest.update(words[(words < 1 << 16) | ~np.isin(words >> np.uint64(16), near)].tobytes())
            digest.update(code + body[len(words) * 8 :])
    return digest.hexdigest()


STEPS: list[tuple[Callable[[], object], str]] = [
    (start, ""),
    (open_loupe, "loupe"),
    (loupe_seen, ""),
    (open_flip, "lod"),
    (flip_seen, ""),
    (turn, "original"),
    (wipe, "wipe"),
    (close, ""),
    (ramps, "ramps"),
]

play(STEPS, at_work, (OUT / "error.txt").write_text)
