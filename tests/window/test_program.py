# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/score.py under the real Blender program: the numbers and exit codes of the Python module."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.blender.script import SCORE, SMALL, noise, numbers, read_json, score, write_png, write_torus

pytestmark = pytest.mark.program
ONE_BLENDER = 1e-9  # the same release, another build and numpy
TWO_BLENDERS = 1e-3


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("assets")
    write_png(folder / "a.png", noise(seed=1))
    write_torus(folder, "ref", "a.png")
    write_torus(folder, "shaken", "a.png", shake=0.03)
    return folder


@pytest.fixture(scope="module")
def program(blender: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[tuple[str, ...], dict[str, str]]:
    """The command up to the script's own arguments, and settings of its own."""
    settings = {"BLENDER_USER_RESOURCES": str(tmp_path_factory.mktemp("user"))}
    return (blender, "-b", "-q", "--python", str(SCORE), "--"), settings


def test_same_numbers_as_the_module(
    program: tuple[tuple[str, ...], dict[str, str]], assets: Path, tmp_path: Path
) -> None:
    command, env = program
    files = ("ref.obj", "ref.obj", "shaken.obj", *SMALL)
    done = score(*files, "--json", tmp_path / "program", command=command, env=env, cwd=assets)
    assert done.returncode == 0, done.stderr
    assert score(*files, "--json", tmp_path / "module", cwd=assets).returncode == 0
    documents = [read_json(tmp_path / name) for name in ("program", "module")]
    releases = [document["blender_version"].split(".")[:2] for document in documents]
    same, shaken = ([document["pairs"][k] for document in documents] for k in (0, 1))
    assert numbers(same[0]) == [1.0] * 5
    assert shaken[0]["samples"] == shaken[1]["samples"]
    tolerance = ONE_BLENDER if releases[0] == releases[1] else TWO_BLENDERS
    print([a - b for a, b in zip(numbers(shaken[0]), numbers(shaken[1]), strict=True)])
    assert numbers(shaken[0]) == pytest.approx(numbers(shaken[1]), abs=tolerance)
    assert re.search(r"^shaken\.obj  +0\.\d{4}  ", done.stdout, re.MULTILINE)


def test_json_is_all_that_the_script_prints(program: tuple[tuple[str, ...], dict[str, str]], assets: Path) -> None:
    """Blender's own start may print before the script runs; nothing may after it."""
    command, env = program
    done = score("ref.obj", "shaken.obj", *SMALL, "--json", "-", "--quiet", command=command, env=env, cwd=assets)
    assert done.returncode == 0
    before, brace, text = done.stdout.partition("{")
    assert before.count("\n") <= 1
    assert json.loads(brace + text)["pairs"][0]["error"] is None and text.endswith("}\n")


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("ref.obj", "ref.obj", *SMALL, "--fail-under", "1"), 0),
        (("ref.obj", "shaken.obj", *SMALL, "--fail-under", "1"), 1),
        (("ref.obj", "nowhere.obj", *SMALL), 1),
        (("ref.obj", "shaken.obj", "--samples", "0"), 2),
        (("ref.obj",), 2),
        ((), 2),
        (("--help",), 0),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_exit_codes_arrive(
    program: tuple[tuple[str, ...], dict[str, str]], assets: Path, arguments: tuple[str, ...], code: int
) -> None:
    command, env = program
    assert score(*arguments, command=command, env=env, cwd=assets).returncode == code


def test_without_two_dashes_the_arguments_are_blenders(blender: str, tmp_path: Path) -> None:
    command = (blender, "-b", "-q", "--python", str(SCORE))
    env = {"BLENDER_USER_RESOURCES": str(tmp_path)}
    done = score(command=command, env=env)
    assert done.returncode == 2 and "REFERENCE" in done.stderr
