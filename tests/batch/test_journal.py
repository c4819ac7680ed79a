# SPDX-License-Identifier: GPL-3.0-or-later
"""The journal: what it keeps through a kill or a power cut, and what makes a pair count as new. Needs no Blender."""

from __future__ import annotations

import errno
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fmqm_addon.batch.journal import Journal, Records, parse_line, row_key
from fmqm_addon.batch.rows import Options, Row
from fmqm_addon.metric.errors import FileError, SettingsError
from fmqm_addon.metric.settings import Settings
from fmqm_addon.report.records import PairScore, pair_record

VERSIONS = {"fmqm_version": "1", "blender_version": "5"}
OPTIONS = Options(Settings())


def record(name: str, score: float | None = 0.5) -> dict[str, Any]:
    return pair_record(PairScore("r", name, error=None if score else "broken")) | {"FMQM": score}


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


def test_an_error_is_a_record_but_worth_another_run_and_the_last_record_counts(tmp_path: Path) -> None:
    path = str(tmp_path / "j")
    journal = Journal(path)
    journal.done("a", record("a", None))
    assert "a" in journal and not journal.has_scores("a") and journal.record("a")["error"] == "broken"
    journal.done("a", record("a"))
    journal.close()
    resumed = Journal(path, resume=True)
    assert resumed.has_scores("a") and resumed.record("a") == record("a")


@pytest.mark.parametrize(
    "line",
    ['{"done": ["a"]}', '{"done": "a"}', '{"done": "a", "pair": {}}', '{"start": {}}', "7", "[" * 100_000],
    ids=lambda line: line[:20],
)
def test_what_an_editor_left_is_skipped(tmp_path: Path, line: str) -> None:
    assert parse_line(line.encode()) == {}
    path = tmp_path / "j"
    journal = Journal(str(path))
    journal.done("b", record("b"))
    journal.close()
    path.write_text(f"{path.read_text()}{line}\n")
    resumed = Journal(str(path), resume=True)
    assert "a" not in resumed and "b" in resumed


@pytest.mark.parametrize("resume", [False, True])
def test_a_file_of_another_kind_is_refused_and_left(tmp_path: Path, resume: bool) -> None:
    path = tmp_path / "precious.txt"
    for text in ("v 0 0 0\n", "id,reference\na,b\n", '{"start": 0.5, "text": "hello"}\n', "\n\n", "x"):
        path.write_text(text)
        with pytest.raises(SettingsError, match="precious.txt: this file is not a journal"):
            Journal(str(path), resume)
        assert path.read_text() == text
    for text in ("", '{"sta', '{"done": "a", "pa'):
        path.write_text(text)
        Journal(str(path), resume).close()
        assert path.read_text() == ""


def test_a_full_disk_is_an_error_and_no_torn_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A disk that is nearly full takes a part of the line before it says so."""
    path = tmp_path / "j"
    journal = Journal(str(path))
    journal.done("a", record("a"))
    whole = path.read_bytes()
    filling = NearlyFull(journal._file)
    monkeypatch.setattr(journal, "_file", filling)
    with pytest.raises(FileError, match="j: the journal cannot be written .No space"):
        journal.done("b", record("b"))
    assert "b" not in journal and path.read_bytes() == whole


class NearlyFull:
    """A file on a disk that has room for ten more bytes."""

    def __init__(self, file: Any) -> None:
        self._file = file
        self._room = 10

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)

    def write(self, data: memoryview) -> int:
        if not self._room:
            raise OSError(errno.ENOSPC, "No space left on device")
        self._room = 0
        return int(self._file.write(data[:10]))


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
