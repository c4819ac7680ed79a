# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes in, scores out: the metric with Blender's trees, over one or several seeds, in steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..metric.errors import MeshError
from ..metric.score import Evaluation, Progress, Result, Stepper, Work, as_work
from ..metric.settings import Settings
from ..metric.spatial import Floats
from ..metric.surface import MeshArrays, Surface, preparing_surface
from .bvh import BVHQuery


@dataclass(frozen=True)
class Comparison:
    """Scores of one distorted mesh.

    Attributes:
        scores: (5,) float64 in the order of metric.score.COLUMNS, mean over the seeds.
        stderr: (5,) standard error of that mean; None for one seed.
        result: of the first seed, with patches and fields. distorted: the prepared surface.
    """

    scores: Floats
    stderr: Floats | None
    result: Result
    distorted: Surface


class Measurement:
    """A reference, prepared once for any number of comparisons, each over `repeats` seeds."""

    def __init__(self, reference: MeshArrays, settings: Settings, repeats: int = 1) -> None:
        self._mesh = reference
        self._settings = settings
        self._repeats = repeats
        self._evaluations: list[Evaluation] = []

    @property
    def reference(self) -> Surface:
        """The prepared reference; only after prepare()."""
        return self._evaluations[0].reference

    def prepare(self) -> Stepper[None]:
        return Stepper(self._prepare())

    def compare(self, distorted: MeshArrays) -> Stepper[Comparison]:
        return Stepper(self._compare(distorted))

    def _prepare(self) -> Work[None]:
        yield Progress("prepare", 0.0)
        surface = yield from as_work(preparing_surface(self._mesh, BVHQuery), "prepare", 0.0, 0.05)
        yield Progress("prepare", 0.05)
        for repeat in range(self._repeats):
            evaluation = Evaluation(surface, self._settings.with_seed(self._settings.seed + repeat))
            yield from _scaled(evaluation.prepare(), 0.05 + 0.95 * repeat / self._repeats, 0.95 / self._repeats)
            self._evaluations.append(evaluation)

    def _compare(self, distorted: MeshArrays) -> Work[Comparison]:
        yield Progress("prepare", 0.0)
        preparing = preparing_surface(distorted, BVHQuery, self.reference.frame)
        surface = yield from as_work(preparing, "prepare", 0.0, 0.05)
        yield Progress("prepare", 0.05)
        results = []
        for repeat, evaluation in enumerate(self._evaluations):
            stepper = evaluation.compare(surface)
            try:
                yield from _scaled(stepper, 0.05 + 0.95 * repeat / self._repeats, 0.95 / self._repeats)
            except MeshError as error:
                raise MeshError(f"{distorted.name}: {error}") from error
            results.append(stepper.result)
        scores = np.array([result.scores for result in results])
        if not np.isfinite(scores).all():
            raise MeshError(
                f"{distorted.name}: the scores are not finite; its coordinates are beyond what can be measured"
            )
        stderr = None
        if len(results) > 1:
            stderr = scores.std(axis=0, ddof=1) / np.sqrt(len(results))
        return Comparison(scores.mean(axis=0), stderr, results[0], surface)


def _scaled(stepper: Stepper[Any], first: float, share: float) -> Work[None]:
    """The steps of a stepper as a part of larger work."""
    while stepper.step():
        yield Progress(stepper.progress.stage, first + share * stepper.progress.done)
