# SPDX-License-Identifier: GPL-3.0-or-later
"""The journal: what it keeps through a kill or a power cut, and what makes a pair count as new. Needs no Blender."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fmqm_addon.batch.journal import Journal, Records, row_key
from fmqm_addon.batch.rows import Options, Row
from fmqm_addon.metric.errors import FileError
from fmqm_addon.metric.settings import Settings

VERSIONS = {"fmqm_version": "1", "blender_version": "5"}
OPTIONS = Options(Settings())


def record(name: str, score: float | None = 0.5) -> dict[str, Any]:
    return {"id": name, "FMQM": score, "error": None if score else "broken"}


def test_resuming_finds_what_was_done_and_replacing_does_not(tmp_path: Path) -> None:
    path = str(tmp_path / "j")
    journal = Journal(path)
    journal.start("a")
    journal.done("a", record("a"))
    journal.start("b")
    journal.close()
    resumed = Journal(path, resume=True)
    assert "a" in resumed and "b" not in resumed and resumed.record("a") == record("a")
    resumed.done("b", record("b"))
    assert resumed.record("b") == record("b") and resumed.record("a") == record("a")
    resumed.close()
    assert "a" not in Journal(path)
    assert Path(path).read_bytes() == b""


@pytest.mark.parametrize("cut", [1, 10, 40])
def test_a_torn_last_line_is_cut_off(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "j"
    journal = Journal(str(path))
    journal.done("a", record("a"))
    whole = path.read_bytes()
    journal.done("b", record("b"))
    journal.close()
    path.write_bytes(path.read_bytes()[:-cut])
    resumed = Journal(str(path), resume=True)
    assert "a" in resumed and "b" not in resumed and path.read_bytes() == whole


def test_rubbish_between_lines_costs_only_itself(tmp_path: Path) -> None:
    path = tmp_path / "j"
    journal = Journal(str(path))
    journal.done("a", record("a"))
    journal.close()
    path.write_bytes(b"\0\0\0\n[]\n" + path.read_bytes() + b"\xff\xfe{\n")
    assert Journal(str(path), resume=True).record("a") == record("a")


def test_a_pair_that_ended_its_worker_has_a_record_but_is_worth_another_run(tmp_path: Path) -> None:
    path = str(tmp_path / "j")
    journal = Journal(path)
    journal.done("a", record("a", None), lost=True)
    assert "a" not in journal and journal.record("a")["error"] == "broken"
    journal.done("a", record("a"))
    journal.close()
    resumed = Journal(path, resume=True)
    assert "a" in resumed and resumed.record("a") == record("a")


def test_two_runs_do_not_share_a_journal(tmp_path: Path) -> None:
    pytest.importorskip("fcntl", reason="no locks on Windows")
    first = Journal(str(tmp_path / "j"))
    first.done("a", record("a"))
    with pytest.raises(FileError, match="another run"):
        Journal(str(tmp_path / "j"))
    assert first.record("a") == record("a")


def test_what_makes_a_pair_new(tmp_path: Path) -> None:
    """Its files, images, settings, options and versions; not its name or threshold."""
    for name in ("r.glb", "d.blend", "t.png"):
        (tmp_path / name).write_text("x")
    row = Row("id", "r.glb", "d.blend:Object", "", "t.png", 0.5, (("seed", 1),), str(tmp_path))
    key = row_key(row, OPTIONS, VERSIONS)
    assert row_key(replace(row, id="other", fail_under=0.9), OPTIONS, VERSIONS) == key
    changed = {
        row_key(replace(row, distorted="d.blend:Other"), OPTIONS, VERSIONS),
        row_key(replace(row, texture=""), OPTIONS, VERSIONS),
        row_key(replace(row, settings=(("seed", 2),)), OPTIONS, VERSIONS),
        row_key(row, replace(OPTIONS, repeats=2), VERSIONS),
        row_key(row, Options(Settings(seed=7)), VERSIONS),
        row_key(row, OPTIONS, VERSIONS | {"blender_version": "4"}),
    }
    for name in ("r.glb", "d.blend", "t.png"):
        before = (tmp_path / name).stat()
        os.utime(tmp_path / name, ns=(before.st_atime_ns, before.st_mtime_ns + 10**9))
        changed.add(row_key(row, OPTIONS, VERSIONS))
    (tmp_path / "r.glb").write_text("longer")
    changed.add(row_key(row, OPTIONS, VERSIONS))
    (tmp_path / "r.glb").unlink()
    changed.add(row_key(row, OPTIONS, VERSIONS))
    assert len(changed) == 11 and key not in changed


def test_records_come_in_the_rows_order_with_their_names_and_thresholds() -> None:
    journal = Journal()
    journal.done("k2", record("x"))
    journal.done("k1", record("x"))
    rows = [Row("one", "r", "x", fail_under=0.25), Row("two", "r", "x", settings=(("radius", float("inf")),))]
    records = Records(rows, ["k1", "k2"], journal, 0.75)
    assert [(r["id"], r["fail_under"], r["settings"]) for r in records] == [
        ("one", 0.25, {}),
        ("two", 0.75, {"radius": "inf"}),
    ]
    assert list(records) == list(records)
