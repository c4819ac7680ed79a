# SPDX-License-Identifier: GPL-3.0-or-later
"""Flip and wipe without a window: what is shown after each key and drag, and that nothing of the file is touched."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from fmqm_addon.ui import session, stale
from fmqm_addon.ui.operators.flip import FMQM_OT_flip
from fmqm_addon.ui.operators.view_tool import ViewTool
from fmqm_addon.ui.view import flip, heat, loupe
from tests.ui.test_look import measured, scene  # noqa: F401  the fixtures

REGION = SimpleNamespace(type="WINDOW", x=100, y=0, width=800, height=600)
AREA = SimpleNamespace(as_pointer=lambda: 1, type="VIEW_3D", regions=[REGION])


@pytest.fixture
def opened(scene: bpy.types.Scene, monkeypatch: pytest.MonkeyPatch) -> Iterator[flip.Flip]:  # noqa: F811
    monkeypatch.setattr(flip, "PLACES", (500, 20_000))
    try:
        yield flip.open_in(AREA, scene)
    finally:
        flip.close()


class Running(ViewTool):
    """The operator while it runs."""

    is_on, act, end = FMQM_OT_flip.is_on, FMQM_OT_flip.act, FMQM_OT_flip.end

    def __init__(self, shown: flip.Flip) -> None:
        self._area, self._shown, self._drags = AREA, shown, False
        self.context = SimpleNamespace(workspace=SimpleNamespace(status_text_set=lambda _: None))

    def gets(self, kind: str, value: str = "PRESS", x: int = 500) -> str:
        event = SimpleNamespace(type=kind, value=value, mouse_x=x, mouse_y=300, ctrl=False, shift=False, alt=False)
        (answer,) = self.modal(self.context, event)
        return answer


def test_both_are_sampled_coarse_to_fine(opened: flip.Flip, measured: session.Measured) -> None:  # noqa: F811
    counts = []
    while opened.work.step():
        mesh = opened.meshes.get(heat.LOD)
        if mesh is not None and (not counts or counts[-1] is not mesh):
            counts.append(mesh)
    assert len(counts) == 2 and set(opened.meshes) == {heat.ORIGINAL, heat.LOD}
    positions, _, first, _, colors = opened.meshes[heat.ORIGINAL]._arrays
    assert len(first) == len(measured.reference.triangles) == len(positions) // 3
    plain = measured.reference.color_at(np.array([0]), np.array([[1.0, 0, 0]]))
    assert colors[first[0]] == pytest.approx(plain[0] * 255, abs=0.51)


def test_keys_turn_and_a_drag_wipes(opened: flip.Flip) -> None:
    running = Running(opened)
    assert opened.showing == heat.LOD
    assert running.gets("F") == "RUNNING_MODAL" and opened.showing == heat.ORIGINAL
    running.gets("F")
    assert opened.showing == heat.LOD and opened.wipe is None
    running.gets("LEFTMOUSE", x=300)
    assert opened.wipe == 0.25
    for kind, x, wipe in (("MOUSEMOVE", 700, 0.75), ("MOUSEMOVE", 2000, 1.0), ("MOUSEMOVE", 0, 0.0)):
        running.gets(kind, x=x)
        assert opened.wipe == wipe
    running.gets("LEFTMOUSE", "RELEASE")
    assert running.gets("MOUSEMOVE", x=500) == "PASS_THROUGH" and opened.wipe == 0.0
    assert running.gets("LEFTMOUSE", x=50) == "PASS_THROUGH", "beside the view buttons go on working"
    assert running.gets("MIDDLEMOUSE") == "PASS_THROUGH", "and the view can be turned"
    assert running.gets("F") == "RUNNING_MODAL" and opened.wipe is None
    work = opened.work
    assert running.gets("ESC") == "FINISHED" and flip.shown is None
    assert not work.step(), "its work is stopped"


def test_another_file_ends_both_tools(opened: flip.Flip) -> None:
    stale._before_load()
    assert flip.shown is None and loupe.shown is None
    assert Running(opened).gets("MOUSEMOVE") == "FINISHED"


def test_what_is_out_of_date_is_not_shown(opened: flip.Flip) -> None:
    opened.work.run()
    session.stale["row"] = "Monkey_LOD1 has changed since; measure again"
    flip.refresh()
    assert not opened.meshes and opened.work is None
    session.stale.clear()
    flip.refresh()
    opened.work.run()
    assert len(opened.meshes) == 2


def test_nothing_of_the_file_is_touched(opened: flip.Flip) -> None:
    kinds = [name for name, each in bpy.data.bl_rna.properties.items() if each.type == "COLLECTION"]
    before = [len(getattr(bpy.data, kind)) for kind in kinds]
    opened.work.run()
    flip.turn()
    flip.wipe_to(0.5)
    assert [len(getattr(bpy.data, kind)) for kind in kinds] == before
