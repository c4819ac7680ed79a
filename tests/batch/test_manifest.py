# SPDX-License-Identifier: GPL-3.0-or-later
"""Manifests and globs: what rows they make, and what they say about mistakes. Needs no Blender."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from fmqm_addon.batch.manifest import glob_files, plain_rows, read_manifest
from fmqm_addon.batch.rows import BatchOptions, Row, Task, group_by_reference, task_of
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.errors import FileError, FMQMError, SettingsError
from fmqm_addon.metric.settings import Settings

SETTINGS = Settings()


def write(folder: Path, text: str, name: str = "pairs.csv") -> str:
    (folder / name).write_text(text, encoding="utf-8")
    return str(folder / name)


def test_a_csv_and_a_json_manifest_say_the_same(tmp_path: Path) -> None:
    text = "\ufeffreference,distorted,id,texture,fail_under,samples,gradient_radius,centers\n"
    text += 'rock.glb,lods/rock 1.glb,"a, b",,0.9,9000,inf,random\nrock.glb,lods/rock 2.glb,,b.png,,,,\n'
    plain: list[dict[str, Any]] = [
        {"reference": "rock.glb", "distorted": "lods/rock 1.glb", "id": "a, b", "fail_under": 0.9, "samples": 9000,
         "gradient_radius": "inf", "centers": "random"},
        {"reference": "rock.glb", "distorted": "lods/rock 2.glb", "texture": "b.png", "seed": None},
    ]  # fmt: skip
    from_csv = read_manifest(write(tmp_path, text), SETTINGS)
    assert from_csv == read_manifest(write(tmp_path, json.dumps(plain), "pairs.json"), SETTINGS)
    first, second = from_csv
    assert first.settings == (("samples", 9000), ("gradient_radius", float("inf")), ("centers", "random"))
    assert (first.id, first.fail_under, second.id, second.fail_under) == ("a, b", 0.9, "lods/rock 2.glb", None)
    assert second.path(second.texture) == str(tmp_path / "b.png") and second.path("") == ""
    assert BatchOptions(pair=PairOptions(settings=SETTINGS)).pair_of(first).settings.samples == 9000


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("reference,distorted,colour\na,b,c\n", "unknown column colour"),
        ("reference\na\n", "no column distorted"),
        ("reference,distorted,distorted\na,b,c\n", "distorted is there twice"),
        ("reference,distorted\na,b\na,\n", "row 3: no distorted"),
        ("reference,distorted\na,b,c\n", "row 2: more values than columns"),
        ("reference,distorted,samples\na,b,many\n", "row 2: samples is many; a whole number"),
        ("reference,distorted,samples\na,b,100\n", "row 2: samples is 100; it must be at least 32"),
        ("reference,distorted,fail_under\na,b,1.5\n", "row 2: fail_under is 1.5"),
        ("reference,distorted,fail_under\na,b,nan\n", "row 2: fail_under is nan"),
        ("reference,distorted,id\na,b,x\na,c,x\n", "row 3: id x is that of row 2"),
        ("reference,distorted\n", "no rows"),
        ("", "no rows"),
        ("reference,distorted\n,\n", "no rows"),
        ('reference,distorted\na,"b\nc,d\n', "are all quotes closed"),
        ("reference,distorted,samples\na,b,1000000000000\n", "row 2: samples is 1000000000000; it must be at most"),
        ("reference,distorted\n\0", "no distorted"),
    ],
)
def test_a_wrong_manifest_is_one_line_that_names_file_and_row(tmp_path: Path, text: str, words: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(FMQMError) as told:
        read_manifest(path, SETTINGS)
    assert words in str(told.value) and str(told.value).startswith(path) and "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "not a JSON file"),
        ('{"reference": "a"}', "a list of objects"),
        ("[1]", "a list of objects"),
        ('[{"reference": "a", "distorted": 7}]', "row 1: distorted is 7; a text"),
        ('[{"reference": "a", "distorted": "b", "seed": true}]', "row 1: seed is true; a whole number"),
        ('[{"reference": "a", "distorted": "b"}, {"distorted": "b"}]', "row 2: no reference"),
        ("[" * 100_000, "not a JSON file"),
        ("[" + "7" * 5000 + "]", "not a JSON file"),
    ],
    ids=range(8),
)
def test_a_wrong_json_manifest(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(FMQMError, match=words):
        read_manifest(write(tmp_path, text, "pairs.json"), SETTINGS)


def test_what_is_no_manifest(tmp_path: Path) -> None:
    (tmp_path / "latin.csv").write_bytes(b"reference,distorted\n\xe4,b\n")
    (tmp_path / "excel.csv").write_text("reference,distorted\na,b\n", encoding="utf-16")
    for name, words in (("latin.csv", "UTF-8"), ("excel.csv", "UTF-8"), ("none.csv", "cannot be read")):
        with pytest.raises(FileError, match=words):
            read_manifest(str(tmp_path / name), SETTINGS)
    with pytest.raises(SettingsError, match="must end in"):
        read_manifest(str(tmp_path / "pairs.txt"), SETTINGS)


@pytest.mark.parametrize(
    "text",
    [
        "reference, distorted , id\nr, a,x\n",
        "reference;distorted;id\nr;a;x\n",
        "\ufeffreference\tdistorted\tid\r\nr\ta\tx\r\n",
        "reference,distorted,id\n\n,,\nr,a,x\n , ,\n",
    ],
)
def test_what_spreadsheets_and_people_write(tmp_path: Path, text: str) -> None:
    (row,) = read_manifest(write(tmp_path, text), SETTINGS)
    assert (row.reference, row.distorted, row.id) == ("r", "a", "x")


def test_ids_are_made_unique_and_leave_given_ones_alone(tmp_path: Path) -> None:
    text = "reference,distorted,id\na,x,\nb,x,\nc,x,x (2)\n"
    assert [row.id for row in read_manifest(write(tmp_path, text), SETTINGS)] == ["x", "x (3)", "x (2)"]


def test_textures_are_none_one_or_each() -> None:
    assert [row.texture for row in plain_rows("r", ["a", "b"], "", [])] == ["", ""]
    assert [row.texture for row in plain_rows("r", ["a", "b"], "", ["t"])] == ["t", "t"]
    assert [row.texture for row in plain_rows("r", ["a", "b"], "", ["t", "u"])] == ["t", "u"]
    with pytest.raises(SettingsError, match="--texture is given 3 times for 2 files"):
        plain_rows("r", ["a", "b"], "", ["t", "u", "v"])


def test_a_glob_is_sorted_and_leaves_the_reference_out(tmp_path: Path) -> None:
    for name in ("b.glb", "a.glb", "rock.glb", "c.png"):
        (tmp_path / name).touch()
    (tmp_path / "folder.glb").mkdir()
    found = glob_files(str(tmp_path / "rock.glb"), str(tmp_path / "*.glb"))
    assert [Path(path).name for path in found] == ["a.glb", "b.glb"]
    with pytest.raises(FileError, match="no file matches"):
        glob_files("rock.glb", str(tmp_path / "*.fbx"))


def test_rows_that_share_a_reference_come_together() -> None:
    rows = [
        Row("1", "a", "x"), Row("2", "b", "x"), Row("3", "a", "y"), Row("4", "a", "z", settings=(("seed", 1),)),
        Row("5", "a", "z", ref_texture="t"), Row("6", "b", "y", fail_under=0.5),
    ]  # fmt: skip
    groups = group_by_reference([Task(row.id, row) for row in rows])
    assert [[task.key for task in group] for group in groups] == [["1", "3"], ["2", "6"], ["4"], ["5"]]


def test_a_task_survives_json() -> None:
    row = Row("1", "ä", "x", "t", "u", 0.5, (("seed", 1), ("gradient_radius", float("inf"))), "folder")
    assert task_of(json.loads(json.dumps(Task("key", row).as_dict()))) == Task("key", row)


def test_headers_ignore_case_and_blanks(tmp_path: Path) -> None:
    text = "Reference, DISTORTED,Fail under,Color-Units\nrock.glb,lod.glb,0.9,7\n"
    (row,) = read_manifest(write(tmp_path, text), SETTINGS)
    assert (row.reference, row.distorted, row.fail_under) == ("rock.glb", "lod.glb", 0.9)
    assert row.settings == (("color_units", 7),)
    plain = [{"Reference": "rock.glb", "Distorted": "lod.glb", "Fail Under": 0.9, "Color Units": 7}]
    assert read_manifest(write(tmp_path, json.dumps(plain), "pairs.json"), SETTINGS) == [row]
    for name, twice in (
        ("a.csv", "Reference,reference,distorted\na,b,c\n"),
        ("a.json", json.dumps([{"reference": "a", "REFERENCE": "b", "distorted": "c"}])),
    ):
        with pytest.raises(SettingsError, match="there twice"):
            read_manifest(write(tmp_path, twice, name), SETTINGS)


@pytest.mark.parametrize("name", ["lods\\*.glb", "lods/rock_LOD?.glb", "*.blend:Rock"])
def test_patterns_that_no_shell_has_replaced_name_glob(name: str) -> None:
    with pytest.raises(SettingsError, match="say --glob"):
        plain_rows("rock.glb", [name], "", ())


def test_a_file_may_be_called_like_a_pattern(tmp_path: Path) -> None:
    (tmp_path / "rock [1].glb").touch()
    (row,) = plain_rows("rock.glb", [str(tmp_path / "rock [1].glb")], "", ())
    assert row.distorted.endswith("rock [1].glb")
    (row,) = plain_rows("rock.glb", ["rock.blend:Rock [old]*"], "", ())
    assert row.distorted == "rock.blend:Rock [old]*"
