# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings that nobody has measured."""

from __future__ import annotations

from typing import Any

from fmqm_addon.comparison.measurement import Readings
from fmqm_addon.metric.evaluation import Scores
from fmqm_addon.metric.perceived import Perceived
from fmqm_addon.report.records import PairScore, pair_record

NUMBERS = ("FMQM", "geoSSIM", "geoGraSSIM", "colorSSIM", "colorGraSSIM", "fmqm_p10", "perceived")  # a record's keys


def all_alike(score: float) -> Readings:
    """Readings of which every number is the score."""
    return Readings(Scores(*[score] * 5), None, score, Perceived(*[score] * 6), None)


def numbers(score: float | None) -> dict[str, Any]:
    """What a record has of such readings; None: of a pair without scores."""
    record = pair_record(PairScore("", "", None if score is None else all_alike(score)))
    return {name: record[name] for name in NUMBERS}
