# SPDX-License-Identifier: GPL-3.0-or-later
"""Choosing what is compared: families, levels and patterns."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import pytest

import fmqm_addon
from fmqm_addon.ui.properties.scene import FMQMScene
from tests.blender import scenes


@pytest.fixture(autouse=True)
def addon(empty_session: None) -> Iterator[None]:
    fmqm_addon.register()
    yield
    fmqm_addon.unregister()


@pytest.fixture
def fmqm() -> FMQMScene:
    return bpy.context.scene.fmqm


@pytest.fixture
def truck() -> bpy.types.Object:
    """An empty, the body below it, and a wheel below that."""
    root = bpy.data.objects.new("Truck", None)
    bpy.context.scene.collection.objects.link(root)
    body, wheel = scenes.cube("Body"), scenes.cube("Wheel")
    body.parent, wheel.parent = root, body
    return root


def select(active: bpy.types.Object, *others: bpy.types.Object) -> None:
    bpy.ops.object.select_all(action="DESELECT")
    for object_ in (active, *others):
        object_.select_set(True)
    bpy.context.view_layer.objects.active = active


def compared(fmqm: FMQMScene) -> list[str]:
    return [item.name for item in fmqm.compared]


def test_parts_are_not_compared_with_their_whole(fmqm: FMQMScene, truck: bpy.types.Object) -> None:
    """An import leaves all of it selected."""
    body, wheel = (bpy.data.objects[name] for name in ("Body", "Wheel"))
    other = scenes.cube("Other")
    for active in (truck, body, wheel):
        select(active, *({truck, body, wheel} - {active}))
        assert bpy.ops.fmqm.use_selection() == {"CANCELLED"}
    select(other, truck, body, wheel)
    assert bpy.ops.fmqm.use_selection() == {"FINISHED"}
    assert compared(fmqm) == ["Truck"]
    select(wheel)
    bpy.ops.fmqm.add_selected()
    assert compared(fmqm) == ["Truck"]


def test_a_list_that_holds_a_part_is_not_measured(fmqm: FMQMScene, truck: bpy.types.Object) -> None:
    fmqm.reference = truck
    item = fmqm.compared.add()
    item.object = bpy.data.objects["Wheel"]
    assert not bpy.ops.fmqm.measure.poll()


def test_patterns_say_what_counts(fmqm: FMQMScene, truck: bpy.types.Object) -> None:
    scenes.cube("Other")
    select(bpy.data.objects["Other"], truck)
    bpy.ops.fmqm.use_selection()
    fmqm.settings.samples, fmqm.settings.patches = 600, 10
    fmqm.settings.exclude = "nothing_*, Wh??l"
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    assert fmqm.rows[0].triangles == 12 and not fmqm.rows[0].error
    fmqm.settings.include = "Nobody"
    bpy.ops.fmqm.measure()
    assert "the patterns leave nothing" in fmqm.rows[0].error


@pytest.mark.parametrize("names", [("x00_Rock", "x01_Rock"), ("Rock_high", "Rock_low"), ("Rock_L0", "Rock_L1")])
def test_find_lods_knows_what_files_are_read_by(fmqm: FMQMScene, names: tuple[str, str]) -> None:
    for name in names:
        scenes.cube(name)
    assert bpy.ops.fmqm.find_lods() == {"FINISHED"}
    assert fmqm.reference.name == names[0] and compared(fmqm) == [names[1]]
