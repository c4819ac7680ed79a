# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of the two readings decides: about thresholds and targets, and what is shown of a pair."""

from __future__ import annotations

from enum import StrEnum

from ..metric.evaluation import COLUMNS
from ..metric.perceived import PERCEIVED_COLUMNS
from .measurement import Readings


class Judge(StrEnum):
    """One of the two readings, by what flags call it."""

    FMQM = "fmqm"
    PERCEIVED = "perceived"

    @property
    def column(self) -> str:
        """What people call its score, and columns of patches and layers too."""
        return "FMQM" if self is Judge.FMQM else "perceived"

    @property
    def p10_column(self) -> str:
        """What the 10th percentile of its score over the patches is called."""
        return "fmqm_p10" if self is Judge.FMQM else "perceived_p10"

    @property
    def features(self) -> tuple[str, ...]:
        """Columns of the four features that its score is the mean of."""
        return COLUMNS[:4] if self is Judge.FMQM else PERCEIVED_COLUMNS[:4]

    def score(self, readings: Readings) -> float:
        """The whole score of a pair, in [0, 1]."""
        return readings.scores.FMQM if self is Judge.FMQM else readings.perceived.score
