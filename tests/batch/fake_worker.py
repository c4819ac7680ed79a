# SPDX-License-Identifier: GPL-3.0-or-later
"""A worker that scores nothing but does what the names of its pairs say: die, realtime, die once, quit, wait, hang."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from fmqm_addon.batch.journal import Journal
from fmqm_addon.batch.rows import task_of
from fmqm_addon.batch.workers import end_with_parent, journal_of
from fmqm_addon.report.records import PairScore, pair_record
from tests.readings import numbers

shard = Path(sys.argv[-1])
end_with_parent()
if sys.argv[1] == "refuse":
    sys.exit("no Blender here")
Path(sys.argv[1]).joinpath(f"{os.getpid()}.pid").touch()
while Path(sys.argv[1], "slow").exists():
    time.sleep(0.02)
journal = Journal(journal_of(str(shard)), made_by={"fmqm_code": "other"} if Path(sys.argv[1], "other").exists() else {})
for task in (task_of(plain) for plain in json.loads(shard.read_text(encoding="utf-8"))):
    journal.start(task.key)
    name = task.row.distorted
    once = Path(sys.argv[1]) / f"{task.key}.once"
    if name == "die" or (name == "die once" and not once.exists()):
        once.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    if name == "realtime":
        os.kill(os.getpid(), 40)  # a signal without a name
    if name == "quit":
        sys.exit("no memory here")
    while name == "wait" and not Path(sys.argv[1], "go").exists():
        time.sleep(0.02)
    if name == "hang":
        time.sleep(3600)
    if name == "swell":
        swollen = bytearray(300_000_000)
        swollen[::4096] = b"x" * len(swollen[::4096])
        time.sleep(3600)
    scores = numbers(0.5) | {"id": task.row.id, "pid": os.getpid()}
    journal.done(task.key, pair_record(PairScore("reference", name, patches=200)) | scores)
