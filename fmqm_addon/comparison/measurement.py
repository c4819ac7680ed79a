# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes in, scores out: the metric over one or several seeds, with its trust report, in steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..metric.errors import MeshError
from ..metric.evaluation import Evaluation, Result, Scores
from ..metric.geometry import Floats
from ..metric.perceived import Perceived
from ..metric.settings import Settings
from ..metric.stepper import Progress, Stepper, Work, as_part
from ..metric.surface import MeshArrays, QueryBuilder, Surface, preparing_surface
from .parts import Grouping, groupings
from .surface_facts import Fact, surface_facts
from .trust import Trust, assessing


@dataclass(frozen=True)
class Readings:
    """Both readings of the samples of a pair, FMQM and perceived: means over the seeds.

    Attributes:
        scores: the paper's. perceived: the second reading.
        stderr, perceived_stderr: standard errors of these means; None for one seed.
        fmqm_p10: 10th percentile of FMQM over the patches.
    """

    scores: Scores
    stderr: Scores | None
    fmqm_p10: float
    perceived: Perceived
    perceived_stderr: Perceived | None


@dataclass(frozen=True)
class Comparison(Readings):
    """Scores of one distorted mesh.

    Attributes:
        result: of the first seed, with patches and fields. distorted: the prepared surface.
        trust: what is known about the scores, from the first seed.
    """

    result: Result
    distorted: Surface
    trust: Trust

    @property
    def warnings(self) -> tuple[str, ...]:
        """What should be known before the scores are believed."""
        return (*self.result.warnings, *self.trust.warnings)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done with the meshes that misleads nobody."""
        return (*self.result.notes, *self.trust.notes)


class Measurement:
    """A reference, prepared once for any number of comparisons.

    Args:
        build_query: makes the spatial query of a surface; under Blender blender.scene.node_queries.surface_query.
        repeats: of each comparison, with the seeds settings.seed to settings.seed + repeats - 1.
    """

    def __init__(self, reference: MeshArrays, build_query: QueryBuilder, settings: Settings, repeats: int = 1) -> None:
        self._mesh = reference
        self._build_query = build_query
        self._settings = settings
        self._repeats = repeats
        self._evaluations: list[Evaluation] = []
        # Of the reference, from the first comparison on.
        self._facts: tuple[Fact, ...] = ()
        self._groups: tuple[Grouping, ...] = ()

    @property
    def reference(self) -> Surface:
        """The prepared reference; only after prepare()."""
        return self._evaluations[0].reference

    def prepare(self) -> Stepper[None]:
        """A stepper over preparing the reference, which comes before any comparison."""
        return Stepper(self._prepare())

    def compare(self, distorted: MeshArrays, known: Sequence[Fact] = ()) -> Stepper[Comparison]:
        """A stepper over scoring a distorted mesh, with its trust report.

        Args:
            known: facts about the pair that begin the report, such as where the two were put.
        """
        return Stepper(self._compare(distorted, known))

    def score(self, distorted: MeshArrays) -> Stepper[Readings]:
        """A stepper over a comparison without its trust report."""
        return Stepper(self._score(distorted))

    def reverse(self, distorted: MeshArrays) -> Stepper[Readings]:
        """A stepper over the other direction, the distorted mesh as the reference.

        Sees what only the distorted mesh has, and costs a preparation of its own.
        """
        return Stepper(self._reverse(distorted))

    def _prepare(self) -> Work[None]:
        yield Progress("prepare", 0.0)
        surface = yield from as_part(preparing_surface(self._mesh, self._build_query), 0.0, 0.05, "prepare")
        yield Progress("prepare", 0.05)
        for repeat in range(self._repeats):
            evaluation = Evaluation(surface, self._settings.with_seed(self._settings.seed + repeat))
            yield from as_part(evaluation.prepare(), 0.05 + 0.95 * repeat / self._repeats, 0.95 / self._repeats)
            self._evaluations.append(evaluation)

    def _compare(self, distorted: MeshArrays, known: Sequence[Fact]) -> Work[Comparison]:
        surface, results = yield from self._results(distorted, 0.0, 0.92)
        if not self._facts:
            self._facts = yield from as_part(surface_facts(self.reference), 0.92, 0.03, "features")
            self._groups = yield from as_part(groupings(self.reference), 0.95, 0.01, "features")
        assessed = assessing(self.reference, surface, results[0], self._facts, self._groups)
        trust = yield from as_part(assessed, 0.96, 0.04, "features")
        readings = _means(results)
        return Comparison(
            **vars(readings),
            result=results[0],
            distorted=surface,
            trust=replace(trust, pair=(*known, *trust.pair, _error_fact(readings.stderr, len(results)))),
        )

    def _score(self, distorted: MeshArrays) -> Work[Readings]:
        _, results = yield from self._results(distorted, 0.0, 1.0)
        return _means(results)

    def _reverse(self, distorted: MeshArrays) -> Work[Readings]:
        other = Measurement(distorted, self._build_query, self._settings, self._repeats)
        yield from as_part(other.prepare(), 0.0, 0.5)
        _, results = yield from other._results(self._mesh, 0.5, 0.5)
        return _means(results)

    def _results(self, distorted: MeshArrays, first: float, share: float) -> Work[tuple[Surface, list[Result]]]:
        """The prepared mesh and its result for each seed; progress goes from first on by the share."""
        yield Progress("prepare", first)
        preparing = preparing_surface(distorted, self._build_query, self.reference.frame)
        surface = yield from as_part(preparing, first, 0.05 * share, "prepare")
        yield Progress("prepare", first + 0.05 * share)
        results = []
        each = 0.95 * share / self._repeats
        for repeat, evaluation in enumerate(self._evaluations):
            comparing = evaluation.compare(surface)
            try:
                results.append((yield from as_part(comparing, first + 0.05 * share + each * repeat, each)))
            except MeshError as error:
                raise MeshError(f"{distorted.name}: {error}") from error
        if not all(np.isfinite([*result.scores, *result.perceived]).all() for result in results):
            raise MeshError(
                f"{distorted.name}: the scores are not finite; its coordinates are beyond what can be measured"
            )
        return surface, results


def _means(results: Sequence[Result]) -> Readings:
    """Over the seeds."""
    scores: Floats = np.array([result.scores for result in results])
    perceived: Floats = np.array([result.perceived for result in results])
    several = len(results) > 1
    return Readings(
        scores=Scores(*scores.mean(axis=0).tolist()),
        stderr=Scores(*_standard_error(scores)) if several else None,
        fmqm_p10=float(np.mean([result.fmqm_p10 for result in results])),
        perceived=Perceived(*perceived.mean(axis=0).tolist()),
        perceived_stderr=Perceived(*_standard_error(perceived)) if several else None,
    )


def _standard_error(rows: Floats) -> list[float]:
    """Of the means of columns."""
    errors: list[float] = (np.std(rows, axis=0, ddof=1) / np.sqrt(len(rows))).tolist()
    return errors


def _error_fact(stderr: Scores | None, repeats: int) -> Fact:
    if stderr is None:
        return Fact("standard_error", None, "of FMQM", "measured with one seed; repeats tell it")
    return Fact("standard_error", stderr.FMQM, f"of FMQM, over {repeats} seeds")
