# SPDX-License-Identifier: GPL-3.0-or-later
"""A few pairs scored on a host of a cluster: tasks come in as JSON, lines of a journal go out.

python -m fmqm_addon.batch.cluster_part < tasks > lines
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

from .journal import Journal
from .progress_log import Log
from .rows import task_of
from .workers import Limits, score_with_workers, workers_command


def score_part(request: Mapping[str, Any], out: BinaryIO) -> None:
    """Scores in a watched worker, since a pair may end its process.

    Args:
        request: "tasks" as Task.as_dict has them; "script" and "arguments" as workers_command
            takes them; "limits": fields of Limits; "made_by"
            as the journal has it; "cwd": what relative paths are relative to. A host on which that is missing gets by
            with absolute ones.
    """
    tasks = [task_of(plain) for plain in request["tasks"]]
    there = request["cwd"] if os.path.isdir(request["cwd"]) else None
    with tempfile.TemporaryDirectory(prefix="fmqm-") as folder:
        written = os.path.join(folder, "done.jsonl")
        journal = Journal(written, made_by=request["made_by"])
        command = workers_command(request["script"], request["arguments"])
        log = Log("", len(tasks), len(tasks), silent=True)
        score_with_workers(tasks, command, Path(folder), 1, Limits(**request["limits"]), journal, log, there)
        journal.close()
        out.write(Path(written).read_bytes())


if __name__ == "__main__":
    score_part(json.load(sys.stdin), sys.stdout.buffer)
