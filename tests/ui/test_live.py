# SPDX-License-Identifier: GPL-3.0-or-later
"""Live, tick by tick: when it measures, what it shares, what it survives. tests/window has the timer and the drag."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import bpy
import pytest

from fmqm_addon import api, ui
from fmqm_addon.comparison.measurement import Measurement
from fmqm_addon.metric.settings import Settings
from fmqm_addon.ui import live, session
from fmqm_addon.ui.operators import inputs
from tests.blender import scenes

TINY = Settings(samples=3200, patches=50, scored_patches=40, color_units=20)


@pytest.fixture(autouse=True)
def addon(empty_session: None) -> Iterator[None]:
    ui.register()
    yield
    ui.unregister()


@pytest.fixture
def lods() -> list[bpy.types.Object]:
    made = [scenes.monkey(f"Rock_LOD{level}") for level in range(2)]
    made[1].modifiers.new("Decimate", "DECIMATE").ratio = 0.4
    fmqm = bpy.context.scene.fmqm
    inputs.set_reference(fmqm, made[0])
    inputs.set_compared(fmqm, made[1:])
    bpy.context.view_layer.update()
    return made


@pytest.fixture
def prepared(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Grows by one with each preparation of a reference."""
    counted: list[int] = []
    prepare = Measurement.prepare

    def counting(self: Measurement) -> object:
        counted.append(1)
        return prepare(self)

    monkeypatch.setattr(Measurement, "prepare", counting)
    return counted


class Clock:
    """Ticks as Blender's timer would, on a clock of its own."""

    def __init__(self) -> None:
        self.now = 100.0
        live.turn_on(TINY)

    def touch(self) -> None:
        bpy.context.view_layer.update()
        assert live.current is not None
        live.current.touch(self.now)

    def settle(self, between: Callable[[], object] = lambda: None) -> list[str]:
        """Until it rests; what is shown then."""
        while live.current is not None and (wait := live.current.tick(self.now)) is not None:
            self.now += max(wait, 1e-3)
            between()
        return live.texts(bpy.context.scene)


def score() -> float:
    assert live.current is not None and live.current.reading is not None
    return live.current.reading.readings.scores.FMQM


def test_it_measures_again_what_has_changed_and_only_that(lods: list[bpy.types.Object], prepared: list[int]) -> None:
    rest, blocks = Clock(), scenes.blocks()
    shown = rest.settle(lambda: scenes.blocks() == blocks or pytest.fail("between ticks nothing is left in the file"))
    first = score()
    assert shown == [f"FMQM {first:.3f}", "Rock_LOD1, 386 triangles, Quick"]
    assert first == pytest.approx(api.measure(*lods, TINY)[0].scores.FMQM, abs=1e-9)
    reading = live.current.reading
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Other", None))
    rest.touch()
    rest.settle()
    assert live.current.reading is reading, "neither the original nor the LOD has changed"
    prepared.clear()
    lods[1].modifiers[0].ratio = 0.1
    rest.touch()
    assert live.texts(bpy.context.scene)[0] == f"FMQM {first:.3f} ...", "said to be old at once"
    rest.settle()
    assert score() < first and not prepared, "the original's preparation serves again"
    lods[0].data.vertices[0].co.z += 1
    rest.touch()
    rest.settle()
    assert prepared == [1]
    bpy.context.scene.fmqm.judge = "PERCEIVED"
    assert live.texts(bpy.context.scene)[0].startswith("Perceived 0.")
    assert not bpy.context.scene.fmqm.rows and not session.stale, "nothing of it is kept in the file"


def test_it_does_nothing_while_changes_go_on(lods: list[bpy.types.Object]) -> None:
    drag = Clock()
    drag.settle()
    before = live.current.reading
    for _ in range(20):
        lods[1].modifiers[0].ratio -= 0.01
        drag.touch()
        wait = live.current.tick(drag.now)
        assert wait == pytest.approx(live.REST) and live.current.reading is before
        drag.now += live.REST / 2
    drag.settle()
    assert live.current.reading is not before


def test_a_change_while_it_measures_begins_anew(lods: list[bpy.types.Object], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "SLICE", 0)  # a step for each tick, however fast the machine is
    clock = Clock()
    for _ in range(5):
        clock.now += live.current.tick(clock.now) or 0
    assert live.current.reading is None
    lods[1].modifiers[0].ratio = 0.2
    clock.touch()
    assert clock.settle()[1] == "Rock_LOD1, 192 triangles, Quick"


def test_the_chosen_pair(lods: list[bpy.types.Object]) -> None:
    fmqm = bpy.context.scene.fmqm
    other = scenes.monkey("Rock_LOD2")
    inputs.set_compared(fmqm, [lods[1], other])
    assert [target.name for target in live.chosen_pair(bpy.context.scene)] == ["Rock_LOD0", "Rock_LOD1"]
    fmqm.compared_index = 1
    assert live.chosen_pair(bpy.context.scene)[1].name == "Rock_LOD2"
    row = fmqm.rows.add()
    row.reference_name, row.reference_kind, row.name, row.kind = "Rock_LOD0", "OBJECT", "Rock_LOD1", "OBJECT"
    assert live.chosen_pair(bpy.context.scene)[1].name == "Rock_LOD1", "the chosen result comes first"
    row.reference_name = "Pebble"
    assert live.chosen_pair(bpy.context.scene)[1].name == "Rock_LOD2", "unless it is of another asset"
    fmqm.compared.clear()
    assert live.chosen_pair(bpy.context.scene)[0].name == "Pebble"
    fmqm.rows.clear()
    assert live.chosen_pair(bpy.context.scene) is None


def test_it_says_which_is_gone_and_measures_it_when_it_is_back(lods: list[bpy.types.Object]) -> None:
    clock, scene = Clock(), bpy.context.scene
    clock.settle()
    row = scene.fmqm.rows.add()
    row.reference_name, row.reference_kind, row.name, row.kind = "Rock_LOD0", "OBJECT", "Rock_LOD1", "OBJECT"
    for object_ in lods:
        scene.collection.objects.unlink(object_)
        clock.touch()
        assert clock.settle() == [f"Live: {object_.name} is gone"]
        scene.collection.objects.link(object_)
        clock.touch()
        assert clock.settle()[0].startswith("FMQM 0.")


def test_it_goes_on_in_another_file(lods: list[bpy.types.Object]) -> None:
    clock = Clock()
    for _ in range(5):
        clock.now += live.current.tick(clock.now) or 0
    live._before_load()
    scenes.clear()
    live._after_load()
    clock.touch()
    assert clock.settle() == ["Live: choose an original and an LOD"]
    fmqm = bpy.context.scene.fmqm
    inputs.set_reference(fmqm, scenes.monkey("Bust"))
    inputs.set_compared(fmqm, [scenes.cube("Block")])
    assert live.current.follow(bpy.context.scene)
    clock.touch()
    assert clock.settle()[1].startswith("Block, 12 triangles")


def test_what_cannot_be_measured_is_told(lods: list[bpy.types.Object]) -> None:
    clock = Clock()
    lods[1].data.clear_geometry()
    clock.touch()
    (text,) = clock.settle()
    assert text.startswith("Live: Rock_LOD1") and "no face" in text and live.current.reading is None


def test_it_is_off_where_a_pair_takes_long(lods: list[bpy.types.Object], monkeypatch: pytest.MonkeyPatch) -> None:
    """But for the original's first preparation, which is not repeated."""
    clock = Clock()
    monkeypatch.setattr(live, "MOST", 0.0)
    while live.current is not None and not live.current.is_too_slow:
        assert live._run() is None or live.current is not None
        clock.now += 1
    assert live.current is None
    assert live.texts(bpy.context.scene) == ["Live is off: Rock_LOD1 takes more than 0 s to measure"]
    live.turn_on(TINY)
    assert live.texts(bpy.context.scene) == ["Live: measuring..."]


def test_it_waits_for_other_measurements(lods: list[bpy.types.Object]) -> None:
    clock = Clock()
    session.job = session.Job(stop=lambda: None)
    try:
        assert live.current.tick(clock.now) == live.WAIT
    finally:
        session.job = None
    assert clock.settle()


def test_the_button(lods: list[bpy.types.Object]) -> None:
    assert bpy.ops.fmqm.live() == {"FINISHED"} and live.current is not None
    assert bpy.ops.fmqm.live() == {"FINISHED"} and live.current is None
    assert live.texts(bpy.context.scene) == []
    bpy.context.scene.fmqm.compared.clear()
    with pytest.raises(RuntimeError, match="Choose an original and an LOD"):
        bpy.ops.fmqm.live()
