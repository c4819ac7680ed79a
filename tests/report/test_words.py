# SPDX-License-Identifier: GPL-3.0-or-later
"""One word for one thing wherever an artist reads: Original and LOD, never what JSON's keys call them."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from fmqm_addon.metric.settings import PRESETS, Settings
from fmqm_addon.report.records import PERCEIVED, SHOWN
from fmqm_addon.report.visual.layers import LAYERS
from fmqm_addon.report.words import CUSTOM, LABELS, MEANINGS, PRESET_LABELS, plain, preset_label

ROOT = Path(__file__).parents[2] / "fmqm_addon"
FORBIDDEN = re.compile(r"\b([Rr]eference|[Dd]istorted)\b")
SPEAKING = sorted(
    path
    for folder in ("comparison", "report", "ui")
    for path in (ROOT / folder).rglob("*.py")
    if path.parent.name != "html"  # HTML's own attributes; tests/report/test_page.py reads the page
)


def sentences(path: Path) -> list[str]:
    """Texts of more than one word that are no docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    texts = [node for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return [node.value for node in texts if id(node) not in docs and " " in node.value.strip()]


@pytest.mark.parametrize("path", SPEAKING, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_sentences_say_original_and_lod(path: Path) -> None:
    assert [text for text in sentences(path) if FORBIDDEN.search(text)] == []


def test_every_number_has_its_label_and_its_meaning() -> None:
    assert set(LABELS) == set(MEANINGS) == {*SHOWN, *PERCEIVED}
    assert all(LAYERS[name].label == label for name, label in LABELS.items() if name in LAYERS)
    assert plain("distance_to_reference_mean") == "distance to original mean" and plain("distorted") == "LOD"


def test_settings_are_called_by_their_preset() -> None:
    for name, values in PRESETS.items():
        assert preset_label(Settings(**values, seed=7).as_dict()) == PRESET_LABELS[name]
    assert preset_label(Settings(patches=100).as_dict()) == CUSTOM
