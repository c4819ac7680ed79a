# SPDX-License-Identifier: GPL-3.0-or-later
"""fmqm screen-size: what it prints, writes and returns, and what it says about bad input."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest

from fmqm_addon.cli import command
from fmqm_addon.report.record_check import record_fault
from fmqm_addon.screen_size.definition import SIZES
from tests.blender.script import SMALL, noise, read_json, score, write_png, write_torus


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("assets")
    write_png(folder / "a.png", noise(seed=1))
    write_torus(folder, "ref", "a.png")
    write_torus(folder, "near", "a.png", shake=0.01)
    write_torus(folder, "far", "a.png", shake=0.04)
    (folder / "cut.glb").write_bytes(b"glTF\2\0\0\0\xff\xff\0\0")
    return folder


def run(*argv: object) -> tuple[int, str]:
    out = io.StringIO()
    code = command.run(["screen-size", *map(str, argv)], out)
    return code, out.getvalue()


def test_a_chain_as_table_and_json_with_an_engine(assets: Path, tmp_path: Path) -> None:
    path = tmp_path / "sizes.json"
    lods = [assets / name for name in ("ref.obj", "near.obj", "far.obj")]
    code, text = run(assets / "ref.obj", *lods, "--engine", "threejs", "--quiet", "--json", path)
    document = json.loads(path.read_text(encoding="utf-8"))
    assert code == 0
    found = [each["screen_size"] for each in document["levels"]]
    assert found[0]["strict"] == {"pixels": 512.0, "bound": "at least", "worst_view": found[0]["strict"]["worst_view"]}
    pixels = [each["strict"]["pixels"] for each in found]
    assert pixels == sorted(pixels, reverse=True) and pixels[1] > pixels[2] >= 16
    assert [each["size"] for each in found[0]["curve"]] == list(SIZES) == document["definition"]["sizes"]
    assert document["engine"]["screen"]["fov"] == 60 and document["engine"]["text"] in text
    assert "at least 512" in text and all(str(lod) in text for lod in lods)
    assert list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_read_is_one_line_and_the_others_are_measured(
    assets: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, text = run(assets / "ref.obj", assets / "cut.glb", assets / "ref.obj", "--quiet", "--json", "-")
    levels = json.loads(text)["levels"]
    assert code == 1
    assert levels[0]["screen_size"] is None and "cut.glb" in levels[0]["error"]
    assert levels[1]["error"] is None and levels[1]["screen_size"]["fade"]["bound"] == "at least"
    said = capsys.readouterr().err
    assert "cut.glb" in said and "Traceback" not in said and len(said.splitlines()) == 1


def test_an_unreadable_reference_ends_it(assets: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, text = run(assets / "nowhere.obj", assets / "ref.obj", "--quiet")
    assert (code, text) == (1, "")
    assert "no such file" in capsys.readouterr().err


@pytest.mark.parametrize(
    "wrong, why",
    [
        (["--fov", "180"], "fov is 180"), (["--height", "0"], "height is 0"), (["--views", "7"], "7"),
        (["--bake", "-1"], "bake is -1"), (["--json", "ref.obj"], "ref.obj"), (["--asset-root", "."], "--untrusted"),
    ],
)  # fmt: skip
def test_wrong_arguments_are_refused(
    assets: Path, wrong: list[str], why: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(assets)
    with pytest.raises(SystemExit) as end:
        run("ref.obj", "ref.obj", *wrong)
    assert end.value.code == 2 and why in capsys.readouterr().err
    assert (assets / "ref.obj").read_text(encoding="utf-8").startswith(("mtllib", "#", "v"))


def test_score_tells_the_same_sizes(assets: Path, tmp_path: Path) -> None:
    """In all its outputs, and only where they are asked for."""
    names = [assets / "ref.obj", assets / "near.obj", assets / "cut.glb"]
    done = score(*SMALL, *names, "--screen-size", "--json", tmp_path / "s.json", "--csv", tmp_path / "s.csv", "--quiet")
    assert done.returncode == 1 and "screen_size_strict  screen_size_fade" in done.stdout
    pairs = read_json(tmp_path / "s.json")["pairs"]
    _, text = run(*names, "--quiet", "--json", "-")
    alone = json.loads(text)["levels"][0]["screen_size"]
    assert pairs[0]["screen_size"] == alone and "screen_size" not in pairs[1]
    rows = list(csv.DictReader((tmp_path / "s.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["screen_size_strict"] for row in rows] == [repr(alone["strict"]["pixels"]), ""]
    assert not record_fault(pairs[0])
    assert record_fault(pairs[0] | {"screen_size": {"strict": alone["strict"], "fade": {"pixels": "8"}}})


def test_an_lod_is_put_where_it_is_scored(assets: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Another axis is up, and it stands beside the reference: it is put there, and a note says so."""
    turned = assets / "turned.obj"
    lines = (assets / "ref.obj").read_text(encoding="utf-8").splitlines()
    for index, line in enumerate(lines):
        if line.startswith("v "):
            x, y, z = map(float, line.split()[1:4])
            lines[index] = f"v {x + 5} {-z} {y}"
    turned.write_text("\n".join(lines), encoding="utf-8")
    code, text = run(assets / "ref.obj", turned, "--quiet", "--json", "-")
    (level,) = json.loads(text)["levels"]
    assert code == 0 and level["screen_size"]["strict"]["bound"] == "at least"
    assert level["warnings"] == [] and "turned by" in level["notes"][0]
    assert f"note: {level['notes'][0]}" in capsys.readouterr().err
