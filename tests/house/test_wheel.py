# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheel as `pip install` gets it, outside the checkout: the command fmqm does what the scripts do."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from fmqm_addon import VERSION
from tests.blender.script import SMALL, noise, read_json, score, without_seconds, write_png, write_torus

pytestmark = pytest.mark.once
ROOT = Path(__file__).resolve().parents[2]
PIP = (sys.executable, "-m", "pip", "--isolated", "--disable-pip-version-check", "--quiet")
OUTPUTS = ("--json", "scores.json", "--csv", "scores.csv", "--report", "web", "--quiet")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy, since a build leaves files beside its sources, by the setuptools of requirements-dev.txt."""
    source, folder = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    shutil.copytree(ROOT / "fmqm_addon", source / "fmqm_addon", ignore=shutil.ignore_patterns("__pycache__"))
    run(*PIP, "wheel", "--no-deps", "--no-index", "--no-build-isolation", "-w", str(folder), str(source))
    return folder / f"fmqm-{VERSION}-py3-none-any.whl"


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with our package alone; bpy, numpy and Pillow are the environment's."""
    folder = tmp_path_factory.mktemp("site")
    run(*PIP, "install", "--no-deps", "--no-index", "--target", str(folder), str(wheel))
    return folder


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("assets")
    write_png(folder / "a.png", noise(seed=1))
    for number, name in enumerate(("ref", "shaken", "more")):
        write_torus(folder, name, "a.png", shake=0.02 * number)
    return folder


def run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def fmqm(installed: Path, *arguments: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    command = (sys.executable, str(installed / "bin" / "fmqm"))
    return score(*arguments, command=command, env={"PYTHONPATH": str(installed)}, cwd=cwd)


def test_what_is_in_it(wheel: Path) -> None:
    names = set(zipfile.ZipFile(wheel).namelist())
    package = {path.relative_to(ROOT).as_posix() for path in (ROOT / "fmqm_addon").rglob("*") if path.is_file()}
    assert {name for name in package if "__pycache__" not in name} == {
        name for name in names if not name.startswith(f"fmqm-{VERSION}.dist-info/")
    }


@pytest.mark.parametrize("more", [(), ("more.obj",)], ids=["one pair, here", "two pairs, in a worker"])
def test_score_as_the_script_does(installed: Path, assets: Path, tmp_path: Path, more: tuple[str, ...]) -> None:
    files = [str(assets / name) for name in ("ref.obj", "shaken.obj", *more)]
    folders = [tmp_path / name for name in ("command", "script")]
    for folder in folders:
        folder.mkdir()
    by_command = fmqm(installed, "score", *files, *SMALL, *OUTPUTS, cwd=folders[0])
    by_script = score(*files, *SMALL, *OUTPUTS, cwd=folders[1])
    assert by_command.returncode == by_script.returncode == 0, by_command.stderr
    assert by_command.stdout == by_script.stdout and by_command.stderr == by_script.stderr == ""
    command, script = (without_seconds(read_json(folder / "scores.json")) for folder in folders)
    assert command == script
    pages = [(folder / "web" / "index.html").read_text(encoding="utf-8") for folder in folders]
    css = (ROOT / "fmqm_addon" / "report" / "html" / "page.css").read_text(encoding="utf-8")
    assert css in pages[0] and len(pages[0].splitlines()) == len(pages[1].splitlines())
    pictures = [{path.name: path.read_bytes() for path in folder.rglob("*.jpg")} for folder in folders]
    assert pictures[0] and pictures[0] == pictures[1]


def test_decimate_and_exit_codes(installed: Path, assets: Path) -> None:
    search = ("decimate", "ref.obj", "--target-fmqm", "0.3", *SMALL[:4], "--json", "-", "--quiet")
    done = fmqm(installed, *search, cwd=assets)
    assert done.returncode == 0 and '"reached": true' in done.stdout, done.stderr
    missing = fmqm(installed, "score", "ref.obj", "nowhere.obj", "--quiet", cwd=assets)
    assert (missing.returncode, missing.stderr) == (1, "fmqm score: nowhere.obj: no such file\n")
    for arguments in ((), ("sore",), ("score",), ("score", "ref.obj", "shaken.obj", "--samples", "0")):
        wrong = fmqm(installed, *arguments, cwd=assets)
        assert wrong.returncode == 2 and len(wrong.stderr.splitlines()) == 1, arguments
        assert wrong.stderr.startswith(" ".join(["fmqm", *arguments[:1]]) if len(arguments) != 1 else "fmqm")
    helped = fmqm(installed, "score", "--help", cwd=assets)
    assert helped.returncode == 0 and helped.stdout.startswith("usage: fmqm score ")


def test_the_package_is_the_command(installed: Path, tmp_path: Path) -> None:
    env = {**os.environ, "PYTHONPATH": str(installed)}
    command = [sys.executable, "-P", "-m", "fmqm_addon", "--help"]
    done = subprocess.run(command, env=env, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "score" in done.stdout and "decimate" in done.stdout
