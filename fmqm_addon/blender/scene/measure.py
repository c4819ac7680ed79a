# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects of the open scene against their reference, in steps: what the button and the Python API run."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from ...comparison.alignment import Alignment, AssetMesh, location_counts
from ...comparison.attribution import Attribution
from ...comparison.measurement import Comparison, Readings
from ...comparison.pair import PairOptions, PairResult, comparing_pair, measurement_of
from ...comparison.trust import Trust
from ...metric.errors import FMQMError
from ...metric.evaluation import Scores
from ...metric.perceived import Perceived
from ...metric.stepper import Progress, Stepper, Work, as_part
from ..materials.images import TextureCache
from ..materials.types import Reading
from .fingerprint import fingerprint
from .lods import are_kin
from .mesh_arrays import AS_FOUND
from .node_queries import surface_query
from .target import Target, bakes, take

_READING = 0.05  # share of the whole that reading the scene takes, about


@dataclass(frozen=True)
class Outcome:
    """One compared asset.

    Attributes:
        reference_target, target: what was asked for.
        pair_result: None where there is an error.
        triangles, reference_triangles: counts after triangulation, before anything is left out.
        seconds: by report.records.STAGES; reading and preparing the reference count in the first outcome.
        fingerprint: of reference and compared, as they were when they were read.
        error: why there is no score.
    """

    reference_target: Target
    target: Target
    pair_result: PairResult | None = None
    triangles: int = 0
    reference_triangles: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    fingerprint: tuple[str, str] = ("", "")
    error: str | None = None

    @property
    def comparison(self) -> Comparison | None:
        """Scores, patches, samples and fields; None where there is an error."""
        return None if self.pair_result is None else self.pair_result.comparison

    @property
    def scores(self) -> Scores | None:
        """Means over the patches and seeds; None where there is an error."""
        return None if self.comparison is None else self.comparison.scores

    @property
    def perceived(self) -> Perceived | None:
        """The second reading, means over the patches and seeds; None where there is an error."""
        return None if self.comparison is None else self.comparison.perceived

    @property
    def trust(self) -> Trust | None:
        """How far to trust the scores; None where there is an error."""
        return None if self.comparison is None else self.comparison.trust

    @property
    def reverse(self) -> Scores | None:
        """Scores of the other direction; None where they were not asked for, or there is an error."""
        return None if self._reverse is None else self._reverse.scores

    @property
    def reverse_perceived(self) -> Perceived | None:
        """The second reading of the other direction; None as reverse is."""
        return None if self._reverse is None else self._reverse.perceived

    @property
    def _reverse(self) -> Readings | None:
        return None if self.pair_result is None else self.pair_result.reverse

    @property
    def attribution(self) -> Attribution | None:
        """Whose loss it is; None where that was not asked for, or there is an error."""
        return None if self.pair_result is None else self.pair_result.attribution

    @property
    def warnings(self) -> tuple[str, ...]:
        """What should be known before the scores are believed."""
        return () if self.pair_result is None else self.pair_result.warnings

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done with the pair that misleads nobody."""
        return () if self.pair_result is None else self.pair_result.notes


def measuring(
    reference: Target,
    compared: Sequence[Target],
    options: PairOptions,
    reading: Reading = AS_FOUND,
    finished: Callable[[Outcome], None] = lambda _: None,
) -> Stepper[list[Outcome]]:
    """A stepper over reading, preparing and comparing.

    Everything is read from the scene in the first steps, an asset a step; after these the scene may change.
    An asset that fails has its error in its outcome and does not stop the others.

    Args:
        reading: how the materials are read.
        finished: gets each outcome as soon as it is there.
    """
    return Stepper(_work(reference, compared, options, reading, finished))


def _work(
    reference: Target,
    compared: Sequence[Target],
    options: PairOptions,
    reading: Reading,
    finished: Callable[[Outcome], None],
) -> Work[list[Outcome]]:
    # Read all, then measure: the user may go on working meanwhile.
    read = []
    for index, target in enumerate((reference, *compared)):
        kin = index > 0 and are_kin(target.find(), reference.find())
        item = yield from _read(target, reading, _READING * index / (len(compared) + 1))
        if kin:
            why = f"{target.label}: it is measured with {reference.label}, since one hangs from the other"
            item = replace(item, asset=None, error=f"{why}; choose assets that stand apart")
        read.append(item)
    share = (1 - _READING) / (len(compared) + 1)
    outcomes: list[Outcome] = []
    original, rest = read[0], read[1:]
    shared = {"load": original.seconds}
    error, measurement = original.error, None
    if original.asset is not None:
        measurement = measurement_of(original.asset, surface_query, options)
        preparing = measurement.prepare()
        try:
            yield from as_part(preparing, _READING, share, f"Preparing {reference.label}")
        except FMQMError as reason:
            error, measurement = str(reason), None
        shared = _added(shared, preparing.seconds)
    for index, item in enumerate(rest):
        outcome = Outcome(reference, item.target, error=error or item.error)
        seconds = _added(shared if index == 0 else {}, {"load": item.seconds})
        if measurement is not None and original.asset is not None and item.asset is not None:
            began = _READING + share * (index + 1)
            stepper = comparing_pair(measurement, original.asset, item.asset, options, reading.facts)
            try:
                result = yield from as_part(stepper, began, share, f"Measuring {item.target.label}")
                seconds = _added(seconds, stepper.seconds)
                outcome = Outcome(
                    reference,
                    item.target,
                    result,
                    triangles=len(item.asset.mesh.triangles),
                    reference_triangles=len(original.asset.mesh.triangles),
                    fingerprint=(original.mark(result.alignment), item.mark(result.alignment)),
                    seconds={**seconds, "total": sum(seconds.values())},
                )
            except FMQMError as reason:
                outcome = Outcome(reference, item.target, error=str(reason), seconds=seconds)
        outcomes.append(outcome)
        finished(outcome)
    return outcomes


@dataclass(frozen=True)
class _Read:
    target: Target
    asset: AssetMesh | None
    marks: tuple[str, str]  # fingerprints, by whether the location counts
    seconds: float
    error: str | None

    def mark(self, alignment: Alignment) -> str:
        return self.marks[location_counts(alignment.label)]


def _read(target: Target, reading: Reading, done: float) -> Work[_Read]:
    yield Progress(f"Reading {target.label}", done)
    began = time.perf_counter()
    cache = TextureCache()
    baked = bakes(target, reading, cache)
    if baked:
        yield Progress(f"Reading {target.label}: baking {', '.join(baked)}", done)
    asset, error = None, None
    try:
        asset = take(target, reading, cache)
    except FMQMError as reason:
        error = str(reason)
    marks = (fingerprint(target, False), fingerprint(target, True))
    return _Read(target, asset, marks, time.perf_counter() - began, error)


def _added(a: dict[str, float], b: dict[str, float]) -> dict[str, float]:
    return {stage: a.get(stage, 0.0) + b.get(stage, 0.0) for stage in (*a, *(stage for stage in b if stage not in a))}
