# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs scored on an existing Dask cluster, whose workers have this package, bpy and the same files."""

from __future__ import annotations

import importlib
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..metric.errors import FMQMError
from .journal import Journal
from .progress_log import Log
from .rows import Task, grouped, task_of
from .workers import Limits, score_with_workers, workers_command

ROOT = Path(__file__).resolve().parents[2]
PAIRS_A_TASK = 4  # of one reference: few enough to spread and to lose
RETRIES = 2  # of a task that raises; one whose worker is lost goes to another by Dask's own rule
_CONNECT = 10.0  # seconds


def score_on_cluster(
    tasks: Sequence[Task], address: str, arguments: Sequence[str], limits: Limits, journal: Journal, log: Log
) -> None:
    """Scores all tasks into the journal, as they come.

    Args:
        address: of the scheduler, such as tcp://scheduler:8786. arguments: of this command line.
        log: counts the pairs.

    Raises:
        FMQMError: dask.distributed is not installed, or the scheduler cannot be reached.
    """
    here = os.getcwd()
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise FMQMError("--dask needs dask.distributed: pip install -r requirements-cluster.txt") from error
    parts = [
        group[first : first + PAIRS_A_TASK] for group in grouped(tasks) for first in range(0, len(group), PAIRS_A_TASK)
    ]
    try:
        client = distributed.Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise FMQMError(f"--dask {address}: no scheduler answers there ({error})") from error
    with client:
        sent = {
            client.submit(score_part, [task.as_dict() for task in part], list(arguments), limits, here, pure=False,
                          retries=RETRIES): part
            for part in parts
        }  # fmt: skip
        for future in distributed.as_completed(list(sent), loop=client.loop):
            part = sent.pop(future)
            if future.status == "finished":
                for key, record in future.result():
                    journal.done(key, record)
                    log.scored(record)
            else:  # error, or cancelled where the scheduler has gone
                why = _cause(future.exception()) if future.status == "error" else future.status
                for task in part:
                    record = task.row.failed(f"{task.row.distorted}: its task failed on the cluster ({why})")
                    journal.done(task.key, record)
                    log.scored(record)
    log.end()


def _cause(error: BaseException) -> str:
    """What a chain of exceptions began with, and the remedy of what is most likely."""
    while error.__cause__ is not None:
        error = error.__cause__
    why = f"{type(error).__name__}: {str(error).partition(chr(10))[0]}"
    if isinstance(error, ModuleNotFoundError) and error.name == __name__.partition(".")[0]:
        why += f"; start the scheduler and its workers with PYTHONPATH={ROOT}"
    return why


def score_part(
    plain_tasks: Sequence[dict[str, Any]], arguments: Sequence[str], limits: Limits, cwd: str
) -> list[tuple[str, dict[str, Any]]]:
    """What a task does on its host: a watched worker of its own, since bpy must not live in a thread.

    Args:
        cwd: what relative paths are relative to; a host on which it is missing gets by with absolute ones.

    Returns:
        For each pair its key and its record.
    """
    tasks = [task_of(plain) for plain in plain_tasks]
    script = ROOT / "scripts" / "score.py"
    journal = Journal()
    with tempfile.TemporaryDirectory(prefix="fmqm-") as folder:
        command = workers_command(str(script), arguments)
        log = Log("", len(tasks), len(tasks), silent=True)
        there = cwd if os.path.isdir(cwd) else None
        score_with_workers(tasks, command, Path(folder), 1, limits, journal, log, there)
    return [(task.key, journal.record(task.key)) for task in tasks]
