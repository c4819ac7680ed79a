# SPDX-License-Identifier: GPL-3.0-or-later
"""Every metric of a table against people's scores: overall, by kind of distortion, by reference."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from ..metric.errors import SettingsError
from .agreement import RESAMPLES, Agreement, Difference, agreement, difference, draws
from .tables import OpinionTable, ScoreTable, joined

GROUPINGS = ("overall", "kind", "reference")
OVERALL = "all"  # the one group of the first of them


@dataclass(frozen=True)
class Evaluation:
    """What came of it.

    Attributes:
        rows: pairs with an id in both tables. unscored, unjudged: ids of people's and of the metric's that met nothing.
        agreements: by metric, grouping and group.
        compared: two metrics, and their difference; None where none were asked about.
        x, opinions, kinds: the joined numbers: by metric (n,); (n,); (n,) or empty.
    """

    rows: int
    unscored: tuple[str, ...]
    unjudged: tuple[str, ...]
    agreements: dict[str, dict[str, dict[str, Agreement]]]
    compared: tuple[str, str, Difference] | None
    x: dict[str, NDArray[np.float64]]
    opinions: NDArray[np.float64]
    kinds: tuple[str, ...]


def evaluate(
    scores: ScoreTable,
    opinions: OpinionTable,
    metrics: Sequence[str] = (),
    compare: tuple[str, str] | None = None,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Evaluation:
    """Judges columns of scores by opinions.

    Args:
        metrics: columns; none are all. compare: two of the table that are tested against each other.
        resamples, seed: of the bootstrap; 0 tells no intervals.

    Raises:
        SettingsError: there is no such column, or the tables share no id.
    """
    chosen = tuple(metrics) or tuple(scores.columns)
    for name in (*chosen, *(compare or ())):
        if name not in scores.columns:
            raise SettingsError(f"no column {name} with numbers; there are {', '.join(scores.columns) or 'none'}")
    if not chosen:
        raise SettingsError("no column with numbers in the table of scores")
    pairs = joined(scores, opinions)
    if not pairs:
        raise SettingsError(
            f"the tables share no id: one has such as {scores.ids[0]}, the other such as {opinions.ids[0]}"
        )
    of_score, of_opinion = np.array(pairs).T
    x = {name: scores.columns[name][of_score] for name in (*chosen, *(compare or ()))}
    judged = opinions.opinions[of_opinion]
    kinds = tuple(opinions.kinds[index] for index in of_opinion) if opinions.kinds else ()
    references = opinions.references or ()
    named = tuple(references[index] for index in of_opinion) if references else ()
    if not named and scores.references:
        named = _short([scores.references[index] for index in of_score])
    groups = {"overall": (OVERALL,) * len(pairs), "kind": kinds, "reference": named}
    agreements = {
        name: {
            grouping: dict(_by_group(x[name], judged, labels, resamples, seed))
            for grouping, labels in groups.items()
            if labels and (grouping == "overall" or len(set(labels)) > 1)
        }
        for name in chosen
    }
    compared = None
    if compare is not None:
        weights = draws(len(pairs), resamples or RESAMPLES, seed)
        compared = (*compare, difference(x[compare[0]], x[compare[1]], judged, weights))
    met_scores, met_opinions = set(of_score.tolist()), set(of_opinion.tolist())
    return Evaluation(
        len(pairs),
        tuple(name for index, name in enumerate(opinions.ids) if index not in met_opinions),
        tuple(name for index, name in enumerate(scores.ids) if index not in met_scores),
        agreements, compared, {name: x[name] for name in chosen}, judged, kinds,
    )  # fmt: skip


def _short(paths: Sequence[str]) -> tuple[str, ...]:
    """Names of files without folder and ending, where those still differ."""
    names = [PurePath(path.replace("\\", "/")).stem for path in paths]
    return tuple(names if len(set(names)) == len(set(paths)) else paths)


def _by_group(
    x: NDArray[np.float64], opinions: NDArray[np.float64], labels: Sequence[str], resamples: int, seed: int
) -> Iterator[tuple[str, Agreement]]:
    array = np.array(labels)
    for label in dict.fromkeys(labels):
        rows = np.flatnonzero(array == label)
        known = rows[np.isfinite(x[rows])]
        # Of the rows that have a number: a resample has as many of them as there are.
        weights = draws(len(known), resamples, seed) if resamples and len(known) else None
        yield label, agreement(x[known], opinions[known], weights)
