# SPDX-License-Identifier: GPL-3.0-or-later
"""The loupe without a window: its pictures are the report's, it follows what is chosen, and leaves nothing."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from fmqm_addon.report.html.pictures import CLOSE_UP_MARGIN
from fmqm_addon.report.render import Camera, render
from fmqm_addon.report.visual.worst import patch_view
from fmqm_addon.ui import session
from fmqm_addon.ui.operators.loupe import FMQM_OT_loupe
from fmqm_addon.ui.operators.view_tool import ViewTool
from fmqm_addon.ui.view import loupe, panes, sight, worst
from fmqm_addon.ui.view.result import why_not
from tests.ui.test_look import measured, scene  # noqa: F401  the fixtures

AREA = SimpleNamespace(as_pointer=lambda: 1, type="")
SIDE = 70


@pytest.fixture
def opened(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> Iterator[loupe.Loupe]:  # noqa: F811
    """The loupe at the worst place, with small pictures."""
    monkeypatch.setattr(panes, "SECOND", SIDE - 1)
    worst.step_worst(scene, None, 1)
    try:
        shown = loupe.open_in(AREA, scene)
        shown.side = SIDE
        yield shown
    finally:
        loupe.close()


def report_camera(measured: session.Measured, patch: int) -> Camera:  # noqa: F811
    center, diagonal, normal = patch_view(measured.comparison.result, patch)
    return Camera.facing(center, normal, CLOSE_UP_MARGIN * diagonal)


def test_pictures_are_the_close_ups_of_the_report(opened: loupe.Loupe, measured: session.Measured) -> None:  # noqa: F811
    opened.work.run()
    look = bpy.context.scene.fmqm.look
    camera, size = report_camera(measured, look.worst[0].patch), (SIDE, SIDE)
    original, lod, heat = (picture.pixels for picture in opened.pictures)
    assert np.array_equal(original, render(measured.reference, camera, size))
    assert np.array_equal(lod, render(measured.comparison.distorted, camera, size))
    assert heat.shape == original.shape and not np.array_equal(heat, original)
    assert opened.caption == f"FMQM {look.worst[0].score:.3f}"


def test_coarse_ones_come_first_and_another_place_stops_them(opened: loupe.Loupe) -> None:
    found = []
    first = opened.work
    while len(found) < 2 and first.step():
        if opened.pictures and len(opened.pictures[0].pixels) not in found:
            found.append(len(opened.pictures[0].pixels))
    assert found == [panes.FIRST, SIDE - 1]
    worst.step_worst(bpy.context.scene, None, 1)
    loupe.refresh()
    assert not first.step() and opened.work is not first
    assert len(opened.pictures[0].pixels) == SIDE - 1, "what was there stays until there is something new"
    opened.work.run()
    assert len(opened.pictures[0].pixels) == SIDE


def test_worst_places_are_stepped_through(opened: loupe.Loupe, measured: session.Measured) -> None:  # noqa: F811
    look = bpy.context.scene.fmqm.look
    for number in (2, 3):
        worst.step_worst(bpy.context.scene, None, 1)
        loupe.refresh()
        assert opened.sight.title.startswith(f"Worst place {number} of {len(look.worst)}")
        assert np.array_equal(opened.sight.camera.eye, report_camera(measured, look.worst[number - 1].patch).eye)
    worst.show_all_patches(bpy.context.scene)
    loupe.refresh()
    assert opened.sight.title.startswith("Worst place 3"), "it stays where it is"


def test_what_is_out_of_date_is_not_shown(opened: loupe.Loupe) -> None:
    opened.work.run()
    session.stale["row"] = "Monkey_LOD1 has changed since; measure again"
    loupe.refresh()
    assert not opened.pictures and "measure again" in why_not(bpy.context.scene)
    session.stale.clear()
    loupe.refresh()
    opened.work.run()
    assert len(opened.pictures) == 3
    session.clear()  # as after another file was opened
    loupe.refresh()
    assert not opened.pictures and "press Measure Quality again" in why_not(bpy.context.scene)


def test_closing_stops_the_work_and_nothing_is_left(opened: loupe.Loupe) -> None:
    kinds = ("objects", "meshes", "materials", "images", "scenes", "node_groups")
    before = [len(getattr(bpy.data, kind)) for kind in kinds]
    work = opened.work
    work.step()
    loupe.close()
    assert loupe.shown is None and not work.step()
    assert [len(getattr(bpy.data, kind)) for kind in kinds] == before


class Running(ViewTool):
    """The operator while it runs."""

    is_on, act, end = FMQM_OT_loupe.is_on, FMQM_OT_loupe.act, FMQM_OT_loupe.end

    def __init__(self, shown: loupe.Loupe) -> None:
        region = SimpleNamespace(type="WINDOW", x=0, y=0, width=800, height=600)
        self._area, self._shown, self.moved = SimpleNamespace(regions=[region]), shown, 0
        workspace = SimpleNamespace(status_text_set=lambda _: None)
        self.context = SimpleNamespace(workspace=workspace, scene=bpy.context.scene)

    def gets(self, kind: str, value: str = "PRESS") -> str:
        event = SimpleNamespace(type=kind, value=value, mouse_x=400, mouse_y=300)
        (answer,) = self.modal(self.context, event)
        return answer

    def _move(self, *_: object) -> None:
        self.moved += 1


def test_clicks_hold_the_place_keys_step_and_escape_closes(opened: loupe.Loupe) -> None:
    running = Running(opened)
    assert not opened.follows, "it was opened at a worst place"
    assert running.gets("LEFTMOUSE") == "RUNNING_MODAL" and opened.follows
    assert running.gets("MOUSEMOVE") == "PASS_THROUGH" and running.moved == 2
    running._area.type = ""  # no view is framed
    look = bpy.context.scene.fmqm.look
    for key, index in (("PAGE_DOWN", 1), ("PAGE_DOWN", 2), ("PAGE_UP", 1)):
        assert running.gets(key) == "RUNNING_MODAL" and look.worst_index == index
    loupe.refresh()
    assert not opened.follows and opened.sight.title.startswith("Worst place 2")
    assert running.gets("MIDDLEMOUSE") == "PASS_THROUGH", "the view can be turned"
    assert running.gets("ESC") == "FINISHED" and loupe.shown is None


def from_above(center: np.ndarray) -> tuple[Any, Any]:
    """A region of 600 pixels and its view: orthographic, a scene unit in 100 pixels, looking down on a place."""
    view = Matrix.Translation(-center - (0, 0, 10))
    clip = Matrix.Diagonal((1 / 3, 1 / 3, -0.01, 1.0)) @ view
    fake = SimpleNamespace(is_perspective=False, view_perspective="ORTHO", view_matrix=view, perspective_matrix=clip)
    return SimpleNamespace(width=600, height=600), fake


def test_the_place_under_the_mouse_is_magnified(scene: bpy.types.Scene, measured: session.Measured) -> None:  # noqa: F811
    row, frame = scene.fmqm.rows[0], measured.reference.frame
    region, view = from_above(frame.center)
    camera = sight.sight_under(row, measured, region, view, (320.0, 290.0), 80).camera
    width = 0.8 / sight.MAGNIFIED / frame.scale
    seen = camera.eye + camera.axes[2] * width / 2 / camera.half[0]
    assert frame.leave(seen)[:2] - frame.center[:2] == pytest.approx([0.2, -0.1], abs=1e-4), "where the mouse is"
    assert camera.axes == pytest.approx(np.array([[1, 0, 0], [0, 1, 0], [0, 0, -1]]), abs=1e-6)
    assert sight.sight_under(row, measured, region, view, (5.0, 5.0), 80) is None, "beside both"
