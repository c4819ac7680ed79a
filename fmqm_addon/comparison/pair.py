# SPDX-License-Identifier: GPL-3.0-or-later
"""One pair, from where its two meshes are put to all that is asked about them, in steps: the button, the Python API
and the script score their pairs with this."""

from __future__ import annotations

from dataclasses import dataclass

from ..blender.materials.types import MAX_BAKE, Reading
from ..blender.trust import known_facts
from ..metric.errors import SettingsError
from ..metric.evaluation import Scores
from ..metric.settings import Settings
from ..metric.stepper import Stepper, Work, as_part
from ..metric.surface import Surface
from .alignment import SPACES, Placed, Placement, place
from .attribution import Attribution, attribute
from .measurement import Comparison, Measurement


@dataclass(frozen=True)
class Question:
    """What is asked about pairs.

    Attributes:
        settings: of the metric. repeats: seeds settings.seed to settings.seed + repeats - 1.
        space, match_scale: as in comparison.alignment.place.
        both: score the other direction too. attribution: score geometry and texture apart too.
        reading: how the materials are read.

    Raises:
        SettingsError: one of these is none that can be asked.
    """

    settings: Settings = Settings()
    repeats: int = 1
    space: str = "auto"
    match_scale: bool = False
    both: bool = False
    attribution: bool = False
    reading: Reading = Reading()

    def __post_init__(self) -> None:
        if not isinstance(self.settings, Settings):
            raise SettingsError(f"settings are {self.settings!r}; they must be Settings(...)")
        if self.repeats < 1:
            raise SettingsError(f"repeats is {self.repeats}; it must be at least 1")
        if self.space not in SPACES:
            raise SettingsError(f"space is {self.space!r}; it must be one of {', '.join(SPACES)}")
        if not 0 <= self.reading.bake <= MAX_BAKE:
            raise SettingsError(f"bake is {self.reading.bake}; it must be between 0 and {MAX_BAKE}")


@dataclass(frozen=True)
class Answer:
    """What came of it.

    Attributes:
        reference: the prepared surface; comparison holds the other one.
        reverse: scores of the other direction; None: not asked for.
        attribution: whose loss it is; None: not asked for.
    """

    reference: Surface
    placement: Placement
    comparison: Comparison
    reverse: Scores | None
    attribution: Attribution | None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What should be known before the scores are believed."""
        return (*self.placement.warnings, *self.comparison.warnings)


def measurement_of(reference: Placed, asked: Question) -> Measurement:
    """To be prepared once for all pairs of the reference."""
    return Measurement(reference.world(), asked.settings, asked.repeats)


def answering(measurement: Measurement, reference: Placed, compared: Placed, asked: Question) -> Stepper[Answer]:
    """Args:
        measurement: measurement_of(reference, asked), prepared.

    Raises:
        MeshError, while stepping: the compared mesh cannot be measured.
    """
    return Stepper(_answering(measurement, reference, compared, asked))


def _answering(measurement: Measurement, reference: Placed, compared: Placed, asked: Question) -> Work[Answer]:
    placement = place(reference, compared, asked.space, asked.match_scale)
    share = 1 / (1 + asked.both + 2 * asked.attribution)  # attribution makes two comparisons
    comparing = measurement.compare(placement.mesh, known_facts(placement, asked.reading))
    comparison = yield from as_part(comparing, 0.0, share)
    reverse, attribution = None, None
    if asked.both:
        reverse = yield from as_part(measurement.reverse(placement.mesh), share, share)
    if asked.attribution:
        attributing = attribute(measurement, reference.world(), placement.mesh, comparison)
        attribution = yield from as_part(attributing, 1 - 2 * share, 2 * share)
    return Answer(measurement.reference, placement, comparison, reverse, attribution)
