# SPDX-License-Identifier: GPL-3.0-or-later
"""Loupe, flip and wipe in the real window: what is on the screen is what the report has, and nothing else changes."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fmqm_addon.report.render import BACKGROUND
from tests.house.test_extension import package  # noqa: F401  the fixture
from tests.window.pictures import Pixels, cut, pictures_in, run_in_window

pytestmark = pytest.mark.program
REPORT: dict[str, Any] = {}  # what the script wrote down


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory, package: Path) -> dict[str, Pixels]:  # noqa: F811
    """Pictures of the window by name, and those that the report's rays make, after "expected"."""
    out = tmp_path_factory.mktemp("compare")
    printed = run_in_window("compare_script.py", package, out)
    REPORT.update(json.loads((out / "report.json").read_text()))
    REPORT["undo"] = re.findall(r"^Undo (\d+) Steps", printed, re.MULTILINE)
    with np.load(out / "expected.npz") as expected:
        return pictures_in(out) | {f"expected {name}": expected[name] / 255 for name in expected.files}


@pytest.mark.parametrize(("number", "name"), [(0, "original"), (1, "lod"), (2, "heat")])
def test_loupe_shows_the_close_ups_of_the_report(seen: dict[str, Pixels], number: int, name: str) -> None:
    loupe, (left, bottom, _, _) = REPORT["loupe"], REPORT["region"]
    x, y, _, _ = loupe["place"]
    side, pad = loupe["side"], loupe["pad"]
    corner = (left + x + pad + number * (side + pad), bottom + y + pad)
    shown = cut(seen["loupe"], [*map(round, corner), side, side])
    wanted = seen[f"expected loupe {name}"]
    assert wanted.std() > 0.05, "there is something to see"
    assert np.abs(shown - wanted).max() < 4.5 / 255, "what the darkest ones are rounded to"


@pytest.mark.parametrize(("name", "other"), [("lod", "original"), ("original", "lod")])
def test_flip_shows_what_the_report_would(seen: dict[str, Pixels], name: str, other: str) -> None:
    """In the colors and the light of the report, up to the grid of places and to smooth edges."""
    shown = cut(seen[name], REPORT["crop"])
    wanted, not_wanted = seen[f"expected {name}"], seen[f"expected {other}"]
    inside = (np.abs(np.stack([wanted, not_wanted]) - np.array(BACKGROUND) / 255) > 0.01).any(axis=3).all(axis=0)
    assert inside.mean() > 0.5
    error = np.abs(shown - wanted).max(axis=2)[inside]
    assert np.median(error) < 3 / 255 and np.percentile(error, 95) < 12 / 255
    assert error.mean() < 0.5 * np.abs(shown - not_wanted).max(axis=2)[inside].mean()


@pytest.mark.parametrize(("row", "means"), list(enumerate(["heat map", "slice", "loupe and flip", "legend"])))
def test_a_view_shows_the_colors_that_are_meant(seen: dict[str, Pixels], row: int, means: str) -> None:
    ramp, wanted = REPORT["ramp"], seen["expected ramp"]
    place = [ramp["x"], ramp["y"] + row * ramp["side"], len(wanted) * ramp["side"], ramp["side"]]
    middles = cut(seen["ramps"], place)[ramp["side"] // 2, ramp["side"] // 2 :: ramp["side"]]
    assert np.abs(middles - wanted).max() < 2.5 / 255, f"{means}: {255 * middles} for {255 * wanted}"


def test_wipe_shows_one_beside_the_other(seen: dict[str, Pixels]) -> None:
    left, bottom, width, height = REPORT["region"]
    border = left + round(width * REPORT["wipe"])
    x, y, across, up = REPORT["crop"]
    for name, start, stop in (("original", x, border - 4), ("lod", border + 4, x + across)):
        part = [start, y, stop - start, up]
        assert np.abs(cut(seen["wipe"], part) - cut(seen[name], part)).max() < 0.01


def test_nothing_of_the_file_changes(seen: dict[str, Pixels]) -> None:
    assert REPORT["file"] == REPORT["file again"], "saving twice gives the same bytes"
    assert REPORT["file after"] == REPORT["file"]
    before, after = REPORT["undo"]
    assert before == after and not REPORT["dirty"]
    assert REPORT["blocks after"] == REPORT["blocks"]
    assert REPORT["loupe closed"] and REPORT["showing"] == "REFERENCE"
