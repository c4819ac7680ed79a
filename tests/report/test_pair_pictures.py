# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture that cannot be written stops the run and leaves no record of the pair, which --resume would trust."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fmqm_addon.batch import scorer
from fmqm_addon.batch.journal import Journal
from fmqm_addon.batch.progress_log import Log
from fmqm_addon.batch.rows import BatchOptions, Row, Task
from fmqm_addon.metric.errors import MeshError, OutputError
from fmqm_addon.report.html.pictures import _write


def test_a_picture_that_cannot_be_written_is_an_output_error(tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    with pytest.raises(OutputError, match="does not exist"):
        _write(str(tmp_path / "gone"), "stem", np.zeros((4, 4, 3), np.uint8))


@pytest.mark.parametrize(("error", "stops"), [(OutputError("full"), True), (MeshError("bad"), False)])
def test_only_output_errors_stop_the_run(monkeypatch: pytest.MonkeyPatch, error: Exception, stops: bool) -> None:
    pytest.importorskip("bpy")

    def fail(*_: Any) -> None:
        raise error

    working = scorer._Scorer(BatchOptions(), journal := Journal(), Log("", 2, 1, silent=True), None)
    for name in ("_load", "_note_memory", "_work"):
        monkeypatch.setattr(working, name, lambda *_: type("AssetMesh", (), {"world": lambda self: None})())
    monkeypatch.setattr(
        "fmqm_addon.comparison.measurement.Measurement", lambda *_: type("M", (), {"prepare": lambda self: None})()
    )
    monkeypatch.setattr(working, "_compare", fail)
    task = Task("key", Row("1", "r", "d"))
    if stops:
        with pytest.raises(OutputError):
            working.score([task])
    else:
        working.score([task])
    assert ("key" in journal) is not stops
