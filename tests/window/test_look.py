# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads pictures of the program's window: is what the add-on shows really on the screen, without any switch?"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.house.test_extension import package  # noqa: F401  the fixture
from tests.window.pictures import Pixels, cut, pictures_in, run_in_window

pytestmark = pytest.mark.program
REPORT: dict[str, object] = {}  # what the script wrote down


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory, package: Path) -> dict[str, Pixels]:  # noqa: F811
    """(H, W, 3) float pictures in [0, 1] of the 3D view and, under "panel", of its sidebar."""
    out = tmp_path_factory.mktemp("pictures")
    run_in_window("look_script.py", package, out, "--enable-event-simulate")
    regions = json.loads((out / "regions.json").read_text())
    REPORT.update(json.loads((out / "report.json").read_text()))
    found = {}
    for name, whole in pictures_in(out).items():
        found[name] = cut(whole, regions["WINDOW"], regions["UI"][2])
        found["panel"] = cut(whole, regions["UI"])
    return found


def center(picture: Pixels) -> Pixels:
    """Without the toolbar, the legend and what lies along the edges."""
    height, width, _ = picture.shape
    return picture[int(0.12 * height) : int(0.9 * height), int(0.25 * width) :]


def count(picture: Pixels, color: tuple[float, float, float], tolerance: float = 0.12) -> int:
    """Pixels of about the same chromaticity as a color; shade takes all channels down alike."""
    bright = picture.max(axis=2) > 0.25
    scaled = picture / np.maximum(picture.max(axis=2, keepdims=True), 1e-6)
    wanted = np.array(color) / max(color)
    return int((bright & (np.abs(scaled - wanted).max(axis=2) < tolerance)).sum())


def saturated(picture: Pixels) -> int:
    return int((picture.max(axis=2) - picture.min(axis=2) > 0.25).sum())


def test_measuring_paints(pictures: dict[str, Pixels]) -> None:
    """The original and the LOD are painted, and nothing else changes: the cube in the picture is as it was."""
    before, shown = pictures["before"], pictures["look"]
    assert saturated(center(shown)) > saturated(center(before)) + 5_000
    left, low, right, high = REPORT["cube"]  # type: ignore[misc]
    height = len(before)
    cube = (slice(height - high + 3, height - low - 3), slice(left + 3, right - 3))
    assert before[cube].size > 3 * 50 * 50 and np.abs(before[cube] - shown[cube]).max() < 0.01


def test_nothing_of_it_gets_anywhere(pictures: dict[str, Pixels]) -> None:
    """Into the file, an export, a render, or the selection."""
    assert REPORT["blocks shown"] == REPORT["blocks"]
    assert abs(REPORT["size shown"] - REPORT["size"]) < 1000  # type: ignore[operator]
    assert REPORT["show"] == "SURFACE"
    assert REPORT["rendered shown"] == REPORT["rendered"]
    assert sorted(REPORT["exported"]) == ["Cube", "Monkey_LOD0", "Monkey_LOD1"]  # type: ignore[call-overload]
    assert {"Monkey_LOD0", "Monkey_LOD1"} <= set(REPORT["picked"]) <= set(REPORT["not ours"])  # type: ignore[call-overload]


@pytest.mark.parametrize("name", ["xray", "overlays off"])
def test_gone_in_xray_and_without_overlays(pictures: dict[str, Pixels], name: str) -> None:
    assert saturated(center(pictures[name])) < 1000 + saturated(center(pictures["before"]))


def test_an_end_of_the_legend_is_dragged_by_the_mouse(pictures: dict[str, Pixels]) -> None:
    low, high = REPORT["ends"]  # type: ignore[misc]
    assert REPORT["ends dragged"] == pytest.approx([(low + high) / 2, high], abs=0.02 * (high - low))
    assert REPORT["range"] == "CUSTOM"


def test_the_slice_is_drawn_and_dragged_by_its_arrow(pictures: dict[str, Pixels]) -> None:
    """At its front end it stands before both; the file has nothing of it."""
    assert REPORT["blocks slice"] == REPORT["blocks"] and 5 < REPORT["offset"] < 95  # type: ignore[operator]
    changed = np.abs(center(pictures["slice"]) - center(pictures["look"])).max(axis=2) > 0.1
    assert changed.mean() > 0.05


def test_the_probe_tells_what_is_under_the_mouse(pictures: dict[str, Pixels]) -> None:
    lines = REPORT["hint"]
    assert isinstance(lines, list) and len(lines) == 6
    assert lines[0].startswith("LOD, patch ") and all(0 <= float(line.split()[-1]) <= 1 for line in lines[1:])


def test_clear_puts_the_view_back(pictures: dict[str, Pixels]) -> None:
    assert REPORT["place after"] == pytest.approx(REPORT["place before"], abs=1e-5)


def test_points_show_in_solid_shading(pictures: dict[str, Pixels]) -> None:
    from fmqm_addon.report.visual.colormap import score_colors

    before, shown = center(pictures["before"]), center(pictures["points"])
    assert saturated(shown) > saturated(before) + 5_000
    hot, dark = score_colors(np.array([0.12, 0.75]))
    for color in (hot, dark):
        assert count(shown, tuple(color)) > count(before, tuple(color)) + 100, color


def test_legend_shows(pictures: dict[str, Pixels]) -> None:
    height, width, _ = pictures["look"].shape
    corner = (slice(int(0.6 * height), height), slice(0, int(0.2 * width)))
    assert saturated(pictures["look"][corner]) > saturated(pictures["before"][corner]) + 500


def test_another_layer_looks_different(pictures: dict[str, Pixels]) -> None:
    changed = np.abs(center(pictures["points"]) - center(pictures["layer"])).max(axis=2) > 0.1
    assert changed.mean() > 0.03


def test_worst_place_is_framed_alone(pictures: dict[str, Pixels]) -> None:
    changed = np.abs(center(pictures["layer"]) - center(pictures["worst"])).max(axis=2) > 0.1
    assert changed.mean() > 0.1


def test_clear_leaves_nothing(pictures: dict[str, Pixels]) -> None:
    assert saturated(center(pictures["cleared"])) < 1000 + saturated(center(pictures["before"]))
    height, width, _ = pictures["cleared"].shape
    corner = (slice(int(0.6 * height), height), slice(int(0.05 * width), int(0.2 * width)))
    assert saturated(pictures["cleared"][corner]) < 200


def test_panel_is_not_empty(pictures: dict[str, Pixels]) -> None:
    lines = np.abs(np.diff(pictures["panel"].mean(axis=2), axis=1)) > 0.1
    assert lines.any(axis=1).mean() > 0.3  # rows with text or edges


def test_measured_by_the_modal_operator(pictures: dict[str, Pixels]) -> None:
    """From the installed zip; what Clear leaves is what there was before."""
    assert REPORT["modal"] is True
    (row,) = REPORT["rows"]  # type: ignore[misc]
    name, scores, error = row
    assert (name, error) == ("Monkey_LOD1", "") and 0 < scores[-1] < 1
    assert REPORT["blocks after"] == REPORT["blocks"]
    print(f"longest tick {REPORT['longest tick']:.3f} s")
