# SPDX-License-Identifier: GPL-3.0-or-later
"""The second reading in what score.py writes, and which of the two decides."""

from __future__ import annotations

import csv
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.blender.script import SMALL, noise, read_json, score, write_png, write_torus

COLUMNS = ("FMQM", "geoSSIM", "geoGraSSIM", "colorSSIM", "colorGraSSIM")
PERCEIVED = ("perceived", "shape", "facing", "color", "detail", "perceived_p10")  # as tables show them
KEYS = ("score", "shape", "facing", "color", "detail", "p10")  # as JSON does


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A torus, one with other colors, and one that is shaken."""
    folder = tmp_path_factory.mktemp("assets")
    write_png(folder / "a.png", noise())
    write_png(folder / "b.png", noise(seed=1) // 8 + noise() // 8 * 7)
    write_torus(folder, "ref", "a.png")
    write_torus(folder, "faded", "b.png")
    write_torus(folder, "shaken", "a.png", shake=0.02)
    return folder


def test_both_readings_are_in_all_outputs(assets: Path, tmp_path: Path) -> None:
    outputs = {kind: tmp_path / f"out.{kind}" for kind in ("json", "csv", "xml", "npz")}
    flags = ("--json", outputs["json"], "--csv", outputs["csv"], "--junit", outputs["xml"])
    done = score(
        assets / "ref.obj", assets / "shaken.obj", *SMALL, *flags, "--save-fields", outputs["npz"], "--both",
        "--repeats", 2, "--quiet",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (pair,) = read_json(outputs["json"])["pairs"]
    for direction in (pair, pair["reverse"]):
        perceived = direction["perceived"]
        assert list(perceived) == [*KEYS, "stderr"] and list(perceived["stderr"]) == list(KEYS)
        assert all(0 < perceived[key] < 1 for key in KEYS) and perceived["p10"] < perceived["score"]
        assert 0 < direction["FMQM"] < 1
    assert pair["fmqm_p10"] < pair["FMQM"]
    (row,) = csv.DictReader(outputs["csv"].read_text(encoding="utf-8").splitlines())
    found = ElementTree.parse(outputs["xml"]).iterfind(".//property")
    properties = {each.attrib["name"]: float(each.attrib["value"]) for each in found}
    for column, key in zip(PERCEIVED, KEYS, strict=True):
        assert float(row[column]) == properties[column] == pair["perceived"][key]
        assert float(row[f"reverse {column}"]) == pair["reverse"]["perceived"][key]
    assert properties["FMQM"] == pair["FMQM"] and properties["fmqm_p10"] == pair["fmqm_p10"]
    header, line = done.stdout.splitlines()
    assert header.split()[6] == "perceived" and f"{pair['perceived']['score']:.4f}" in line
    with np.load(outputs["npz"]) as fields:  # of the first seed alone
        assert fields["patch_perceived"].shape == (20, 5)


def test_a_mesh_against_itself_is_1_in_every_number(assets: Path) -> None:
    done = score(assets / "ref.obj", assets / "ref.obj", *SMALL, "--csv", "-", "--quiet")
    (row,) = csv.DictReader(done.stdout.splitlines())
    assert [row[name] for name in (*COLUMNS, *PERCEIVED)] == ["1.0"] * 11


def test_the_judge_decides_about_thresholds(assets: Path, tmp_path: Path) -> None:
    """Other seams of one image's noise: FMQM sees far more in it than the second reading."""
    made = tmp_path / "out.json"
    pair = (assets / "ref.obj", assets / "faded.obj", *SMALL, "--quiet", "--json", made)
    assert score(*pair).returncode == 0
    (record,) = read_json(made)["pairs"]
    fmqm, perceived = record["FMQM"], record["perceived"]["score"]
    assert fmqm < perceived and record["judge"] == "fmqm" and record["fail_under_p10"] is None
    between = (fmqm + perceived) / 2
    strict = score(*pair, "--fail-under", between)
    assert strict.returncode == 1 and f"FMQM {fmqm:.4f} is below" in strict.stderr
    kind = score(*pair, "--fail-under", between, "--judge", "perceived", "--fail-under-p10", 0)
    assert (kind.returncode, kind.stderr) == (0, "")
    for judge, p10 in (("fmqm", record["fmqm_p10"]), ("perceived", record["perceived"]["p10"])):
        assert score(*pair, "--judge", judge, "--fail-under-p10", p10).returncode == 0
        worst = score(*pair, "--judge", judge, "--fail-under-p10", p10 + 1e-9)
        assert worst.returncode == 1 and f"{judge}_p10 0.9" in worst.stderr
    assert score(*pair, "--fail-under-p10", 2).returncode == score(*pair, "--judge", "me").returncode == 2


def test_resuming_with_another_judge_draws_pictures_and_scores_nothing_else(assets: Path, tmp_path: Path) -> None:
    manifest, journal = assets / "pairs.csv", tmp_path / "j"
    manifest.write_text("reference,distorted,fail_under\nref.obj,faded.obj,0\nref.obj,shaken.obj,1\n")
    made = tmp_path / "out.json"
    run = ("--manifest", manifest, *SMALL, "--quiet", "--journal", journal, "--json", made)
    assert score(*run).returncode == 1
    first = read_json(made)["pairs"]
    again = score(*run, "--resume", "--judge", "perceived")
    assert "perceived" in again.stderr and again.returncode == 1
    changed = [record | {"judge": "fmqm"} for record in read_json(made)["pairs"]]
    assert changed == first, "nothing was scored anew: the same seconds"
    report = (*run, "--resume", "--report", tmp_path / "page")
    for judge in ("fmqm", "perceived"):
        score(*report, "--judge", judge)
        assert {record["pictures"]["judge"] for record in read_json(made)["pairs"]} == {judge}
    page = (tmp_path / "page" / "index.html").read_text(encoding="utf-8")
    assert "Original colored by the Perceived of" in page and "<h4>Perceived of the patches</h4>" in page


def test_the_picture_is_the_judges(assets: Path, tmp_path: Path) -> None:
    pytest.importorskip("PIL.Image")
    pictures = []
    for judge in ("fmqm", "perceived"):
        path = tmp_path / f"{judge}.png"
        flags = ("--quiet", "--judge", judge, "--picture", path)
        assert score(assets / "ref.obj", assets / "faded.obj", *SMALL, *flags).returncode == 0
        pictures.append(path.read_bytes())
    assert pictures[0] != pictures[1]
