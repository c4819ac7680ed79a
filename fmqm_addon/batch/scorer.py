# SPDX-License-Identifier: GPL-3.0-or-later
"""Scoring rows in this process, one after the other; pairs that share a reference share its preparation."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..metric.errors import (
    FileError,
    FMQMError,
    ImageMissingError,
    ImageSizeError,
    OutputError,
    OutsideError,
    one_line,
)
from ..report.explain import explain, where
from ..report.records import Costs, PairScore, pair_record
from ..report.texture_memory import texture_bytes
from .interrupt import defer_interrupts
from .journal import Journal
from .progress_log import Log, print_stderr
from .rows import BatchOptions, Row, Task, group_by_reference, task_of
from .workers import NOTE, end_when_stuck, end_with_parent, journal_of

if TYPE_CHECKING:
    from ..comparison.alignment import AssetMesh
    from ..comparison.measurement import Measurement
    from ..comparison.pair import PairOptions, PairResult
    from ..metric.stepper import Stepper
    from ..report.html.viewer.files import ReferenceFile
    from ..screen_size.measure import ScreenSizes

T = TypeVar("T")
# What the scripts can do about an error; the sidebar cannot.
REMEDIES: dict[type[Exception], str] = {
    ImageMissingError: ", give another (--texture, --ref-texture) or let it be magenta (--bake)",
    ImageSizeError: "; see --max-image-side, --max-image-bytes",
    OutsideError: ", or allow the folder where it is (--asset-root)",
}


def score_tasks(
    tasks: Sequence[Task],
    options: BatchOptions,
    journal: Journal,
    log: Log,
    before_each: Callable[[], None] | None = None,
) -> PairResult | None:
    """Scores all into the journal; a pair that fails does not stop the others. None if the last one failed.

    Args:
        log: counts units_of(tasks). before_each: called before each pair.
    """
    scorer = _Scorer(options, journal, log, before_each)
    for group in group_by_reference(tasks):
        scorer.score(group)
    log.end()
    return scorer.last


def units_of(tasks: Sequence[Task]) -> int:
    """Of work: each pair, and each reference."""
    return len(tasks) + len(group_by_reference(tasks))


def score_shard(shard: str, options: BatchOptions, versions: Mapping[str, str], stuck_after: float) -> None:
    """What a worker does: scores the tasks of a shard into the journal beside it, as long as its parent lives.

    Raises:
        FileError: there is no such shard.
    """
    try:
        tasks = [task_of(plain) for plain in json.loads(Path(shard).read_text(encoding="utf-8"))]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(f"{shard}: no shard for a worker ({getattr(error, 'strerror', None) or error})") from error
    end_with_parent()
    journal = Journal(journal_of(shard), made_by=options.made_by(versions))
    log = _WorkersLog("", units_of(tasks), len(tasks), silent=True)
    score_tasks(tasks, options, journal, log, lambda: end_when_stuck(stuck_after))
    journal.close()


class _WorkersLog(Log):
    """Only notes, which the parent reads and passes on; it sees the rest in the journal."""

    def note(self, text: str) -> None:
        print_stderr(f"{NOTE}{one_line(text)}\n")


class _Scorer:
    """Where the work is, group after group."""

    def __init__(
        self, options: BatchOptions, journal: Journal, log: Log, before_each: Callable[[], None] | None
    ) -> None:
        self.last: PairResult | None = None
        self._options = options
        self._journal = journal
        self._log = log
        self._before_each = before_each
        self._sizes: ScreenSizes | None = None  # of the group's reference
        self._reference_file: ReferenceFile | None = None  # of the group's reference, for the viewer
        self._units = 0  # of work done
        self._seconds: dict[str, float] = {}  # of the pair at hand, by stage

    def score(self, group: Sequence[Task]) -> None:
        """Prepares the reference that the tasks share, and scores them one by one."""
        from ..blender.scene.node_queries import surface_query
        from ..comparison.pair import measurement_of

        row = group[0].row
        options = self._options.pair_of(row)
        self._reference_file = None
        self._begin(group[0])
        began = time.perf_counter()
        failure = ""
        try:
            reference = self._load(row, row.reference, row.ref_texture)
            self._note_memory(reference, options)
            self._sizes = self._screen_sizes(reference)
            measurement = measurement_of(reference, surface_query, options)
            self._work(measurement.prepare(), "preparing the reference")
        except Exception as error:
            failure = _reason(error, row.reference)
        self._units += 1
        for task in group:
            if task is not group[0]:
                self._begin(task)
            pair = PairScore(task.row.reference, task.row.distorted)
            self.last = None
            why = failure
            if not failure:
                try:
                    pair = self._compare(pair, task.row, reference, measurement)
                except OutputError:
                    raise
                except Exception as error:
                    why = _reason(error, task.row.distorted)
            if why:
                pair = replace(pair, error=why)
                self._log.say(why, task.row.id)
            now = time.perf_counter()
            record = pair_record(replace(pair, seconds={**self._seconds, "total": now - began}))
            record["id"] = task.row.id
            if self._options.explain:
                record["explanation"] = explain(record)
            self._journal.done(task.key, record)
            began = now
            self._units += 1
            self._log.finished += 1

    def _begin(self, task: Task) -> None:
        """Before the reference is loaded too, so that a reference that ends the process names its first pair."""
        if self._before_each is not None:
            self._before_each()
        self._journal.start(task.key)
        self._seconds = {}

    def _compare(self, pair: PairScore, row: Row, reference: AssetMesh, measurement: Measurement) -> PairScore:
        from ..comparison.pair import comparing_pair
        from ..report.trust_table import trust_dict

        loaded = self._load(row, row.distorted, row.texture)
        options, known = self._options.pair_of(row), self._options.reading.facts
        answer = self._work(comparing_pair(measurement, reference, loaded, options, known), f"scoring {row.id}")
        self.last = answer
        comparison, result = answer.comparison, answer.comparison.result
        return replace(
            pair,
            readings=comparison,
            patches=len(result.patches),
            samples=len(result.samples.positions),
            space=answer.alignment.label,
            warnings=answer.warnings,
            notes=answer.notes,
            costs=_costs(answer),
            reverse=answer.reverse,
            trust=trust_dict(comparison.trust),
            parts=tuple(part.as_dict() for part in comparison.trust.parts),
            findings=self._findings(row, answer),
        )

    def _findings(self, row: Row, answer: PairResult) -> dict[str, Any]:
        """What else the options ask for."""
        findings: dict[str, Any] = {}
        surfaces, result = (answer.reference, answer.comparison.distorted), answer.comparison.result
        if self._options.report:
            from ..report.heat import side_of_loss
            from ..report.html.pictures import picture_stem, write_pair_pictures

            judge, side = self._options.judge, side_of_loss(surfaces[0], result, self._options.judge)
            stem = picture_stem(row.reference, row.id, row.distorted)
            findings["pictures"] = write_pair_pictures(self._options.report, stem, *surfaces, result, judge, side)
            findings["viewer"] = self._viewer(row, stem, answer, side)
        if self._options.explain or self._options.report:
            findings["where"] = where(answer.reference, result)
        if answer.attribution is not None:
            findings["attribution"] = answer.attribution.as_dict()
        if self._sizes is not None:
            from ..screen_size.records import size_record

            sized = self._work(self._sizes.measure(answer.alignment.mesh), f"rendering {row.id}")
            findings["screen_size"] = size_record(sized)
        return findings

    def _viewer(self, row: Row, stem: str, answer: PairResult, side: tuple[float, float]) -> dict[str, str]:
        """What can be turned around on the page; of the reference once for its group."""
        from ..report.html.pictures import picture_stem
        from ..report.html.viewer.files import write_pair_data, write_reference_data

        folder, comparison = self._options.report, answer.comparison
        if self._reference_file is None:
            own = picture_stem(row.ref_texture, row.reference)
            self._reference_file = write_reference_data(folder, own, answer.reference)
        judge, result = self._options.judge, comparison.result
        return write_pair_data(folder, stem, self._reference_file, comparison.distorted, result, judge, side)

    def _screen_sizes(self, reference: AssetMesh) -> ScreenSizes | None:
        if not self._options.screen_size:
            return None
        from ..screen_size.measure import ScreenSizes

        sizes = ScreenSizes(reference.world())
        self._work(sizes.prepare(), "preparing the reference")
        return sizes

    def _load(self, row: Row, name: str, image: str) -> AssetMesh:
        self._log.show(self._units, f"loading {name}")
        began = time.perf_counter()
        from ..blender.files.load import load_asset
        from ..blender.materials.images import load_texture

        reading = self._options.reading
        try:
            with defer_interrupts():
                if image:
                    reading = replace(reading, texture=load_texture(row.path(image), reading.limits))
                return load_asset(row.path(name), reading, self._log.note)
        finally:
            self._spent("load", time.perf_counter() - began)

    def _note_memory(self, reference: AssetMesh, options: PairOptions) -> None:
        from ..comparison.memory import WORTH_SAYING, peak_bytes, peak_text

        if peak_bytes(reference.mesh, options.settings, options.repeats) > WORTH_SAYING:
            self._log.note(peak_text(reference.mesh, options.settings, options.repeats))

    def _work(self, stepper: Stepper[T], text: str) -> T:
        """Runs a stepper to its end with its progress shown and its seconds added up by stage."""
        while stepper.step():
            self._log.show(self._units + stepper.progress.done, text)
        for stage, seconds in stepper.seconds.items():
            self._spent(stage, seconds)
        return stepper.result

    def _spent(self, stage: str, seconds: float) -> None:
        self._seconds[stage] = self._seconds.get(stage, 0.0) + seconds


def _reason(error: Exception, name: str) -> str:
    """Why there are no scores; what nobody has foreseen is no reason to leave the other pairs alone."""
    if isinstance(error, FMQMError):
        return str(error) + REMEDIES.get(type(error), "")
    kind = MemoryError if isinstance(error, MemoryError) else type(error)  # numpy has one of its own
    return one_line(f"{name}: {kind.__name__}: {error}")


def _costs(answer: PairResult) -> Costs:
    triangles, whole = (surface.preparation.given for surface in (answer.comparison.distorted, answer.reference))
    return Costs(triangles, triangles / whole, texture_bytes(answer.comparison.distorted))
