# SPDX-License-Identifier: GPL-3.0-or-later
"""The cheapest version of an asset whose score stays at or above a target, found by bisection, in steps.

All versions are scored on the same samples of the same reference, so that their differences are the meshes' and not
chance. Most are scored with few patches; the one that is chosen, and the next cheaper one, with all of them and, where
a file is wanted, as that file holds them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..metric.errors import MeshError, SettingsError
from ..metric.settings import FAST_SCORED_PATCHES, Settings
from ..metric.stepper import Progress, Stepper, Work, as_part
from ..metric.surface import MeshArrays, QueryBuilder
from .judge import Judge
from .measurement import Measurement

TOLERANCE = 0.01  # neighboring versions differ by this share of their triangles
LEAST_TRIANGLES = 4  # a tetrahedron

T = TypeVar("T")

_CLOSE = 4  # versions between those that quick scores pass and miss: they do not tell neighbors apart
_PREPARED = 0.1  # share of the progress
_PER_STEP = 0.1  # of the rest: how many steps there will be is not known


@dataclass(frozen=True)
class Version:
    """What is made of the asset.

    Attributes:
        ratio: of the Decimate modifier (collapse), above 0; 1 leaves the triangles alone.
        texture: longest side of its color images, in pixels; None leaves them alone.
    """

    ratio: float = 1.0
    texture: int | None = None


@dataclass(frozen=True)
class Step:
    """A version that was scored.

    Attributes:
        quick: with few patches, or not as the file holds it; such scores only lead to those that count.
        fmqm, perceived: both scores, in [0, 1]; None: nothing was left that could be measured.
    """

    version: Version
    triangles: int
    fmqm: float | None
    perceived: float | None
    quick: bool

    def score(self, judge: Judge) -> float | None:
        """That of the judge."""
        return self.fmqm if judge is Judge.FMQM else self.perceived


@dataclass(frozen=True)
class SearchResult:
    """The result of one search.

    Attributes:
        reached: whether best is at or above the target; otherwise best is the dearest version that was allowed.
        below: the next cheaper version, which misses the target; None: there is none.
        path: every step that this search took, in order.
    """

    target: float
    reached: bool
    best: Step
    below: Step | None
    path: tuple[Step, ...]


VersionReader = Callable[[Version], MeshArrays]


class Search:
    """An asset, prepared once, with the scores of its versions, for any number of targets.

    Args:
        read: the arrays of a version, always in the same frame; raises MeshError where nothing is left of it.
        settings: that decide. While searching only FAST_SCORED_PATCHES of the patches are scored.
        build_query: makes the spatial query of a surface.
        written: the arrays of a version as its file holds them, in the same frame; these decide. None: no file.
        repeats: seeds of the scores that decide, as of a Measurement.
    """

    def __init__(
        self,
        read: VersionReader,
        build_query: QueryBuilder,
        settings: Settings,
        written: VersionReader | None = None,
        repeats: int = 1,
    ) -> None:
        few = replace(settings, scored_patches=min(settings.scored_patches or settings.patches, FAST_SCORED_PATCHES))
        self._build_query = build_query
        self._read = {True: read, False: written or read}
        self._settings = {True: few, False: settings}
        self._repeats = {True: 1, False: repeats}
        self._same_settings = repeats == 1 and few.scored_patches == (settings.scored_patches or settings.patches)
        self._two_rounds = written is not None or not self._same_settings
        self._measurements: dict[bool, Measurement] = {}
        self._steps: dict[tuple[bool, Version], Step] = {}
        self.triangles = 0  # of the asset as it is; this, its warnings and notes after preparing
        self.warnings: tuple[str, ...] = ()
        self.notes: tuple[str, ...] = ()

    @property
    def measurement(self) -> Measurement:
        """That of the scores that decide; only after prepare()."""
        return self._measurements[False]

    def prepare(self) -> Work[None]:
        """Reads the asset and prepares it as the reference.

        Raises:
            MeshError: it cannot be measured.
        """
        yield Progress("Reading", 0.0)
        asset = self._read[True](Version())
        self.triangles = len(asset.triangles)
        rounds = (False,) if self._same_settings else (True, False)
        for number, quick in enumerate(rounds):
            measurement = Measurement(asset, self._build_query, self._settings[quick], self._repeats[quick])
            yield from as_part(measurement.prepare(), number / len(rounds), 1 / len(rounds), "Preparing")
            self._measurements[quick] = measurement
        self._measurements.setdefault(True, measurement)
        surface = self.measurement.reference
        self.warnings, self.notes = surface.warnings, surface.notes

    def ratios(self, max_triangles: int | None = None) -> list[Version]:
        """Versions with fewer and fewer triangles: TOLERANCE apart, or one triangle where that is more."""
        most = min(self.triangles, max_triangles or self.triangles)
        counts = [most]
        while (fewer := min(counts[-1] - 1, round(counts[-1] * (1 - TOLERANCE)))) >= LEAST_TRIANGLES:
            counts.append(fewer)
        return [self._of_triangles(count) for count in counts]

    def _of_triangles(self, count: int) -> Version:
        # The modifier rounds down; half a triangle more keeps float32 from losing one.
        return Version(1.0 if count == self.triangles else (count + 0.5) / self.triangles)

    def within(self, versions: Sequence[Version], max_triangles: int) -> Work[list[Version]]:
        """Those of falling versions that keep to max_triangles: curves, texts and some meshes collapse less than asked.

        Raises:
            MeshError: none does.
        """

        def exceeds(index: int) -> Work[bool]:
            yield Progress("Counting triangles", 0.0)
            try:
                return len(self._read[True](versions[index]).triangles) > max_triangles
            except MeshError:
                return False  # nothing is left of it

        last = yield from last_passing(len(versions), exceeds, 0, 1)
        if last == len(versions) - 1:
            raise MeshError(f"it cannot be decimated to {max_triangles} triangles; allow more")
        return list(versions[last + 1 :])

    def find(self, target: float, versions: Sequence[Version], judge: Judge = Judge.FMQM) -> Work[SearchResult]:
        """The last of versions, which get ever cheaper, that the judge scores at or above the target; not the next one.

        Scores fall about steadily with them, not strictly: a much cheaper one that happens to pass may be missed.
        """
        path: list[Step] = []

        def scored(index: int, quick: bool) -> Work[bool]:
            step = yield from self._scored(versions[index], quick, len(path))
            if step not in path:
                path.append(step)
            score = step.score(judge)
            return score is not None and score >= target

        start, stride = len(versions) // 2, max(1, len(versions) // 4)
        if self._two_rounds:
            guess = yield from last_passing(len(versions), lambda index: scored(index, True), start, stride, _CLOSE)
            guess = max(guess, 0)
            yield from scored(guess, False)
            start, stride = self._corrected(versions, guess, target, judge), 1
        last = yield from last_passing(len(versions), lambda index: scored(index, False), start, stride)
        steps = [self._steps.get((False, version)) for version in versions[max(last, 0) : max(last, 0) + 2]]
        best, below = steps[0], steps[1] if last >= 0 and len(steps) > 1 else None
        assert best is not None
        return SearchResult(target, last >= 0, best, below, tuple(path))

    def _corrected(self, versions: Sequence[Version], guess: int, target: float, judge: Judge) -> int:
        """The last version that passes if all quick scores are as far off as that of the guess, which has both."""
        quick, full = (self._steps[is_quick, versions[guess]].score(judge) for is_quick in (True, False))
        if quick is None or full is None:
            return guess
        known = [(index, self._steps.get((True, version))) for index, version in enumerate(versions)]
        places, scores = zip(
            *((index, step.score(judge) or 0.0) for index, step in known if step is not None), strict=True
        )
        passing = np.flatnonzero(np.interp(np.arange(len(versions)), places, scores) + (full - quick) >= target)
        return int(passing[-1]) if passing.size else 0

    def _scored(self, version: Version, quick: bool, number: int) -> Work[Step]:
        """Scores of earlier searches serve again."""
        known = self._steps.get((quick, version))
        if known is not None:
            return known
        done = 1 - (1 - _PER_STEP) ** number
        what = f"Trying {100 * version.ratio:.3g} % of the triangles"
        if version.texture is not None:
            what += f", textures of {version.texture}"
        yield Progress(what, done)
        triangles, fmqm, perceived = 0, None, None
        try:
            mesh = self._read[quick](version)
            triangles = len(mesh.triangles)
            scoring = self._measurements[quick].score(mesh)
            readings = yield from as_part(scoring, done, (1 - done) * _PER_STEP, what)
            fmqm, perceived = readings.scores.FMQM, readings.perceived.score
        except MeshError:
            pass  # nothing is left of it: it misses any target
        step = Step(version, triangles, fmqm, perceived, quick)
        self._steps[quick, version] = step
        return step


def last_passing(count: int, passes: Callable[[int], Work[bool]], start: int, stride: int, apart: int = 1) -> Work[int]:
    """The last of `count` indices that passes, next to one that does not; -1 where index 0 does not pass.

    With apart, one that passes where one that does not is at most so many further.

    Goes from start in strides that double until it has passed and failed once, then halves what is between.
    """
    passed, failed, index = -1, count, start
    while failed - passed > (apart if 0 <= passed and failed < count else 1):
        if (yield from passes(index)):
            passed = index
        else:
            failed = index
        if passed < 0:
            index, stride = max(failed - stride, 0), 2 * stride
        elif failed == count:
            index, stride = min(passed + stride, count - 1), 2 * stride
        else:
            index = (passed + failed) // 2
    return passed


@dataclass(frozen=True)
class DecimationGoal:
    """What decimation is to reach.

    Attributes:
        targets: scores that decimated versions must keep; empty: the triangles stay as they are.
        max_triangles: that no version may exceed, at least LEAST_TRIANGLES; None: as many as the asset has.
        texture_target: score that each of them must still keep with smaller textures; None: these stay as they are.
        texture_sizes: longest sides of the color images, falling, the first the present one.
        judge: whose scores these are.

    Raises:
        SettingsError: max_triangles is too small.
    """

    targets: tuple[float, ...] = ()
    max_triangles: int | None = None
    texture_target: float | None = None
    texture_sizes: tuple[int, ...] = ()
    judge: Judge = Judge.FMQM

    def __post_init__(self) -> None:
        if self.max_triangles is not None and self.max_triangles < LEAST_TRIANGLES:
            raise SettingsError(f"max-triangles is {self.max_triangles}; at least {LEAST_TRIANGLES} are wanted")


@dataclass(frozen=True)
class TargetResult:
    """What was found for one target: first the geometry, then for it the textures, each where it was asked for."""

    geometry: SearchResult | None
    texture: SearchResult | None

    @property
    def last(self) -> SearchResult:
        """The last of its searches."""
        found = self.texture or self.geometry
        assert found is not None
        return found


@dataclass(frozen=True)
class DecimationResult:
    """What was found for a goal, a result for each target.

    Attributes:
        triangles: of the asset as it is. warnings: what should be known of it before scores are believed. notes: what
            was done with it that misleads nobody.
    """

    results: tuple[TargetResult, ...]
    triangles: int
    warnings: tuple[str, ...]
    notes: tuple[str, ...]


def decimating(
    read: VersionReader,
    build_query: QueryBuilder,
    goal: DecimationGoal,
    settings: Settings,
    written: VersionReader | None = None,
) -> Stepper[DecimationResult]:
    """A stepper over the searches for a goal; its steps raise what the readers, Measurement and Search.within raise.

    Args:
        read, build_query, settings, written: as for Search.
    """
    return Stepper(searching(Search(read, build_query, settings, written), goal))


def searching(search: Search, goal: DecimationGoal) -> Work[DecimationResult]:
    """The searches for a goal, one after the other, in an asset that is not prepared yet."""
    yield from as_part(search.prepare(), 0.0, _PREPARED)
    ratios = search.ratios(goal.max_triangles)
    if goal.max_triangles is not None:
        ratios = yield from as_part(search.within(ratios, goal.max_triangles), _PREPARED, 0.0)
    parts = max(1, len(goal.targets)) * (1 + (goal.texture_target is not None))
    share = (1 - _PREPARED) / parts
    results: list[TargetResult] = []
    for number, target in enumerate(goal.targets or (None,)):
        first = _PREPARED + share * parts * number / max(1, len(goal.targets))
        geometry, texture, ratio = None, None, 1.0
        if target is not None:
            geometry = yield from as_part(search.find(target, ratios, goal.judge), first, share)
            ratio = geometry.best.version.ratio
        if goal.texture_target is not None and (geometry is None or geometry.reached):
            versions = [Version(ratio), *(Version(ratio, size) for size in goal.texture_sizes[1:])]
            searching = search.find(goal.texture_target, versions, goal.judge)
            texture = yield from as_part(searching, first + share, share)
        results.append(TargetResult(geometry, texture))
    return DecimationResult(tuple(results), search.triangles, search.warnings, search.notes)
