# SPDX-License-Identifier: GPL-3.0-or-later
"""The report's page in a real browser, from its path on the disk, as score.py wrote it."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from chromium import Page

from tests.blender.script import SMALL, noise, score, write_png, write_torus

pytestmark = [pytest.mark.browser, pytest.mark.once]

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
STRANGE = "<img src=x onerror=alert(1)>&'.obj"
ALL_PICTURES = "Promise.all([...document.images].map((i) => { i.loading = 'eager'; return i.decode(); }))"
CONTRAST = 4.5  # WCAG AA for text


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two levels of one reference, one of another with a name like HTML, and one that cannot be read."""
    folder = tmp_path_factory.mktemp("assets")
    write_png(folder / "a.png", noise(seed=1))
    write_png(folder / "b.png", noise(8, seed=2))
    write_torus(folder, "ref", "a.png")
    write_torus(folder, "shaken", "b.png", shake=0.03)
    shutil.copy(write_torus(folder, "near", "a.png", shake=0.004), folder / STRANGE)
    (folder / "cut.glb").write_bytes(b"glTF\2\0\0\0\xff\xff\0\0")
    done = score("ref.obj", "shaken.obj", "cut.glb", STRANGE, *SMALL, "--report", "out", cwd=folder)
    assert done.returncode == 1 and "cut.glb" in done.stderr
    return folder / "out" / "index.html"


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        pytest.skip(f"none of {', '.join(PROGRAMS)} is installed")
    with Page(program) as opened:
        yield opened


def rows(page: Page) -> list[str]:
    """The names in the table, from the top."""
    return page.run("[...document.querySelectorAll('.scores tbody a')].map((a) => a.textContent)")


def test_pictures_load_and_the_console_stays_empty(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    page.run(f"{ALL_PICTURES}.then(() => 1)")
    widths = page.run("[...document.images].map((image) => image.naturalWidth)")
    assert len(widths) == 2 * 9 and min(widths) > 0
    loaded = page.run("performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert all(name.startswith("file:") for name in loaded)
    assert page.messages == []


def test_names_are_text(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    assert rows(page) == ["shaken.obj", "cut.glb", STRANGE]
    assert page.run("document.querySelectorAll('img[onerror]').length") == 0


def test_only_the_pages_own_script_runs(page: Page, report: Path) -> None:
    """Should something slip through all escaping, the page's policy keeps it from running, and the table sorts."""
    hostile = (
        "<script>window.ran = 1</script><img src=x onerror='window.ran = 2'><a href='javascript:window.ran = 3'>x</a>"
        "<svg onload='window.ran = 4'></svg><script src='data:text/javascript,window.ran=5'></script>"
        "<base href='https://example.invalid/'><iframe srcdoc='<script>parent.ran = 6</script>'></iframe>"
    )
    changed = report.with_name("hostile.html")
    changed.write_text(report.read_text(encoding="utf-8").replace("<main>", f"<main>{hostile}", 1), encoding="utf-8")
    page.open(changed, width=1280)
    page.run("document.querySelector('a[href^=javascript]').click()")
    page.run("new Promise((done) => setTimeout(done, 300))")
    assert page.run("typeof window.ran") == "undefined"
    assert page.run("document.baseURI").startswith("file:")
    page.click(".scores th:nth-child(2) button")
    assert rows(page)[0] == "shaken.obj" and page.run("document.querySelectorAll('[aria-sort]').length") == 1
    refused = [message for message in page.messages if "Content Security Policy" in message]
    assert len(refused) >= 4
    page.messages.clear()


def test_the_table_is_sorted_by_a_click_and_by_a_key(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    column = ".scores th:nth-child(2)"
    state = f"document.querySelector('{column}').getAttribute('aria-sort')"
    assert page.run(state) is None
    page.click(f"{column} button")
    assert rows(page) == ["shaken.obj", STRANGE, "cut.glb"] and page.run(state) == "ascending"
    page.run(f"document.querySelector('{column} button').focus()")
    page.press("Enter")
    assert rows(page) == [STRANGE, "shaken.obj", "cut.glb"] and page.run(state) == "descending"
    page.press("Tab")
    page.press("Enter")  # the next column
    assert rows(page) == ["shaken.obj", STRANGE, "cut.glb"] and page.run(state) is None
    page.click(".scores th:first-child button")
    assert rows(page) == sorted(rows(page), key=str.casefold)


def test_a_phone_scrolls_only_downwards(page: Page, report: Path) -> None:
    page.open(report, width=375)
    assert page.run("[document.documentElement.scrollWidth, innerWidth]") == [375, 375]
    outside = page.run(
        "[...document.querySelectorAll('img, p, svg, h3, dl')]"
        ".filter((element) => element.getBoundingClientRect().right > 375).length"
    )
    assert outside == 0
    assert page.run("parseFloat(getComputedStyle(document.querySelector('figcaption')).fontSize)") >= 12


@pytest.mark.parametrize("dark", [False, True])
def test_text_can_be_read_in_light_and_dark(page: Page, report: Path, dark: bool) -> None:
    page.open(report, width=1280, dark=dark)
    paper = color(page, "body", "backgroundColor")
    assert (luminance(paper) < 0.1) == dark
    card = color(page, ".card", "backgroundColor")
    for selector in ("h1", "p.faint", "figcaption", ".bad", "svg text"):
        ink = color(page, selector, "fill" if selector == "svg text" else "color")
        for behind in (paper, card):
            light, deep = sorted((luminance(ink), luminance(behind)), reverse=True)
            assert (light + 0.05) / (deep + 0.05) >= CONTRAST, selector


def color(page: Page, selector: str, name: str) -> np.ndarray:
    text = page.run(f"getComputedStyle(document.querySelector({selector!r})).{name}")
    return np.array([int(number) for number in re.findall(r"\d+", text)[:3]]) / 255


def luminance(encoded: np.ndarray) -> float:
    """Relative luminance of sRGB, as WCAG has it."""
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return float(linear @ (0.2126, 0.7152, 0.0722))
