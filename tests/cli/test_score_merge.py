# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/score.py --merge on parts made by hand: no Blender, no scores."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from fmqm_addon.cli.score import main
from fmqm_addon.report.criteria import ANYTHING
from fmqm_addon.report.records import PairScore, pair_record
from tests.readings import all_alike, numbers

HEAD = {"fmqm_version": "1", "fmqm_code": "c", "blender_version": "4", "settings": {}}


def write_part(folder: Path, *names: str, **more: Any) -> str:
    """A part in which all scores are 0.5."""
    told = {"settings": {}, **ANYTHING.record_fields()}
    records = [pair_record(PairScore("r", name, all_alike(0.5), patches=200)) | told for name in names]
    (folder / "part.json").write_text(json.dumps(HEAD | {"pairs": [record | more for record in records]}))
    return str(folder / "part.json")


def write_manifest(folder: Path, text: str) -> str:
    (folder / "pairs.csv").write_text(text)
    return str(folder / "pairs.csv")


def test_what_comes_without_an_explanation_gets_one(tmp_path: Path) -> None:
    manifest = write_manifest(tmp_path, "reference,distorted\nr,a\nr,b\n")
    out = io.StringIO()
    outputs = ["--explain", "--csv", str(tmp_path / "c")]
    assert main(["--merge", write_part(tmp_path, "a"), "--manifest", manifest, *outputs], out) == 1
    assert "none of the merged parts has it" in out.getvalue() and "very annoying" in out.getvalue()
    assert (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("recorded", "limit", "rows", "code"),
    [
        (None, (), "", 0),
        (None, ("--fail-under", "0.4"), "", 0),
        (None, ("--fail-under", "0.6"), "", 1),
        (0.6, (), "", 1),
        (None, (), "r,a,0.6\n", 1),
        (0.6, ("--fail-under", "0.7"), "r,a,0\n", 0),
        (None, ("--fail-under", "0.6"), "r,a,\n", 1),
    ],
)
def test_limits_of_the_manifest_and_the_arguments_count(
    tmp_path: Path, recorded: float | None, limit: tuple[str, ...], rows: str, code: int
) -> None:
    manifest = ("--manifest", write_manifest(tmp_path, f"reference,distorted,fail_under\n{rows}")) if rows else ()
    part = write_part(tmp_path, "a", fail_under=recorded)
    assert main(["--merge", part, *manifest, *limit], io.StringIO()) == code


def test_a_threshold_that_is_missed_by_a_hair_is_said_with_enough_digits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    part = write_part(tmp_path, "a", FMQM=0.499999, fail_under=0.5)
    assert main(["--merge", part, "--junit", str(tmp_path / "x")], io.StringIO()) == 1
    assert capsys.readouterr().err == "score.py: a: FMQM 0.499999 is below 0.5\n"
    assert "FMQM 0.499999 is below 0.5: " in (tmp_path / "x").read_text()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("reference,distorted,id\nr,b,a\n", "distorted a instead of b"),
        ("reference,distorted\nother,a\n", "reference r instead of other"),
        ("reference,distorted,texture\nr,a,t.png\n", "texture none instead of t.png"),
        ("reference,distorted,samples\nr,a,9000\n", "settings none instead of {'samples': 9000}"),
    ],
)
def test_a_record_of_another_row_does_not_count(
    tmp_path: Path, text: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Unless another part has the row's own."""
    manifest = write_manifest(tmp_path, text)
    arguments = ["--merge", write_part(tmp_path, "a"), "--manifest", manifest, "--csv", str(tmp_path / "c")]
    assert main(arguments, io.StringIO()) == 1
    assert words in capsys.readouterr().err and words in (tmp_path / "c").read_text().replace('""', '"')


def test_of_two_parts_the_one_that_is_the_rows_counts(tmp_path: Path) -> None:
    old = Path(write_part(tmp_path, "a", reference="older")).rename(tmp_path / "old.json")
    manifest = write_manifest(tmp_path, "reference,distorted\nr,a\n")
    assert main(["--merge", str(old), write_part(tmp_path, "a"), "--manifest", manifest], io.StringIO()) == 0


def test_shards_know_their_places_and_which_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = []
    for number, names in ((3, "c"), (1, "ad"), (2, "be")):
        part = Path(write_part(tmp_path, *names))
        document = json.loads(part.read_text()) | {"shard": [number, 3]}
        parts.append(str(part.rename(tmp_path / f"{number}.json")))
        Path(parts[-1]).write_text(json.dumps(document))
    out = io.StringIO()
    assert main(["--merge", *parts], out) == 0
    assert [line[0] for line in out.getvalue().splitlines()[1:]] == list("abcde")
    assert main(["--merge", *parts[:2]], io.StringIO()) == 1
    assert "shard 2/3" in capsys.readouterr().err


def test_the_unforeseen_ends_with_1() -> None:
    """Under Blender too, which would go on after an exception that leaves the script."""
    code = (
        "from fmqm_addon.cli.process import run_script\n"
        "def fail(*_):\n    raise RuntimeError('unforeseen')\n"
        "try:\n    run_script(fail, __name__)\nexcept Exception:\n    pass\n"
    )
    root = Path(__file__).resolve().parents[2]
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True)
    assert done.returncode == 1 and "RuntimeError: unforeseen" in done.stderr


@pytest.mark.parametrize("flag", [("--jobs", "2"), ("--resume",), ("--both",), ("--picture", "p.png")])
def test_what_only_scoring_does_is_refused(
    tmp_path: Path, flag: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--merge", write_part(tmp_path, "a"), *flag, "--csv", str(tmp_path / "c")], io.StringIO())
    assert ended.value.code == 2 and f"leave out {flag[0]}" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["fmqm_version", "fmqm_code", "blender_version"])
def test_parts_of_different_code_do_not_mix(tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> None:
    first = Path(write_part(tmp_path, "a")).rename(tmp_path / "first.json")
    second = Path(write_part(tmp_path, "b"))
    document = json.loads(second.read_text())
    second.write_text(json.dumps(document | {name: "newer"}))
    assert main(["--merge", str(first), str(second), "--csv", str(tmp_path / "c")], io.StringIO()) == 1
    told = capsys.readouterr().err
    assert told.startswith(f"score.py: {second}: made by {name} newer instead of {HEAD[name]} in {first}")
    assert len(told.splitlines()) == 1 and not (tmp_path / "c").exists()
    del document[name]
    second.write_text(json.dumps(document))
    assert main(["--merge", str(first), str(second)], io.StringIO()) == 1
    assert f"{second}: not a JSON output of score.py, or an older one: {name} is missing" in capsys.readouterr().err


HOSTILE = '"><script>alert(1)</script>'
NAMES = {name: f"pictures/{name}.jpg" for name in ("reference", "distorted", "heat")}
VIEW = {"name": "front", "size": [4, 3], **NAMES}
PICTURES = {
    "views": [VIEW], "thumbnails": NAMES, "range": [0.5, 1.0], "histogram": [1, 2], "triangles": [2, 1],
    "texture_bytes": [0, 0], "judge": "fmqm", "has_gaps": False, "worst": [],
}  # fmt: skip
WORST = {
    "reference": "pictures/r.jpg",
    "distorted": "pictures/d.jpg",
    "FMQM": 0.5,
    "perceived": 0.5,
    "value": 0.5,
    "blame": "x",
    "place": "left",
    "object": None,
    "at": [None],
}
TEXTS = ("blame", "place", "object")  # of these, which may hold any


def test_pictures_of_a_part_are_taken(tmp_path: Path) -> None:
    part = write_part(tmp_path, "a", pictures=PICTURES | {"worst": [WORST]})
    assert main(["--merge", part], io.StringIO()) == 0


@pytest.mark.parametrize(
    "more",
    [
        *({name: HOSTILE} for name in ("FMQM", "stderr", "seconds", "warnings", "fail_under", "patches", "settings")),
        *({name: HOSTILE} for name in ("fail_under_p10", "fmqm_p10", "judge", "perceived")),
        {"perceived": numbers(0.5)["perceived"] | {"p10": HOSTILE}}, {"perceived": numbers(None)["perceived"]},
        {"perceived": numbers(0.5)["perceived"] | {"stderr": {"score": HOSTILE}}},
        {"reverse": numbers(0.5) | {"perceived": None}}, {"reverse": {"FMQM": HOSTILE}},
        {"attribution": {"phrase": HOSTILE}},
        {"pictures": HOSTILE}, {"id": 7}, {"trust": {"reference": {}, "distorted": {}, "pair": HOSTILE}},
        *({"pictures": PICTURES | {name: HOSTILE}} for name in PICTURES),
        *({"pictures": PICTURES | {"thumbnails": NAMES | {"heat": path}}}
          for path in ("//host/a.jpg", "../a.jpg", "pictures/../../a.jpg")),
        *({"pictures": PICTURES | {"views": [VIEW | {name: HOSTILE}]}} for name in VIEW),
        {"pictures": PICTURES | {"views": [VIEW | {"size": [HOSTILE, 1]}]}}, {"pictures": PICTURES | {"views": []}},
        {"pictures": PICTURES | {"range": [1.0, 1.0]}}, {"pictures": PICTURES | {"histogram": []}},
        {"pictures": PICTURES | {"triangles": [1, 1e308]}},
        *({"pictures": PICTURES | {"worst": [WORST | {name: 7 if name in TEXTS else HOSTILE}]}} for name in WORST),
        {"pictures": PICTURES | {"worst": [WORST | {"at": []}]}},
    ],
    ids=str,
)  # fmt: skip
def test_a_part_with_text_for_a_number_is_refused_in_one_line(
    tmp_path: Path, more: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--merge", write_part(tmp_path, "a", **more), "--junit", str(tmp_path / "x")]
    assert main(arguments, io.StringIO()) == 1
    told = capsys.readouterr().err
    assert "part.json: not a JSON output of score.py, or an older one: pair 1: " in told and len(told.splitlines()) == 1
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("text", ["", "[]", "{}", "NaN", '{"pairs": NaN}', "[" * 100_000, '{"shard": 1e999}', "\xff"])
def test_what_is_no_part_is_refused_in_one_line(tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "p").write_text(text, encoding="latin-1")
    assert main(["--merge", str(tmp_path / "p")], io.StringIO()) == 1
    told = capsys.readouterr().err
    assert told.startswith(f"score.py: {tmp_path / 'p'}: not a JSON output") and len(told.splitlines()) == 1


@pytest.mark.parametrize("shard", [[0, 2], [3, 2], [1], "1/2", [1.0, 2], None])
def test_a_shard_that_cannot_be_is_refused(tmp_path: Path, shard: object, capsys: pytest.CaptureFixture[str]) -> None:
    part = Path(write_part(tmp_path, "a"))
    part.write_text(json.dumps(json.loads(part.read_text()) | {"shard": shard}))
    assert main(["--merge", str(part)], io.StringIO()) == 1
    assert "shard is not such as [2, 5]" in capsys.readouterr().err


def test_an_id_like_a_formula_goes_through_a_merge(tmp_path: Path) -> None:
    part = write_part(tmp_path, "=1+1")
    outputs = ["--csv", str(tmp_path / "c"), "--json", str(tmp_path / "j")]
    assert main(["--merge", part, *outputs], io.StringIO()) == 0
    assert json.loads((tmp_path / "j").read_text())["pairs"][0]["id"] == "=1+1"
    assert (tmp_path / "c").read_text().splitlines()[1].startswith('"\'=1+1",r,')
    assert main(["--merge", part, *outputs, "--csv-raw"], io.StringIO()) == 0
    assert (tmp_path / "c").read_text().splitlines()[1].startswith("=1+1,r,")
