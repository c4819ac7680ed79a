# SPDX-License-Identifier: GPL-3.0-or-later
"""Where outputs go: never in the place of a device, and through links."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from fmqm_addon.apart import check_apart
from fmqm_addon.metric.errors import FileError, SettingsError
from fmqm_addon.report.atomic_files import check_writable, write_text


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_devices_and_pipes_are_left_alone(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(FileError, match="a device or a pipe"):
        write_text(str(tmp_path / "pipe"), "text")
    with pytest.raises(FileError, match="a device or a pipe"):
        check_writable(os.devnull)
    assert (tmp_path / "pipe").is_fifo()


def test_a_link_stays_and_what_it_names_is_written(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    for name in ("there", "new"):
        (tmp_path / name).symlink_to(tmp_path / "folder" / name)
    (tmp_path / "folder" / "there").write_text("older")
    for name in ("there", "new"):
        write_text(str(tmp_path / name), name)
        assert (tmp_path / name).is_symlink() and (tmp_path / "folder" / name).read_text() == name
    assert sorted(path.name for path in (tmp_path / "folder").iterdir()) == ["new", "there"]
    (tmp_path / "lost").symlink_to(tmp_path / "nowhere" / "file")
    with pytest.raises(FileError, match="does not exist"):
        check_writable(str(tmp_path / "lost"))


def test_outputs_are_kept_apart_from_inputs_and_each_other(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "model.obj")
    path = str(tmp_path / "model.obj")
    check_apart([("--json", "-"), ("--csv", f"{path}.csv")], [path, "", "a\0b"])
    for name in ("model.obj", "./folder/../model.obj", "link"):
        with pytest.raises(SettingsError, match=r"^--csv .*: it would replace .*, which is an input"):
            check_apart([("--json", "-"), ("--csv", f"{tmp_path}/{name}")], ["", path])
        with pytest.raises(SettingsError, match=r"^--json and --csv both write to"):
            check_apart([("--json", path), ("--csv", f"{tmp_path}/{name}")], [])
    with pytest.raises(SettingsError, match="both write to -"):
        check_apart([("--json", "-"), ("--csv", "-")], [])
    Path(path).touch()
    os.link(path, tmp_path / "other.obj")
    with pytest.raises(FileError, match="other.obj: it would replace"):
        check_apart([("-o", str(tmp_path / "other.obj"))], [path], FileError)


@pytest.mark.skipif(os.name == "nt", reason="modes are POSIX's")
def test_a_replaced_file_keeps_its_mode_and_a_new_one_gets_the_users(tmp_path: Path) -> None:
    umask = os.umask(0o027)
    try:
        write_text(str(tmp_path / "new"), "text")
        (tmp_path / "old").write_text("older")
        (tmp_path / "old").chmod(0o604)
        write_text(str(tmp_path / "old"), "newer")
    finally:
        os.umask(umask)
    modes = [(tmp_path / name).stat().st_mode & 0o7777 for name in ("new", "old")]
    assert modes == [0o640, 0o604] and (tmp_path / "old").read_text() == "newer"


def test_names_may_be_as_long_as_the_system_allows(tmp_path: Path) -> None:
    for length in (244, 255):
        name = "n" * (length - 4) + ".csv"
        write_text(str(tmp_path / name), "text")
        assert (tmp_path / name).read_text() == "text"
    assert len(list(tmp_path.iterdir())) == 2
    with pytest.raises(FileError, match="cannot be written"):
        write_text(str(tmp_path / ("n" * 256)), "text")


@pytest.mark.skipif(os.name == "nt", reason="a folder in use stays there")
def test_a_working_folder_that_is_gone_is_a_files_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    with pytest.raises(FileError, match="^file: "):
        write_text("file", "text")
