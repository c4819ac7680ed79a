# SPDX-License-Identifier: GPL-3.0-or-later
"""What makes the page easy to read, and true: room for names and numbers, what comes first, what is not said."""

from __future__ import annotations

import re
from xml.etree import ElementTree

from fmqm_addon.report.html.chain_curve import Level, curve_svg
from fmqm_addon.report.html.fragments import name_text
from fmqm_addon.report.html.histogram import legend
from fmqm_addon.report.html.overview import overview_of

from .test_page import Page, costs, record


def test_no_name_on_the_curve_hides_a_mark() -> None:
    levels = [Level(f"prop_lod{k}.glb", cost, score) for k, (cost, score) in enumerate(
        [(5856, 0.93), (2927, 0.94), (1464, 0.89), (5856, 0.91), (5856, 0.89), (5856, 0.74), (175, 0.72)]
    )]  # fmt: skip
    drawn = ElementTree.fromstring(curve_svg(levels, "triangles", "FMQM"))
    marks = [(float(each.attrib["cx"]), float(each.attrib["cy"])) for each in drawn.findall("circle")]
    names = [each for each in drawn.findall("text") if each.get("class") == "level"]
    assert len(names) > 3
    for each in names:
        x, y, width = float(each.attrib["x"]), float(each.attrib["y"]), 7 * len(each.text or "")
        left = x - width if each.attrib["text-anchor"] == "end" else x
        assert not any(left - 4 < at < left + width + 4 and y - 13 < height < y + 4 for at, height in marks)


def test_ticks_do_not_run_into_each_other() -> None:
    shown = re.findall(r">(≤? ?[0-9.]+)</span>", legend(0.998, 1.0, "FMQM", "", False))
    assert shown == ["≤ 0.9980", "0.9990", "1.0000"]
    assert re.findall(r">(≤? ?[0-9.]+)</span>", legend(0.6, 1.0, "FMQM", "", False))[0] == "≤ 0.6"


def test_one_stands_for_all_that_were_not_scored() -> None:
    failed = [record(f"bad{k}.glb", None, error="is broken") for k in range(6)]
    low = [record(f"low{k}.glb", 0.1 * k, fail_under=0.9) for k in range(1, 6)]
    assert [line.name for line in overview_of(failed + low).first] == ["bad0.glb", "low1.glb", "low2.glb", "low3.glb"]
    assert [line.name for line in overview_of(failed + low[:1]).first] == [
        "bad0.glb",
        "bad1.glb",
        "bad2.glb",
        "low1.glb",
    ]
    assert len(overview_of(failed).first) == len(overview_of(low).first) == 4


def test_nothing_is_said_of_a_loss_where_there_is_none() -> None:
    said, same = "shows about as much of the loss as any side", costs(10, 1 << 20)
    worst = {"reference": "r.jpg", "distorted": "d.jpg", "FMQM": 0.5, "perceived": 0.5, "blame": "color", "value": 0.5,
             "place": "top", "object": None, "at": [None]}  # fmt: skip
    assert said in Page(record(pictures=same | {"worst": [worst]})).text
    assert said not in Page(record(pictures=same)).text


def test_long_names_break_where_their_parts_join() -> None:
    assert name_text("<a>_b-c/d.glb:e") == "<bdi>&lt;a&gt;_<wbr>b-<wbr>c/<wbr>d.glb:<wbr>e</bdi>"


def test_what_one_pair_has_no_use_for_is_not_there() -> None:
    one, two = Page(record()), Page(record("a.glb"), record("b.glb"))
    assert ["hidden" in attributes for page in (one, two) for _, attributes in page.tags
            if attributes.get("class") == "toolbar"] == [True, False]  # fmt: skip
    assert "1 is the same" in one.text and "1 is the same" not in Page(record(score=None)).text


def test_a_sentence_runs_from_left_to_right_though_a_name_does_not() -> None:
    name = "\u0628\u0642\u0631\u0629.glb"
    said = [f"{name}: {what}" for what in ("it is open", "its images are alike")]
    failed = record(name, score=None, error=f"{name}: is broken; repair it")
    html = Page(record(name, warnings=said[:1], notes=said[1:]), record(), failed).html
    assert [html.count(f'<bdi dir="ltr">{text}</bdi>') for text in (*said, failed["error"])] == [1, 1, 2]
