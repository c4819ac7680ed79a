# SPDX-License-Identifier: GPL-3.0-or-later
"""The journal: what it keeps through a kill or a power cut, and what makes a pair count as new. Needs no Blender."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fmqm_addon.batch.journal import Journal, Records, line_of, own_record, parse_line, row_key
from fmqm_addon.batch.rows import BatchOptions, Row
from fmqm_addon.comparison.judge import Judge
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.errors import FileError, SettingsError
from fmqm_addon.metric.settings import Settings
from fmqm_addon.report.criteria import Criteria
from fmqm_addon.report.record_check import record_fault
from fmqm_addon.report.records import PairScore, pair_record
from tests.readings import numbers

VERSIONS = {"fmqm_version": "1", "blender_version": "5"}
OPTIONS = BatchOptions(pair=PairOptions(settings=Settings()))


def record(name: str, score: float | None = 0.5) -> dict[str, Any]:
    pair = PairScore("r", name, patches=200, error=None if score else "broken")
    return pair_record(pair) | numbers(score)


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
        row_key(row, BatchOptions(pair=PairOptions(repeats=2)), VERSIONS),
        row_key(row, BatchOptions(pair=PairOptions(settings=Settings(seed=7))), VERSIONS),
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
    records = Records(rows, ["k1", "k2"], journal, Criteria(Judge.PERCEIVED, 0.75))
    assert [(r["id"], r["fail_under"], r["settings"]) for r in records] == [
        ("one", 0.25, {}),
        ("two", 0.75, {"radius": "inf"}),
    ]
    assert {r["judge"] for r in records} == {"perceived"}
    assert list(records) == list(records)


def line(event: dict[str, Any]) -> bytes:
    """As line_of, whatever the event holds."""
    body = json.dumps(event).encode().removesuffix(b"}")
    return body + b', "digest": "' + hashlib.blake2b(body, digest_size=8).hexdigest().encode() + b'"}\n'


def done(**changed: Any) -> dict[str, Any]:
    return {"done": "a", "made_by": {}, "pair": record("a") | changed}


def test_no_flipped_bit_goes_unseen() -> None:
    right = line_of(done())
    assert parse_line(right) == done() and right == line(done())
    for place in range(len(right) - 1):
        for bit in range(8):
            flipped = bytearray(right)
            flipped[place] ^= 1 << bit
            assert parse_line(bytes(flipped)) == {}, bytes(flipped)


@pytest.mark.parametrize(
    "changed",
    [
        {"FMQM": float("nan")}, {"FMQM": "0.5"}, {"FMQM": 1.5}, {"FMQM": True}, {"FMQM": None}, {"FMQM": 10**400},
        {"error": "broken"}, {"error": 7}, {"id": None}, {"seconds": {}}, {"seconds": None}, {"warnings": "text"},
        {"warnings": [1]}, {"stderr": {}}, {"reverse": 1}, {"patches": -1}, {"patches": 0.5}, {"trust": {}},
        {"trust": {"reference": 1}}, {"where": 7}, {"attribution": {}}, {"pictures": {"size": ["1", "2"]}},
        {"settings": []}, {"fail_under": "x"},
    ],
    ids=str,
)  # fmt: skip
def test_a_record_of_another_shape_is_refused_though_its_digest_fits(tmp_path: Path, changed: dict[str, Any]) -> None:
    assert parse_line(line(done(**changed))) == {}
    less = record("a")
    del less[next(iter(changed)) if next(iter(changed)) in less else "id"]
    assert parse_line(line({"done": "a", "made_by": {}, "pair": less})) == {}
    path = tmp_path / "j"
    path.write_bytes(line(done(**changed)))
    journal = Journal(str(path), resume=True)
    assert "a" not in journal and journal.damaged == 1
    assert journal.damage().startswith(f"{path}: 1 line does not fit") and "\n" not in journal.damage()


def test_a_journal_of_before_the_digests_is_scored_again(tmp_path: Path) -> None:
    path = tmp_path / "j"
    old = [{"start": "a"}, {"done": "a", "pair": record("a")}]
    path.write_text("".join(json.dumps(event) + "\n" for event in old), encoding="utf-8")
    journal = Journal(str(path), resume=True)
    assert "a" not in journal and journal.damage().startswith(f"{path}: 2 lines do not fit")
    journal.done("a", record("a"))
    assert journal.has_scores("a")


def test_what_other_code_has_made_is_not_taken(tmp_path: Path) -> None:
    path = str(tmp_path / "j")
    ours, others = {"fmqm_code": "1"}, {"fmqm_code": "2"}
    journal = Journal(path, made_by=others)
    journal.done("a", record("a"))
    journal.close()
    resumed = Journal(path, resume=True, made_by=ours)
    assert "a" not in resumed and resumed.damaged == 0
    told = own_record(done() | {"made_by": others}, ours)
    assert told["error"] == "a: scored by fmqm_code 2 instead of 1; give its host the same" and told["FMQM"] is None
    assert not record_fault(told)
    assert own_record(done() | {"made_by": ours}, ours) == record("a")


def test_a_journal_that_changes_under_a_run_is_an_error_of_one_line(tmp_path: Path) -> None:
    path = tmp_path / "j"
    journal = Journal(str(path))
    journal.done("a", record("a"))
    path.write_bytes(path.read_bytes().replace(b"0.5", b"0.6"))
    with pytest.raises(FileError, match="was changed while it was in use"):
        journal.record("a")
