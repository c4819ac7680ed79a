# SPDX-License-Identifier: GPL-3.0-or-later
"""Names in the CSV come back as they are."""

from __future__ import annotations

import csv
import io

from fmqm_addon.report.records import PairScore, csv_text


def test_names_with_breaks_come_back() -> None:
    names = ["a\rb", "a\nb", "a\r\n", "a,b", 'a"b', "a\r"]
    text = csv_text([PairScore("r", name) for name in names])
    assert [row["id"] for row in csv.DictReader(io.StringIO(text, newline=""))] == names
    assert "\r" not in csv_text([PairScore("r", "d")])
