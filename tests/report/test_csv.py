# SPDX-License-Identifier: GPL-3.0-or-later
"""Names in a CSV: what a spreadsheet would run as a formula is text, and numbers stay numbers."""

from __future__ import annotations

import csv
import io
from xml.etree import ElementTree

import pytest

from fmqm_addon.report.junit import junit_parts
from fmqm_addon.report.records import BESIDE, Costs, PairScore, csv_parts, csv_text, pair_record
from tests.readings import numbers

FORMULAS = ("=1+1", "+1", "-1", "@SUM(1)", "\t=1", "\r=1", "\n=1", '=HYPERLINK("x","y")', "\uff1d1")
HARMLESS = ("a=1", "lod-1.glb", "'=1", " =1", "1", "")


def cells(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text, newline=""), strict=True))


@pytest.mark.parametrize("name", FORMULAS)
def test_a_formula_is_text_behind_a_quote(name: str) -> None:
    pairs = [PairScore(name, name, error=name)]
    (row,) = cells(csv_text(pairs))
    assert {row[key] for key in ("id", "reference", "distorted", "error")} == {f"'{name}"}
    assert csv_text(pairs).count("\"'") == 4, "quoted, as some programs look at the first character before they unquote"
    (raw,) = cells("".join(csv_parts([pair_record(pair) for pair in pairs], raw=True)))
    assert raw["id"] == raw["error"] == name


@pytest.mark.parametrize("name", HARMLESS)
def test_other_names_are_as_they_are(name: str) -> None:
    pairs = [PairScore(name, name)]
    assert cells(csv_text(pairs))[0]["reference"] == name
    assert csv_text(pairs) == "".join(csv_parts([pair_record(pair) for pair in pairs], raw=True))


def test_a_negative_number_is_a_number() -> None:
    record = pair_record(PairScore("r", "d")) | numbers(-1e-05)
    assert "".join(csv_parts([record])).splitlines()[1] == "d,r,d" + ",-1e-05" * 11 + "," * 7


def test_what_the_asset_costs_and_what_is_to_be_said_of_it() -> None:
    costs = Costs(triangles=1200, triangle_share=0.25, texture_bytes=4096)
    pair = PairScore("r", "d", level=2, costs=costs, notes=("turned", "moved"), warnings=("=1+1",))
    record = pair_record(pair) | numbers(0.5) | {"fail_under": None, "fail_under_p10": None, "judge": "fmqm"}
    (row,) = cells(csv_text([pair]))
    told = [row[name] for name in ("triangles", "triangle_share", "texture_bytes", "level", "notes", "warnings")]
    assert told == ["1200", "0.25", "4096", "2", "turned | moved", "'=1+1"]
    case = ElementTree.fromstring("".join(junit_parts([record])))
    properties = {each.get("name"): each.get("value") for each in case.iter("property")}
    assert [properties[name] for name in BESIDE] == [*told[:-1], "=1+1"]
