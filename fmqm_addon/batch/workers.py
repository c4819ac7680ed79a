# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs scored by several processes of the same program, each on a shard, watched by this one.

A worker reads its shard, a JSON list of tasks, and writes a journal beside it, which is followed here. There is no
other talk between them: a worker that dies, hangs or swells is ended, and the rest of its shard goes to the next.
"""

from __future__ import annotations

import faulthandler
import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..folders import TEMPORARY_PLACES
from ..metric.errors import FileError, FMQMError
from .interrupt import defer_interrupts
from .journal import Journal, own_record, parse_line
from .progress_log import Log
from .rows import Task, group_by_reference

PACKAGE = Path(__file__).resolve().parents[1]
NOTE = "note: "  # begins a line that a worker prints for this process's log
WORKER = "FMQM_WORKER"  # set in the environment of workers
TRIES = 2  # a pair that ends its worker is tried once more
_POLL = 0.1  # seconds between looks at the workers
_MIN_SECONDS = 5.0  # seconds of work that a worker is started for, at least
_MAX_FAILED_STARTS = 3  # workers in a row that end before their first pair: it is not the pairs
_START_TIMEOUT = 120.0  # seconds that a worker has to begin its first pair: a busy machine is not the pair's fault
_GRACE = 30.0  # seconds after its time-out until a stuck worker ends itself, should nobody do it
_LONGEST = 1e8  # seconds, three years; faulthandler takes no more than its clock can count

Command = Callable[[str], Sequence[str]]  # the command line of a worker, for the path of its shard


@dataclass(frozen=True)
class Limits:
    """What a pair may take: seconds, and bytes of resident memory of its worker (None: any)."""

    timeout: float = 3600.0
    memory: float | None = None


def journal_of(shard: str) -> str:
    return f"{shard}l"  # .json to .jsonl


def score_with_workers(
    tasks: Sequence[Task],
    command: Command,
    folder: Path,
    jobs: int,
    limits: Limits,
    journal: Journal,
    log: Log,
    cwd: str | None = None,
) -> None:
    """Scores all tasks into the journal.

    Args:
        command: a worker's.
        folder: for shards and the workers' journals and temporary files.
        log: counts the pairs.
        cwd: the workers' working directory; None is that of this process.

    Raises:
        FMQMError: workers end before they score anything, cannot be started, or their memory cannot be watched; or
            this process is a worker itself.
    """
    if WORKER in os.environ:
        raise FMQMError("a worker starts no workers; this is a fault of the program")
    if limits.memory is not None and resident_bytes(os.getpid()) is None:
        raise FMQMError("--memory-limit: neither /proc nor ps tells the memory of a process here; leave it out")
    pool = _Pool(tasks, command, folder, limits, journal, log, cwd)
    try:
        while pool.waiting or pool.workers:
            with defer_interrupts():  # a stop inside of Popen.poll would leave its lock closed, and Popen.wait waiting
                pool.update(jobs)
            time.sleep(_POLL)
    finally:
        pool.stop()
    log.end()


def recover_scores(folder: Path, journal: Journal) -> None:
    """Takes over the scores of workers whose parent was killed before it read them, and which pairs they were at."""
    for path in sorted(folder.glob("shard-*.jsonl")):
        for event in map(parse_line, path.read_bytes().splitlines()):
            record = own_record(event, journal.made_by) if "done" in event else None
            if "start" in event and not journal.has_scores(event["start"]):
                journal.start(event["start"])
            elif record and record["error"] is None and not journal.has_scores(event["done"]):
                journal.done(event["done"], record)


class _Pool:
    """The tasks that wait and the workers that are at it."""

    def __init__(
        self,
        tasks: Sequence[Task],
        command: Command,
        folder: Path,
        limits: Limits,
        journal: Journal,
        log: Log,
        cwd: str | None,
    ) -> None:
        # Last, what an earlier run began and did not end: it may have been what ended that run.
        fresh = [task for task in tasks if not journal.was_begun(task.key)]
        begun = [task for task in tasks if journal.was_begun(task.key)]
        self.waiting = deque(task for part in (fresh, begun) for group in group_by_reference(part) for task in group)
        self.workers: list[_Worker] = []
        self._command = command
        self._folder = folder
        self._limits = limits
        self._journal = journal
        self._log = log
        self._cwd = cwd
        self._failed: Counter[str] = Counter()  # tries, by key
        self._began = time.monotonic()
        self._noted: set[str] = set()
        self._started = 0  # workers
        self._failed_starts = 0  # workers in a row that scored nothing

    def update(self, jobs: int) -> None:
        """Starts workers where there is room, takes what they have done, and replaces those that failed."""
        while self.waiting and len(self.workers) < jobs:
            share = [self.waiting.popleft() for _ in range(self._share(jobs))]
            self._started += 1
            shard = self._folder / f"shard-{self._started}.json"
            self.workers.append(_Worker(self._command, shard, share, self._cwd))
        for worker in list(self.workers):
            self._read_events(worker)  # first, since this process may have stood still for long, and the worker not
            trouble = worker.trouble(self._limits)
            if worker.ended or trouble:
                worker.end()
                self._read_events(worker)
                self.workers.remove(worker)
                self._replace_worker(worker, trouble)

    def stop(self) -> None:
        """Ends all workers, and takes what they have done."""
        for worker in self.workers:
            worker.end()
            self._read_events(worker)

    def _share(self, jobs: int) -> int:
        """Much at first, less towards the end, so that all finish together; but worth the start of a worker."""
        if jobs == 1:
            return len(self.waiting)
        fair = len(self.waiting) / (jobs - len(self.workers))
        if not self._log.finished:
            return math.ceil(fair * 0.75)
        seconds = (time.monotonic() - self._began) * jobs / self._log.finished
        return min(len(self.waiting), math.ceil(max(len(self.waiting) / jobs / 2, _MIN_SECONDS / seconds)))

    def _read_events(self, worker: _Worker) -> None:
        for note in worker.new_notes():
            if note not in self._noted:  # each worker that prepares a reference has the same to say
                self._noted.add(note)
                self._log.note(note)
        for event in worker.new_events():
            if "start" in event:
                self._journal.start(event["start"])
            elif "done" in event:
                self._finish(event["done"], own_record(event, self._journal.made_by))

    def _finish(self, key: str, record: Mapping[str, Any]) -> None:
        self._failed_starts = 0
        self._journal.done(key, record)
        self._log.scored(record)

    def _replace_worker(self, worker: _Worker, trouble: str) -> None:
        """What it left goes to the next; the pair it failed at is tried once more, after all others."""
        rest = list(worker.tasks.values())
        if not rest:
            return
        why = trouble or worker.exit_reason()
        failed = worker.tasks.get(worker.at)
        if failed is None:
            self._failed_starts += 1
            if self._failed_starts == _MAX_FAILED_STARTS:
                raise FMQMError(f"workers end before their first pair ({worker.last_line() or why})")
            self.waiting.extendleft(reversed(rest))
            return
        rest.remove(failed)
        self.waiting.extendleft(reversed(rest))
        self._failed[failed.key] += 1
        name = failed.row.distorted
        if self._failed[failed.key] < TRIES:
            self._log.say(f"{name}: {why}; it will be tried once more", failed.row.id)
            self.waiting.append(failed)
        else:
            self._finish(failed.key, failed.row.failed(f"{name}: {why}, {TRIES} times; look at it alone"))


class _Worker:
    """A process, its shard, and its journal as far as it is read.

    Attributes:
        tasks: those it has not done, by key. at: key of the one it is at, "" before the first and between two.
    """

    def __init__(self, command: Command, shard: Path, tasks: Sequence[Task], cwd: str | None) -> None:
        self.tasks = {task.key: task for task in tasks}
        self.at = ""
        self._shard = shard
        self._log = shard.with_suffix(".log")
        self._read = self._read_log = 0  # bytes of its journal, and of what it has printed
        self._heard, self._begun = time.monotonic(), False
        try:
            shard.write_text(json.dumps([task.as_dict() for task in tasks]), encoding="utf-8")
            with open(self._log, "wb") as log:
                # Its input is a pipe that nothing is written to: it closes when this process ends, however it does.
                # In a session of its own, Ctrl-C reaches only this process, which ends it.
                self._process = subprocess.Popen(
                    command(str(shard)),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=log,
                    cwd=cwd,
                    env=os.environ | dict.fromkeys(TEMPORARY_PLACES, str(shard.parent.resolve())) | {WORKER: "1"},
                    start_new_session=True,
                )
        except OSError as error:
            raise FileError(f"{shard}: a worker cannot be started ({error.strerror or error})") from error

    @property
    def ended(self) -> bool:
        return self._process.poll() is not None

    def trouble(self, limits: Limits) -> str:
        """Why it must be ended; "" if all is well."""
        if self.ended:
            return ""
        silent = time.monotonic() - self._heard
        if not self._begun and silent > max(_START_TIMEOUT, limits.timeout):
            return f"it does not begin within {max(_START_TIMEOUT, limits.timeout):g} s"
        if self._begun and silent > limits.timeout:
            return f"not scored within {limits.timeout:g} s (--timeout)"
        if limits.memory is not None and (resident_bytes(self._process.pid) or 0) > limits.memory:
            return f"scoring it takes more than {limits.memory / 1e9:g} GB of memory (--memory-limit)"
        return ""

    def new_events(self) -> list[dict[str, Any]]:
        """The events in its journal since the last time; a line that is still being written comes later."""
        whole = _whole_lines(Path(journal_of(str(self._shard))), self._read)
        self._read += len(whole)
        events = [parse_line(line) for line in whole.splitlines()]
        for event in events:
            self._heard, self._begun = time.monotonic(), True
            self.at = event.get("start", "")
            self.tasks.pop(event.get("done", ""), None)
        return events

    def new_notes(self) -> list[str]:
        """What it has noted since the last time."""
        whole = _whole_lines(self._log, self._read_log)
        self._read_log += len(whole)
        lines = whole.decode("utf-8", "replace").split("\n")
        return [line.removeprefix(NOTE) for line in lines if line.startswith(NOTE)]

    def end(self) -> None:
        """Kills it if it lives, and waits for its end."""
        self._process.kill()
        self._process.wait()
        if self._process.stdin:
            self._process.stdin.close()

    def exit_reason(self) -> str:
        """How it ended by itself, and what it said last."""
        code = self._process.returncode
        how = f"ended with exit code {code}" if code >= 0 else f"died ({_signal_name(-code)})"
        line = self.last_line()
        return f"its worker {how}{f', saying: {line}' if line else ''}"

    def last_line(self) -> str:
        lines = self._log.read_text(encoding="utf-8", errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "")


def _whole_lines(path: Path, begin: int) -> bytes:
    """What a file holds from there on, but for a line that is still being written."""
    try:
        with open(path, "rb") as file:
            file.seek(begin)
            written = file.read()
    except FileNotFoundError:
        return b""
    return written[: written.rfind(b"\n") + 1]


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # real-time signals have none
        return f"signal {number}"


def resident_bytes(pid: int) -> int | None:
    """Resident memory of a process; None if it is gone, or unknown on this system."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, IndexError):
        pass
    try:
        ps = subprocess.run(["ps", "-o", "rss=", "-p", str(pid)], capture_output=True, text=True, check=False)
        return int(ps.stdout) * 1024
    except (OSError, ValueError):
        return None


def end_with_parent() -> None:
    """Lets this process end as soon as its standard input closes. The thread touches nothing else."""

    def wait() -> None:
        while os.read(0, 1):
            pass
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def end_when_stuck(timeout: float) -> None:
    """Lets this process end some time after the timeout, even where the parent is gone and no Python runs any more."""
    faulthandler.dump_traceback_later(min(timeout + _GRACE, _LONGEST), exit=True, file=2)


def workers_command(script: str, arguments: Sequence[str]) -> Command:
    """The command line of a worker: under the Blender program if this process is, else in this Python.

    Args:
        script: what a worker runs, a file of this package, from its folder. arguments: of the command line above it.
            A worker's own arguments come first: after a -- among the others they would be names of files.
    """
    blender = sys.modules.get("bpy")
    program = blender.app.binary_path if blender is not None else ""
    path = str(PACKAGE / script)
    # -P: the script's folder is no place to import from.
    start = [program, "-b", "-q", "--python", path, "--"] if program else [sys.executable, "-P", path]
    return lambda shard: [*start, "--worker", shard, *arguments]
