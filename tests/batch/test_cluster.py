# SPDX-License-Identifier: GPL-3.0-or-later
"""A real Dask scheduler and two workers on this machine, one of which is killed in the middle."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import distributed
import pytest

from fmqm_addon.batch.cluster import _lack, _take, score_on_cluster
from fmqm_addon.batch.journal import Journal, line_of
from fmqm_addon.batch.progress_log import Log
from fmqm_addon.batch.rows import Row, Task
from fmqm_addon.batch.workers import Limits
from fmqm_addon.metric.errors import FMQMError
from fmqm_addon.provenance import code_digest, provenance
from fmqm_addon.report.records import PairScore, pair_record
from tests.blender.script import SCORE, noise, read_json, score, without_seconds, write_png, write_torus
from tests.readings import numbers

TINY = ("--samples", "640", "--patches", "20", "--color-units", "5")
PATIENCE = 300  # seconds for what comes in some on a quiet machine
NAMES = [f"shaken{number}.obj" for number in range(16)]


@pytest.fixture
def assets(tmp_path: Path) -> Path:
    write_png(tmp_path / "a.png", noise(seed=1))
    write_torus(tmp_path, "ref", "a.png")
    for number, name in enumerate(NAMES):
        write_torus(tmp_path, Path(name).stem, "a.png", shake=0.002 * number)
    rows = [{"reference": "ref.obj", "distorted": name} for name in (*NAMES, "nowhere.obj")]
    (tmp_path / "pairs.json").write_text(json.dumps(rows), encoding="utf-8")
    return tmp_path


ROOT = str(SCORE.parents[1])


@pytest.fixture
def cluster(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """The scheduler's address and its workers, without nannies that would start them again.

    Its parameter is what PYTHONPATH each of the workers has; the scheduler, which needs nothing of ours, has none.
    """
    told = tmp_path / "scheduler.json"
    env = os.environ | {"PYTHONPATH": "", "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "10s"}
    common = {"env": env, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    processes = [subprocess.Popen([*start, "--no-dashboard", "--scheduler-file", str(told)], **common)]
    try:
        end = time.monotonic() + PATIENCE
        while not told.exists() or not told.read_text():
            assert time.monotonic() < end
            time.sleep(0.1)
        address = json.loads(told.read_text())["address"]
        start = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--host", "127.0.0.1", "--nthreads", "1"]
        for root in getattr(request, "param", [ROOT, ROOT]):
            common["env"] = env | {"PYTHONPATH": root.format(tmp_path)}
            processes.append(subprocess.Popen([*start, "--no-nanny", "--no-dashboard"], **common))
        yield address, processes[1:]
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()


@pytest.mark.once
def test_all_pairs_are_scored_once_though_a_worker_is_killed(
    assets: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path
) -> None:
    address, workers = cluster
    wait_for(address, len(workers))
    command = ["--manifest", "pairs.json", *TINY, "--quiet"]
    outputs = ["--json", "far.json", "--dask", address]
    arguments = [sys.executable, str(SCORE), *command, *outputs]
    run = subprocess.Popen(arguments, cwd=assets, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    journal = assets / "far.json.journal.jsonl"
    before = _kill_with_results(address, workers[:1], run, journal)
    _, told = run.communicate(timeout=PATIENCE)
    assert run.returncode == 1 and "Traceback" not in told, told
    assert before < len(NAMES), "it was killed in the middle"
    events = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
    assert Counter(Counter(event["done"] for event in events).values()) == {1: len(NAMES) + 1}
    assert score(*command, "--json", "here.json", cwd=assets).returncode == 1
    far, here = (without_seconds(read_json(assets / name)) for name in ("far.json", "here.json"))
    assert [pair["error"] is None for pair in far["pairs"]] == [True] * len(NAMES) + [False]
    assert far == here


@pytest.mark.parametrize("cluster", [["", ""]], indirect=True, ids=["no PYTHONPATH"])
def test_workers_without_the_package_are_told_of_and_live_on(
    assets: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, workers = cluster
    wait_for(address, len(workers))
    for _ in range(2):
        done = score("ref.obj", NAMES[0], *TINY, "--dask", address, "--quiet", cwd=assets)
        first, second = done.stderr.splitlines()
        assert done.returncode == 1 and "127.0.0.1: " in first and "no FMQM (ModuleNotFoundError" in first
        assert first.endswith(f"start the workers with PYTHONPATH={ROOT}")
        assert second == f"score.py: --dask {address}: none of its workers can score"
        assert all(worker.poll() is None for worker in workers)


@pytest.mark.parametrize("cluster", [["{}/other", ROOT, ""]], indirect=True, ids=["other code"])
def test_only_workers_with_the_same_code_score(
    assets: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    """One has ours, one has none, one has a metric that gives other numbers."""
    address, workers = cluster
    own, other = Path(ROOT, "fmqm_addon"), assets / "other" / "fmqm_addon"
    shutil.copytree(own, other, ignore=shutil.ignore_patterns("__pycache__"))  # others write there at the same time
    changed = other / "metric" / "settings.py"
    text = changed.read_text()
    assert '0.05, "standard deviation' in text
    changed.write_text(text.replace('0.05, "standard deviation', '0.06, "standard deviation'))
    wait_for(address, len(workers))
    command = ["--manifest", "pairs.json", *TINY, "--quiet"]
    done = score(*command, "--json", "far.json", "--dask", address, cwd=assets)
    assert done.returncode == 1, "a file is missing"
    told = done.stderr.splitlines()[0]
    assert "127.0.0.1: 2 workers cannot score" in told and "no FMQM" in told
    assert f"instead of {code_digest()}; install the same" in told
    score(*command, "--json", "here.json", cwd=assets)
    assert without_seconds(read_json(assets / "far.json")) == without_seconds(read_json(assets / "here.json"))
    assert all(worker.poll() is None for worker in workers)


def _kill_with_results(
    address: str, workers: list[subprocess.Popen[bytes]], run: subprocess.Popen[str], journal: Path
) -> int:
    """In the middle, when they hold results that the run has not fetched yet; how many pairs it had till then."""
    end, pids = time.monotonic() + PATIENCE, {worker.pid for worker in workers}
    with distributed.Client(address, set_as_default=False, timeout=PATIENCE) as client:
        names = [name for name, pid in client.run(os.getpid).items() if pid in pids]
        while not journal.exists() or b"done" not in journal.read_bytes():
            assert run.poll() is None and time.monotonic() < end, run.communicate()[1]
            time.sleep(0.02)
        run.send_signal(signal.SIGSTOP)
        known = client.has_what()
        while not all(set(client.has_what()[name]) - set(known[name]) for name in names):
            assert time.monotonic() < end
            if not any(client.processing().values()):
                break  # they have done all there is
            time.sleep(0.1)
    for worker in workers:
        worker.kill()
    run.send_signal(signal.SIGCONT)
    return journal.read_bytes().count(b'{"done"')


def wait_for(address: str, count: int) -> None:
    with distributed.Client(address, set_as_default=False, timeout=PATIENCE) as client:
        client.wait_for_workers(count, timeout=PATIENCE)


def test_what_comes_back_by_other_code_is_an_error() -> None:
    """Should a worker's checkout change while it scores."""
    pair = pair_record(PairScore("r", "d", patches=200)) | numbers(0.5)
    lines = line_of({"done": "k", "made_by": {"fmqm_code": "other"}, "pair": pair})
    done = subprocess.CompletedProcess([], 0, stdout=lines)
    journal = Journal(made_by={"fmqm_code": "ours"})
    _take(done, [Task("k", Row("d", "r", "d")), Task("l", Row("e", "r", "e"))], journal, Log("", 2, 2, silent=True))
    assert "scored by fmqm_code other instead of ours" in journal.record("k")["error"]
    assert journal.record("l")["error"] == "e: its task failed on the cluster (it told of no scores)"


def test_a_file_that_a_worker_does_not_see_is_named() -> None:
    ours = provenance("5.2.3")

    def lack(size: int | None, **changed: Any) -> str:
        answer = json.dumps(ours | {"sizes": [size]} | changed).encode()
        done = SimpleNamespace(stdout=b"bpy greets you\n" + answer + b"\n", stderr=b"")
        return _lack(done, ours, ["ref.obj"], [7])

    assert lack(7) == ""
    assert lack(None) == f"ref.obj is missing in {os.getcwd()}"
    assert lack(8) == "ref.obj is another file, of 8 bytes instead of 7"
    assert lack(7, blender_version="4.5.15") == "blender_version 4.5.15 instead of 5.2.3; install the same"
    assert lack(7, no_bpy="ImportError: libX11.so.6") == "no bpy (ImportError: libX11.so.6)"
    older = {name: value for name, value in ours.items() if name != "fmqm_code"}
    done = SimpleNamespace(stdout=json.dumps(older | {"sizes": [7]}).encode(), stderr=b"")
    assert "fmqm_code None instead of" in _lack(done, ours, ["ref.obj"], [7])
    for stdout in (b"", b"{", b"7", b"{}", b"[]"):
        done = SimpleNamespace(stdout=stdout, stderr=b"Segmentation fault\n")
        assert _lack(done, ours, ["ref.obj"], [7])
    assert _lack(TimeoutError("120"), ours, [], []) == "its Python does not answer (TimeoutError('120'))"


@pytest.mark.parametrize("cluster", [[]], indirect=True, ids=["no workers"])
def test_without_a_worker_it_says_so_in_time(assets: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]) -> None:
    command = ["ref.obj", NAMES[0], "--dask", cluster[0], "--wait-workers", "1", "--quiet"]
    done = score(*command, cwd=assets, timeout=PATIENCE)
    assert done.returncode == 1
    assert done.stderr == (
        f"score.py: --dask {cluster[0]}: no worker within 1 s; start some, or wait longer (--wait-workers)\n"
    )


def test_it_waits_as_long_as_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    waited: list[float] = []

    def never(_: object, timeout: float) -> None:
        waited.append(timeout)
        raise TimeoutError

    client = nullcontext()
    client.wait_for_workers = never  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "distributed", SimpleNamespace(Client=lambda *_, **__: client))
    tasks = [Task("k", Row("d", "r", "d"))]
    with pytest.raises(FMQMError, match="no worker within 1 s"):
        score_on_cluster(tasks, "tcp://s:1", "", [], Limits(), Journal(), Log("", 1, 1, silent=True), wait=1)
    assert waited == [1]


@pytest.mark.once
def test_when_all_workers_are_lost_the_rest_is_an_error(
    assets: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    address, workers = cluster
    wait_for(address, len(workers))
    arguments = ["--manifest", "pairs.json", *TINY, "--quiet", "--json", "far.json", "--dask", address]
    command = [sys.executable, str(SCORE), *arguments, "--wait-workers", "2"]
    run = subprocess.Popen(command, cwd=assets, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    _kill_with_results(address, workers, run, assets / "far.json.journal.jsonl")
    _, told = run.communicate(timeout=PATIENCE)
    assert run.returncode == 1 and "all workers that can score are gone; --resume goes on" in told
    assert "Traceback" not in told


@pytest.mark.once
def test_without_a_scheduler_or_dask_it_says_so(assets: Path, tmp_path: Path) -> None:
    done = score("ref.obj", NAMES[0], "--dask", "tcp://127.0.0.1:9", cwd=assets)
    assert done.returncode == 1 and "no scheduler answers" in done.stderr
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['distributed'] = None\n")
    env = {"PYTHONPATH": str(tmp_path)}
    done = score("ref.obj", NAMES[0], "--dask", "tcp://127.0.0.1:9", cwd=assets, env=env)
    assert done.returncode == 1 and "requirements-cluster.txt" in done.stderr and len(done.stderr.splitlines()) == 1
