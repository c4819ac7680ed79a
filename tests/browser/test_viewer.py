# SPDX-License-Identifier: GPL-3.0-or-later
"""The report's viewer in a real browser with software WebGL, from its path on the disk."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import Page
from PIL import Image

from fmqm_addon.report.visual.colormap import score_colors
from tests.blender.script import SMALL, score, write_png, write_torus

pytestmark = [pytest.mark.browser, pytest.mark.once]

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
SOFTWARE_GL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NO_GL = ("--disable-3d-apis",)
GREEN, BLUE = (40, 160, 90), (60, 90, 200)  # the original's color and the LOD's
BACKGROUND = (236, 237, 239)
OPEN = """(async () => {
  document.querySelectorAll(".viewer-open")[0].click();
  while (!document.querySelector(".viewer-shown")) {
    await new Promise((done) => setTimeout(done, 50));
    if (/cannot/.test(document.querySelector(".viewer-said").textContent)) break;
  }
  document.querySelector(".viewer").scrollIntoView();
})()"""
CHOOSE = """(() => {
  const named = [...document.querySelectorAll(".viewer-body label")].find((each) => each.textContent.startsWith(%s));
  const chosen = named.querySelector("select, input");
  if (chosen.type === "checkbox") chosen.checked = %s; else chosen.value = %s;
  chosen.dispatchEvent(new Event("change"));
})()"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A green original and a blue LOD that is shaken."""
    folder = tmp_path_factory.mktemp("assets")
    for name, color, shake in (("ref", GREEN, 0.0), ("lod", BLUE, 0.03)):
        write_png(folder / f"{name}.png", np.tile(np.array(color, np.uint8), (8, 8, 1)))
        write_torus(folder, name, f"{name}.png", shake=shake)
    done = score("ref.obj", "lod.obj", *SMALL, "--report", "out", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "out" / "index.html"


@pytest.fixture(scope="module")
def program() -> str:
    found = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if found is None:
        pytest.skip(f"none of {', '.join(PROGRAMS)} is installed")
    return found


@pytest.fixture(scope="module")
def page(program: str) -> Iterator[Page]:
    with Page(program, *SOFTWARE_GL) as opened:
        yield opened


def show(page: Page, report: Path, width: int = 1280, dark: bool = False, **choices: object) -> None:
    """The pair's viewer; without pins, which would hide pixels, unless they are chosen."""
    page.open(report, width, 900, dark)
    page.run(OPEN)
    for label, value in ({"Pins": False} | {name.replace("_", " "): value for name, value in choices.items()}).items():
        choose(page, label, value)


def choose(page: Page, label: str, value: object) -> None:
    text = json.dumps(value)
    page.run(CHOOSE % (json.dumps(label), text, text))


def pixels(page: Page, selector: str = ".viewer-stage") -> np.ndarray:
    """(H, W, 3) int of an element, once it is drawn."""
    page.draw()
    return np.asarray(Image.open(io.BytesIO(page.picture_of(selector))).convert("RGB")).astype(int)


def landed(page: Page) -> np.ndarray:
    """The stage, once nothing moves on it any more."""
    last = pixels(page)
    while True:
        page.run("new Promise((done) => setTimeout(done, 150))")
        now = pixels(page)
        if np.array_equal(now, last):
            return now
        last = now


def pane(page: Page, number: int) -> np.ndarray:
    return pixels(page, f".viewer-pane:nth-child({number})")


def drawn(image: np.ndarray) -> np.ndarray:
    """(H, W) where something stands before the background."""
    return np.abs(image - BACKGROUND).max(axis=2) > 6


def share_of(image: np.ndarray, color: tuple[int, int, int]) -> float:
    """Of all that is drawn: how much has this color."""
    return float((np.abs(image - color).max(axis=2) <= 2).sum() / drawn(image).sum())


def level_of(report: Path) -> dict[str, Any]:
    """What the viewer is given of the LOD."""
    (path,) = (report.parent / "viewer").glob("lod-*.js")
    text = path.read_text(encoding="utf-8")
    return json.loads(text[text.index("{") : text.rindex("}") + 1])


def test_three_panes_show_the_colors_that_were_measured(page: Page, report: Path) -> None:
    show(page, report, Light="Unlit")
    original, lod, heat = (pane(page, number) for number in (1, 2, 3))
    assert share_of(original, GREEN) > 0.8 and share_of(lod, BLUE) > 0.8 and share_of(heat, GREEN) < 0.05
    one, other, painted = (drawn(image)[40:].sum() for image in (original, lod, heat))
    assert 0.9 < one / other < 1.1 and 0.95 < one / painted < 1.05  # from one camera
    choose(page, "Light", "Headlight")
    lit = pane(page, 1)
    assert share_of(lit, GREEN) < 0.3 and (lit.astype(float) / np.maximum(lit.max(axis=2, keepdims=True), 1)).std() > 0
    assert page.messages == []
    loaded = page.run("performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert all(name.startswith(("file:", "data:image/")) for name in loaded)


def test_it_turns_by_mouse_and_keys_and_back(page: Page, report: Path) -> None:
    show(page, report)
    first = pixels(page)
    page.drag(".viewer-stage", 90, 30)
    dragged = pixels(page)
    assert (np.abs(dragged - first) > 20).mean() > 0.01
    assert page.run("document.activeElement.className") == "viewer-stage"
    page.press("ArrowLeft")
    turned = pixels(page)
    assert (np.abs(turned - dragged) > 20).mean() > 0.01
    page.wheel(".viewer-stage", -400)
    assert drawn(pixels(page)).mean() > 1.1 * drawn(turned).mean()  # nearer
    page.run("document.querySelector('.viewer-choices button').click()")
    inside = (slice(10, -10), slice(10, -10))  # the outline shows what has the focus
    assert (np.abs(landed(page) - first)[inside] > 20).mean() < 0.001
    assert page.messages == []


def test_a_wipe_shows_both(page: Page, report: Path) -> None:
    show(page, report, View="Wipe", Light="Unlit")
    both = pixels(page)
    half = both.shape[1] // 2
    assert share_of(both[:, : half - 20], GREEN) > 0.9 and share_of(both[:, half + 20 :], BLUE) > 0.8
    found = "const slider = document.querySelector('.viewer-slider')"
    slide = f"(() => {{{{ {found}; slider.value = {{}}; slider.dispatchEvent(new Event('input')) }}}})()"
    page.run(slide.format(100))
    assert share_of(pixels(page), BLUE) == 0
    page.run(slide.format(0))
    assert share_of(pixels(page), GREEN) == 0
    page.run(slide.format(50))
    page.drag(".viewer-handle", -200, 0)
    moved = pixels(page)
    assert share_of(moved, BLUE) > share_of(both, BLUE) + 0.05
    choose(page, "Right", 2)
    assert share_of(pixels(page), BLUE) == 0
    assert page.run("[...document.querySelectorAll('.viewer-title')].map((each) => each.textContent)") == [
        "Original", "Heat Map on Original",
    ]  # fmt: skip
    assert page.messages == []


def test_every_heat_map_paints_otherwise(page: Page, report: Path) -> None:
    show(page, report)
    named = "[...document.querySelectorAll('.viewer-body label')].find((l) => l.textContent.startsWith('Heat Map'))"
    layers = page.run(f"[...{named}.querySelectorAll('option')].map((option) => [option.value, option.textContent])")
    assert [label for _, label in layers] == [
        "FMQM", "geoSSIM", "geoGraSSIM", "colorSSIM", "colorGraSSIM", "Perceived", "Shape", "Facing", "Color", "Detail",
        "Color Difference", "Distance Difference",
    ]  # fmt: skip
    seen: list[np.ndarray] = []
    for name, label in layers:
        choose(page, "Heat Map", name)
        image = pane(page, 3)
        assert page.run("document.querySelector('.viewer-legend').textContent").startswith(label)
        if all((np.abs(image - other) > 4).any() for other in seen):
            seen.append(image)
    assert len(seen) >= 8  # some features of plain colors are 1 everywhere
    high = level_of(report)["heat"]["layers"][-1]["high"]
    legend = page.run("document.querySelector('.viewer-legend').textContent")
    assert legend == f"Distance Difference0{high:.3g} scene units"
    on_original = drawn(seen[-1])
    choose(page, "Show On", 1)
    assert (drawn(pane(page, 3)) != on_original)[40:].sum() > 20  # the LOD's outline
    assert page.messages == []


def test_pins_and_their_buttons_fly_to_the_worst_places(page: Page, report: Path) -> None:
    show(page, report, View="Wipe", Pins=True)
    before = pixels(page)
    count = page.run("document.querySelectorAll('.viewer-places button').length")
    assert count == page.run("document.querySelectorAll('.viewer-pin').length") > 2
    page.run("document.querySelector('.viewer-places li:nth-child(2) button').click()")
    assert (np.abs(landed(page) - before) > 20).mean() > 0.05
    place = """(() => {
      const stage = document.querySelector(".viewer-stage").getBoundingClientRect();
      const pin = [...document.querySelectorAll(".viewer-pin")].find((each) => each.textContent === "%d");
      const at = pin.getBoundingClientRect();
      return [(at.x + at.width / 2 - stage.x) / stage.width, (at.y + at.height / 2 - stage.y) / stage.height];
    })()"""
    assert page.run(place % 2) == pytest.approx([0.5, 0.5], abs=0.2)
    page.run("[...document.querySelectorAll('.viewer-pin')].find((each) => each.textContent === '1').click()")
    landed(page)
    x, y = page.run(place % 1)
    assert [x, y] == pytest.approx([0.5, 0.5], abs=0.2)
    for label, value in (("Pins", False), ("Light", "Unlit"), ("Left", 2), ("Right", 2)):
        choose(page, label, value)
    page.run("document.querySelector('.viewer-handle').hidden = true")
    image = pixels(page)
    found = image[int(y * image.shape[0]), int(x * image.shape[1])] / 255
    heat = level_of(report)["heat"]
    layer = next(layer for layer in heat["layers"] if layer["name"] == "FMQM")
    share = (heat["worst"][0]["score"] - layer["low"]) / (layer["high"] - layer["low"])
    assert found == pytest.approx(score_colors(np.array([share]))[0], abs=0.03)  # what the patch there has
    assert page.messages == []


def test_wireframe_draws_edges(page: Page, report: Path) -> None:
    show(page, report, Light="Unlit")
    plain = pane(page, 1)
    choose(page, "Wireframe", True)
    wired = pane(page, 1)
    changed = (np.abs(wired - plain) > 10).any(axis=2)
    assert 0.05 < changed.sum() / drawn(plain).sum() < 0.8
    assert page.messages == []


def test_closed_and_opened_again(page: Page, report: Path) -> None:
    show(page, report)
    page.run("[...document.querySelectorAll('.viewer-choices button')].find((b) => b.textContent === 'Close').click()")
    assert page.run("document.querySelectorAll('canvas').length") == 0
    assert page.run("document.activeElement.className") == "viewer-open"
    page.press("Enter")
    page.run(OPEN)
    assert drawn(pane(page, 1)).mean() > 0.05
    assert page.messages == []


@pytest.mark.parametrize("dark", [False, True])
def test_a_phone_has_the_wipe_first_and_all_in_its_width(page: Page, report: Path, dark: bool) -> None:
    show(page, report, width=375, dark=dark)
    assert page.run("document.querySelectorAll('.viewer-wiping').length") == 1
    outside = (
        "[...document.querySelectorAll('.viewer *')].filter((e) => e.getBoundingClientRect().right > 375.5).length"
    )
    for layout in ("Wipe", "Side by Side"):
        choose(page, "View", layout)
        page.draw()
        assert page.run("document.documentElement.scrollWidth") == 375 and page.run(outside) == 0
    colors = "getComputedStyle(document.querySelector('.viewer-stage')).backgroundColor"
    assert (sum(map(int, re.findall(r"\d+", page.run(colors))[:3])) < 300) == dark
    before = pixels(page)
    page.swipe(".viewer-stage", 60, 20)
    assert (np.abs(pixels(page) - before) > 20).mean() > 0.01
    assert page.messages == []


def test_without_webgl_the_pictures_stay(program: str, report: Path) -> None:
    with Page(program, *NO_GL) as page:
        page.open(report, width=1280)
        page.run(OPEN)
        assert "the pictures show the same" in page.run("document.querySelector('.viewer-said').textContent")
        loading = (
            "Promise.all([...document.querySelectorAll('img[src]')].map((i) => "
            "{ i.loading = 'eager'; return i.decode(); })).then(() => 1)"
        )
        assert page.run(loading) == 1 and page.run("document.images.length") >= 3
        assert page.run("document.querySelectorAll('canvas').length") == 0
        assert page.messages == []
