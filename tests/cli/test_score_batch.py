# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/score.py on many pairs: manifests, workers, resuming, shards, LOD chains, JUnit."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from fmqm_addon.batch.journal import Journal
from fmqm_addon.batch.progress_log import Log
from fmqm_addon.batch.rows import BatchOptions, Row, Task
from fmqm_addon.batch.scorer import score_tasks
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.settings import Settings
from tests.blender.script import (
    COLUMNS,
    SCORE,
    noise,
    numbers,
    read_json,
    score,
    without_seconds,
    write_png,
    write_torus,
)

TINY = ("--samples", "640", "--patches", "20", "--color-units", "5")
SHAKEN = [f"shaken{number}.obj" for number in range(20)]
# A run comes to this file and waits there until it is stopped, however long that takes.
HOLD = """
import os, sys, time
def hook(event, arguments):
    if event == "open" and os.path.basename(str(arguments[0])) == os.environ["HOLD_AT"]:
        while not sys.modules["fmqm_addon.batch.interrupt"].interrupted():
            time.sleep(0.02)
sys.addaudithook(hook)
"""
HOSTILE = ["cut.glb", "nowhere.obj", "flat.obj", "a.png", "broken.obj"]


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ref.obj, copies of it that are shaken more and more, and five files that cannot be scored."""
    folder = tmp_path_factory.mktemp("assets")
    write_png(folder / "a.png", noise(seed=1))
    write_torus(folder, "ref", "a.png")
    write_torus(folder, "broken", "missing.png")
    for number, name in enumerate(SHAKEN):
        write_torus(folder, Path(name).stem, "a.png", shake=0.002 * number)
    (folder / "cut.glb").write_bytes(b"glTF\2\0\0\0\xff\xff\0\0")
    (folder / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    return folder


def write_manifest(folder: Path, rows: list[dict[str, Any]], name: str = "pairs.json") -> Path:
    (folder / name).write_text(json.dumps(rows), encoding="utf-8")
    return folder / name


def pairs_of(*names: str) -> list[dict[str, Any]]:
    return [{"reference": "ref.obj", "distorted": name} for name in names]


def events(journal: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in journal.read_text(encoding="utf-8").splitlines()]


def scored(journal: Path) -> list[str]:
    return [event["pair"]["distorted"] for event in events(journal) if "done" in event]


def bytes_but_for_seconds(path: Path) -> str:
    text = path.read_text(encoding="utf-8")
    return re.sub(r'("(?:load|prepare|fields|features|total)": |time=")[-+.e0-9]+', r"\1", text)


@pytest.mark.once
def test_200_pairs_five_hostile_killed_twice_and_resumed(assets: Path, tmp_path: Path) -> None:
    """As if nothing had happened: 195 scores, each made once, five errors, the same bytes as an undisturbed run."""
    rows = [row | {"seed": seed, "id": f"{seed} {row['distorted']}"} for seed in range(10) for row in pairs_of(*SHAKEN)]
    for place, name in zip((0, 50, 99, 100, 199), HOSTILE, strict=True):
        rows[place] |= {"distorted": name}
    manifest = write_manifest(assets, rows, "many.json")

    def outputs(folder: str) -> list[str]:
        (tmp_path / folder).mkdir(exist_ok=True)
        return [f"--{kind}={tmp_path / folder / f'all.{kind}'}" for kind in ("json", "csv", "junit")]

    command = ["--manifest", manifest, *TINY, "--quiet"]
    assert score(*command, *outputs("calm")).returncode == 1
    journal = tmp_path / "killed" / "all.json.journal.jsonl"
    for part in (60, 130):
        arguments = map(str, [*command, *outputs("killed"), "--jobs", "2", "--resume"])
        parent = subprocess.Popen([sys.executable, str(SCORE), *arguments], stderr=subprocess.DEVNULL)
        end = time.monotonic() + 600
        while not journal.exists() or journal.read_bytes().count(b'{"done"') < part:
            assert parent.poll() is None and time.monotonic() < end
            time.sleep(0.02)
        parent.send_signal(signal.SIGKILL)
        parent.wait()
    assert not (tmp_path / "killed" / "all.json").exists()
    assert score(*command, *outputs("killed"), "--jobs", "2", "--resume").returncode == 1

    done = [event for event in events(journal) if "done" in event]
    times = Counter(event["done"] for event in done if event["pair"]["error"] is None)
    assert len(times) == 195 and set(times.values()) == {1}, "no score was made twice"
    assert len({event["done"] for event in done}) == 200
    pairs = read_json(tmp_path / "killed" / "all.json")["pairs"]
    assert [pair["id"] for pair in pairs] == [row["id"] for row in rows], "no duplicates"
    with (tmp_path / "killed" / "all.csv").open(encoding="utf-8", newline="") as table:
        assert [row["id"] for row in csv.DictReader(table)] == [row["id"] for row in rows]
    assert [pair["distorted"] for pair in pairs if pair["error"]] == HOSTILE
    assert sum(0 < pair["FMQM"] <= 1 for pair in pairs if not pair["error"]) == 195
    for kind in ("json", "csv", "junit"):
        calm, killed = (bytes_but_for_seconds(tmp_path / folder / f"all.{kind}") for folder in ("calm", "killed"))
        assert calm == killed
    left = sorted(path.name for path in (tmp_path / "killed").iterdir())
    assert left == ["all.csv", "all.json", "all.json.journal.jsonl", "all.junit"]


def test_the_same_bytes_whatever_the_number_of_jobs(assets: Path, tmp_path: Path) -> None:
    manifest = write_manifest(assets, pairs_of(*SHAKEN[:6], "cut.glb"))
    told = []
    for jobs in (("--jobs", 1), ("--jobs", 8)):
        done = score("--manifest", manifest, *TINY, *jobs, "--json", tmp_path / "j", "--csv", tmp_path / "c")
        assert done.returncode == 1 and len(done.stdout.splitlines()) == 8
        told.append((done.stdout, bytes_but_for_seconds(tmp_path / "j"), (tmp_path / "c").read_bytes()))
    assert told[0] == told[1]


@pytest.mark.once
def test_resuming_scores_what_is_missing_or_has_changed(assets: Path, tmp_path: Path) -> None:
    rows = pairs_of(*SHAKEN[:4])
    journal = tmp_path / "journal"
    command = [*TINY, "--json", tmp_path / "j", "--journal", journal, "--resume", "--quiet"]
    assert score("--manifest", write_manifest(assets, rows), *command).returncode == 0
    first = read_json(tmp_path / "j")
    rows[1] |= {"sigma": 0.02}
    rows[2] |= {"fail_under": 1, "id": "a new name"}
    rows.append({"reference": "ref.obj", "distorted": "ref.obj"})
    done = score("--manifest", write_manifest(assets, rows), *command)
    assert done.returncode == 1, "the new threshold counts without a new score"
    assert scored(journal)[4:] == [SHAKEN[1], "ref.obj"]
    second = read_json(tmp_path / "j")
    assert [numbers(pair) for pair in second["pairs"]][0::2] == [
        *(numbers(first["pairs"][k]) for k in (0, 2)), [1.0] * 5,
    ]  # fmt: skip
    assert numbers(second["pairs"][1]) != numbers(first["pairs"][1])
    assert second["pairs"][1]["settings"] == {"sigma": 0.02} and second["pairs"][2]["id"] == "a new name"
    assert score("--manifest", assets / "pairs.json", *command, "--seed", "3").returncode == 1
    assert len(scored(journal)) == 6 + 5, "another seed is another score for all"
    assert score("--manifest", assets / "pairs.json", *command[:-2]).returncode == 1
    assert len(scored(journal)) == 5, "without --resume it begins anew"


@pytest.mark.once
def test_resuming_tries_errors_again_whose_cause_may_be_repaired(assets: Path, tmp_path: Path) -> None:
    """An image that was missing is no file that the row names, so that nothing else tells that it has come."""
    image = noise(seed=1)
    write_png(tmp_path / "a.png", image)
    write_torus(tmp_path, "ref", "a.png")
    write_torus(tmp_path, "late", "late.png")
    write_manifest(tmp_path, pairs_of("ref.obj", "late.obj", "nowhere.obj"))
    command = ["--manifest", "pairs.json", *TINY, "--csv", "c", "--resume", "--quiet"]
    assert "late.png" in score(*command, cwd=tmp_path).stderr
    write_png(tmp_path / "late.png", image)
    done = score(*command, cwd=tmp_path)
    assert done.returncode == 1 and done.stderr.splitlines() == ["score.py: nowhere.obj: no such file"]
    journal = tmp_path / "c.journal.jsonl"
    assert Counter(scored(journal)) == {"ref.obj": 1, "late.obj": 2, "nowhere.obj": 2}
    rows = list(csv.DictReader((tmp_path / "c").read_text(encoding="utf-8").splitlines()))
    assert [(row["id"], row["FMQM"]) for row in rows] == [("ref.obj", "1.0"), ("late.obj", "1.0"), ("nowhere.obj", "")]


def test_what_nobody_has_foreseen_is_an_error_of_its_pair(
    assets: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where it comes with the reference; the others are scored."""
    pytest.importorskip("bpy")
    from fmqm_addon.blender.files import load as files

    load = files.load_asset

    def fail(path: str, *others: Any) -> Any:
        if "shaken1" in path:
            raise MemoryError("Unable to allocate 797 GiB\nfor an array")
        if "shaken2" in path:
            raise OverflowError("too large")
        return load(path, *others)

    monkeypatch.setattr(files, "load_asset", fail)
    journal = Journal()
    names = [("ref.obj", "shaken1.obj"), ("shaken2.obj", "ref.obj"), ("ref.obj", "ref.obj")]
    tasks = [Task(str(k), Row(f"id {k}", *pair, folder=str(assets))) for k, pair in enumerate(names)]
    score_tasks(
        tasks,
        BatchOptions(pair=PairOptions(settings=Settings(samples=640, patches=20))),
        journal,
        Log("", 5, 3, silent=True),
    )
    assert [journal.record(task.key)["error"] for task in tasks] == [
        r"shaken1.obj: MemoryError: Unable to allocate 797 GiB\nfor an array",
        "shaken2.obj: OverflowError: too large",
        None,
    ]


@pytest.mark.once
def test_files_are_written_though_nobody_reads_the_table(assets: Path, tmp_path: Path) -> None:
    """As with | head -1; errors of a full disk are one line, and leave the files as well."""
    manifest = write_manifest(assets, pairs_of("ref.obj", "cut.glb"))
    for name, words in (("pipe", []), ("full", ["the output cannot be printed (No space left on device)"])):
        if name == "full" and not Path("/dev/full").exists():
            pytest.skip("this system has no full device")
        reader, writer = os.pipe()
        os.close(reader)
        with os.fdopen(writer, "w") if name == "pipe" else open("/dev/full", "w") as out:
            command = [sys.executable, SCORE, "--manifest", manifest, *TINY, "--csv", tmp_path / name, "--quiet"]
            done = subprocess.run(list(map(str, command)), stdout=out, stderr=subprocess.PIPE, text=True)
        assert done.returncode == 1 and (tmp_path / name).read_text().count("\n") == 3
        assert done.stderr.splitlines()[1:] == [f"score.py: {each}" for each in words]


def test_the_work_goes_on_though_nobody_reads_its_progress(assets: Path, tmp_path: Path) -> None:
    """As with 2>&1 | head -1."""
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, SCORE, assets / "ref.obj", assets / "ref.obj", *TINY, "--csv", tmp_path / "c"]
    with os.fdopen(writer, "w") as out:
        done = subprocess.run(list(map(str, command)), stdout=out, stderr=out)
    assert done.returncode == 0 and "1.0" in (tmp_path / "c").read_text()


@pytest.mark.once
def test_remarks_name_their_pairs(assets: Path, tmp_path: Path) -> None:
    """Where there are several; a warning of all of them comes once. Below a threshold, each pair has a line."""
    write_torus(tmp_path, "bare")
    rows = [
        {"reference": "bare.obj", "distorted": str(assets / SHAKEN[9]), "id": "first"},
        {"reference": "bare.obj", "distorted": str(assets / SHAKEN[9]), "id": "second", "fail_under": 0.999},
        {"reference": "bare.obj", "distorted": "gone.obj", "id": "third"},
    ]
    manifest = write_manifest(tmp_path, rows)
    for jobs in ((), ("--jobs", "1")):
        done = score("--manifest", manifest, *TINY, *jobs, "--csv", tmp_path / "c")
        assert done.returncode == 1
        error, warning, below = (line for line in done.stderr.splitlines() if line.startswith("score.py: "))
        assert error.startswith("score.py: third: ") and error.endswith("gone.obj: no such file")
        assert warning.startswith(f"score.py: warning: first and 1 more: {SHAKEN[9]}: its colors differ")
        assert re.fullmatch(r"score.py: second: FMQM 0\.\d{4} is below 0\.999", below)
        assert any(f" {how} second" in done.stderr for how in ("scoring", "scored"))


@pytest.mark.once
def test_interrupted_run_says_how_to_go_on(assets: Path, tmp_path: Path) -> None:
    """SIGTERM as Ctrl-C; plain pairs too, whose journal is gone once they are all done."""
    command = [sys.executable, str(SCORE), "ref.obj", *SHAKEN, *TINY, "--csv", str(tmp_path / "c"), "--quiet"]
    journal = tmp_path / "c.journal.jsonl"
    python = tmp_path / "python"
    python.mkdir()
    (python / "sitecustomize.py").write_text(HOLD)
    for how, last in ((signal.SIGINT, SHAKEN[10]), (signal.SIGTERM, SHAKEN[-1])):
        known = len(scored(journal)) if journal.exists() else 0
        env = os.environ | {"PYTHONPATH": str(python), "HOLD_AT": last}
        process = subprocess.Popen(command, cwd=assets, env=env, stderr=subprocess.PIPE, text=True)
        while not journal.exists() or journal.read_bytes().count(b'{"done"') <= known:
            assert process.poll() is None
            time.sleep(0.02)
        process.send_signal(how)
        _, told = process.communicate(timeout=120)
        assert process.returncode == 130 and "--resume" in told and "Traceback" not in told
        before = len(scored(journal))
        assert 0 < before < len(SHAKEN) and not (tmp_path / "c").exists()
        command += ["--resume"]
    done = score(*command[2:], cwd=assets)
    assert done.returncode == 0 and sorted(scored(journal)) == sorted(SHAKEN)
    assert score("ref.obj", SHAKEN[0], *TINY, "--csv", tmp_path / "d", cwd=assets).returncode == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c", "c.journal.jsonl", "d", "python"]


def test_junit(assets: Path, tmp_path: Path) -> None:
    rows = pairs_of("ref.obj", SHAKEN[9], SHAKEN[19], "cut.glb")
    rows[2] |= {"fail_under": 0.01}
    done = score("--manifest", write_manifest(assets, rows), *TINY, "--fail-under", 0.999, "--junit", tmp_path / "x")
    assert done.returncode == 1
    suite = ElementTree.parse(tmp_path / "x").getroot()[0]
    assert [suite.get(name) for name in ("tests", "failures", "errors")] == ["4", "1", "1"]
    beside = ("system-out", "properties")
    cases = {case.get("name"): [child.tag for child in case if child.tag not in beside] for case in suite}
    assert cases == {"ref.obj": [], SHAKEN[9]: ["failure"], SHAKEN[19]: [], "cut.glb": ["error"]}
    message = suite.find("*/failure").get("message")  # type: ignore[union-attr]
    assert "below 0.999" in message and all(name in message for name in COLUMNS)
    assert "cut.glb" in suite.find("*/error").get("message")  # type: ignore[union-attr]


@pytest.mark.once
def test_shards_merge_into_the_whole(assets: Path, tmp_path: Path) -> None:
    manifest = write_manifest(assets, pairs_of(*SHAKEN[:5]))
    command = ["--manifest", manifest, *TINY, "--quiet", "--fail-under", "0.9"]
    whole = score(*command, "--json", tmp_path / "whole")
    for shard in ("1/2", "2/2"):
        assert score(*command, "--shard", shard, "--json", tmp_path / shard[0]).returncode in (0, 1)
    parts = [tmp_path / "2", tmp_path / "1"]
    done = score("--merge", *parts, "--manifest", manifest, "--json", tmp_path / "merged")
    assert (done.returncode, done.stdout) == (whole.returncode, whole.stdout)
    assert without_seconds(read_json(tmp_path / "merged")) == without_seconds(read_json(tmp_path / "whole"))
    alone = score("--merge", *parts, "--json", tmp_path / "alone")
    assert (alone.returncode, alone.stdout) == (whole.returncode, whole.stdout), "the parts know their places"
    assert (tmp_path / "alone").read_bytes() == (tmp_path / "merged").read_bytes()
    gap = score("--merge", tmp_path / "1", tmp_path / "1", "--manifest", manifest, "--csv", tmp_path / "c")
    assert gap.returncode == 1
    assert [line for line in gap.stderr.splitlines() if "is there twice" in line] and "none of the merged" in gap.stderr
    rows = list(csv.DictReader((tmp_path / "c").read_text(encoding="utf-8").splitlines()))
    assert [bool(row["error"]) for row in rows] == [False, True, False, True, False]
    assert score(*command, "--seed", 5, "--shard", "2/2", "--json", tmp_path / "2").returncode in (0, 1)
    done = score("--merge", *parts)
    assert done.returncode == 1 and "settings differ" in done.stderr and done.stdout == ""
    done = score("--merge", assets / "a.png", "--json", tmp_path / "no")
    assert done.returncode == 1 and "a.png: not a JSON output" in done.stderr


@pytest.mark.once
def test_lod_chains_of_a_file(assets: Path, tmp_path: Path) -> None:
    """Of a glb and of a blend: each level against level 0 and against the level before."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    for level in range(3):
        bpy.ops.wm.obj_import(filepath=str(assets / SHAKEN[6 * level]))
        bpy.context.selected_objects[0].name = f"Rock_LOD{level}"
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "rock.glb"))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "rock.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    for name in ("rock.glb", "rock.blend"):
        done = score("--lods", name, *TINY, "--json", "j", "--quiet", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        pairs = {pair["id"]: pair for pair in read_json(tmp_path / "j")["pairs"]}
        assert list(pairs) == ["Rock LOD1 / LOD0", "Rock LOD2 / LOD0", "Rock LOD2 / LOD1"]
        assert pairs["Rock LOD2 / LOD1"]["reference"] == f"{name}:Rock_LOD1"
        assert 1 > pairs["Rock LOD1 / LOD0"]["FMQM"] > pairs["Rock LOD2 / LOD0"]["FMQM"]
        assert [pair["level"] for pair in pairs.values()] == [1, 2, 2]
    done = score("--lods", "rock.glb", *TINY, "--json", "j", "--quiet", "--fail-under", "0.999,0.1", cwd=tmp_path)
    assert done.returncode == 1 and "Rock LOD1 / LOD0" in done.stderr and "Rock LOD2" not in done.stderr
    assert [pair["fail_under"] for pair in read_json(tmp_path / "j")["pairs"]] == [0.999, 0.1, 0.1]
    done = score("--lods", assets / "ref.obj", *TINY)
    assert done.returncode == 1 and "ref.obj: no names in it tell levels" in done.stderr


def test_parts_and_poses_are_chosen(tmp_path: Path) -> None:
    """--include and --exclude reach workers and records; --frame is in the trust report."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    for name in ("Rock_LOD0", "Rock_LOD1", "UCX_Rock"):
        bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=1 if name == "Rock_LOD1" else 3)
        bpy.context.object.name = name
    rock = bpy.data.objects["Rock_LOD1"]
    for frame, size in ((1, 1.0), (9, 2.0)):
        rock.scale = (size,) * 3
        rock.keyframe_insert("scale", frame=frame)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "rock.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)

    def pair(*flags: str) -> dict[str, Any]:
        done = score("rock.blend", "rock.blend:Rock_LOD1", *TINY, *flags, "--json", "j", "--quiet", cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        answer = read_json(tmp_path / "j")
        assert answer["pairs"][0]["error"] is None
        return answer["pairs"][0]

    plain = pair()
    assert plain["FMQM"] < 1 and plain["trust"]["pair"]["pose_of_distorted"]["value"].startswith("frame 1 of ")
    chosen = pair("--include", "*_lod1", "--include", "nobody", "--jobs", "1")
    assert chosen["FMQM"] == 1
    assert pair("--exclude", "*_LOD0", "--exclude", "UCX*")["FMQM"] == 1
    assert pair("--frame", "9")["trust"]["pair"]["pose_of_distorted"]["value"].startswith("frame 9 of ")
    done = score("rock.blend", "rock.blend", *TINY, "--include", "nobody", cwd=tmp_path)
    assert done.returncode == 1 and "the patterns leave nothing" in done.stderr
    assert score("a.obj", "b.obj", "--frame", "9999999").returncode == 2


MISSING = ("none.csv: cannot be read", "no file matches")  # files, which are no wrong arguments


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--manifest", "none.csv"), "none.csv: cannot be read"),
        (("--manifest", "bad.csv"), "bad.csv, row 2: samples is x"),
        (("a.obj", "b.obj", "--fail-under", "0.9,0.8"), "several numbers for the levels of --lods"),
        (("a.obj", "b.obj", "--fail-under", "0.9,x"), "0.9,x is no number"),
        (("--lods", "x.blend", "--fail-under", "0.9,1.5"), "fail-under is 1.5; it must be between 0 and 1"),
        (("--manifest", "bad.csv", "ref.obj"), "--manifest"),
        (("--manifest", "bad.csv", "--lods", "x.blend"), "leave out --lods"),
        (("--manifest", "bad.csv", "--texture", "a.png"), "name them in a manifest"),
        (("--glob", "*.obj"), "REFERENCE"),
        (("ref.obj", "--glob", "*.fbx"), "no file matches"),
        (("ref.obj", "a.obj", "--jobs", "0"), "--jobs is 0"),
        (("ref.obj", "a.obj", "--timeout", "5", "--picture", "p.png"), "leave out the batch's flags"),
        (("ref.obj", "a.obj", "--jobs", "1", "--memory-limit", "nan"), "--memory-limit is nan"),
        (("ref.obj", "a.obj", "--shard", "3/2"), "--shard is 3/2"),
        (("ref.obj", "a.obj", "--resume"), "--resume needs"),
        (("ref.obj", "a.obj", "--jobs", "1", "--picture", "p.png"), "--picture"),
        (("--manifest", "empty.json"), "no rows in it"),
        (("--manifest", "object.json"), "a list of objects"),
        (("--merge", "part.json", "--shard", "1/2"), "leave out --shard"),
        (("ref.obj", "a.obj", "--journal", "a.png"), "a.png: this file is not a journal"),
        (("ref.obj", "a.obj", "--jobs", "1", "--dask", "tcp://127.0.0.1:1"), "--dask exclude each other"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_wrong_arguments_are_one_line(assets: Path, arguments: tuple[str, ...], words: str) -> None:
    (assets / "bad.csv").write_text("reference,distorted,samples\nref.obj,b,x\n")
    (assets / "empty.json").write_text("[]")
    (assets / "object.json").write_text("{}")
    done = score(*arguments, cwd=assets)
    assert done.returncode == (1 if words in MISSING else 2) and done.stdout == ""
    assert words in done.stderr and len(done.stderr.splitlines()) == 1
