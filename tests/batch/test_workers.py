# SPDX-License-Identifier: GPL-3.0-or-later
"""The watch over workers, whatever becomes of them. The workers are fakes: no Blender, no scores."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from fmqm_addon.batch import workers
from fmqm_addon.batch.journal import Journal, parse_line
from fmqm_addon.batch.progress_log import Log
from fmqm_addon.batch.rows import Row, Task
from fmqm_addon.batch.workers import (
    WORKER,
    Command,
    Limits,
    journal_of,
    recover_scores,
    score_with_workers,
    workers_command,
)
from fmqm_addon.metric.errors import FileError, FMQMError
from fmqm_addon.report.records import PairScore, pair_record
from tests.readings import numbers

FAKE = Path(__file__).parent / "fake_worker.py"
ROOT = Path(__file__).resolve().parents[2]


def tasks_of(*names: str) -> list[Task]:
    return [Task(f"k{number}", Row(str(number), "reference", name)) for number, name in enumerate(names)]


def record(name: str, score: float | None) -> dict[str, Any]:
    pair = PairScore("r", name, patches=200, error=None if score else "broken")
    return pair_record(pair) | numbers(score)


def watch(folder: Path, tasks: list[Task], jobs: int = 2, limits: Limits | None = None, told: str = "") -> Journal:
    journal = Journal(str(folder / "journal"))
    log = Log("", len(tasks), len(tasks), silent=True)
    score_with_workers(tasks, fake(folder, told), folder, jobs, limits or Limits(), journal, log)
    return journal


def fake(folder: Path, told: str = "") -> Command:
    return lambda shard: [sys.executable, str(FAKE), told or str(folder), shard]


def alive(folder: Path) -> list[int]:
    """Of the workers that were ever started, those that still run."""
    return [int(path.stem) for path in folder.glob("*.pid") if Path(f"/proc/{path.stem}").exists()]


def finished(folder: Path) -> Counter[str]:
    """How often each pair was noted as done."""
    events = map(parse_line, (folder / "journal").read_bytes().splitlines())
    return Counter(event["done"] for event in events if "done" in event)


def test_each_pair_is_scored_once_by_as_many_workers_as_there_are_jobs(tmp_path: Path) -> None:
    tasks = tasks_of(*["fine"] * 20)
    journal = watch(tmp_path, tasks, jobs=3)
    assert finished(tmp_path) == Counter({task.key: 1 for task in tasks})
    assert len({journal.record(task.key)["pid"] for task in tasks}) >= 3
    assert not alive(tmp_path)


@pytest.mark.parametrize(
    ("name", "limits", "words"),
    [
        ("die", Limits(), "its worker died (SIGKILL), 2 times"),
        ("realtime", Limits(), "its worker died (signal 40), 2 times"),
        ("quit", Limits(), "its worker ended with exit code 1, saying: no memory here, 2 times"),
        ("hang", Limits(timeout=3), "not scored within 3 s (--timeout), 2 times"),
        ("swell", Limits(memory=2e8), "scoring it takes more than 0.2 GB of memory (--memory-limit), 2 times"),
    ],
)
def test_a_pair_that_ends_its_worker_costs_only_itself(tmp_path: Path, name: str, limits: Limits, words: str) -> None:
    tasks = tasks_of("fine", name, "fine", "fine", "fine")
    journal = watch(tmp_path, tasks, limits=limits)
    assert finished(tmp_path) == Counter({task.key: 1 for task in tasks})
    error = journal.record("k1")["error"]
    assert error.startswith(f"{name}: ") and words in error
    assert [task.key for task in tasks if journal.record(task.key)["error"]] == ["k1"]
    assert not journal.has_scores("k1"), "a resumed run tries it again"
    assert not alive(tmp_path)


def test_a_pair_that_fails_once_is_tried_once_more(tmp_path: Path) -> None:
    journal = watch(tmp_path, tasks_of("fine", "die once", "fine"))
    assert all(journal.record(f"k{number}")["error"] is None for number in range(3))


def test_what_an_earlier_run_began_and_did_not_end_comes_last(tmp_path: Path) -> None:
    """It may have ended that run, and would this one."""
    tasks = tasks_of("fine", "fine", "fine")
    left = Journal(str(tmp_path / "journal"))
    left.start("k0")
    left.start("k1")
    left.done("k1", record("1", None))
    left.close()
    journal = Journal(str(tmp_path / "journal"), resume=True)
    score_with_workers(tasks, fake(tmp_path), tmp_path, 1, Limits(), journal, Log("", 3, 3, silent=True))
    events = map(parse_line, (tmp_path / "journal").read_bytes().splitlines()[3:])
    assert [event["done"] for event in events if "done" in event] == ["k1", "k2", "k0"]


def test_a_worker_starts_no_workers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(WORKER, "1")
    with pytest.raises(FMQMError, match="a worker starts no workers"):
        watch(tmp_path, tasks_of("fine"))
    assert not list(tmp_path.glob("*.pid"))


def test_a_workers_own_arguments_come_before_a_double_dash() -> None:
    command = workers_command("cli/worker.py", ["a.obj", "--", "-b.obj"])("S")
    assert command[-5:] == ["--worker", "S", "a.obj", "--", "-b.obj"]
    assert Path(command[-6]) == ROOT / "fmqm_addon" / "cli" / "worker.py"


def test_only_scores_are_adopted_and_only_new_ones(tmp_path: Path) -> None:
    left = Journal(journal_of(str(tmp_path / "shard-1.json")))
    for key, score in (("scored", 0.1), ("repaired", 0.1), ("failed", None), ("new", 0.1)):
        left.done(key, record(key, score))
    left.close()
    journal = Journal()
    journal.done("scored", record("scored", 0.9))
    journal.done("repaired", record("repaired", None))
    recover_scores(tmp_path, journal)
    scores = {key: journal.record(key)["FMQM"] for key in ("scored", "repaired", "new")}
    assert scores == {"scored": 0.9, "repaired": 0.1, "new": 0.1} and "failed" not in journal


def test_a_worker_that_cannot_be_started_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match="shard-1.json: a worker cannot be started"):
        score_with_workers(
            tasks_of("fine"), lambda shard: ["x"], tmp_path / "file", 1, Limits(), Journal(), Log("", 1, 1)
        )


class Clock:
    """The watch's time: 100 seconds pass between two of its looks, in which the workers do what is waited for."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *waited_for: Callable[[], object]) -> None:
        self.now = 0.0
        self._waited_for = iter(waited_for)
        monkeypatch.setattr(workers, "time", SimpleNamespace(monotonic=lambda: self.now, sleep=self.sleep))

    def sleep(self, _: float) -> None:
        self.now += 100
        wait_for(next(self._waited_for, lambda: True))


def test_a_watch_that_stood_still_does_not_take_the_workers_for_stuck(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As after SIGSTOP or a laptop's sleep: the pairs are done, but have not been read for longer than the time-out."""

    def all_done() -> bool:
        (tmp_path / "go").touch()
        return b'{"done": "k2"' in written(tmp_path)

    Clock(monkeypatch, lambda: written(tmp_path), all_done)
    watch(tmp_path, tasks_of("wait", "fine", "fine"), jobs=1, limits=Limits(timeout=2))
    assert finished(tmp_path) == Counter(["k0", "k1", "k2"]) and len(list(tmp_path.glob("*.pid"))) == 1


def test_starting_a_worker_is_not_the_pairs_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine it may take longer than a pair may."""
    (tmp_path / "slow").touch()

    def done() -> bool:
        (tmp_path / "slow").unlink(missing_ok=True)
        return b'{"done": "k0"' in written(tmp_path)

    Clock(monkeypatch, lambda: list(tmp_path.glob("*.pid")), done)
    watch(tmp_path, tasks_of("fine"), jobs=1, limits=Limits(timeout=2))
    assert finished(tmp_path) == Counter(["k0"]) and len(list(tmp_path.glob("*.pid"))) == 1


def written(folder: Path) -> bytes:
    """The first worker's journal so far."""
    path = Path(journal_of(str(folder / "shard-1.json")))
    return path.read_bytes() if path.exists() else b""


def test_a_worker_that_never_begins_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "slow").touch()
    monkeypatch.setattr(workers, "_START_TIMEOUT", 0.1)
    with pytest.raises(FMQMError, match=r"workers end before their first pair \(it does not begin within 0\.1 s\)"):
        watch(tmp_path, tasks_of("fine"), limits=Limits(timeout=0.1))
    assert not alive(tmp_path)


def test_any_timeout_can_be_counted() -> None:
    workers.end_when_stuck(1e300)
    workers.faulthandler.cancel_dump_traceback_later()


def test_workers_that_never_begin_are_the_runs_error(tmp_path: Path) -> None:
    with pytest.raises(FMQMError, match="workers end before their first pair .no Blender here."):
        watch(tmp_path, tasks_of("fine", "fine"), told="refuse")


def test_without_a_way_to_watch_memory_it_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "resident_bytes", lambda pid: None)
    with pytest.raises(FMQMError, match="--memory-limit"):
        watch(tmp_path, tasks_of("fine"), limits=Limits(memory=1e9))


def test_memory_is_told_by_proc_and_by_ps(monkeypatch: pytest.MonkeyPatch) -> None:
    by_proc = workers.resident_bytes(os.getpid())
    monkeypatch.setattr(workers.Path, "read_text", lambda *_, **__: "")
    by_ps = workers.resident_bytes(os.getpid())
    if by_proc is None or by_ps is None:
        pytest.skip("this system has only one of the two")
    assert by_ps == pytest.approx(by_proc, rel=0.2) and by_ps > 1e7


PARENT = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmqm_addon.batch.interrupt import handle_signals
from tests.batch.test_workers import tasks_of, watch
handle_signals()  # as score.py
try:
    watch(Path(sys.argv[2]), tasks_of("fine", "hang", "fine", "hang"))
except KeyboardInterrupt:
    sys.exit(130)
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_workers_end_with_their_parent_and_what_they_did_is_kept(tmp_path: Path, how: signal.Signals) -> None:
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(ROOT), str(tmp_path)])
    wait_for(lambda: len(alive(tmp_path)) == 2 and all(done_by(path) for path in tmp_path.glob("shard-*.json")))
    parent.send_signal(how)
    assert parent.wait(300) == (130 if how == signal.SIGINT else -how)
    wait_for(lambda: not alive(tmp_path))
    journal = Journal(str(tmp_path / "journal"), resume=True)
    recover_scores(tmp_path, journal)
    assert "k0" in journal and "k1" not in journal


def done_by(shard: Path) -> bool:
    """Whether its worker has come to the pair that hangs."""
    written = Path(journal_of(str(shard)))
    return written.exists() and b"done" in written.read_bytes()


def wait_for(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 300  # machines are busy, and every line is synced to disk
    while not condition():
        assert time.monotonic() < end, "it does not come"
        time.sleep(0.05)


def test_a_worker_of_other_code_scores_nothing(tmp_path: Path) -> None:
    """As where the checkout changes while a run goes on."""
    (tmp_path / "other").touch()
    journal = watch(tmp_path, tasks_of("fine", "fine"))
    found = [journal.record(f"k{number}") for number in range(2)]
    assert {pair["error"] for pair in found} == {
        "fine: scored by fmqm_code other instead of None; give its host the same"
    }
    assert {pair["FMQM"] for pair in found} == {None}
