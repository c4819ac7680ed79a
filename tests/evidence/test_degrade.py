# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/degrade.py as a user runs it: files that score.py reads, and the same bytes for the same seed."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

from fmqm_addon.evidence.degrade import COLUMNS
from fmqm_addon.evidence.distortions import DISTORTIONS
from tests.blender.script import SCORE, SMALL, noise, read_json, score, write_png, write_torus

DEGRADE = SCORE.with_name("degrade.py")


def degrade(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(DEGRADE), *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "Traceback" not in done.stderr, done.stderr
    return done


@pytest.fixture(scope="module")
def torus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("torus")
    write_png(folder / "a.png", noise(64))
    return write_torus(folder, "torus", "a.png")


@pytest.fixture(scope="module")
def made(torus: Path) -> Path:
    """All distortions of the torus."""
    folder = torus.parent / "made"
    done = degrade(torus, "-o", folder)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    assert done.stdout == f"{folder / 'manifest.csv'}: {len(DISTORTIONS)} distorted models\n"
    return folder


def test_the_manifest_is_read_by_score(made: Path, tmp_path: Path) -> None:
    """Kind and level arrive in JSON and CSV; each kind does harm, and what it leaves alone is left alone."""
    outputs = ("--json", tmp_path / "scores.json", "--csv", tmp_path / "scores.csv")
    done = score("--manifest", made / "manifest.csv", *SMALL, *outputs, "--quiet")
    assert done.returncode == 0, done.stderr
    pairs = {pair["id"]: pair for pair in read_json(tmp_path / "scores.json")["pairs"]}
    assert len(pairs) == len(DISTORTIONS)
    for each in DISTORTIONS:
        pair = pairs[f"torus_{each.name}"]
        assert (pair["kind"], pair["level"], pair["error"]) == (each.kind, each.level, None)
        assert pair["perceived"]["score"] < 1
        changes_shape = each.kept < 1 or each.noise > 0 or each.position_bits > 0
        assert (pair["perceived"]["shape"] < 1) == changes_shape, each.name
    assert pairs["torus_SOT_4"]["triangles"] == pytest.approx(0.06 * 576, abs=4)
    with open(tmp_path / "scores.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["kind"], row["level"]) for row in rows] == [(each.kind, str(each.level)) for each in DISTORTIONS]


def test_what_is_left_alone_is_no_distortion(torus: Path, made: Path) -> None:
    done = score(torus, made / "torus.glb", *SMALL, "--json", made / "same.json", "--quiet")
    assert done.returncode == 0, done.stderr
    assert read_json(made / "same.json")["pairs"][0]["perceived"]["score"] == pytest.approx(1, abs=1e-6)


def test_deterministic_by_seed(torus: Path, made: Path, tmp_path: Path) -> None:
    for seed in (0, 7):
        assert degrade(torus, "-o", tmp_path / str(seed), "--seed", seed, "--only", "GN,GTC").returncode == 0
    for name in ("torus.glb", "torus_GN_3.glb", "torus_GTC_5.glb"):
        assert (tmp_path / "0" / name).read_bytes() == (made / name).read_bytes(), name
    assert (tmp_path / "7" / "torus_GN_3.glb").read_bytes() != (made / "torus_GN_3.glb").read_bytes()
    with open(tmp_path / "0" / "manifest.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 14 and tuple(rows[0]) == COLUMNS


def test_what_cannot_be_done_is_told(tmp_path: Path) -> None:
    """A model without a texture has none to compress; one that is not there is one line, and so is a wrong kind."""
    plain = write_torus(tmp_path, "plain")
    done = degrade(plain, "-o", tmp_path / "out", "--only", "QP,TMC")
    assert done.returncode == 0 and "5 distorted models" in done.stdout
    assert f"degrade.py: TMC_1 is left out: {plain} has not a texture\n" in done.stderr
    for arguments, code in (((tmp_path / "no.obj", "-o", tmp_path), 1), ((plain, "-o", tmp_path, "--only", "GX"), 2)):
        wrong = degrade(*arguments)
        assert wrong.returncode == code and len(wrong.stderr.splitlines()) == 1, wrong.stderr


def test_the_model_is_not_replaced(made: Path) -> None:
    before = (made / "torus.glb").read_bytes()
    done = degrade(made / "torus.glb", "-o", made)
    assert done.returncode == 1 and "would be replaced" in done.stderr
    assert (made / "torus.glb").read_bytes() == before
