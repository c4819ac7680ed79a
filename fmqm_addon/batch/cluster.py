# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs scored on an existing Dask cluster, whose workers have this package, bpy and the same files."""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..metric.errors import FMQMError
from ..report.pair import PairScore, pair_record
from .journal import Journal
from .log import Log
from .rows import Task, grouped, task_of
from .workers import Limits, score_with_workers, workers_command

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
            client.submit(score_part, [task.as_dict() for task in part], list(arguments), limits, pure=False,
                          retries=RETRIES): part
            for part in parts
        }  # fmt: skip
        for future in distributed.as_completed(list(sent), loop=client.loop):
            part = sent.pop(future)
            if future.status == "finished":
                for key, record, lost in future.result():
                    journal.done(key, record, lost)
                    log.scored(record)
            else:  # error, or cancelled where the scheduler has gone
                why = str(future.exception()).partition("\n")[0] if future.status == "error" else future.status
                for task in part:
                    text = f"{task.row.distorted}: its task failed on the cluster ({why})"
                    record = pair_record(PairScore(task.row.reference, task.row.distorted, error=text))
                    journal.done(task.key, record, lost=True)
                    log.scored(record)
    log.end()


def score_part(
    plain_tasks: Sequence[dict[str, Any]], arguments: Sequence[str], limits: Limits
) -> list[tuple[str, dict[str, Any], bool]]:
    """What a task does on its host: a watched worker of its own, since bpy must not live in a thread.

    Returns:
        For each pair its key, its record and whether it ended its worker.
    """
    tasks = [task_of(plain) for plain in plain_tasks]
    script = Path(__file__).resolve().parents[2] / "scripts" / "score.py"
    journal = Journal()
    with tempfile.TemporaryDirectory(prefix="fmqm-") as folder:
        command = workers_command(str(script), arguments)
        log = Log("", len(tasks), len(tasks), silent=True)
        score_with_workers(tasks, command, Path(folder), 1, limits, journal, log)
    return [(task.key, journal.record(task.key), task.key not in journal) for task in tasks]
