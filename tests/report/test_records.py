# SPDX-License-Identifier: GPL-3.0-or-later
"""Names in the CSV come back as they are, and a score reads alike everywhere."""

from __future__ import annotations

import csv
import io

from fmqm_addon.report.numbers import score_text
from fmqm_addon.report.records import PairScore, csv_text, pair_record, shown_score


def test_names_with_breaks_come_back() -> None:
    names = ["a\rb", "a\nb", "a\r\n", "a,b", 'a"b', "a\r"]
    text = csv_text([PairScore("r", name) for name in names])
    assert [row["id"] for row in csv.DictReader(io.StringIO(text, newline=""))] == names
    assert "\r" not in csv_text([PairScore("r", "d")])


def test_a_score_reads_alike_wherever_it_stands() -> None:
    assert score_text(0.71904) == "0.7190" and score_text(0.71904, places=2) == "0.72"
    assert score_text(0.71904, 0.00312) == "0.7190 ± 0.0031" and score_text(None, 0.1) == "-"
    assert [score_text(0.99996, places=places) for places in (2, 3, 4)] == ["0.99", "0.999", "0.9999"], "not 1"
    assert score_text(1.0, places=3) == "1.000" and score_text(0.99984) == "0.9998"
    scored = pair_record(PairScore("a", "b")) | {"FMQM": 0.71904, "stderr": {"FMQM": 0.00312}}
    assert shown_score(scored, "FMQM") == "0.7190 ± 0.0031" and shown_score(scored, "perceived") == "-"
