# SPDX-License-Identifier: GPL-3.0-or-later
"""A real Dask scheduler and two workers on this machine, one of which is killed in the middle."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.blender.script import SCORE, noise, read_json, score, without_seconds, write_png, write_torus

TINY = ("--samples", "640", "--patches", "20", "--color-units", "5")
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


@pytest.fixture
def cluster(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """The scheduler's address and its two workers, without nannies that would start them again."""
    told = tmp_path / "scheduler.json"
    root = getattr(request, "param", str(SCORE.parents[1]))
    env = os.environ | {"PYTHONPATH": root, "DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT": "10s"}
    common = {"env": env, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    start = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    processes = [subprocess.Popen([*start, "--no-dashboard", "--scheduler-file", str(told)], **common)]
    try:
        end = time.monotonic() + 30
        while not told.exists() or not told.read_text():
            assert time.monotonic() < end
            time.sleep(0.1)
        address = json.loads(told.read_text())["address"]
        start = [sys.executable, "-m", "distributed.cli.dask_worker", address, "--host", "127.0.0.1", "--nthreads", "1"]
        for _ in range(2):
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
    command = ["--manifest", "pairs.json", *TINY, "--quiet"]
    outputs = ["--json", "far.json", "--dask", address]
    arguments = [sys.executable, str(SCORE), *command, *outputs]
    run = subprocess.Popen(arguments, cwd=assets, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    journal = assets / "far.json.journal.jsonl"
    end = time.monotonic() + 60
    while not journal.exists() or b"done" not in journal.read_bytes():
        assert run.poll() is None and time.monotonic() < end, run.communicate()[1]
        time.sleep(0.02)
    workers[0].kill()
    before = journal.read_bytes().count(b'{"done"')
    _, told = run.communicate(timeout=120)
    assert run.returncode == 1 and "Traceback" not in told, told
    assert before < len(NAMES), "it was killed in the middle"
    events = [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]
    assert Counter(Counter(event["done"] for event in events).values()) == {1: len(NAMES) + 1}
    assert score(*command, "--json", "here.json", cwd=assets).returncode == 1
    far, here = (without_seconds(read_json(assets / name)) for name in ("far.json", "here.json"))
    assert [pair["error"] is None for pair in far["pairs"]] == [True] * len(NAMES) + [False]
    assert far == here


@pytest.mark.once
@pytest.mark.parametrize("cluster", [""], indirect=True, ids=["no PYTHONPATH"])
def test_a_cluster_without_the_package_says_what_to_do(
    assets: Path, cluster: tuple[str, list[subprocess.Popen[bytes]]]
) -> None:
    done = score("ref.obj", NAMES[0], *TINY, "--dask", cluster[0], "--quiet", cwd=assets)
    assert done.returncode == 1 and len(done.stderr.splitlines()) == 1
    assert "No module named 'fmqm_addon'" in done.stderr and f"PYTHONPATH={SCORE.parents[1]}" in done.stderr


@pytest.mark.once
def test_without_a_scheduler_or_dask_it_says_so(assets: Path, tmp_path: Path) -> None:
    done = score("ref.obj", NAMES[0], "--dask", "tcp://127.0.0.1:9", cwd=assets)
    assert done.returncode == 1 and "no scheduler answers" in done.stderr
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['distributed'] = None\n")
    env = {"PYTHONPATH": str(tmp_path)}
    done = score("ref.obj", NAMES[0], "--dask", "tcp://127.0.0.1:9", cwd=assets, env=env)
    assert done.returncode == 1 and "requirements-cluster.txt" in done.stderr and len(done.stderr.splitlines()) == 1
