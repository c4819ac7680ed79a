# SPDX-License-Identifier: GPL-3.0-or-later
"""One pair of the open scene, scored again and again while it is worked on, in steps.

The reference is read and prepared once, as long as it does not change. Queries are the plain loop's: nodes would put
a scene of theirs into the file, and into the undo steps of what is being done meanwhile.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

from ...comparison.alignment import align
from ...comparison.candidates import AssetMesh
from ...comparison.measurement import Measurement, Readings
from ...comparison.pair import PairOptions, measurement_of
from ...metric.stepper import Progress, Work, as_part
from ..materials.types import Reading
from .bvh import BVHQuery
from .fingerprint import fingerprint
from .target import Target, take

_PREPARED = 0.4  # share of the progress


@dataclass(frozen=True)
class PairState:
    """A pair as it stands.

    Attributes:
        reference, target: its two assets. options, reading: how it is measured.
        marks: of the two, by fingerprint; "" for one that is gone.
    """

    reference: Target
    target: Target
    options: PairOptions
    reading: Reading
    marks: tuple[str, str]


@dataclass(frozen=True)
class PairReading:
    """What a pair scored: both readings, and how many triangles the compared has."""

    readings: Readings
    triangles: int


@dataclass(frozen=True)
class _Prepared:
    state: PairState
    asset: AssetMesh
    measurement: Measurement


def state_of(reference: Target, target: Target, options: PairOptions, reading: Reading) -> PairState:
    """The pair as it stands now."""
    marks = fingerprint(reference, True), fingerprint(target, True)
    return PairState(reference, target, options, reading, marks)


class RepeatedPair:
    """What one measurement leaves for the next.

    Attributes:
        is_new: the reference is being prepared for the first time, which will not be repeated.
    """

    def __init__(self) -> None:
        self.is_new = False
        self._prepared: _Prepared | None = None

    def measuring(self, state: PairState) -> Work[PairReading]:
        """Scores the pair; its scene may change once it has been read.

        Raises:
            FMQMError: it cannot be measured.
        """
        prepared = self._prepared
        if prepared is None or _of_reference(prepared.state) != _of_reference(state):
            self.is_new = prepared is None or prepared.state.reference != state.reference
            self._prepared = None
            yield Progress(f"Reading {state.reference.label}", 0.0)
            asset = take(state.reference, state.reading)
            measurement = measurement_of(asset, functools.partial(BVHQuery, every_ray=False), state.options)
            yield from as_part(measurement.prepare(), 0.0, _PREPARED)
            prepared = self._prepared = _Prepared(state, asset, measurement)
            self.is_new = False
        yield Progress(f"Reading {state.target.label}", _PREPARED)
        compared = take(state.target, state.reading)
        yield Progress(f"Measuring {state.target.label}", _PREPARED)
        options, measurement = state.options, prepared.measurement
        placed = align(prepared.asset, compared, options.space, options.match_scale, measurement.reference)
        readings = yield from as_part(measurement.score(placed.mesh), _PREPARED, 1 - _PREPARED)
        return PairReading(readings, len(compared.mesh.triangles))


def _of_reference(state: PairState) -> tuple[object, ...]:
    """What a preparation depends on."""
    return state.reference, state.options, state.reading, state.marks[0]
