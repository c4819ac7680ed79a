# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects of the open scene against their reference, in steps: what the button and the Python API run."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from ..metric.errors import FMQMError
from ..metric.score import Progress, Stepper, Work
from ..metric.settings import Settings
from ..metric.spatial import Floats
from ..metric.surface import Surface
from ..metric.trust import Trust
from .attribution import Attribution, attribute
from .images import TextureCache
from .looks import Reading
from .measure import Comparison, Measurement
from .mesh import AS_FOUND
from .snapshot import Target, bakes, fingerprint, take
from .space import Placed, Placement, place, place_counts
from .trust import known_facts

_READING = 0.05  # share of the whole that reading the scene takes, about


@dataclass(frozen=True)
class Outcome:
    """One compared asset.

    Attributes:
        reference_target, target: what was asked for.
        reference, comparison, placement: None where there is an error.
        triangles, reference_triangles: counts after triangulation, before anything is left out.
        seconds: by report.pair.STAGES; reading and preparing the reference count in the first outcome.
        fingerprint: of reference and compared, as they were when they were read; see pair_fingerprint.
        reverse: (5,) float64 scores of the other direction, where they were asked for.
        attribution: whose loss it is, where that was asked for.
        error: why there is no score.
    """

    reference_target: Target
    target: Target
    reference: Surface | None = None
    comparison: Comparison | None = None
    placement: Placement | None = None
    triangles: int = 0
    reference_triangles: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    fingerprint: tuple[str, str] = ("", "")
    reverse: Floats | None = None
    attribution: Attribution | None = None
    error: str | None = None

    @property
    def scores(self) -> Floats | None:
        """(5,) float64 in the order of metric.score.COLUMNS; None where there is an error."""
        return None if self.comparison is None else self.comparison.scores

    @property
    def trust(self) -> Trust | None:
        """How far to trust the scores; None where there is an error."""
        return None if self.comparison is None else self.comparison.trust

    @property
    def warnings(self) -> tuple[str, ...]:
        """What should be known before the scores are believed."""
        own = () if self.placement is None else self.placement.warnings
        return own + (() if self.comparison is None else self.comparison.warnings)


def pair_fingerprint(reference: Target, target: Target, label: str) -> tuple[str, str]:
    """Tells which of the two has changed since the measurement whose Placement.label is given."""
    counts = place_counts(label)
    return fingerprint(reference, counts), fingerprint(target, counts)


def measuring(
    reference: Target,
    compared: Sequence[Target],
    settings: Settings,
    repeats: int = 1,
    space: str = "auto",
    match_scale: bool = False,
    both: bool = False,
    attribution: bool = False,
    reading: Reading = AS_FOUND,
    finished: Callable[[Outcome], None] = lambda _: None,
) -> Stepper[list[Outcome]]:
    """A stepper over reading, preparing and comparing.

    Everything is read from the scene in the first steps, an asset a step; after these the scene may change.
    An asset that fails has its error in its outcome and does not stop the others.

    Args:
        repeats: seeds settings.seed to settings.seed + repeats - 1.
        space, match_scale: as in blender.space.place.
        both: score the other direction too.
        attribution: score geometry and texture apart too.
        reading: how the materials are read.
        finished: gets each outcome as soon as it is there.
    """
    return Stepper(
        _work(reference, compared, settings, repeats, space, match_scale, both, attribution, reading, finished)
    )


def _work(
    reference: Target,
    compared: Sequence[Target],
    settings: Settings,
    repeats: int,
    space: str,
    match_scale: bool,
    both: bool,
    attribution: bool,
    reading: Reading,
    finished: Callable[[Outcome], None],
) -> Work[list[Outcome]]:
    # Read all, then measure: the user may go on working meanwhile.
    read = []
    for index, target in enumerate((reference, *compared)):
        item = yield from _read(target, reading, _READING * index / (len(compared) + 1))
        read.append(item)
    share = (1 - _READING) / (len(compared) + 1)
    outcomes: list[Outcome] = []
    original, rest = read[0], read[1:]
    shared = {"load": original.seconds}
    error, measurement = original.error, None
    if original.placed is not None:
        measurement = Measurement(original.placed.world(), settings, repeats)
        preparing = measurement.prepare()
        try:
            while preparing.step():
                yield Progress(f"Preparing {reference.label}", _READING + share * preparing.progress.done)
        except FMQMError as reason:
            error, measurement = str(reason), None
        shared = _added(shared, preparing.seconds)
    for index, item in enumerate(rest):
        outcome = Outcome(reference, item.target, error=error or item.error)
        seconds = _added(shared if index == 0 else {}, {"load": item.seconds})
        if measurement is not None and original.placed is not None and item.placed is not None:
            began = _READING + share * (index + 1)
            try:
                placement = place(original.placed, item.placed, space, match_scale)
                comparing = measurement.compare(placement.mesh, known_facts(placement, reading))
                one = share / (1 + both + 2 * attribution)
                while comparing.step():
                    yield Progress(f"Measuring {item.target.label}", began + one * comparing.progress.done)
                seconds = _added(seconds, comparing.seconds)
                reverse = None
                if both:
                    turned = measurement.reverse(placement.mesh)
                    while turned.step():
                        yield Progress(f"Measuring from {item.target.label}", began + one * (1 + turned.progress.done))
                    reverse = turned.result
                    seconds = _added(seconds, turned.seconds)
                whose = None
                if attribution:
                    attributing = attribute(measurement, original.placed.world(), placement.mesh, comparing.result)
                    while attributing.step():
                        done = began + one * (1 + both + 2 * attributing.progress.done)
                        yield Progress(f"Attributing {item.target.label}", done)
                    whose = attributing.result
                    seconds = _added(seconds, attributing.seconds)
                outcome = Outcome(
                    reference,
                    item.target,
                    reference=measurement.reference,
                    comparison=comparing.result,
                    placement=placement,
                    triangles=len(item.placed.mesh.triangles),
                    reference_triangles=len(original.placed.mesh.triangles),
                    fingerprint=(original.mark(placement), item.mark(placement)),
                    reverse=reverse,
                    attribution=whose,
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
    placed: Placed | None
    marks: tuple[str, str]  # fingerprints, by whether the place counts
    seconds: float
    error: str | None

    def mark(self, placement: Placement) -> str:
        return self.marks[place_counts(placement.label)]


def _read(target: Target, reading: Reading, done: float) -> Work[_Read]:
    yield Progress(f"Reading {target.label}", done)
    began = time.perf_counter()
    cache = TextureCache()
    baked = bakes(target, reading, cache)
    if baked:
        yield Progress(f"Reading {target.label}: baking {', '.join(baked)}", done)
    placed, error = None, None
    try:
        placed = take(target, reading, cache)
    except FMQMError as reason:
        error = str(reason)
    marks = (fingerprint(target, False), fingerprint(target, True))
    return _Read(target, placed, marks, time.perf_counter() - began, error)


def _added(a: dict[str, float], b: dict[str, float]) -> dict[str, float]:
    return {stage: a.get(stage, 0.0) + b.get(stage, 0.0) for stage in (*a, *(stage for stage in b if stage not in a))}
