# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/score.py where files end their process, nobody listens, or the machine lacks something: no traceback."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from tests.blender.script import SCORE, noise, read_json, score, write_png, write_torus

TINY = ("--samples", "640", "--patches", "20", "--color-units", "5")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="of POSIX")

# Acts when a file is opened, as an importer in C may: it dies, or does not come back and hears no signal.
ON_OPEN = """
import ctypes, os, sys
def hook(event, arguments):
    name = os.path.basename(str(arguments[0])) if event == "open" else ""
    if name == "crash.obj":
        os.kill(os.getpid(), 11)
    if name in ("busy.obj", "deaf.obj"):
        library = (ctypes.CDLL if name == "busy.obj" else ctypes.PyDLL)(None)
        mutex = ctypes.create_string_buffer(64)
        print("it has come to", name, file=sys.stderr, flush=True)
        library.pthread_mutex_lock(mutex)
        library.pthread_mutex_lock(mutex)
sys.addaudithook(hook)
"""


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("assets")
    write_png(folder / "a.png", noise(seed=1))
    for name in ("ref", "crash", "busy", "deaf"):
        write_torus(folder, name, "a.png")
    (folder / "python").mkdir()
    (folder / "python" / "sitecustomize.py").write_text(ON_OPEN)
    return folder


def hooked(assets: Path, temporary: Path) -> dict[str, str]:
    temporary.mkdir(exist_ok=True)
    return {"PYTHONPATH": str(assets / "python"), "TMPDIR": str(temporary)}


def errors(path: Path) -> list[str | None]:
    return [pair["error"] for pair in read_json(path)["pairs"]]


def test_a_double_dash_does_not_hide_what_a_worker_is(assets: Path, tmp_path: Path) -> None:
    """Each worker would be a parent of workers, and so on."""
    command = ["--jobs", "2", *TINY, "--json", tmp_path / "j", "--quiet", "ref.obj", "--", "-b.obj", "ref.obj"]
    assert score(*command, cwd=assets, timeout=600).returncode == 1
    assert errors(tmp_path / "j") == ["-b.obj: no such file", None]


def test_a_worker_without_its_shard_ends(assets: Path, tmp_path: Path) -> None:
    done = score("--worker", tmp_path / "none", "ref.obj", "ref.obj", cwd=assets)
    assert done.returncode == 1 and done.stderr.endswith("none: no shard for a worker (No such file or directory)\n")
    done = score("ref.obj", "ref.obj", cwd=assets, env={"FMQM_WORKER": "1"})
    assert done.returncode == 1 and len(done.stderr.splitlines()) == 1 and done.stdout == ""


def test_a_pair_that_ends_its_process_is_an_error_of_its_own(assets: Path, tmp_path: Path) -> None:
    """Without any flag; resumed it is tried again, and still costs only itself. What the user has there stays."""
    (tmp_path / "run.workers").mkdir()
    (tmp_path / "run.workers" / "thesis").write_text("mine")
    command = ["ref.obj", "crash.obj", "ref.obj", *TINY, "--json", tmp_path / "j", "--journal", tmp_path / "run"]
    for more in ([], ["--resume"]):
        done = score(*command, *more, "--quiet", cwd=assets, env=hooked(assets, tmp_path / "tmp"))
        assert done.returncode == 1
        assert errors(tmp_path / "j") == ["crash.obj: its worker died (SIGSEGV), 2 times; look at it alone", None]
    assert (tmp_path / "run.workers" / "thesis").read_text() == "mine"
    assert sorted(os.listdir(tmp_path)) == ["j", "run", "run.workers", "tmp"] and not os.listdir(tmp_path / "tmp")


def test_a_single_pair_that_ended_this_process_is_resumed_in_a_worker(assets: Path, tmp_path: Path) -> None:
    command = ["ref.obj", "crash.obj", *TINY, "--json", tmp_path / "j", "--quiet"]
    env = hooked(assets, tmp_path / "tmp")
    assert score(*command, cwd=assets, env=env).returncode == -signal.SIGSEGV
    assert len(os.listdir(tmp_path / "tmp")) == 1, "what it had no time to remove"
    done = score(*command, "--resume", cwd=assets, env=env)
    assert done.returncode == 1 and errors(tmp_path / "j")[0] is not None
    assert score("ref.obj", "ref.obj", *TINY, "--quiet", cwd=assets, env=env).returncode == 0
    assert not os.listdir(tmp_path / "tmp"), "swept by the next one"


@pytest.mark.parametrize(
    ("name", "times", "code"), [("busy.obj", 1, 130), ("busy.obj", 2, 130), ("deaf.obj", 1, -signal.SIGKILL)]
)
def test_a_stop_ends_what_does_not_come_back_from_c(
    assets: Path, tmp_path: Path, name: str, times: int, code: int
) -> None:
    command = [sys.executable, str(SCORE), "ref.obj", name, *TINY, "--quiet"]
    env = os.environ | hooked(assets, tmp_path / "tmp")
    process = subprocess.Popen(command, cwd=assets, env=env, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert "it has come to" in process.stderr.readline()
    while sys.platform == "linux" and not sleeps(process.pid):  # in C
        time.sleep(0.02)
    for _ in range(times):
        time.sleep(0.1)
        process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=120)
    assert process.returncode == code and "Traceback" not in told
    assert code == -signal.SIGKILL or not os.listdir(tmp_path / "tmp")


def sleeps(pid: int) -> bool:
    """Whether its main thread waits for something."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "S"


def shell(text: str, *arguments: object, **more: Any) -> subprocess.CompletedProcess[str]:
    """Of a shell, in which "$@" is the script with its arguments."""
    command = ["bash", "-c", text, "bash", sys.executable, str(SCORE), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, **more)
    assert "Traceback" not in done.stderr and "Exception ignored" not in done.stderr
    return done


def test_streams_that_are_closed_are_no_error(assets: Path, tmp_path: Path) -> None:
    for redirection in (">&-", "2>&-", "<&- >&- 2>&-"):
        done = shell(f'"$@" {redirection}', "ref.obj", "ref.obj", *TINY, "--csv", tmp_path / "c", cwd=assets)
        assert done.returncode == 0 and "1.0" in (tmp_path / "c").read_text(), redirection
    for arguments in (["--help"], ["gone.obj", "ref.obj"], ["--wrong"]):
        alone = shell('"$@"', *arguments, cwd=assets).returncode
        done = shell('"$@" 2>&1 | true; exit ${PIPESTATUS[0]}', *arguments, cwd=assets)
        assert (done.returncode, done.stderr) == (alone, ""), arguments


def test_a_working_folder_that_is_gone_is_one_line(assets: Path, tmp_path: Path) -> None:
    (tmp_path / "gone").mkdir()
    ref = assets / "ref.obj"
    done = shell('cd gone && rmdir ../gone && "$@"', ref, ref, *TINY, "--json", "j", cwd=tmp_path)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr == "score.py: the working folder is gone; change to another\n"


def test_without_a_place_for_temporary_files_it_is_one_line(assets: Path, tmp_path: Path) -> None:
    (tmp_path / "python").mkdir()
    nowhere = "import tempfile\ntempfile._candidate_tempdir_list = lambda: ['/dev/null/none']\n"
    (tmp_path / "python" / "sitecustomize.py").write_text(nowhere)
    env = {"PYTHONPATH": str(tmp_path / "python")}
    for more in ([], ["ref.obj"]):
        done = score("ref.obj", "ref.obj", *more, *TINY, cwd=assets, env=env)
        assert done.returncode == 1 and len(done.stderr.splitlines()) == 1 and "set TMPDIR" in done.stderr


def test_names_of_outputs_may_be_as_long_as_the_system_allows(assets: Path, tmp_path: Path) -> None:
    for length in (241, 255):
        names = [letter * (length - 4) + ending for letter, ending in (("j", ".jso"), ("c", ".csv"), ("p", ".png"))]
        flags = ["--json", names[0], "--csv", names[1], "--picture", names[2]]
        done = score(assets / "ref.obj", assets / "ref.obj", *TINY, *flags, "--quiet", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert all((tmp_path / name).stat().st_size for name in names)
    assert len(os.listdir(tmp_path)) == 6
    done = score(assets / "ref.obj", assets / "ref.obj", *TINY, "--json", "j" * 256, cwd=tmp_path)
    assert done.returncode == 1 and len(done.stderr.splitlines()) == 1 and "File name too long" in done.stderr
