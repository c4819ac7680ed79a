# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pair must reach, and by which of its two readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..comparison.judge import Judge
from .numbers import score_text
from .records import value_of

FIELDS = ("judge", "fail_under", "fail_under_p10")  # by what a record tells of it


@dataclass(frozen=True)
class Criteria:
    """What all pairs of a run must reach.

    Attributes:
        judge: which reading decides; None is nobody's wish: FMQM, or what merged records say.
        fail_under: least score; None: any. fail_under_p10: least 10th percentile over the patches.
    """

    judge: Judge | None = None
    fail_under: float | None = None
    fail_under_p10: float | None = None

    def record_fields(self, fail_under: float | None = None) -> dict[str, Any]:
        """What a record tells of it.

        Args:
            fail_under: of a pair that has its own.
        """
        least = self.fail_under if fail_under is None else fail_under
        return dict(zip(FIELDS, (str(self.judge or Judge.FMQM), least, self.fail_under_p10), strict=True))

    def given_fields(self, fail_under: float | None = None) -> dict[str, Any]:
        """As record_fields(), without what nobody wishes."""
        fields = self.record_fields(fail_under)
        return {name: fields[name] for name in FIELDS if (name != "judge" or self.judge) and fields[name] is not None}


ANYTHING = Criteria()


def judge_of(record: Mapping[str, Any]) -> Judge:
    """Which reading decides about a pair."""
    return Judge(record["judge"])


def below(record: Mapping[str, Any]) -> bool:
    """Whether a scored pair misses one of its thresholds."""
    return bool(_missed(record))


def shortfall(record: Mapping[str, Any]) -> str:
    """By how much a pair that is below its thresholds misses them; with so many digits that it shows."""
    return ", ".join(f"{name} {_short_of(value, least)} is below {least:g}" for name, value, least in _missed(record))


def _missed(record: Mapping[str, Any]) -> list[tuple[str, float, float]]:
    """The name, the value and the threshold of each that is missed."""
    judge = judge_of(record)
    wanted = ((judge.column, record["fail_under"]), (judge.p10_column, record["fail_under_p10"]))
    valued = [(name, value_of(record, name), least) for name, least in wanted if least is not None]
    return [(name, value, least) for name, value, least in valued if value is not None and value < least]


def _short_of(value: float, least: float) -> str:
    shown = score_text(value)
    return shown if float(shown) < least else repr(value)
