# SPDX-License-Identifier: GPL-3.0-or-later
"""Temporary folders: gone with their process or after it, and never anybody else's."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import IO

import pytest

from fmqm_addon import folders
from fmqm_addon.folders import TEMPORARY, own_folder, sweep

ROOT = Path(__file__).resolve().parents[2]
OWNER = """
import sys, time
sys.path.insert(0, sys.argv[1])
from fmqm_addon.folders import own_folder
with own_folder(sys.argv[2], sys.argv[3]) as folder:
    (folder / "score").write_text("0.5")
    print(folder, flush=True)
    time.sleep(60)
"""


def owner_of(parent: Path, kind: str) -> tuple[subprocess.Popen[str], Path]:
    """A process with a folder of its own."""
    command = [sys.executable, "-c", OWNER, str(ROOT), str(parent), kind]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return process, Path(process.stdout.readline().strip())


def killed(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()


def test_a_folder_goes_with_its_owner_or_with_the_next_one(tmp_path: Path) -> None:
    with own_folder(tmp_path) as folder:
        (folder / "file").touch()
    assert not list(tmp_path.iterdir())
    process, left = owner_of(tmp_path, TEMPORARY)
    sweep(tmp_path, TEMPORARY)
    assert (left / "score").exists(), "its owner lives"
    killed(process)
    sweep(tmp_path, "other")
    assert (left / "score").exists(), "another kind is swept"
    sweep(tmp_path, TEMPORARY)
    assert not list(tmp_path.iterdir())


def test_who_sweeps_may_stand_still_with_a_lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder that was made without its lock would be taken for left by the next who sweeps."""
    held: list[threading.Timer] = []
    take = folders._lock

    def held_by_another_at_first(file: IO[bytes]) -> bool:
        if not held:
            other = open(file.name, "rb+")  # noqa: SIM115
            assert take(other)
            held.append(threading.Timer(1, other.close))
            held[0].start()
        return take(file)

    monkeypatch.setattr(folders, "_lock", held_by_another_at_first)
    with own_folder(tmp_path, "other") as folder:
        monkeypatch.undo()
        held[0].join()
        sweep(tmp_path, "other")
        assert folder.exists()


def test_the_next_one_sweeps_by_itself_but_not_what_could_be_adopted(tmp_path: Path) -> None:
    (process, left), (other, scores) = owner_of(tmp_path, TEMPORARY), owner_of(tmp_path, "workers-1")
    killed(process)
    killed(other)
    with own_folder(tmp_path), own_folder(tmp_path, "workers-1"):
        assert not left.exists() and scores.exists()
    adopted: list[str] = []
    sweep(tmp_path, "workers-1", lambda folder: adopted.append((folder / "score").read_text()))
    assert adopted == ["0.5"] and not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_nothing_that_others_made_is_swept(tmp_path: Path) -> None:
    """Whatever it is called: a folder without our lock, with another file of its name, or a link to one of ours."""
    process, left = owner_of(tmp_path, TEMPORARY)
    killed(process)
    left.rename(tmp_path / "mine")
    (tmp_path / ".fmqm-tmp-abcdefgh").symlink_to(tmp_path / "mine")
    for name, text in ((".fmqm-tmp-aaaaaaaa", None), (".fmqm-tmp-bbbbbbbb", ""), (".fmqm-tmp-cccccccc", "my own")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "work").touch()
        if text is not None:
            (tmp_path / name / "owner.lock").write_text(text)
    (tmp_path / ".fmqm-tmp-dddddddd").write_text("a file")
    before = sorted(tmp_path.rglob("*"))
    sweep(tmp_path, TEMPORARY)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_killed_owner_leaves_its_lock_free(tmp_path: Path) -> None:
    process, left = owner_of(tmp_path, TEMPORARY)
    process.send_signal(signal.SIGINT)
    process.communicate()
    assert not left.exists(), "Ctrl-C unwinds"
    assert not os.listdir(tmp_path)
