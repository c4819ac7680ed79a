# SPDX-License-Identifier: GPL-3.0-or-later
"""One pair, from aligning its two meshes to all that is wanted of their comparison, in steps.

The button, the Python API and the scripts score their pairs with this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..metric.errors import SettingsError
from ..metric.settings import Settings, info_of, setting
from ..metric.stepper import Stepper, Work, as_part
from ..metric.surface import QueryBuilder, Surface
from .alignment import ALIGNS, SPACES, Alignment, AssetMesh, align
from .attribution import Attribution, attribute
from .measurement import Comparison, Measurement, Readings
from .pose import pose_warnings
from .surface_facts import Fact


@dataclass(frozen=True, kw_only=True)
class PairOptions:
    """How pairs are scored, and what else is wanted of them: the one set of options, from a button or a flag to a pair.

    Attributes:
        settings: of the metric. repeats: seeds settings.seed to settings.seed + repeats - 1.
        space, match_scale: as in comparison.alignment.align.
        align: "icp" refines each placement, as there.
        both: score the other direction too. attribution: score geometry and texture apart too.

    Raises:
        SettingsError: one of these has a value that it cannot have.
    """

    settings: Settings = Settings()
    repeats: int = setting(1, "measure with so many seeds; scores become means, with their standard errors", minimum=1)
    space: str = setting(
        "auto",
        "where the two are compared: as they stand in their worlds, in their local spaces, or (auto) in the world "
        "unless another place fits far better",
        choices=SPACES,
    )
    match_scale: bool = setting(
        False, "undo a difference in size: a factor between units, such as 2.54, or any that fits"
    )
    align: str = setting(
        "none", "refine the placement: icp does so rigidly, for scans that stand a little askew", choices=ALIGNS
    )
    both: bool = setting(False, "score the other direction too, which sees what only the LOD has; takes twice as long")
    attribution: bool = setting(
        False, "score geometry and texture apart too: whose loss it is; takes up to three times as long"
    )

    def __post_init__(self) -> None:
        if not isinstance(self.settings, Settings):
            raise SettingsError(f"settings are {self.settings!r}; they must be Settings(...)")
        for name, choices in (("space", SPACES), ("align", ALIGNS)):
            if getattr(self, name) not in choices:
                raise SettingsError(f"{name} is {getattr(self, name)!r}; it must be one of {', '.join(choices)}")
        if fault := info_of(PairOptions, "repeats").fault(self.repeats):
            raise SettingsError(f"repeats is {self.repeats}; it must be {fault}")
        self.settings.with_seed(self.settings.seed + self.repeats - 1)  # it raises what is wrong with the last seed

    def as_dict(self) -> dict[str, Any]:
        """Plain values of all that decides the scores, under the names of the command line's flags."""
        rest = {"repeats": self.repeats, "space": self.space, "match_scale": self.match_scale}
        refined = {} if self.align == "none" else {"align": self.align}
        return self.settings.as_dict() | rest | refined


@dataclass(frozen=True)
class PairResult:
    """A scored pair.

    Attributes:
        reference: the prepared surface; comparison holds the other one.
        reverse: readings of the other direction; None: not asked for.
        attribution: whose loss it is; None: not asked for.
    """

    reference: Surface
    alignment: Alignment
    comparison: Comparison
    reverse: Readings | None
    attribution: Attribution | None

    @property
    def warnings(self) -> tuple[str, ...]:
        """What should be known before the scores are believed."""
        return (*self.alignment.warnings, *self.comparison.warnings)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done with the pair that misleads nobody."""
        return (*self.alignment.notes, *self.comparison.notes)


def measurement_of(reference: AssetMesh, build_query: QueryBuilder, options: PairOptions) -> Measurement:
    """The measurement of a reference, to be prepared once for all its pairs."""
    return Measurement(reference.world(), build_query, options.settings, options.repeats)


def comparing_pair(
    measurement: Measurement,
    reference: AssetMesh,
    compared: AssetMesh,
    options: PairOptions,
    known: Sequence[Fact] = (),
) -> Stepper[PairResult]:
    """A stepper over aligning and comparing a mesh with the reference of a measurement.

    Args:
        measurement: measurement_of(reference, ..., options), prepared.
        known: facts for the trust report that are known before, such as how the materials were read.

    Raises:
        MeshError, while stepping: the compared mesh cannot be measured.
    """
    return Stepper(_comparing_pair(measurement, reference, compared, options, known))


def _comparing_pair(
    measurement: Measurement,
    reference: AssetMesh,
    compared: AssetMesh,
    options: PairOptions,
    known: Sequence[Fact],
) -> Work[PairResult]:
    alignment = align(
        reference, compared, options.space, options.match_scale, measurement.reference, options.align == "icp"
    )
    posed = pose_warnings(reference.mesh.name, reference.pose, compared.mesh.name, compared.pose)
    alignment = replace(alignment, warnings=(*alignment.warnings, *posed))
    share = 1 / (1 + options.both + 2 * options.attribution)  # attribution makes two comparisons
    placed = (*_alignment_facts(alignment), *_pose_facts(reference, compared))
    comparing = measurement.compare(alignment.mesh, (*placed, *known))
    comparison = yield from as_part(comparing, 0.0, share)
    reverse, attribution = None, None
    if options.both:
        reverse = yield from as_part(measurement.reverse(alignment.mesh), share, share)
    if options.attribution:
        attributing = attribute(measurement, reference.world(), alignment.mesh, comparison)
        attribution = yield from as_part(attributing, 1 - 2 * share, 2 * share)
    return PairResult(measurement.reference, alignment, comparison, reverse, attribution)


def _alignment_facts(alignment: Alignment) -> tuple[Fact, ...]:
    return (
        Fact("space", alignment.label, "where the two were compared"),
        Fact("size_divided_by", alignment.factor, "factor between units"),
        Fact("boxes_apart", alignment.misfit, "share of the original's box diagonal"),
    )


def _pose_facts(reference: AssetMesh, compared: AssetMesh) -> tuple[Fact, ...]:
    unit = "frame and clip, or rest: without a clip"
    return (
        Fact("pose_of_reference", str(reference.pose), unit),
        Fact("pose_of_distorted", str(compared.pose), unit),
    )
