# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in small steps, for a loop, a progress bar or a timer alike."""

from __future__ import annotations

import time
from collections.abc import Generator
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Progress:
    """What a step has worked on, and the share of the whole stepper that is done, in [0, 1].

    The stage is "" in work that has only one: what it is a part of names it.
    """

    stage: str
    done: float


Work = Generator[Progress, None, T]


class Stepper(Generic[T]):
    """Work in steps of some milliseconds: for a loop, a progress bar or a timer alike.

    Attributes:
        progress: where the work is. result: there once step() is False.
        seconds: by stage, from the first step on, with what has passed between the steps: as long as someone waits.
    """

    def __init__(self, work: Work[T]) -> None:
        self._work = work
        self._done = False
        self._last: float | None = None  # when the last step ended
        self.progress = Progress("", 0.0)
        self.seconds: dict[str, float] = {}
        self.result: T

    def step(self) -> bool:
        """Do a little; True while there is more to do."""
        if self._done:
            return False
        began = time.perf_counter() if self._last is None else self._last
        more = True
        try:
            self.progress = next(self._work)
        except StopIteration as end:
            self.result = end.value
            self._done, more = True, False
        stage = self.progress.stage
        self._last = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + self._last - began
        return more

    def run(self) -> T:
        """All of it at once."""
        while self.step():
            pass
        return self.result

    def steps(self) -> Work[T]:
        """Its progress after each step; ends in the result."""
        while self.step():
            yield self.progress
        return self.result

    def cancel(self) -> None:
        self._work.close()
        self._done = True


def as_part(part: Stepper[T] | Work[T], first: float, share: float, stage: str | None = None) -> Work[T]:
    """The steps of something smaller as a part of larger work; ends in its result.

    Args:
        first, share: where in the larger work it begins, and how much of that it is.
        stage: what all of its steps are called; None: as it calls them.
    """
    work = part.steps() if isinstance(part, Stepper) else part
    while True:
        try:
            step = next(work)
        except StopIteration as end:
            result: T = end.value
            return result
        yield Progress(stage or step.stage, first + share * step.done)


def finish(work: Work[T]) -> T:
    """What work ends in, all of it at once."""
    return Stepper(work).run()
