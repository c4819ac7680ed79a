# SPDX-License-Identifier: GPL-3.0-or-later
"""The report's page in a real browser, from its path on the disk, as score.py wrote it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from chromium import Page

from fmqm_addon.report.html.page import write_page
from tests.blender.script import SMALL, noise, score, write_png, write_torus

pytestmark = [pytest.mark.browser, pytest.mark.once]

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
STRANGE = "<img src=x onerror=alert(1)>&'<-script>.obj"
OPEN_IMAGES = "[...document.images].filter((image) => image.offsetParent)"
ALL_PICTURES = f"Promise.all({OPEN_IMAGES}.map((i) => {{ i.loading = 'eager'; return i.decode(); }}))"
MANY, LEVELS = 1000, 4  # pairs of a large report; of each of its references
STAND = 200  # of many pairs, fewer than these stand in the page
CLICK = 4  # times what laying the table out anew takes, at most: about a tenth of a second


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
    outputs = ("--report", "out", "--json", "out/scores.json")
    (folder / "out").mkdir()
    done = score("ref.obj", "shaken.obj", "cut.glb", STRANGE, *SMALL, "--screen-size", *outputs, cwd=folder)
    assert done.returncode == 1 and "cut.glb" in done.stderr
    return folder / "out" / "index.html"


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        pytest.skip(f"none of {', '.join(PROGRAMS)} is installed")
    with Page(program) as opened:
        yield opened


@pytest.fixture(scope="module")
def many(report: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A thousand pairs: copies of those that were scored, of names of their own."""
    scored = json.loads((report.parent / "scores.json").read_text(encoding="utf-8"))
    records = []
    for number in range(MANY):
        copy = json.loads(json.dumps(scored["pairs"][number % 3]))
        copy["reference"] = f"/assets/{number // LEVELS:03}/prop_{number // LEVELS:03}.glb"
        copy["id"] = copy["distorted"] = f"/assets/{number // LEVELS:03}/prop_{number:04}_lod.glb"
        if copy["FMQM"] is not None:
            copy["FMQM"] *= 1 - number / MANY / 2
        records.append(copy)
    folder = tmp_path_factory.mktemp("large")
    (folder / "pictures").symlink_to(report.parent / "pictures")
    write_page(str(folder), records, scored["settings"], {})
    return folder / "index.html"


def table(page: Page) -> list[str]:
    """The names in the table, from the top."""
    return page.run("[...document.querySelectorAll('.scores tbody a')].map((a) => a.textContent)")


def tiles(page: Page) -> list[str]:
    """The names below the thumbnails, in their order."""
    return page.run("[...document.querySelectorAll('.tile .name')].map((name) => name.textContent)")


def choose(page: Page, order: str) -> None:
    """Of the orders to sort by."""
    page.run(
        f"((select) => {{ select.value = {json.dumps(order)}; select.dispatchEvent(new Event('change')) }})"
        "(document.querySelector('.toolbar select'))"
    )


def search(page: Page, words: str) -> None:
    page.run(
        f"((input) => {{ input.value = {json.dumps(words)}; input.dispatchEvent(new Event('input')) }})"
        "(document.querySelector('.toolbar input'))"
    )


def open_pair(page: Page) -> str:
    """The name on the card that is open; "" for none."""
    return page.run("document.querySelector('.pair h3')?.textContent ?? ''")


def test_pictures_load_and_the_console_stays_empty(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    page.click(".level:first-child .tile")
    page.run(f"{ALL_PICTURES}.then(() => 1)")
    widths = page.run(f"{OPEN_IMAGES}.map((image) => image.naturalWidth)")
    assert len(widths) > 10 and min(widths) > 0
    loaded = page.run("performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert all(name.startswith("file:") for name in loaded)
    assert page.messages == []


def test_names_are_text(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    assert tiles(page) == table(page) == ["shaken.obj", "cut.glb", STRANGE]
    page.click(".level:nth-child(3) .tile")
    assert open_pair(page) == STRANGE
    assert page.run("document.querySelectorAll('img[onerror]').length") == 0 and page.messages == []


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
    choose(page, "FMQM")
    assert tiles(page)[0] == "shaken.obj"
    refused = [message for message in page.messages if "Content Security Policy" in message]
    assert len(refused) >= 4
    page.messages.clear()


def test_a_card_opens_below_its_chain_and_closes(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    assert open_pair(page) == "cut.glb"  # what to look at first, where there is one original
    page.click(".level:first-child .tile")
    assert open_pair(page) == "shaken.obj" and page.run("document.querySelectorAll('.pair').length") == 1
    assert page.run("location.hash") == "#pair-1" and page.run("document.activeElement.id") == "name-1"
    assert page.run("document.querySelectorAll('[aria-expanded=true]').length") == 1
    page.press("Escape")
    assert open_pair(page) == "" and page.run("document.activeElement.getAttribute('href')") == "#pair-1"
    page.press("Enter")
    assert open_pair(page) == "shaken.obj"
    page.click(".pair .close")
    assert open_pair(page) == ""


def test_pictures_open_large_and_arrows_go_on(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    page.click(".level:first-child .tile")
    page.click(".views .zoom")
    shown = "document.querySelector('.lightbox[open] img').src"
    first = page.run(shown)
    assert first.endswith("-reference.jpg")
    page.press("ArrowRight")
    assert page.run(shown) == first.replace("-reference", "-distorted")
    page.press("Escape")
    assert page.run("document.querySelector('.lightbox').open") is False and open_pair(page) == "shaken.obj"


def test_the_table_is_sorted_by_a_click_and_by_a_key(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    page.click("[data-show=table]")
    column = ".scores th:nth-child(2)"
    state = f"document.querySelector('{column}').getAttribute('aria-sort')"
    assert page.run(state) is None
    page.click(f"{column} button")
    assert table(page) == ["shaken.obj", STRANGE, "cut.glb"] and page.run(state) == "ascending"
    arrow = f"getComputedStyle(document.querySelector('{column} button'), '::after').content"
    assert page.run(arrow) == '"↑"'
    page.run(f"document.querySelector('{column} button').focus()")
    page.press("Enter")
    assert table(page) == [STRANGE, "shaken.obj", "cut.glb"] and page.run(state) == "descending"
    assert tiles(page) == table(page)
    page.press("Tab")
    page.press("Enter")  # the next column
    assert table(page) == ["shaken.obj", STRANGE, "cut.glb"] and page.run(state) is None
    page.click(".scores th:first-child button")
    assert table(page) == sorted(table(page), key=str.casefold)
    page.click(".scores tbody tr:last-child a")
    assert open_pair(page) == table(page)[-1] and page.run("document.querySelector('.tile').offsetHeight") > 0


def test_heat_maps_are_not_said_to_be_alike(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    note = "document.querySelector('.of-heat.note').offsetHeight > 0"
    assert page.run(note) is False
    page.click("[data-show=heat]")
    assert page.run(note) is True and page.run("document.querySelector('.level .of-heat').offsetHeight") > 0


def test_filters_and_search(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    page.click("[data-filter=failed]")
    assert tiles(page) == ["cut.glb"] and page.run("document.querySelector('.found').textContent") == "1 of 3"
    search(page, "shaken")
    assert tiles(page) == [] and page.run("document.querySelector('.nothing').offsetHeight") > 0
    page.click("[data-filter=all]")
    assert tiles(page) == table(page) == ["shaken.obj"]
    page.run("location.hash = '#pair-2'; new Promise((done) => addEventListener('hashchange', done, { once: true }))")
    assert open_pair(page) == "cut.glb" and len(tiles(page)) == 3  # a link shows what a filter hides
    assert page.messages == []


def test_a_thousand_pairs_stay_fluid(page: Page, many: Path) -> None:
    """A click costs the page's thread no more than some layouts of the few that stand in it: the best of two."""
    page.open(many, width=1280)
    assert page.run("document.querySelector('h1').textContent") == f"1,000 LODs of {MANY // LEVELS} originals"
    assert 60 <= len(tiles(page)) < STAND
    anew = "const table = document.querySelector('.scores'), all = table.parentNode; table.remove(); all.append(table)"
    clicks = [f"document.querySelector('{selector}').click()" for selector in (
        "[data-filter=failed]", "[data-filter=all]", ".turn", "[data-show=table]", ".scores th:nth-child(3) button",
        "[data-show=heat]", "[data-show=lod]", ".level:nth-child(2) .tile", ".level:nth-child(1) .tile",
    )]  # fmt: skip
    clicks.insert(5, anew)  # where the table is shown
    seconds = {}
    for click in clicks:
        seconds[click] = min(page.seconds(click) for _ in range(2))
        assert len(tiles(page)) < STAND and len(table(page)) < STAND, click
    layout = seconds.pop(anew)
    assert max(seconds.values()) < CLICK * layout, (seconds, layout)
    search(page, "PROP_0042")
    assert tiles(page) == ["prop_0042_lod.glb"]
    search(page, "")
    choose(page, "FMQM")
    for _ in range(50):  # more come as one scrolls; what comes into view may be higher than was guessed
        page.run("scrollTo(0, 1e9)")
        if len(tiles(page)) > 100:
            break
        page.draw()
    else:
        pytest.fail("no more come")
    assert page.messages == []


def test_on_paper_stands_every_pair_that_is_shown(page: Page, report: Path) -> None:
    page.open(report, width=1280)
    for wanted, count in (("all", 3), ("failed", 1)):
        page.click(f"[data-filter={wanted}]")
        page.run("dispatchEvent(new Event('beforeprint'))")
        assert page.run("document.querySelectorAll('.pair').length") == count
        page.run("dispatchEvent(new Event('afterprint'))")
        assert page.run("document.querySelectorAll('.pair').length") == 1


def test_paper_is_white_and_a_pair_takes_a_sheet(page: Page, report: Path) -> None:
    page.open(report, width=1280, dark=True)
    assert page.sheets() <= 4  # the overview, two pairs, and one that was not scored
    page.as_on_paper(dark=True)
    style = "getComputedStyle(document.documentElement).getPropertyValue('--{}')"
    dark = {
        name for name in ("ink", "faint", "accent", "warn", "bad") if brightness(page.run(style.format(name))) > 140
    }
    pale = {name for name in ("paper", "card", "track") if brightness(page.run(style.format(name))) < 200}
    assert not dark | pale


def brightness(color: str) -> float:
    """Of #rgb or #rrggbb, from 0 to 255."""
    digits = color.strip()[1:]
    parts = [int(digit * 2, 16) for digit in digits] if len(digits) == 3 else list(bytes.fromhex(digits))
    return sum(parts) / 3


def test_marks_stay_on_their_pictures_in_a_low_window(page: Page, report: Path) -> None:
    page.open(report, width=1280, height=300)
    page.click(".level:first-child .tile")
    sides = page.run(
        "[...document.querySelectorAll('.views .picture')].map((each) => {"
        "const image = each.querySelector('img'), { width, height } = each.getBoundingClientRect();"
        "return [width, height, image.getAttribute('width') / image.getAttribute('height')] })"
    )
    assert sides and all(width == pytest.approx(ratio * height, abs=1) for width, height, ratio in sides)
    assert all(height <= 0.8 * 300 + 1 for _, height, _ in sides)


def test_nothing_hides_behind_the_toolbar(page: Page, many: Path) -> None:
    """A card's title when it opens, and the table's heads as one scrolls."""
    bottom = "document.querySelector('.toolbar').getBoundingClientRect().bottom"
    top = "document.querySelector('{}').getBoundingClientRect().top"
    for width in (800, 1280):
        page.open(many, width=width)
        page.click(".level:nth-child(2) .tile")
        assert page.run(top.format(".pair h3")) >= page.run(bottom) > 0
    page.click("[data-show=table]")
    page.run("scrollTo(0, 1500)")
    page.draw()
    assert abs(page.run(top.format(".scores th")) - page.run(bottom)) < 2


def test_a_phone_scrolls_only_downwards(page: Page, report: Path, many: Path) -> None:
    page.open(many, width=360)  # also where there is more than is in view
    assert page.run("[document.documentElement.scrollWidth, innerWidth]") == [360, 360]
    page.open(report, width=375)
    page.click(".level:first-child .tile")
    assert page.run("[document.documentElement.scrollWidth, innerWidth]") == [375, 375]
    outside = page.run(
        "[...document.querySelectorAll('img, p, svg, h3, dl')].filter((element) => element.offsetParent)"
        ".filter((element) => element.getBoundingClientRect().right > 375).length"
    )
    assert outside == 0
    assert page.run("parseFloat(getComputedStyle(document.querySelector('figcaption')).fontSize)") >= 12
    page.run("document.querySelectorAll('details').forEach((each) => { each.open = true })")
    heads = "[...document.querySelectorAll('.pair.open details th')].filter((head) => head.textContent === 'Triangles')"
    assert page.run(f"{heads}.map((head) => head.offsetHeight < 40)") == [True]  # a word is not broken; it scrolls


@pytest.mark.parametrize(("width", "dark"), [(1280, False), (1280, True), (375, False)])
def test_everybody_can_read_and_use_it(page: Page, report: Path, width: int, dark: bool) -> None:
    """By axe-core: roles, names, labels, and contrasts of WCAG AA; of the first screen, a card, and the table."""
    page.open(report, width=width, dark=dark)
    page.run(files("axe_core_python").joinpath("axe.min.js").read_text(encoding="utf-8"))
    page.click(".level:first-child .tile")
    page.run("document.querySelectorAll('details').forEach((each) => { each.open = true })")
    assert violations(page) == []
    page.click("[data-show=table]")
    assert violations(page) == []
    paper = page.run("getComputedStyle(document.body).backgroundColor")
    assert (sum(int(part) for part in paper[4:-1].split(",")) < 120) == dark


def violations(page: Page) -> list[Any]:
    found = page.run("axe.run(document).then((found) => JSON.stringify(found.violations))")
    return [
        (each["id"], node["html"][:200], node["failureSummary"]) for each in json.loads(found) for node in each["nodes"]
    ]
