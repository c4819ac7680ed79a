# SPDX-License-Identifier: GPL-3.0-or-later
"""The button Screen Sizes: what it writes into the results, and what it leaves alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

import fmqm_addon
from fmqm_addon import api
from fmqm_addon.report.record_check import record_fault
from fmqm_addon.report.records import pair_record
from fmqm_addon.screen_size.engines import ENGINES, Extent, Screen, chain, numbers, pasteable
from fmqm_addon.screen_size.measure import Switch
from fmqm_addon.ui.panels.sizes import FMQM_PT_sizes
from fmqm_addon.ui.properties.rows import is_whole, pair_of, row_screen_size
from fmqm_addon.ui.sizes import engine_text, levels_of
from tests.blender import scenes
from tests.blender.script import read_json


@pytest.fixture
def rows(empty_session: None) -> Iterator[bpy.types.bpy_prop_collection]:
    """Two results: a copy, and one that is decimated."""
    fmqm_addon.register()
    monkeys = [scenes.monkey(f"Rock_LOD{level}", []) for level in range(3)]
    monkeys[2].modifiers.new("Decimate", "DECIMATE").ratio = 0.1
    fmqm = bpy.context.scene.fmqm
    fmqm.settings.samples, fmqm.settings.patches = 640, 20
    fmqm.reference = monkeys[0]
    for monkey in monkeys[1:]:
        fmqm.compared.add().object = monkey
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    yield fmqm.rows
    fmqm_addon.unregister()


def test_the_button_gives_each_result_its_sizes(rows: bpy.types.bpy_prop_collection, tmp_path: Path) -> None:
    """The same as the Python API; they are saved, and go with a new measurement."""
    assert [row_screen_size(row) for row in rows] == [None, None]
    assert bpy.ops.fmqm.screen_sizes() == {"FINISHED"}
    found = [row_screen_size(row) for row in rows]
    assert found[0]["strict"]["bound"] == "at least" and found[1]["strict"]["pixels"] < 128
    objects = bpy.data.objects
    alone = api.screen_sizes(objects["Rock_LOD0"], [objects["Rock_LOD2"]]).lods[0]
    assert found[1]["strict"]["pixels"] == alone.size.strict.pixels
    assert bpy.ops.fmqm.save_results(filepath=str(tmp_path / "r.json"), file_format="json") == {"FINISHED"}
    assert [pair["screen_size"] for pair in read_json(tmp_path / "r.json")["pairs"]] == found
    assert not any(record_fault(pair_record(pair_of(row))) for row in rows)
    bpy.ops.fmqm.measure()
    assert [row.screen_size for row in rows] == ["", ""], "they were of what stood there before"


def test_an_engines_numbers_are_those_of_the_api(rows: bpy.types.bpy_prop_collection) -> None:
    """Of the chain from fine to coarse, however the results are sorted; without sizes there is nothing to copy."""
    scene, objects = bpy.context.scene, bpy.data.objects
    assert not bpy.ops.fmqm.copy_sizes.poll() and not FMQM_PT_sizes.poll(bpy.context)
    objects["Rock_LOD1"].modifiers.new("Decimate", "DECIMATE").ratio = 0.4
    assert bpy.ops.fmqm.measure() == bpy.ops.fmqm.screen_sizes() == {"FINISHED"}
    found = [Switch(each["pixels"], each["bound"], 0) for each in (row_screen_size(row)["fade"] for row in rows)]
    extent = Extent(*json.loads(rows[0].screen_extent))
    original = objects["Rock_LOD0"]
    box = np.ptp([original.matrix_world @ vertex.co for vertex in original.data.vertices], axis=0)
    assert (extent.diagonal, extent.side) == pytest.approx((np.linalg.norm(box), box.max()), rel=1e-6)
    rows.move(0, 1)
    scene.fmqm.sizes.transition, scene.fmqm.sizes.height = "fade", 720
    levels = chain(["Rock_LOD1", "Rock_LOD2"], found)
    assert levels_of(scene) == levels
    for engine in ENGINES:
        scene.fmqm.sizes.engine = engine
        assert engine_text(scene) == pasteable(engine, numbers(engine, levels, extent, Screen(height=720)))
    assert bpy.ops.fmqm.copy_sizes() == {"FINISHED"} and FMQM_PT_sizes.poll(bpy.context)
    rows[0].screen_extent = rows[1].screen_extent = "[1, -2, 3]"
    assert engine_text(scene) == "" and not is_whole(rows[0])


def test_what_cannot_be_read_is_no_size(rows: bpy.types.bpy_prop_collection) -> None:
    for text in ("{", "[]", "{}", '{"strict": 1, "fade": 2, "curve": []}', "NaN"):
        rows[0].screen_size = text
        assert row_screen_size(rows[0]) is None and not is_whole(rows[0])
    rows[0].screen_size = ""
    assert is_whole(rows[0])


def test_without_its_reference_nothing_changes(rows: bpy.types.bpy_prop_collection) -> None:
    bpy.data.objects.remove(bpy.data.objects["Rock_LOD0"])
    assert bpy.ops.fmqm.screen_sizes() == {"CANCELLED"}
    assert [row.screen_size for row in rows] == ["", ""]
