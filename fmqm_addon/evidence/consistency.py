# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows from the measured pairs: order, spread, smallest losses, how much settings change the ranking."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..report.records import value_of
from .distortions import DISTORTIONS, GTC, KINDS, SWT, Distortion, steps
from .study import BASE, RENDERED, SEEDS, Measured, Study, Variant, is_visible, ladder_name

READINGS = ("perceived", "FMQM")  # columns of records
ALL = "all"  # in the place of a kind
SMALL_SPREAD = 0.001  # the goal
ORDER_GOAL = 0.99
HARMLESS = 0.9999  # from here on nothing was lost: a flat side with fewer triangles is the same side
_FEWEST = 4  # pairs that a correlation is told of


class Results:
    """The measured pairs by model, variant and distortion; those with an error are left out."""

    def __init__(self, study: Study, found: Iterable[Measured]) -> None:
        self.study = study
        found = list(found)
        self.errors = [each for each in found if each.record["error"] is not None]
        self._records = {
            (each.model, each.variant, each.distortion.name): each.record
            for each in found
            if each.record["error"] is None
        }
        self.models = tuple(dict.fromkeys(each.model for each in found))

    def record(self, model: str, variant: str, distortion: Distortion) -> Mapping[str, Any] | None:
        return self._records.get((model, variant, distortion.name))

    def value(self, model: str, variant: str, distortion: Distortion, reading: str) -> float | None:
        record = self.record(model, variant, distortion)
        return None if record is None else value_of(record, reading)

    def over_seeds(self, model: str, distortion: Distortion, reading: str) -> list[float]:
        """The values of the ladder's seeds that were measured."""
        values = [self.value(model, ladder_name(seed), distortion, reading) for seed in range(SEEDS)]
        return [value for value in values if value is not None]

    def of_kind(self, kind: str) -> list[Distortion]:
        return [each for each in self.study.distortions if kind in (ALL, each.kind)]

    @property
    def kinds(self) -> list[str]:
        present = {each.kind for each in self.study.distortions}
        return [kind for kind in KINDS if kind in present]


@dataclass(frozen=True)
class Step:
    """A milder and a harsher level of one model under one seed.

    Attributes:
        fall: by how much the harsher one scores lower.
        is_harmless: what is harsher does no harm, so that there is no order.
    """

    model: str
    seed: int
    milder: Distortion
    harsher: Distortion
    fall: float
    is_harmless: bool

    @property
    def in_order(self) -> bool:
        return self.fall > 0


def ladder_steps(results: Results, reading: str, kind: str = ALL) -> list[Step]:
    """Every step of every model and seed, as far as both ends were measured, the harmless ones too."""
    found = []
    for milder, harsher in steps():
        if kind not in (ALL, milder.kind):
            continue
        for model in results.models:
            for seed in range(SEEDS):
                ends = [results.value(model, ladder_name(seed), each, reading) for each in (milder, harsher)]
                if ends[0] is None or ends[1] is None:
                    continue
                alone = [results.value(model, ladder_name(seed), each, reading) for each in _alone(milder, harsher)]
                harmless = all(value is not None and value >= HARMLESS for value in alone)
                found.append(Step(model, seed, milder, harsher, ends[0] - ends[1], harmless))
    return found


def _alone(milder: Distortion, harsher: Distortion) -> tuple[Distortion, ...]:
    """The two, or, where GTC only takes more triangles from the same texture, what takes these alone."""
    if milder.kind != GTC or milder.quality != harsher.quality:
        return milder, harsher
    return tuple(each for each in DISTORTIONS if each.kind == SWT and each.kept in (milder.kept, harsher.kept))


def share_in_order(found: Sequence[Step]) -> float | None:
    """Of those that did harm; None where there are none."""
    harmful = [each for each in found if not each.is_harmless]
    return None if not harmful else sum(each.in_order for each in harmful) / len(harmful)


@dataclass(frozen=True)
class Spread:
    """Standard deviations over the seeds, of all pairs of a kind with at least two."""

    pairs: int
    mean: float
    worst: float
    worst_pair: str
    small: float  # the share of pairs below SMALL_SPREAD


def spread(results: Results, reading: str, kind: str = ALL) -> Spread | None:
    """None where no pair was measured with two seeds."""
    named = []
    for model in results.models:
        for each in results.of_kind(kind):
            values = results.over_seeds(model, each, reading)
            if len(values) > 1:
                named.append((float(np.std(values, ddof=1)), f"{model} {each.name}"))
    if not named:
        return None
    deviations = np.array([deviation for deviation, _ in named])
    worst, name = max(named)
    return Spread(len(named), float(deviations.mean()), worst, name, float((deviations < SMALL_SPREAD).mean()))


@dataclass(frozen=True)
class Visible:
    """The mildest levels of a kind whose renderings differ, one of each model.

    Attributes:
        loss: the smallest by a reading, 1 less the mean over seeds. pair: whose it is.
        models: how many have such a level. hidden: the largest loss of a level whose renderings do not differ; None
            where each was seen to.
    """

    loss: float
    pair: str
    models: int
    hidden: float | None


def smallest_visible(results: Results, reading: str, kind: str) -> Visible | None:
    """None where no level was seen to differ."""
    losses, hidden = [], []
    for model in results.models:
        for each in results.of_kind(kind):
            record = results.record(model, RENDERED, each)
            visible = None if record is None else is_visible(record)
            values = results.over_seeds(model, each, reading)
            if visible is None or not values:
                continue
            loss = 1 - float(np.mean(values))
            if visible:
                losses.append((loss, f"{model}, {each.label}"))
                break
            hidden.append(loss)
    if not losses:
        return None
    return Visible(*min(losses), models=len(losses), hidden=max(hidden, default=None))


def rank_correlation(one: Sequence[float], other: Sequence[float]) -> float | None:
    """Spearman's; None of too few values, or where one side is the same everywhere."""
    from scipy.stats import spearmanr

    if len(one) < _FEWEST or len(set(one)) == 1 or len(set(other)) == 1:
        return None
    return float(spearmanr(one, other).statistic)


def kept_ranking(results: Results, variant: Variant, reading: str, base: str = BASE) -> tuple[float | None, int]:
    """The rank correlation of a variant's numbers with the base's over all models, and of how many pairs."""
    pairs = []
    for model in results.models:
        for each in results.study.distortions:
            here, there = (results.value(model, name, each, reading) for name in (variant.name, base))
            if here is not None and there is not None:
                pairs.append((here, there))
    one, other = [a for a, _ in pairs], [b for _, b in pairs]
    return rank_correlation(one, other), len(pairs)


def beside(results: Results, kind: str = ALL) -> tuple[list[float], list[float]]:
    """Means over seeds of FMQM and of perceived, pair by pair."""
    both: tuple[list[float], list[float]] = [], []
    for model in results.models:
        for each in results.of_kind(kind):
            values = [results.over_seeds(model, each, reading) for reading in ("FMQM", "perceived")]
            if values[0]:
                for column, own in zip(both, values, strict=True):
                    column.append(float(np.mean(own)))
    return both
