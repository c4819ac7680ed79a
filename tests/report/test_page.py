# SPDX-License-Identifier: GPL-3.0-or-later
"""The report's page and the pictures on it: what they show, and that no name can break them."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import sys
from collections.abc import Mapping
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.comparison.judge import Judge
from fmqm_addon.metric.errors import FileError, FMQMError
from fmqm_addon.metric.surface import MeshArrays, Surface, prepare_surface
from fmqm_addon.metric.texture import Material, PlainColor, Texture
from fmqm_addon.report import render as rendering
from fmqm_addon.report.criteria import ANYTHING, Criteria
from fmqm_addon.report.heat import FRONT, side_of_loss
from fmqm_addon.report.html import pictures as pair_pictures
from fmqm_addon.report.html.chain_curve import Level, curve_svg
from fmqm_addon.report.html.page import page_parts, write_page
from fmqm_addon.report.html.pictures import open_report_folder, picture_stem, write_pair_pictures
from fmqm_addon.report.render import Camera, is_seen, render
from fmqm_addon.report.texture_memory import texture_bytes
from tests.blender.script import COLUMNS, SMALL, noise, score, write_png, write_torus
from tests.readings import numbers

from .test_render import FEW, RED, compared, hue

HOSTILE = "<script>alert(1)</script>&\"'\u202e.glb"
SETTINGS = {"samples": 2000, "scored_patches": None, "centers": "fps"}
VERSIONS = {"fmqm_version": "0.1.0", "blender_version": "5.2.3"}
SVG = "{http://www.w3.org/2000/svg}"


def record(distorted: str = "lod.glb", score: float | None = 0.5, **others: Any) -> dict[str, Any]:
    """A pair as JSON has it."""
    pair = {"id": distorted, "reference": "ref.glb", "distorted": distorted, **numbers(score), "stderr": None}
    return (
        pair
        | {
            **ANYTHING.record_fields(),
            "warnings": [],
            "impairment": None,
            "parts": [],
            "patches": 250,
            "notes": [],
            "error": None if score is not None else "it cannot be read",
        }
        | others
    )


def costs(triangles: int, texture_bytes: int) -> dict[str, Any]:
    """What pictures say of a pair, without close-ups."""
    names = {name: f"pictures/{name}.jpg" for name in ("reference", "distorted", "heat")}
    return {
        "views": [{"name": "front", "size": [40, 30], **names}],
        "thumbnails": names,
        "range": [0.5, 1.0],
        "histogram": [1, 0, 3],
        "triangles": [1000, triangles],
        "texture_bytes": [1 << 22, texture_bytes],
        "judge": "fmqm",
        "has_gaps": False,
        "worst": [],
    }


class Page(HTMLParser):
    """The page's elements and its visible text."""

    def __init__(self, *records: Mapping[str, Any]) -> None:
        super().__init__()
        self.html = "".join(page_parts(records, SETTINGS, VERSIONS))
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text = ""
        self._inside: list[str] = []
        self.feed(self.html)
        assert not self._inside

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attributes)))
        if tag not in {"meta", "link", "img", "br", "wbr", "input"}:
            self._inside.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self._inside.pop() == tag

    def handle_data(self, text: str) -> None:
        if self._inside and self._inside[-1] not in {"script", "style"}:
            self.text += text

    def count(self, tag: str) -> int:
        return sum(tag == name for name, _ in self.tags)


# Pictures


def test_pictures_of_a_pair(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    reference, distorted, result = compared(8, FEW)
    open_report_folder(str(tmp_path))
    side = side_of_loss(reference, result, Judge.FMQM)
    made = write_pair_pictures(str(tmp_path), "pair", reference, distorted, result, Judge.FMQM, side)
    assert json.loads(json.dumps(made, allow_nan=False)) == json.loads(json.dumps(made))
    assert made["triangles"] == [128, 2] and made["texture_bytes"] == [16, 16]
    worst = [patch["FMQM"] for patch in made["worst"]]
    assert worst == np.sort(result.patch_scores[:, 4])[:3].tolist()
    assert made["views"][-1]["name"] == "front" and sum(made["histogram"]) == len(result.patches)
    sizes = {view[kind]: tuple(view["size"]) for view in made["views"] for kind in pair_pictures.KINDS}
    assert all(max(size) == pair_pictures.LONG_SIDE for size in sizes.values())
    sizes |= dict.fromkeys(made["thumbnails"].values(), (pair_pictures.THUMBNAIL,) * 2)
    sizes |= {patch[name]: (pair_pictures.CLOSE_UP,) * 2 for patch in made["worst"] for name in pair_pictures.MESHES}
    files = sorted(pair_pictures.picture_files(made))
    assert files == sorted(sizes) == sorted(f"pictures/{path.name}" for path in (tmp_path / "pictures").iterdir())
    for name, size in sizes.items():
        with image.open(tmp_path / name) as decoded:
            assert decoded.format == "JPEG" and (
                max(decoded.size) == max(size) if "thumb" in name else decoded.size == size
            )
            assert (np.abs(np.asarray(decoded).astype(int) - rendering.BACKGROUND) > 40).any()
    for patch in made["worst"]:  # all of the wall is seen
        assert all(0 < share < 1 for place in patch["at"] for share in place)
        assert patch["place"] and patch["object"] is None


def test_equal_surfaces_have_no_worst_patches(tmp_path: Path) -> None:
    pytest.importorskip("PIL.Image")
    reference, _, result = compared(8, FEW)
    open_report_folder(str(tmp_path))
    same = np.ones_like(result.patch_scores)
    made = write_pair_pictures(
        str(tmp_path), "pair", reference, reference, replace(result, patch_scores=same), Judge.FMQM, FRONT
    )
    assert made["worst"] == []
    assert "None: every patch is like the original" in Page(record(score=1.0, pictures=made)).text


def two_walls(gap: float) -> Surface:
    """A red wall at y = 0, and before it, nearer to the front by the gap, a blue one."""
    line = np.array([(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)], float)
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    mesh = MeshArrays(
        name="walls",
        positions=np.concatenate([line, line - (0, gap, 0)]),
        triangles=np.concatenate([faces, faces + 4]),
        corners=np.zeros((4, 3, 2)),
        material=np.array([0, 0, 1, 1]),
        materials=(Material("red", PlainColor((0.8, 0.1, 0.1))), Material("blue", PlainColor((0.1, 0.1, 0.8)))),
    )
    return prepare_surface(mesh, BVHQuery)


def test_a_close_up_looks_past_what_stands_in_the_way() -> None:
    surface = two_walls(gap=1.0)
    center = surface.frame.enter(np.array([0.5, 0.0, 0.5]))
    towards = np.array([0.0, -1.0, 0.0])
    camera = Camera.facing(center, towards, 0.2)
    assert camera.place_of(center) == pytest.approx((0.5, 0.5))
    assert camera.axes @ camera.axes.T == pytest.approx(np.eye(3)) and camera.axes[1, 2] == pytest.approx(1)
    image = render(surface, camera, (20, 20))
    assert hue(image[10, 10]) == pytest.approx(hue(np.array(RED)), abs=0.1)
    edge = center + 0.1 * camera.axes[0] + 0.05 * camera.axes[1]
    assert camera.place_of(edge) == pytest.approx((1.0, 0.25))
    assert Camera.facing(center, np.zeros(3), 0.2).axes == pytest.approx(Camera.framing(surface).axes)


def test_what_is_hidden_gets_no_mark() -> None:
    surface = two_walls(gap=1.0)
    camera = Camera.framing(surface, azimuth=0.0, elevation=0.0)
    assert not is_seen(surface, camera, surface.frame.enter(np.array([0.5, 0.0, 0.5])))
    assert is_seen(surface, camera, surface.frame.enter(np.array([0.5, -1.0, 0.5])))


def test_texture_memory_counts_an_image_once() -> None:
    pixels = np.zeros((4, 8, 3), np.uint8)
    surface = compared(1, FEW)[0]
    shared = tuple(Material(name, Texture(pixels, extension="clip")) for name in "ab")
    assert texture_bytes(replace(surface, materials=shared)) == 4 * 8 * 4
    assert texture_bytes(replace(surface, materials=(Material("plain", PlainColor((1, 1, 1))),))) == 0


def test_stems_are_safe_and_their_own() -> None:
    stems = [picture_stem("ref.glb", HOSTILE), picture_stem("other.glb", HOSTILE), picture_stem("..", "../../etc"), ""]
    assert len(set(stems)) == 4
    assert all(re.fullmatch(r"[A-Za-z0-9-]+", stem) for stem in stems[:3])
    assert picture_stem("a", "b.glb") == picture_stem("a", "b.glb") and picture_stem("a", "b.glb").startswith("b-")


def test_a_folder_that_cannot_be_is_one_line(tmp_path: Path) -> None:
    pytest.importorskip("PIL.Image")
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="cannot be made") as caught:
        open_report_folder(str(tmp_path / "file"))
    assert "\n" not in str(caught.value)


def test_missing_pillow_is_said_before_any_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("PIL", "PIL.Image"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(FMQMError, match="pictures need Pillow"):
        open_report_folder(str(tmp_path / "report"))
    assert not list(tmp_path.iterdir())


# The page


def test_names_from_strangers_stay_text() -> None:
    fact = {"value": HOSTILE, "unit": HOSTILE}
    image = {"role": HOSTILE, "name": HOSTILE, "path": HOSTILE, "missing": True}
    meshes = {group: {HOSTILE: fact, "images": {"value": [image], "unit": ""}} for group in ("reference", "distorted")}
    trust = {**meshes, "pair": {HOSTILE: fact}}
    shown = Page(
        record(HOSTILE, reference=HOSTILE, warnings=[HOSTILE], trust=trust, pictures=costs(10, 1 << 20)),
        record(HOSTILE, score=None, id=HOSTILE * 2, reference=HOSTILE, error=HOSTILE),
        record("b.glb", 0.2, reference=HOSTILE, pictures=costs(20, 1 << 20)),
    )
    harmless = Page(
        record("x/a", reference="r", warnings=["w"], trust=json.loads(json.dumps(trust).replace("<script>", "")),
               pictures=costs(10, 1 << 20)),
        record("x/a", score=None, id="aa", reference="r", error="e"),
        record("b.glb", 0.2, reference="r", pictures=costs(20, 1 << 20)),
    )  # fmt: skip
    tags, wanted = ([tag for tag, _ in page.tags if tag != "wbr"] for page in (shown, harmless))
    assert tags == wanted
    assert shown.count("script") == 1 and shown.text.count(HOSTILE) > 10
    assert "<script>alert" not in shown.html


def test_numbers_from_strangers_stay_text() -> None:
    """Where they are not checked before, as merging does."""
    pictures = costs(10, 1 << 20)
    pictures["views"][0]["size"] = ['4" onload="alert(1)', '"><script>alert(1)</script>']
    for shown in (Page(record(pictures=pictures)),):
        assert shown.count("script") == 1 and "<script>alert" not in shown.html
        assert not any(name.startswith("on") for _, attributes in shown.tags for name in attributes)


def test_the_policy_names_the_pages_own_script_alone() -> None:
    html = Page(record()).html
    (policy,) = re.findall(r'Content-Security-Policy" content="([^"]*)"', html)
    (script,) = re.findall(r"<script>(.*?)</script>", html, re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy and policy.startswith("default-src 'none'; base-uri 'none'")
    assert "onclick" not in html


def test_pairs_are_told_apart_by_their_names() -> None:
    """By the last parts of their paths, as few as it takes."""

    def names(*paths: str) -> list[str | None]:
        page = Page(*map(record, paths))
        return [attributes["data-value"] for tag, attributes in page.tags if tag == "th" and "data-value" in attributes]

    assert names("../lods/two//mesh.obj", "../lods/rock.obj") == ["mesh.obj", "rock.obj"]
    paths = ("../lods/one/mesh.obj", "../lods/two//mesh.obj", "../lods/rock.obj")
    assert names(*paths) == ["one/mesh.obj", "two/mesh.obj", "rock.obj"]
    assert names("/a/mesh.obj", "b/mesh.obj") == ["/a/mesh.obj", "b/mesh.obj"]


def test_every_pair_is_on_the_page() -> None:
    page = Page(record("good.glb", 0.875), record("bad.glb", None, error="bad.glb: is broken; repair it"))
    assert "2 LODs of ref.glb" in page.text and "Lowest FMQM 0.8750: good.glb. 1 not scored." in page.text
    assert page.count("article") == 2 and page.count("tr") == 3
    assert page.text.count("Not scored: bad.glb: is broken; repair it") == 2  # to be looked at first, and on its card
    assert page.count("svg") == 0
    for name, value in (("scored patches", "all"), ("samples", "2,000"), ("centers", "fps")):
        assert name in page.text and value in page.text
    assert "0.5000 ± 0.0125" in Page(record(stderr=dict.fromkeys(COLUMNS, 0.0125))).text


def test_a_chain_has_two_curves() -> None:
    chain = [record(f"lod{k}.glb", 0.9 - 0.1 * k, pictures=costs(500 >> k, 1 << (20 - k))) for k in range(3)]
    page = Page(*chain)
    histograms = len(chain)
    assert page.count("svg") == 2 + histograms and page.count("circle") == 2 * 4
    apart = Page(*(each | {"reference": f"ref{k}"} for k, each in enumerate(chain)))
    assert apart.count("svg") == histograms
    same = Page(*(each | {"pictures": costs(500 >> k, 1 << 22)} for k, each in enumerate(chain)))
    assert same.count("svg") == 1 + histograms and "All levels have the same: 4 texture MB" in same.text
    bare = Page(*(each | {"pictures": costs(500 >> k, 0)} for k, each in enumerate(chain)))
    assert bare.count("svg") == 1 + histograms and "no curve against texture MB" in bare.text


def test_the_curve_rises_with_the_costs() -> None:
    levels = [Level("b", 2000, 0.8), Level(HOSTILE, 500, 0.33), Level("ref", 8000, 1.0, True)]
    drawn = ElementTree.fromstring(
        curve_svg(levels, "triangles", "FMQM").replace("<svg", f'<svg xmlns="{SVG[1:-1]}"', 1)
    )
    circles = drawn.findall(f"{SVG}circle")
    x, y = (np.array([float(circle.attrib[name]) for circle in circles]) for name in ("cx", "cy"))
    assert np.diff(x) == pytest.approx([np.diff(x)[0]] * 2)  # four times as many, each
    assert np.diff(y) / np.diff(y)[0] == pytest.approx([1, 0.2 / 0.47], abs=0.01)
    assert [circle.get("class") for circle in circles] == [None, None, "reference"]
    texts = [text.text for text in drawn.findall(f"{SVG}text")]
    assert {"b", "ref", "1.00", "0.40", "1k", "5k"} <= set(texts)


def test_names_on_the_curve_do_not_overlap_and_only_a_chain_is_joined() -> None:
    alike = [Level(f"pair {k}", 1000, 0.9 + 0.001 * k) for k in range(5)]
    assert curve_svg(alike, "triangles", "FMQM").count('class="level"') == 2  # the lowest below it, the highest above
    assert curve_svg(alike, "triangles", "FMQM").count("<circle") == 5
    assert "polyline" not in curve_svg(alike, "triangles", "FMQM")
    chain = [Level(f"LOD{k}", 8000 >> k, 1 - 0.2 * k) for k in range(4)]
    assert curve_svg(chain, "triangles", "FMQM").count('class="level"') == 4 and "polyline" in curve_svg(
        chain, "triangles", "FMQM"
    )


def test_the_page_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    write_page(str(tmp_path), [record()], SETTINGS, VERSIONS)
    before = (tmp_path / "index.html").read_bytes()
    assert before.endswith(b"</html>\n")
    with pytest.raises(KeyError):
        write_page(str(tmp_path), [{}], SETTINGS, VERSIONS)
    assert [path.name for path in tmp_path.iterdir()] == ["index.html"]
    assert (tmp_path / "index.html").read_bytes() == before


def test_words_losses_and_thresholds_are_shown_where_there_are_any() -> None:
    losses = {"geometry_loss": 0.01, "texture_loss": 0.4321, "phrase": "most of the loss is the texture"}
    losses |= {"mostly": "texture", "how": "same UVs"}
    told = Page(record(attribution=losses, fail_under=0.75))
    for text in (
        "lod.glb differs from ref.glb",
        "Most of the loss is the texture: 0.010",
        "0.432 with",
        "Too low: FMQM 0.5000 is below 0.75.",
    ):
        assert text in told.text
    plain = Page(record(fail_under=0.5))
    assert "alone distorted" not in plain.text and "is below" not in plain.text and "Too low" not in plain.text


def test_the_judge_names_the_scores() -> None:
    numbers = {"perceived": {**record()["perceived"], "score": 0.9, "p10": 0.25}}
    chain = [record(f"lod{k}.glb", pictures=costs(900 - k, 1 << k) | {"judge": "perceived"}) for k in (1, 2)]
    page = Page(*(each | numbers | Criteria(Judge.PERCEIVED, 0.75, 0.5).record_fields() for each in chain))
    assert "Lowest Perceived 0.9000: lod1.glb. 2 below the threshold." in page.text
    assert "Perceived against triangles" in page.text
    missed = "perceived_p10 0.2500 is below 0.5"
    assert page.text.count(missed) == 2 * 4 and page.text.count(f"Too low: {missed}.") == 2
    assert "Threshold: at least Perceived 0.75 and Worst Tenth 0.5" in page.text
    assert "0.9000 is below" not in page.text


def test_what_all_pairs_have_stands_once() -> None:
    """Warnings, notes and sentences; a pair alone keeps its own."""
    ours, theirs = "Both meshes are open.", "Only this one is."
    chain = [record(f"lod{k}.glb", 0.5, warnings=[ours], notes=["Baked."]) for k in range(3)]
    chain[1]["warnings"] = [ours, theirs]
    page = Page(*chain, record("bad.glb", None))
    sentence = "Above all the surface"
    assert all(page.text.count(text) == 1 for text in (ours, theirs, "Baked.", sentence)), page.text
    assert page.text.count("2 warnings") == 2 and page.text.count("1 warning") == 4  # on the tile, and to be looked at
    alone = Page(chain[0])
    assert alone.text.count(ours) == 1 and "True of every pair" not in alone.text


def test_names_are_short_and_paths_are_in_tooltips() -> None:
    page = Page(*(record(f"/far/away/lods/lod{k}.glb", reference="/far/away/rock.glb") for k in range(2)))
    assert "/far/away" not in page.text and "lod1.glb differs from rock.glb" in page.text
    titles = [attributes.get("title") or "" for _, attributes in page.tags]
    assert any("/far/away/lods/lod1.glb" in title for title in titles) and "/far/away/rock.glb" in titles


def test_what_is_worst_comes_first_and_is_named() -> None:
    worst = {"reference": "pictures/a.jpg", "distorted": "pictures/b.jpg", "FMQM": 0.2, "perceived": 0.3, "value": 0.1,
             "blame": "color", "place": "upper left", "object": "Lid", "at": [[0.5, 0.5]]}  # fmt: skip
    parts = [
        {"kind": "object", "name": name, "triangles": 4, "area": 0.5, "FMQM": seen, "perceived": seen, "missing": False}
        for name, seen in (("Lid", 0.4), ("Body", 0.9))
    ]
    low = record("low.glb", 0.3, impairment="annoying", pictures=costs(10, 1) | {"worst": [worst]}, parts=parts)
    fine = record("fine.glb", 0.999, impairment="imperceptible")
    page = Page(fine, low, record("bad.glb", None))
    first = page.text[page.text.index("Look at first") : page.text.index("Search names")]
    assert "fine.glb" not in first and first.index("bad.glb") < first.index("low.glb")
    assert "Annoying; worst: color at the upper left, on Lid" in first
    assert "Worst: object Lid (Perceived 0.4000)." in page.text and "Upper left, Lid" in page.text
    assert "Nothing stands out" in Page(fine, fine | {"id": "other"}).text


# score.py --report


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two levels and a file that cannot be read, scored and reported in one go."""
    folder = tmp_path_factory.mktemp("assets")
    write_png(folder / "a.png", noise(seed=1))
    write_torus(folder, "ref", "a.png")
    for k in (1, 2):
        write_torus(folder, f"lod{k}", "a.png", shake=0.01 * k)
    (folder / "cut.glb").write_bytes(b"glTF\2\0\0\0\xff\xff\0\0")
    assert score(*FILES, "--report", "whole", cwd=folder).returncode == 1
    return folder


FILES = ("ref.obj", "lod1.obj", "cut.glb", "lod2.obj", *SMALL, "--attribution", "--explain")


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.once
def test_a_report_from_workers_resumed_draws_what_is_missing(run: Path) -> None:
    batch = (*FILES, "--report", "jobs", "--journal", "jobs.jsonl")
    assert score(*batch, "--jobs", "2", cwd=run).returncode == 1
    whole = files(run / "whole")
    assert files(run / "jobs") == whole
    kept, lost = sorted((run / "jobs" / "pictures").glob("*-thumbnail-heat.jpg"))
    lost.unlink()
    before = kept.stat().st_mtime_ns
    assert score(*batch, "--resume", cwd=run).returncode == 1
    assert files(run / "jobs") == whole and kept.stat().st_mtime_ns == before


@pytest.mark.once
def test_a_report_is_merged_from_shards(run: Path) -> None:
    for shard in (1, 2):
        flags = ("--shard", f"{shard}/2", "--report", "parts", "--json", f"part{shard}.json")
        score(*FILES, *flags, cwd=run)
    assert score("--merge", "part1.json", "part2.json", "--report", "parts", cwd=run).returncode == 1
    merged, whole = files(run / "parts"), files(run / "whole")
    page = "index.html"
    assert {name: data for name, data in merged.items() if name != page} == {
        name: data for name, data in whole.items() if name != page
    }
    names = rb"<h3.*?>(.*?)</h3>"
    assert sorted(re.findall(names, merged[page])) == sorted(re.findall(names, whole[page]))


def test_a_report_that_cannot_be_written_is_said_before_any_work(run: Path) -> None:
    (run / "taken").write_text("")
    done = score(*FILES, "--report", "taken", cwd=run)
    assert done.returncode == 1 and done.stdout == ""
    assert re.fullmatch(r"score\.py: taken: this folder cannot be made \(.*\); name another\n", done.stderr)


def test_sizes_on_screen_are_drawn_where_they_were_asked_for() -> None:
    """The mark stands on D = 1 at the switch, or at the end of a curve that never fails."""
    curve = [{"size": 16 * 2**k, "D_strict": 0.5 * 2**k} for k in range(3)]
    sizes = {"strict": {"pixels": 32.0, "bound": ""}, "fade": {"pixels": 512.0, "bound": "at least"}, "curve": curve}
    page = Page(record(screen_size=sizes))
    assert "Strict: 32 px. Fade: at least 512 px." in page.text
    drawing = ElementTree.fromstring(re.search(r"<svg.*?</svg>", page.html, re.DOTALL)[0])  # type: ignore[index]
    (mark,) = (each for each in drawing.iter() if each.tag.endswith("circle"))
    line = next(each for each in drawing.iter() if each.tag.endswith("polyline")).attrib["points"].split()
    assert f"{mark.attrib['cx']},{mark.attrib['cy']}" == line[1]
    assert "Size on screen" not in Page(record()).text
    noted = Page(record(screen_size=sizes | {"notes": ["some is <b>see-through</b>"]}))
    assert "Some is <b>see-through</b>." in noted.text


def test_a_chain_s_sizes_are_one_drawing_and_its_band_says_what_takes_over_where() -> None:
    """Of the levels, given in any order: b may be shown as early as a, which is finer; d at no size."""

    def level(name: str, triangles: int, pixels: float, bound: str = "") -> dict[str, Any]:
        curve = [{"size": 16 * 2**k, "D_strict": 16 * 2**k / pixels} for k in range(4)]
        switch = {"pixels": pixels, "bound": bound}
        sizes = {"strict": switch, "fade": switch, "curve": curve, "notes": []}
        return record(f"rock_{name}.glb", triangles=triangles, screen_size=sizes)

    levels = [level("c", 30, 32.0), level("a", 90, 60.0), level("d", 10, 16.0, "below"), level("b", 50, 64.0)]
    page = Page(*levels)
    (html,) = re.findall(r"<figure><figcaption>D against size.*?</figure>", page.html, re.DOTALL)
    assert "No place: rock_a.glb, rock_d.glb." in html
    drawing = ElementTree.fromstring(re.search(r"<svg.*?</svg>", html, re.DOTALL)[0])  # type: ignore[index]
    assert len([each for each in drawing.iter() if each.tag.endswith("circle")]) == 4
    classes = [each.attrib["class"] for each in drawing.iter() if each.tag.endswith("polyline")]
    assert classes == ["line without", "line", "line", "line without"], "from fine to coarse"
    band = [each for each in drawing.iter() if each.tag.endswith("rect")]
    assert ["".join(each.itertext()) for each in band] == ["c", "b", "Original"]
    ends = [(float(each.attrib["x"]), float(each.attrib["x"]) + float(each.attrib["width"])) for each in band]
    thirds = [44 + (460 - 44 - 16) * k / 3 for k in range(4)]
    assert [at for end in ends for at in end] == pytest.approx(
        [at for k in range(3) for at in thirds[k : k + 2]], abs=0.2
    )
    assert "<figcaption>D against" not in Page(levels[0], record()).html, "one alone has its card's"
