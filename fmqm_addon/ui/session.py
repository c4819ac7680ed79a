# SPDX-License-Identifier: GPL-3.0-or-later
"""What the add-on remembers while Blender runs and never saves: fields, running jobs, what is out of date."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..comparison.measurement import Comparison
from ..metric.geometry import Floats
from ..metric.surface import Surface


@dataclass(frozen=True)
class Measured:
    """All that a row of the results was computed from.

    Attributes:
        reference: the prepared reference. comparison: scores, patches, samples and fields.
        reference_to_world, distorted_to_world: (4, 4) float64; they take positions in scene units,
            `comparison.result.frame.leave(...)`, to where the reference and the compared object stand in
            the world. They differ from the identity where Space moved an object for the measurement.
        reference_stood, distorted_stood: (4, 4) the world matrix of a single object then; None for several.
    """

    reference: Surface
    comparison: Comparison
    reference_to_world: Floats
    distorted_to_world: Floats
    reference_stood: Floats | None = None
    distorted_stood: Floats | None = None


@dataclass
class Job:
    """The measurement that is running.

    Attributes:
        progress: share done, in [0, 1]. text: what is being done.
        cancelled: set by the Cancel button; the operator looks at it at its next tick.
        stop: ends it at once and takes its timer away.
    """

    stop: Callable[[], None]
    progress: float = 0.0
    text: str = ""
    cancelled: bool = False


job: Job | None = None
stale: dict[str, str] = {}  # uid of a row: what has changed since it was measured
longest_tick = 0.0  # seconds, of the last measurement in the window
_measured: dict[str, Measured] = {}


def put(uid: str, measured: Measured) -> None:
    _measured[uid] = measured


def get(uid: str) -> Measured | None:
    """None: measured in another session, or the row was removed since; it has to be measured again."""
    return _measured.get(uid)


def keep(uids: set[str]) -> None:
    """Lets go of all that belongs to other rows."""
    for remembered in (_measured, stale):
        for uid in remembered.keys() - uids:
            del remembered[uid]


def clear() -> None:
    _measured.clear()
    stale.clear()
