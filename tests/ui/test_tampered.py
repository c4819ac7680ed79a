# SPDX-License-Identifier: GPL-3.0-or-later
"""Results in a .blend that strangers have written: what cannot be read is left out and said, and nothing breaks."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import bpy
import pytest

import fmqm_addon
from fmqm_addon.ui import stale
from fmqm_addon.ui.panels import results as panels
from fmqm_addon.ui.panels import trust
from fmqm_addon.ui.properties.rows import is_whole
from tests.blender import scenes
from tests.blender.script import read_json

BROKEN = ("", "{", "[]", "{}", "7", "null", '"text"', "[1, 2, 3, 4, NaN]", '["a", "b", "c", "d", "e"]', "[" * 100_000)
NO_SECOND = json.dumps(
    {**dict.fromkeys(("stderr", "perceived", "perceived_stderr")), "scores": [1.0] * 5, "fmqm_p10": 1.0}
)
BROKEN = (*BROKEN, NO_SECOND)
NAMES = ("scores", "reverse", "attribution", "screen_size", "trust", "settings", "stages")
FINE = {*((name, "") for name in ("reverse", "attribution", "screen_size", "trust", "stages")), ("stages", "{}")}


@pytest.fixture
def rows(empty_session: None) -> Iterator[bpy.types.bpy_prop_collection]:
    """Three results with all that there can be."""
    fmqm_addon.register()
    monkeys = [scenes.monkey(f"Rock_LOD{level}", []) for level in range(4)]
    for level, monkey in enumerate(monkeys):
        monkey.modifiers.new("Decimate", "DECIMATE").ratio = 1 - 0.2 * level
    fmqm = bpy.context.scene.fmqm
    fmqm.settings.samples, fmqm.settings.patches, fmqm.settings.repeats = 640, 20, 2
    fmqm.settings.both = fmqm.settings.attribution = True
    fmqm.reference = monkeys[0]
    for monkey in monkeys[1:]:
        fmqm.compared.add().object = monkey
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    yield fmqm.rows
    fmqm_addon.unregister()


def draw() -> list[str]:
    """Draws all that reads rows; what the sidebar says."""
    layout = MagicMock()
    for part in (layout.column, layout.row, layout.split):
        part.return_value = layout
    context = SimpleNamespace(
        scene=bpy.context.scene,
        region=SimpleNamespace(width=400),
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
    )
    panels.FMQM_PT_results.draw(SimpleNamespace(layout=layout), context)
    trust.FMQM_PT_trust.draw(SimpleNamespace(layout=layout), context)
    for row in bpy.context.scene.fmqm.rows:
        panels.FMQM_UL_rows.draw_item(None, context, layout, bpy.context.scene.fmqm, row, 0, None, "")
    return [call.kwargs["text"] for call in layout.label.call_args_list]


def test_a_broken_row_is_left_out(rows: bpy.types.bpy_prop_collection, tmp_path: Path) -> None:
    fmqm, names = bpy.context.scene.fmqm, {row.name for row in rows}
    assert all(map(is_whole, rows)) and "?" not in draw()
    for name, text in [(name, text) for name in NAMES for text in BROKEN if (name, text) not in FINE]:
        broken, before = rows[1].name, getattr(rows[1], name)
        setattr(rows[1], name, text)
        assert [each.name for each in rows if not is_whole(each)] == [broken], (name, text[:20])
        fmqm.row_index = 1
        draw()
        stale.check(bpy.context.scene)
        assert bpy.ops.fmqm.copy_results() == {"FINISHED"}
        fmqm.row_index = 0
        for kind in ("json", "csv"):
            bpy.ops.fmqm.save_results(filepath=str(tmp_path / "out"), file_format=kind)
        saved = {pair["distorted"] for pair in read_json(tmp_path / "out.json")["pairs"]}
        assert saved == names - {broken} and broken not in (tmp_path / "out.csv").read_text()
        for _ in range(2):
            bpy.ops.fmqm.sort_rows(column="FMQM")
            assert rows[2].name == broken
        setattr(rows[2], name, before)
        rows.move(2, 1)


def test_where_the_chosen_one_is_broken_saving_says_so(rows: bpy.types.bpy_prop_collection, tmp_path: Path) -> None:
    before = rows[0].settings
    rows[0].settings = "{}"
    bpy.context.scene.fmqm.row_index = 0
    with pytest.raises(RuntimeError, match="this result cannot be read; measure again"):
        bpy.ops.fmqm.save_results(filepath=str(tmp_path / "out"), file_format="json")
    assert not list(tmp_path.iterdir())
    rows[0].settings = before


def test_a_choice_beyond_the_rows_removes_none(rows: bpy.types.bpy_prop_collection) -> None:
    fmqm, count = bpy.context.scene.fmqm, len(rows)
    fmqm.row_index = 99
    draw()
    assert bpy.ops.fmqm.remove_row() == {"FINISHED"} and len(rows) == count
    assert fmqm.row_index == count - 1
