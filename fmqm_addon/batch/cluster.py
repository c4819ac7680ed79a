# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs scored on an existing Dask cluster, whose workers have this package, bpy and the same files.

All that travels is functions of Python's standard library and text: neither the scheduler nor a worker ever unpickles
anything of this package, which a process that lacks it would not survive, nor the tasks of others with it.
"""

from __future__ import annotations

import asyncio
import importlib
import json
import operator
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ..metric.errors import FMQMError
from ..report.record_check import checked_json
from .journal import Journal, differences, own_record, parse_line
from .progress_log import Log
from .rows import Task, group_by_reference
from .workers import PACKAGE, Limits

PAIRS_A_TASK = 4  # of one reference: few enough to spread and to lose
RETRIES = 2  # of a task that fails; one whose worker is lost goes to another by Dask's own rule
_CONNECT = 10.0  # seconds
_ANSWER = 120.0  # seconds that a worker has to answer the probe: bpy comes over a network, perhaps
_POLL = 0.1  # seconds between looks at what is done
_LOOK = 5.0  # seconds between looks at who is still there


def score_on_cluster(
    tasks: Sequence[Task],
    address: str,
    script: str,
    arguments: Sequence[str],
    limits: Limits,
    journal: Journal,
    log: Log,
    wait: float = 30.0,
) -> None:
    """Scores all tasks into the journal, as they come.

    Args:
        address: of the scheduler, such as tcp://scheduler:8786.
        script, arguments: as workers_command takes them.
        log: counts the pairs.
        wait: seconds for a first worker, and for another one when all are lost.

    Raises:
        FMQMError: dask.distributed is not installed, the scheduler cannot be reached, or no worker comes or can score.
    """
    if not tasks:
        return
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise FMQMError("--dask needs dask.distributed: pip install -r requirements-cluster.txt") from error
    try:
        client = distributed.Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise FMQMError(f"--dask {address}: no scheduler answers there ({error})") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=wait)
        except TimeoutError as error:
            raise FMQMError(
                f"--dask {address}: no worker within {wait:g} s; start some, or wait longer (--wait-workers)"
            ) from error
        pythons = _usable_workers(client, tasks[0], journal.made_by, log)
        if not pythons:
            raise FMQMError(f"--dask {address}: none of its workers can score")
        request = {"script": script, "arguments": list(arguments), "limits": asdict(limits)}
        request |= {"cwd": os.getcwd(), "made_by": journal.made_by}
        sent = _send(client, tasks, pythons, request)
        _receive(distributed, client, sent, pythons, journal, log, wait)
    log.end()


def _usable_workers(client: Any, first: Task, made_by: Mapping[str, str], log: Log) -> dict[str, list[str]]:
    """The workers that can score, by their Python; what the others lack is logged, a line a host."""
    request = {"cwd": os.getcwd(), "files": [path for path in first.row.files() if path and os.path.isfile(path)]}
    sizes = [os.stat(path).st_size for path in request["files"]]
    probe = (Path(__file__).parent / "probe.py").read_bytes()
    lacks: dict[str, dict[str, str]] = defaultdict(dict)
    pythons: dict[str, list[str]] = defaultdict(list)
    # By modules of the standard library that every Dask worker has; in its own thread it must go on answering.
    executables: dict[str, Any] = client.run(operator.attrgetter("executable"), sys, on_error="return")
    for worker, each in executables.items():
        if not isinstance(each, str):
            lacks[_host(worker)][worker] = f"it does not answer ({each!r})"
    for python in {each for each in executables.values() if isinstance(each, str)}:
        answers: dict[str, Any] = client.run(
            asyncio.to_thread,
            subprocess.run,
            [python, "-", json.dumps(request)],
            input=probe,
            capture_output=True,
            timeout=_ANSWER,
            workers=[worker for worker, each in executables.items() if each == python],
            on_error="return",
        )
        for worker, done in answers.items():
            if lack := _lack(done, made_by, request["files"], sizes):
                lacks[_host(worker)][worker] = lack
            else:
                pythons[python].append(worker)
    for host, by_worker in sorted(lacks.items()):
        count = f"{len(by_worker)} worker{'s' if len(by_worker) > 1 else ''}"
        log.say(f"{host}: {count} cannot score: {'; '.join(dict.fromkeys(by_worker.values()))}")
    return pythons


def _lack(done: Any, made_by: Mapping[str, str], files: Sequence[str], sizes: Sequence[int]) -> str:
    """What a worker lacks, by what its Python printed; "" for nothing."""
    try:
        found = checked_json(done.stdout.decode("utf-8", "replace").splitlines()[-1])
        if "no_fmqm" in found:
            return f"no FMQM ({found['no_fmqm']}); start the workers with PYTHONPATH={PACKAGE.parent}"
        if "no_bpy" in found:
            return f"no bpy ({found['no_bpy']})"
        if difference := differences(found, made_by, ("fmqm_version", "fmqm_code", "blender_version")):
            return f"{difference}; install the same"
        for path, size, wanted in zip(files, found["sizes"], sizes, strict=True):
            if size is None:
                return f"{path} is missing in {os.getcwd()}"
            if size != wanted:
                return f"{path} is another file, of {size} bytes instead of {wanted}"
    except (AttributeError, IndexError, KeyError, TypeError, ValueError):
        lines = getattr(done, "stderr", b"").decode("utf-8", "replace").strip().splitlines()
        return f"its Python does not answer ({lines[-1] if lines else repr(done)})"
    return ""


_Sent = dict[Any, tuple[str, list[Task]]]  # by future: the Python that it was sent to, and its tasks


def _send(
    client: Any, tasks: Sequence[Task], pythons: Mapping[str, Sequence[str]], request: Mapping[str, Any]
) -> _Sent:
    """Parts of the tasks to workers that can score, spread over all of them."""
    turns = [python for python, workers in pythons.items() for _ in workers]
    sent: _Sent = {}
    for group in group_by_reference(tasks):
        for first in range(0, len(group), PAIRS_A_TASK):
            part, python = group[first : first + PAIRS_A_TASK], turns[len(sent) % len(turns)]
            text = json.dumps({**request, "tasks": [task.as_dict() for task in part]})
            future = client.submit(
                subprocess.run,
                [python, "-m", f"{__package__}.cluster_part"],
                input=text.encode(),
                capture_output=True,
                check=True,
                workers=list(pythons[python]),
                pure=False,
                retries=RETRIES,
            )
            sent[future] = (python, part)
    return sent


def _receive(
    distributed: Any,
    client: Any,
    sent: _Sent,
    pythons: Mapping[str, Sequence[str]],
    journal: Journal,
    log: Log,
    wait: float,
) -> None:
    """Takes what is done into the journal until all is; gives a part up whose workers are all gone."""
    # Results are fetched beside this loop: a finished one whose worker is lost before that is waited for again.
    completed = distributed.as_completed(list(sent), loop=client.loop, with_results=True, raise_errors=False)
    lost: dict[str, float] = {}  # since when a Python has no worker
    looked = time.monotonic()
    while sent:
        for future, result in completed.next_batch(block=False):
            if future in sent:
                _, part = sent.pop(future)
                _take(result, part, journal, log)
        now = time.monotonic()
        if now - looked > _LOOK:
            looked, there = now, set(_present_workers(client))
            for future in [each for each in sent if each.status == "error"]:  # lost, then failed: Dask does not tell
                _take((None, future.exception(), None), sent.pop(future)[1], journal, log)
            for python, workers in pythons.items():
                if there & set(workers):
                    lost.pop(python, None)
                elif now - lost.setdefault(python, now) > wait:
                    why = "all workers that can score are gone; --resume goes on"
                    for future in [each for each, (name, _) in sent.items() if name == python]:
                        future.cancel()
                        _fail(sent.pop(future)[1], why, journal, log)
        time.sleep(_POLL)


def _present_workers(client: Any) -> Sequence[str]:
    """Addresses; none where the scheduler does not answer."""
    try:
        return list(client.nthreads())
    except (OSError, TimeoutError):
        return []


def _take(result: Any, part: Sequence[Task], journal: Journal, log: Log) -> None:
    """The records of a part that has ended, however it did.

    Args:
        result: a CompletedProcess; (type, exception, traceback) of a task that failed; or a CancelledError.
    """
    left = {task.key: task for task in part}
    lines: list[bytes] = []
    if isinstance(result, subprocess.CompletedProcess):
        lines, why = result.stdout.splitlines(), "it told of no scores"
    elif isinstance(result, tuple):
        why = _cause(result[1])  # what has happened there, whatever it was
    else:
        why = "cancelled"  # the scheduler has gone
    for event in map(parse_line, lines):
        task = left.pop(event.get("done", ""), None)
        if task is not None:
            record = own_record(event, journal.made_by)
            journal.done(task.key, record)
            log.scored(record)
    _fail(list(left.values()), why, journal, log)


def _fail(tasks: Sequence[Task], why: str, journal: Journal, log: Log) -> None:
    for task in tasks:
        record = task.row.failed(f"{task.row.distorted}: its task failed on the cluster ({why})")
        journal.done(task.key, record)
        log.scored(record)


def _cause(error: BaseException) -> str:
    """What a chain of exceptions began with, and what a process said last."""
    while error.__cause__ is not None:
        error = error.__cause__
    if isinstance(error, subprocess.CalledProcessError):
        lines = (error.stderr or b"").decode("utf-8", "replace").strip().splitlines()
        return f"exit code {error.returncode}{f', saying: {lines[-1]}' if lines else ''}"
    return f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"


def _host(worker: str) -> str:
    """Of an address such as tcp://10.0.0.5:4711."""
    return worker.partition("://")[2].rpartition(":")[0] or worker
