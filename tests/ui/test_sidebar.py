# SPDX-License-Identifier: GPL-3.0-or-later
"""What the sidebar's table and names look like in sidebars of any width, and the buttons of the inputs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

import fmqm_addon
from fmqm_addon.blender.scene.target import target_of
from fmqm_addon.blender.scene.triangle_count import triangle_count
from fmqm_addon.ui import preferences
from fmqm_addon.ui.panels.results import columns_for
from fmqm_addon.ui.panels.sidebar import cut_in_the_middle, short_count, text_width
from fmqm_addon.ui.properties.rows import active_row, row_former, row_scores
from tests.blender import scenes


@pytest.fixture
def scene() -> Iterator[bpy.types.Scene]:
    fmqm_addon.register()
    try:
        yield bpy.context.scene
    finally:
        fmqm_addon.unregister()


@pytest.mark.parametrize("width", range(160, 700, 20))
@pytest.mark.parametrize("judge", ["FMQM", "PERCEIVED"])
def test_a_score_always_has_its_room(width: int, judge: str) -> None:
    columns = dict(columns_for(width, judge))
    assert columns["FMQM" if judge == "FMQM" else "perceived"] >= 46 and columns["name"] >= 40
    assert sum(columns.values()) <= max(width, 190)


def test_a_wide_sidebar_has_all_columns() -> None:
    assert [name for name, _ in columns_for(500, "FMQM")] == ["name", "triangles", "share", "FMQM", "perceived", "bar"]


def test_names_are_cut_in_the_middle() -> None:
    assert cut_in_the_middle("Rock", 60) == "Rock"
    cut = cut_in_the_middle("Cliff_Large_LOD3", 80)
    assert cut.startswith("Clif") and cut.endswith("LOD3") and 60 < text_width(cut) <= 80


@pytest.mark.parametrize(("count", "text"), [(512, "512"), (8_659, "8.7k"), (250_000, "250k"), (1_234_567, "1.2M")])
def test_counts_are_short(count: int, text: str) -> None:
    assert short_count(count) == text


def test_triangles_are_those_that_are_shown(scene: bpy.types.Scene) -> None:
    cube = scenes.cube()
    cube.modifiers.new("Fine", "SUBSURF").levels = 1
    bpy.context.view_layer.update()
    depsgraph = bpy.context.view_layer.depsgraph
    assert triangle_count(target_of(cube), depsgraph) == 48
    assert triangle_count(target_of(cube, bare=True), depsgraph) == 12


def test_swap_exchanges_original_and_chosen(scene: bpy.types.Scene) -> None:
    a, b, c = scenes.cube(), scenes.cube(), scenes.cube()
    fmqm = scene.fmqm
    assert not bpy.ops.fmqm.swap.poll()
    fmqm.reference = a
    for each in (b, c):
        fmqm.compared.add().object = each
    fmqm.compared_index = 1
    assert bpy.ops.fmqm.swap() == {"FINISHED"}
    assert fmqm.reference == c and [item.object for item in fmqm.compared] == [b, a]


def test_a_row_tells_its_former_score(scene: bpy.types.Scene) -> None:
    a, b = scenes.monkey("A", []), scenes.monkey("B", [])
    b.modifiers.new("Fewer", "DECIMATE").ratio = 0.5
    fmqm = scene.fmqm
    fmqm.reference, fmqm.settings.samples, fmqm.settings.patches = a, 1600, 16
    fmqm.compared.add().object = b
    bpy.ops.fmqm.measure()
    row = active_row(scene)
    first = row_scores(row)
    assert row_former(row) is None and scene.fmqm.look.show == "SURFACE"
    b.modifiers["Fewer"].ratio = 0.2
    bpy.ops.fmqm.measure()
    assert row_former(active_row(scene)) == first != row_scores(active_row(scene))
    fmqm.settings.samples = 1700  # not to be compared
    bpy.ops.fmqm.measure()
    assert row_former(active_row(scene)) is None
    scene.fmqm.look.show_after, scene.fmqm.look.show = False, "OFF"
    bpy.ops.fmqm.measure()
    assert scene.fmqm.look.show == "OFF"


def test_json_is_saved_without_pillow(scene: bpy.types.Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "PIL"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "PIL", None)  # type: ignore[arg-type]  importing it fails
    a, b = scenes.monkey("A", []), scenes.monkey("B", [])
    scene.fmqm.reference, scene.fmqm.settings.samples, scene.fmqm.settings.patches = a, 1600, 16
    scene.fmqm.compared.add().object = b
    bpy.ops.fmqm.measure()
    path = tmp_path / "scores.json"
    assert bpy.ops.fmqm.save_results(filepath=str(path), file_format="json") == {"FINISHED"}
    assert json.loads(path.read_text())["pairs"][0]["FMQM"] == 1


def test_help_is_a_file_of_the_extension() -> None:
    assert preferences._HELP.is_file()
    assert preferences.FMQMPreferences.bl_idname == "fmqm_addon"
