# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/score.py: what it prints, writes and returns, and what it says about bad input."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from fmqm_addon.batch import scorer
from fmqm_addon.batch.journal import Journal
from fmqm_addon.batch.progress_log import Log
from fmqm_addon.batch.rows import BatchOptions, Row, Task
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric import stepper
from fmqm_addon.metric.settings import Settings
from tests.blender import scenes
from tests.blender.script import (
    COLUMNS,
    SCORE,
    SMALL,
    STAGES,
    noise,
    numbers,
    read_json,
    score,
    strict_json,
    without_seconds,
    write_png,
    write_torus,
)

PAIR_KEYS = [
    "id", "reference", "distorted", *COLUMNS, "perceived", "stderr", "fmqm_p10", "patches", "samples", "seconds",
    "warnings", "notes", "error", "level", "triangles", "triangle_share", "texture_bytes", "reverse", "impairment",
    "trust", "parts", "ref_texture", "texture", "settings", "judge", "fail_under", "fail_under_p10",
]  # fmt: skip
SETTING_FLAGS = [
    "samples", "patches", "scored-patches", "sigma", "radius", "gradient-radius", "normal-threshold",
    "tangent-threshold", "color-units", "centers", "color-space", "pooling", "seed", "repeats",
]  # fmt: skip
PLACING = {"space", "match_scale"}  # where the two are compared, which has tests of its own
NAMES = ("ref.obj", "shaken.obj", "repainted.obj")


@pytest.fixture(scope="module")
def assets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """ref.obj; shaken.obj, its vertices moved; repainted.obj, with another image; bare.obj, naming no image."""
    folder = tmp_path_factory.mktemp("assets")
    write_png(folder / "a.png", noise(seed=1))
    write_png(folder / "b.png", noise(seed=2))
    write_torus(folder, "ref", "a.png")
    write_torus(folder, "shaken", "a.png", shake=0.03)
    write_torus(folder, "repainted", "b.png")
    write_torus(folder, "bare")
    write_torus(folder, "broken", "nowhere.png")
    (folder / "cut.glb").write_bytes(b"glTF\2\0\0\0\xff\xff\0\0")
    return folder


@pytest.fixture(scope="module")
def whole(assets: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Everything that one run can write, of ref.obj and shaken.obj."""
    out = tmp_path_factory.mktemp("out")
    outputs = ("--json", out / "all.json", "--csv", out / "all.csv", "--save-fields", out / "all.npz")
    done = score("ref.obj", "shaken.obj", *SMALL, *outputs, cwd=assets)
    assert done.returncode == 0, done.stderr
    (out / "stdout").write_text(done.stdout, encoding="utf-8")
    (out / "stderr").write_text(done.stderr, encoding="utf-8")
    assert sorted(path.name for path in out.iterdir()) == ["all.csv", "all.json", "all.npz", "stderr", "stdout"]
    return out


def one_line(text: str) -> str:
    assert len(text.splitlines()) == 1, text
    return text


def keys(pair: dict[str, object]) -> list[str]:
    return [key for key in pair if key not in PLACING]


def said(stderr: str) -> list[str]:
    """The script's own lines; importers written in C add theirs."""
    return [line for line in stderr.splitlines() if line.startswith("score.py: ")]


# What it prints and writes


def test_endings_in_capitals(assets: Path, tmp_path: Path) -> None:
    """numpy would add an ending of its own to .NPZ."""
    outputs = {"--json": "a.JSON", "--csv": "a.Csv", "--save-fields": "a.NPZ", "--picture": "a.Png", "--junit": "a.XML"}
    flags = [part for flag, name in outputs.items() for part in (flag, tmp_path / name)]
    done = score("ref.obj", "shaken.obj", *SMALL, *flags, cwd=assets)
    assert done.returncode == 0, done.stderr
    written = {path.name: path.stat().st_size for path in tmp_path.iterdir()}
    assert sorted(written) == sorted(outputs.values()) and min(written.values()) > 100


def test_table(whole: Path) -> None:
    header, row = (line.split() for line in (whole / "stdout").read_text(encoding="utf-8").splitlines())
    assert header == ["id", *COLUMNS, "perceived"] and row[0] == "shaken.obj"
    pair = read_json(whole / "all.json")["pairs"][0]
    assert row[1:] == [f"{value:.4f}" for value in (*numbers(pair), pair["perceived"]["score"])]


def test_json_has_exactly_the_promised_keys(whole: Path) -> None:
    document = read_json(whole / "all.json")
    assert list(document) == ["fmqm_version", "fmqm_code", "blender_version", "settings", "pairs"]
    assert set(document["settings"]) - PLACING == {flag.replace("-", "_") for flag in SETTING_FLAGS}
    (pair,) = document["pairs"]
    assert keys(pair) == PAIR_KEYS and list(pair["seconds"]) == list(STAGES)
    assert (pair["reference"], pair["distorted"], pair["error"], pair["stderr"]) == (
        "ref.obj",
        "shaken.obj",
        None,
        None,
    )
    assert pair["warnings"] == [] and pair["patches"] == 20 and pair["reverse"] is None
    assert list(pair["trust"]) == ["reference", "distorted", "pair"]
    settings = document["settings"]
    assert (settings["samples"], settings["patches"], settings["color_units"]) == (3200, 20, 20)
    assert (settings["sigma"], settings["centers"], settings["scored_patches"]) == (0.05, "fps", None)


def test_json_numbers_have_full_precision(whole: Path) -> None:
    """Not as rounded for the table, but exactly the mean of the saved patches."""
    pair = read_json(whole / "all.json")["pairs"][0]
    with np.load(whole / "all.npz") as fields:
        scores = dict(zip((*COLUMNS[1:], COLUMNS[0]), fields["patch_scores"].mean(axis=0).tolist(), strict=True))
    assert {name: pair[name] for name in COLUMNS} == scores
    assert all(0 < value < 1 for value in scores.values())


def test_trust_report_says_what_was_given_and_read(whole: Path) -> None:
    trust = read_json(whole / "all.json")["pairs"][0]["trust"]
    for name in ("reference", "distorted"):
        facts = {key: item["value"] for key, item in trust[name].items()}
        assert facts["triangles"] == 24 * 12 * 2 and facts["watertight"] and facts["sign_in_doubt"] < 0.002
        (image,) = facts["images"]
        assert (image["role"], image["width"], image["height"]) == ("base color", 16, 16)
        assert image["path"].endswith("a.png") and image["color_space"] == "sRGB" and not image["missing"]
        assert facts["samples_by_material"] == {"surface": 1.0} and facts["colors_from"] == {"surface": "read"}
        assert facts["uv_outside"] == facts["uv_overlapping"] == facts["uv_missing"] == 0
        low, high = facts["box"]
        assert low == pytest.approx([-1.4, -0.4, -1.4], abs=0.15) and high == pytest.approx([1.4, 0.4, 1.4], abs=0.15)
    pair = {key: item["value"] for key, item in trust["pair"].items()}
    assert (pair["seed"], pair["space"], pair["size_divided_by"], pair["flipped"]) == (0, "world", 1.0, 0)
    assert pair["settings"]["samples"] == 3200 and pair["size"] == pytest.approx(1, abs=0.1)
    assert pair["standard_error"] is None and "seed" in trust["pair"]["standard_error"]["why"]


def test_verbose_prints_the_report_below_the_scores(assets: Path) -> None:
    done = score("ref.obj", "ref.obj", "repainted.obj", *SMALL, "--verbose", "--quiet", cwd=assets)
    assert done.returncode == 0
    scores, *reports = done.stdout.split("\n\n")
    assert len(scores.splitlines()) == 3
    assert [report.splitlines()[0] for report in reports] == [
        f"{n} against ref.obj" for n in ("ref.obj", "repainted.obj")
    ]
    for report, image in zip(reports, ("a.png", "b.png"), strict=True):
        assert re.search(r"^triangles +576 +576  triangles$", report, re.MULTILINE)
        assert re.search(rf"^base color, LOD +{image}, 16 x 16, sRGB$", report, re.MULTILINE)


def test_both_directions(assets: Path, tmp_path: Path) -> None:
    """The other direction is the score of the two files given the other way round."""
    out = ("--json", tmp_path / "j", "--csv", tmp_path / "c", "--quiet")
    done = score("ref.obj", "shaken.obj", "nowhere.obj", *SMALL, "--both", *out, cwd=assets)
    assert done.returncode == 1
    both, failed = read_json(tmp_path / "j")["pairs"]
    assert failed["reverse"] is None
    header, row, empty = (line.split() for line in done.stdout.replace("reverse FMQM", "reverse").splitlines())
    assert header[-1] == "reverse" and row[-1] == f"{both['reverse']['FMQM']:.4f}" and empty[1:] == ["-"] * 7
    first, last = csv.DictReader((tmp_path / "c").read_text(encoding="utf-8").splitlines())
    assert [first[f"reverse {name}"] for name in COLUMNS] == [repr(value) for value in numbers(both["reverse"])]
    assert {last[f"reverse {name}"] for name in COLUMNS} == {""}
    assert score("shaken.obj", "ref.obj", *SMALL, *out, cwd=assets).returncode == 0
    assert numbers(both["reverse"]) == numbers(read_json(tmp_path / "j")["pairs"][0])
    assert numbers(both) != numbers(both["reverse"])


def test_seconds_add_up(whole: Path, assets: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Almost all of them belong to a stage: by those of the processor, which are this process's own."""
    seconds = read_json(whole / "all.json")["pairs"][0]["seconds"]
    assert all(value > 0 for value in seconds.values())
    assert sum(seconds[stage] for stage in STAGES[:-1]) <= seconds["total"]
    for module in (scorer, stepper):
        monkeypatch.setattr(module, "time", SimpleNamespace(perf_counter=time.process_time))
    task, journal = Task("k", Row("shaken", "ref.obj", "shaken.obj", folder=str(assets))), Journal()
    options = BatchOptions(pair=PairOptions(settings=Settings(samples=3200, patches=20, color_units=20)))
    scorer.score_tasks([task], options, journal, Log("", 2, 1, silent=True))
    seconds = journal.record("k")["seconds"]
    assert 0.8 * seconds["total"] <= sum(seconds[stage] for stage in STAGES[:-1]) <= seconds["total"]


def test_csv(whole: Path) -> None:
    rows = list(csv.reader((whole / "all.csv").read_text(encoding="utf-8").splitlines()))
    second = ["perceived", "shape", "facing", "color", "detail", "perceived_p10"]
    beside = ["triangles", "triangle_share", "texture_bytes", "level", "notes", "warnings"]
    assert rows[0] == ["id", "reference", "distorted", *COLUMNS, *second, "error", *beside]
    pair = read_json(whole / "all.json")["pairs"][0]
    perceived = [pair["perceived"][name] for name in ("score", "shape", "facing", "color", "detail", "p10")]
    costs = [str(pair["triangles"]), repr(pair["triangle_share"]), str(pair["texture_bytes"])]
    assert len(rows) == 2
    values = [repr(value) for value in (*numbers(pair), *perceived)]
    assert rows[1] == ["shaken.obj", "ref.obj", "shaken.obj", *values, "", *costs, "", " | ".join(pair["notes"]), ""]


def test_fields_have_the_promised_names_types_and_shapes(whole: Path) -> None:
    with np.load(whole / "all.npz") as fields:
        n, p = len(fields["position"]), len(fields["patch_center"])
        found = {name: (fields[name].dtype.str, fields[name].shape) for name in fields.files}
        document = read_json(whole / "all.json")
        wanted = {k: v for k, v in document["settings"].items() if k not in PLACING | {"repeats"}}
        assert json.loads(str(fields["settings"])) == wanted
    assert found.pop("settings")[1] == ()
    vectors = dict.fromkeys(("position", "ref_nearest", "dist_nearest"), ("<f8", (n, 3)))
    scalars = dict.fromkeys(("ref_sdf", "dist_sdf"), ("<f8", (n,)))
    colors = dict.fromkeys(("ref_ncf", "dist_ncf"), ("<f4", (n, 3)))
    patches = dict.fromkeys(("patch_diagonal", "patch_area"), ("<f8", (p,)))
    assert found == vectors | scalars | colors | patches | {
        "patch": ("<i4", (n,)),
        "unit": ("|b1", (n,)),
        "patch_center": ("<f8", (p, 3)),
        "patch_scores": ("<f8", (p, 5)),
        "patch_perceived": ("<f8", (p, 5)),
    }
    pair = document["pairs"][0]
    assert (p, n) == (pair["patches"], pair["samples"])


def test_fields_agree_with_each_other(whole: Path) -> None:
    with np.load(whole / "all.npz") as saved:
        fields = {name: saved[name] for name in saved.files}
    for mesh in ("ref", "dist"):
        distance = np.linalg.norm(fields["position"] - fields[f"{mesh}_nearest"], axis=1)
        assert np.abs(fields[f"{mesh}_sdf"]) == pytest.approx(distance, rel=1e-9, abs=1e-12)
        assert (fields[f"{mesh}_ncf"] >= 0).all() and (fields[f"{mesh}_ncf"] <= 1).all()
        assert (fields[f"{mesh}_sdf"] < 0).any() and (fields[f"{mesh}_sdf"] > 0).any()
    counts = np.bincount(fields["patch"], minlength=20)
    assert (counts > 0).all() and (np.bincount(fields["patch"], fields["unit"], 20) == np.minimum(20, counts)).all()
    # The torus, turned by the OBJ importer: its tube lies around the xy plane, then around xz.
    assert np.abs(fields["ref_nearest"]).max(axis=0) == pytest.approx([1.4, 0.4, 1.4], abs=0.02)
    assert (fields["patch_area"] > 0).all() and (fields["patch_diagonal"] < 2.8).all()


def test_progress_is_a_line_per_10_percent(whole: Path) -> None:
    lines = (whole / "stderr").read_text(encoding="utf-8").splitlines()
    percents = [int(re.fullmatch(r" *(\d+) %  \S.*", line)[1]) for line in lines]
    assert percents == sorted(set(percents)) and len(percents) <= 11
    assert percents[0] == 0 and percents[-1] == 100
    assert len({percent // 10 for percent in percents}) == len(percents)


def test_baking_is_announced_before_it_begins(tmp_path: Path) -> None:
    rust = scenes.material("Rust")
    veins = rust.node_tree.nodes.new("ShaderNodeTexNoise")
    rust.node_tree.links.new(veins.outputs[1], scenes.base_color(rust))
    scenes.cube(materials=[scenes.material("Red", (1, 0, 0)), rust]).data.polygons[0].material_index = 1
    scenes.export(tmp_path, "blend", "crate")
    done = score("crate.blend", "crate.blend", *SMALL, "--bake", "32", cwd=tmp_path)
    assert done.returncode == 0
    lines = done.stderr.splitlines()
    assert lines[0] == "  0 %  loading crate.blend"
    assert lines[1] == "score.py: baking Rust (materials of crate.blend)"
    assert sum("baking" in line for line in lines) == 2  # for the reference, and for the other
    for off in (("--bake", "32", "--quiet"), ("--bake", "0")):
        assert "baking Rust" not in score("crate.blend", "crate.blend", *SMALL, *off, cwd=tmp_path).stderr


def test_same_command_twice_and_json_alone_on_stdout(assets: Path, whole: Path, tmp_path: Path) -> None:
    """The importer of OBJ prints to stdout from C; here nothing but the JSON may arrive, and with --quiet
    nothing at all on stderr. Identical bytes but for the seconds, whatever the locale."""
    for locale in ("C", "de_DE.UTF-8"):
        out = ("--json", "-", "--csv", tmp_path / "all.csv", "--save-fields", tmp_path / "all.npz", "--quiet")
        done = score("ref.obj", "shaken.obj", *SMALL, *out, cwd=assets, env={"LC_ALL": locale, "LANG": locale})
        assert done.returncode == 0 and done.stderr == ""

        def seconds_away(text: str) -> str:
            return re.sub(r'("(load|prepare|fields|features|total)": )[-+.e0-9]+', r"\1", text)

        strict_json(done.stdout)
        assert seconds_away(done.stdout) == seconds_away((whole / "all.json").read_text(encoding="utf-8"))
        assert (tmp_path / "all.csv").read_bytes() == (whole / "all.csv").read_bytes()
        with np.load(tmp_path / "all.npz") as again, np.load(whole / "all.npz") as first:
            assert all(np.array_equal(again[name], first[name]) for name in first.files)


def test_several_pairs_are_scored_as_each_alone(assets: Path, whole: Path, tmp_path: Path) -> None:
    """On the same samples, in the order given; a mesh against itself is exactly 1."""
    done = score("ref.obj", "ref.obj", "repainted.obj", "shaken.obj", *SMALL, "--json", tmp_path / "j", cwd=assets)
    assert done.returncode == 0
    pairs = read_json(tmp_path / "j")["pairs"]
    assert [pair["distorted"] for pair in pairs] == ["ref.obj", "repainted.obj", "shaken.obj"]
    assert numbers(pairs[0]) == [1.0] * 5
    assert pairs[1]["geoSSIM"] == 1 and pairs[1]["colorSSIM"] < 0.9
    assert numbers(pairs[2]) == numbers(read_json(whole / "all.json")["pairs"][0])
    assert pairs[1]["seconds"]["load"] < pairs[1]["seconds"]["total"]
    lines = done.stdout.splitlines()
    assert len(lines) == 4 and len({len(line) for line in lines}) == 1  # aligned


def test_blend_objects_and_odd_names(assets: Path, tmp_path: Path) -> None:
    import bpy

    bpy.ops.wm.obj_import(filepath=str(assets / "ref.obj"))
    object_ = bpy.context.scene.objects[0]
    object_.name = "Räder: vorn"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "zwei Wörter.blend"))
    spec = "zwei Wörter.blend:Räder: vorn"
    shutil.copy(assets / "a.png", tmp_path)
    shutil.copy(assets / "ref.obj", tmp_path / "Äpfel.obj")
    shutil.copy(assets / "ref.mtl", tmp_path)
    done = score(spec, "Äpfel.obj", *SMALL, "--json", "ergebnis ü.json", "--quiet", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (pair,) = read_json(tmp_path / "ergebnis ü.json")["pairs"]
    assert (pair["reference"], pair["distorted"]) == (spec, "Äpfel.obj")
    assert numbers(pair) == pytest.approx([1.0] * 5, abs=1e-6)
    assert "Äpfel.obj" in done.stdout


# Settings


@pytest.mark.once
def test_repeats_are_the_mean_and_its_standard_error(assets: Path, tmp_path: Path) -> None:
    single = []
    for seed in (5, 6, 7):
        assert score("ref.obj", "shaken.obj", *SMALL, "--seed", seed, "--json", "one", cwd=assets).returncode == 0
        single.append(numbers(read_json(assets / "one")["pairs"][0]))
    mean = np.mean(single, axis=0)
    below_mean = (min(row[0] for row in single) + mean[0]) / 2  # one seed would fail it, the mean does not
    command = (
        "ref.obj",
        "shaken.obj",
        *SMALL,
        "--seed",
        5,
        "--repeats",
        3,
        "--json",
        tmp_path / "three",
        "--fail-under",
    )
    done = score(*command, below_mean, cwd=assets)
    assert done.returncode == 0
    document = read_json(tmp_path / "three")
    (pair,) = document["pairs"]
    assert numbers(pair) == pytest.approx(mean, rel=1e-14)
    assert numbers(pair["stderr"]) == pytest.approx(np.std(single, axis=0, ddof=1) / np.sqrt(3), rel=1e-9)
    assert document["settings"]["repeats"] == 3 and document["settings"]["seed"] == 5
    assert len(np.unique(single)) > 5 and "±" in done.stdout
    assert score(*command, mean[0] + 1e-6, cwd=assets).returncode == 1


@pytest.mark.parametrize(("limit", "code"), [("0.999", 1), ("0.1", 0), ("1", 1)])
def test_fail_under(assets: Path, limit: str, code: int) -> None:
    """1 is reached by the mesh itself, so that the other decides."""
    done = score("ref.obj", "ref.obj", "shaken.obj", *SMALL, "--fail-under", limit, "--quiet", cwd=assets)
    assert done.returncode == code and len(done.stdout.splitlines()) == 3


def test_a_perfect_score_is_not_under_1(assets: Path) -> None:
    assert score("ref.obj", "ref.obj", *SMALL, "--fail-under", "1", cwd=assets).returncode == 0


@pytest.mark.once
def test_preset_fast_and_flags_that_win_over_it(assets: Path, tmp_path: Path) -> None:
    common = ("ref.obj", "shaken.obj", "--samples", "3200", "--patches", "60", "--quiet", "--json", tmp_path / "j")
    for flags, scored in (((), 60), (("--preset", "fast"), 40), (("--scored-patches", 7, "--preset", "fast"), 7)):
        assert score(*common, *flags, cwd=assets).returncode == 0
        document = read_json(tmp_path / "j")
        assert document["pairs"][0]["patches"] == scored
        assert document["settings"]["scored_patches"] == (None if scored == 60 else scored)


def test_every_setting_reaches_the_metric(assets: Path, tmp_path: Path) -> None:
    given = {
        "samples": 4000, "patches": 25, "scored_patches": 10, "sigma": 0.02, "radius": 0.2, "gradient_radius": "inf",
        "normal_threshold": 0.9, "tangent_threshold": 0.1, "color_units": 7, "centers": "random", "color_space": "lab",
        "pooling": "arithmetic", "seed": 12345678901234,
    }  # fmt: skip
    flags = [word for name, value in given.items() for word in (f"--{name.replace('_', '-')}", value)]
    out = ("--json", tmp_path / "j", "--save-fields", tmp_path / "f.npz", "--quiet")
    assert score("ref.obj", "shaken.obj", *flags, *out, cwd=assets).returncode == 0
    document = read_json(tmp_path / "j")
    assert {k: v for k, v in document["settings"].items() if k not in PLACING} == {**given, "repeats": 1}
    with np.load(tmp_path / "f.npz") as fields:
        assert len(fields["patch_center"]) == 10
        assert np.bincount(fields["patch"], fields["unit"]).max() == 7
        assert fields["patch_scores"][:, 4] == pytest.approx(fields["patch_scores"][:, :4].mean(axis=1))
        offset = np.abs(fields["ref_sdf"]) / fields["patch_diagonal"][fields["patch"]]
    assert 0.005 < offset.mean() < 0.02  # nearer to the surface than with sigma 0.05


WRONG = [
    ("samples", "0"), ("samples", "-5"), ("samples", "many"), ("samples", "1e5"), ("samples", "639"),
    ("samples", str(10**26)), ("patches", "0"), ("patches", "101"), ("patches", "1.5"), ("scored-patches", "0"),
    ("sigma", "-0.1"), ("sigma", "nan"), ("sigma", "inf"), ("radius", "0"), ("radius", "nan"),
    ("gradient-radius", "-1"), ("gradient-radius", "nan"), ("normal-threshold", "1.5"), ("normal-threshold", "nan"),
    ("tangent-threshold", "-0.1"), ("color-units", "0"), ("centers", "sobol"), ("color-space", "hsv"),
    ("pooling", "median"), ("seed", "-1"), ("seed", "x"), ("seed", str(2**63)), ("preset", "slow"), ("repeats", "0"),
    ("bake", "-1"), ("bake", "20000"), ("bake", "x"), ("max-image-side", "0"), ("max-image-bytes", "0"),
    ("fail-under", "2"), ("fail-under", "-0.1"), ("fail-under", "nan"), ("save-fields", "fields.txt"),
    ("picture", "picture.txt"), ("journal", "-"), ("report", "-"),
]  # fmt: skip


@pytest.mark.parametrize(("flag", "value"), WRONG, ids=" ".join)
def test_wrong_value_is_2_and_one_line_that_names_the_flag(assets: Path, flag: str, value: str) -> None:
    done = score("ref.obj", "shaken.obj", *SMALL, f"--{flag}", value, cwd=assets)
    assert done.returncode == 2 and done.stdout == ""
    assert flag in one_line(done.stderr)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "REFERENCE"),
        (("ref.obj",), "DISTORTED"),
        (("ref.obj", "a.obj", "--sample", "3200"), "--sample"),
        (("ref.obj", "a.obj", "--samples"), "--samples"),
        (("ref.obj", "a.obj", "b.obj", "c.obj", "--texture", "a.png", "--texture", "b.png"), "--texture"),
        (("ref.obj", "a.obj", "--texture", "a.png", "--texture", "b.png"), "--texture"),
        (("ref.obj", "a.obj", "b.obj", "--save-fields", "f.npz"), "--save-fields"),
        (("ref.obj", "a.obj", "b.obj", "--picture", "f.png"), "--picture"),
        (("ref.obj", "a.obj", "--seed", str(2**63 - 1), "--repeats", "2"), "seed"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else "",
)
def test_wrong_arguments_are_2_and_one_line(assets: Path, arguments: tuple[str, ...], words: str) -> None:
    done = score(*arguments, cwd=assets)
    assert done.returncode == 2 and done.stdout == ""
    assert words in one_line(done.stderr)


def test_help_needs_no_blender(tmp_path: Path) -> None:
    done = score("--help", env=without("bpy", tmp_path))
    assert done.returncode == 0
    assert all(f"--{flag}" in done.stdout for flag in SETTING_FLAGS) and done.stderr == ""


# Textures


@pytest.mark.once
def test_textures_by_hand(assets: Path, tmp_path: Path) -> None:
    """Once per DISTORTED; --ref-texture makes a bare reference what ref.obj is."""
    textures = ("--ref-texture", "a.png", "--texture", "a.png", "--texture", "b.png")
    done = score("bare.obj", "bare.obj", "repainted.obj", *textures, *SMALL, "--json", tmp_path / "j", cwd=assets)
    assert done.returncode == 0
    given = read_json(tmp_path / "j")["pairs"]
    done = score("ref.obj", "ref.obj", "repainted.obj", *SMALL, "--json", tmp_path / "j", cwd=assets)
    named = read_json(tmp_path / "j")["pairs"]
    assert [numbers(pair) for pair in given] == [numbers(pair) for pair in named]
    assert not given[0]["warnings"]


@pytest.mark.once
def test_one_texture_for_all(assets: Path, tmp_path: Path) -> None:
    """Also in the place of an image that is missing."""
    names = ("repainted.obj", "bare.obj", "broken.obj")
    done = score("ref.obj", *names, "--texture", "a.png", *SMALL, "--json", tmp_path / "j", "--quiet", cwd=assets)
    assert done.returncode == 0 and said(done.stderr) == []
    assert [numbers(pair) for pair in read_json(tmp_path / "j")["pairs"]] == [[1.0] * 5] * 3


def test_without_an_image_there_is_a_note(assets: Path, tmp_path: Path) -> None:
    done = score("ref.obj", "bare.obj", *SMALL, "--json", tmp_path / "j", "--quiet", cwd=assets)
    assert done.returncode == 0
    (pair,) = read_json(tmp_path / "j")["pairs"]
    assert any("bare" in note and "grey" in note for note in pair["notes"]) and "grey" not in done.stderr


def test_bake_lets_a_missing_image_be_magenta(assets: Path, tmp_path: Path) -> None:
    out = (*SMALL, "--quiet", "--json", tmp_path / "j")
    assert score("ref.obj", "broken.obj", *out, cwd=assets).returncode == 1
    done = score("ref.obj", "broken.obj", *out, "--bake", 32, cwd=assets)
    assert done.returncode == 0, done.stderr
    (pair,) = read_json(tmp_path / "j")["pairs"]
    assert pair["geoSSIM"] == 1 and pair["colorSSIM"] < 0.9
    assert any("nowhere.png" in warning for warning in pair["warnings"])
    assert pair["trust"]["distorted"]["images"]["value"][0]["missing"] is True


def test_bake_sets_the_size_or_forbids_it(tmp_path: Path) -> None:
    import bpy

    made = scenes.material("Marbled")
    noise_node = made.node_tree.nodes.new("ShaderNodeTexNoise")
    made.node_tree.links.new(noise_node.outputs["Color"], scenes.base_color(made))
    scenes.cube(materials=[made])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "cube.blend"))
    for size, how in ((32, "baked"), (0, "plain")):
        flags = (*SMALL, "--bake", size, "--json", tmp_path / "j", "--quiet")
        assert score("cube.blend", "cube.blend", *flags, cwd=tmp_path).returncode == 0
        (pair,) = read_json(tmp_path / "j")["pairs"]
        assert numbers(pair) == [1.0] * 5
        assert pair["trust"]["reference"]["colors_from"]["value"] == {"Marbled": how}
        assert pair["trust"]["pair"]["baked_at"]["value"] == size
        assert any("Marbled" in text for text in pair["warnings" if how == "plain" else "notes"])


@pytest.mark.parametrize("limit", [("--max-image-side", 15), ("--max-image-bytes", 1023)])
@pytest.mark.once
def test_images_beyond_the_limits_are_refused(assets: Path, limit: tuple[str, int]) -> None:
    done = score("ref.obj", "ref.obj", *SMALL, *limit, "--quiet", cwd=assets)
    assert done.returncode == 1 and "a.png" in said(done.stderr)[0] and limit[0] in said(done.stderr)[0]
    assert score("ref.obj", "ref.obj", *SMALL, limit[0], limit[1] + 1, "--quiet", cwd=assets).returncode == 0


@pytest.mark.parametrize("flag", ["--texture", "--ref-texture"])
def test_given_texture_that_cannot_be_read(assets: Path, flag: str) -> None:
    done = score("ref.obj", "shaken.obj", flag, "nowhere.png", *SMALL, "--quiet", cwd=assets)
    assert done.returncode == 1
    assert "nowhere.png" in one_line(done.stderr)


# Files that cannot be read


def test_a_bad_file_costs_only_itself(assets: Path, whole: Path, tmp_path: Path) -> None:
    names = ("nowhere.obj", "shaken.obj", "broken.obj", "cut.glb", "a.png", "ref.obj")
    out = ("--json", tmp_path / "all.json", "--csv", tmp_path / "all.csv", "--quiet")
    done = score("ref.obj", *names, *SMALL, *out, cwd=assets)
    assert done.returncode == 1
    pairs = {pair["distorted"]: pair for pair in read_json(tmp_path / "all.json")["pairs"]}
    assert tuple(pairs) == names
    assert numbers(pairs["shaken.obj"]) == numbers(read_json(whole / "all.json")["pairs"][0])
    assert numbers(pairs["ref.obj"]) == [1.0] * 5
    bad = [name for name in names if pairs[name]["error"]]
    assert bad == ["nowhere.obj", "broken.obj", "cut.glb", "a.png"]
    lines = said(done.stderr)
    rows = list(csv.DictReader((tmp_path / "all.csv").read_text(encoding="utf-8").splitlines()))
    table = done.stdout.splitlines()[1:]
    assert len(lines) == len(bad)
    for name, line in zip(bad, lines, strict=True):
        pair = pairs[name]
        assert name in pair["error"] and pair["error"] in line and "\n" not in pair["error"]
        assert keys(pair) == PAIR_KEYS and numbers(pair) == [None] * 5
        assert pair["stderr"] is pair["patches"] is pair["samples"] is pair["trust"] is None
        row = rows[names.index(name)]
        assert row["error"] == pair["error"] and {row[column] for column in COLUMNS} == {""}
        assert table[names.index(name)].split() == [name, *"------"]
    assert "nowhere.png" in pairs["broken.obj"]["error"]


@pytest.mark.parametrize("reference", ["nowhere.obj", "broken.obj", "cut.glb"])
def test_without_a_reference_no_pair_is_scored(assets: Path, tmp_path: Path, reference: str) -> None:
    done = score(reference, "ref.obj", "shaken.obj", *SMALL, "--json", tmp_path / "j", "--quiet", cwd=assets)
    assert done.returncode == 1
    pairs = read_json(tmp_path / "j")["pairs"]
    assert [numbers(pair) for pair in pairs] == [[None] * 5] * 2
    assert all(reference in pair["error"] for pair in pairs)
    assert all(pair["error"] in done.stderr for pair in pairs)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\n", "no faces"),
        ("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "zero area"),
        ("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "area"),
        ("", "no"),
    ],
    ids=["lines only", "collinear", "one place", "empty"],
)
@pytest.mark.once
def test_surface_without_area(assets: Path, tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "flat.obj").write_text(text)
    for reference, other in ((assets / "ref.obj", "flat.obj"), ("flat.obj", assets / "ref.obj")):
        done = score(reference, other, *SMALL, "--json", "-", "--quiet", cwd=tmp_path)
        assert done.returncode == 1
        (pair,) = strict_json(done.stdout)["pairs"]
        assert words in pair["error"] and "flat.obj" in one_line(done.stderr)


@pytest.mark.once
def test_degenerate_surfaces_give_numbers(assets: Path, tmp_path: Path) -> None:
    """One triangle; a sliver; one far away; NaN nowhere, and nothing outside [0, 1]."""
    for name, corners in (
        ("one", "0 0 0|1 0 0|0 1 0"),
        ("sliver", "0 0 0|1 0 0|1 0.00001 0"),
        ("far", "1e7 0 0|1e7 1 0|1e7 0 1"),
        ("tiny", "0 0 0|1e-6 0 0|0 1e-6 0"),
    ):
        lines = [f"v {corner}" for corner in corners.split("|")]
        (tmp_path / f"{name}.obj").write_text("\n".join([*lines, "f 1 2 3", ""]))
    names = [assets / "ref.obj", *(f"{name}.obj" for name in ("one", "sliver", "far", "tiny"))]
    for reference in names:
        done = score(reference, *names, *SMALL, "--json", "-", "--quiet", cwd=tmp_path)
        pairs = strict_json(done.stdout)["pairs"]
        assert numbers(pairs[names.index(reference)]) == [1.0] * 5
        for pair in pairs:
            if pair["error"]:  # tiny, seen from another that is far away: not to be told from a point
                assert "far.obj" in (pair["reference"], pair["distorted"])
                assert pair["error"].startswith(f"{pair['distorted']}: the mesh is too small and too far")
            else:
                assert all(0 <= value <= 1 for value in numbers(pair))
        assert done.returncode == any(pair["error"] is not None for pair in pairs)


# Files that cannot be written


@pytest.mark.parametrize("flag", ["--json", "--csv", "--save-fields", "--picture"])
def test_output_that_cannot_be_written_is_said_before_the_work(assets: Path, tmp_path: Path, flag: str) -> None:
    ending = {"--save-fields": ".npz", "--picture": ".png"}.get(flag, "")
    (tmp_path / f"folder{ending}").mkdir()
    kept = tmp_path / ("kept.csv" if flag == "--json" else "kept.json")
    kept.write_text("older")
    for name in (f"missing/file{ending}", f"folder{ending}"):
        path = tmp_path / name
        other = ("--csv" if flag == "--json" else "--json", kept)
        done = score("ref.obj", "shaken.obj", *SMALL, *other, flag, path, cwd=assets)
        assert done.returncode == 1 and done.stdout == ""
        assert str(path) in one_line(done.stderr)
        assert kept.read_text() == "older"
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([f"folder{ending}", kept.name])


def test_read_only_folder(assets: Path, tmp_path: Path) -> None:
    if not hasattr(os, "geteuid") or os.geteuid() == 0:
        pytest.skip("root, and Windows, write to read-only folders")
    tmp_path.chmod(0o500)
    try:
        done = score("ref.obj", "shaken.obj", *SMALL, "--json", tmp_path / "j", cwd=assets)
    finally:
        tmp_path.chmod(0o700)
    assert done.returncode == 1 and "read-only" in one_line(done.stderr)


def test_a_failed_pair_leaves_older_fields_and_pictures_alone(assets: Path, tmp_path: Path) -> None:
    outputs = {"--save-fields": tmp_path / "f.npz", "--picture": tmp_path / "p.png"}
    for path in outputs.values():
        path.write_text("older")
    flags = [word for pair in outputs.items() for word in pair]
    done = score("ref.obj", "cut.glb", *SMALL, *flags, "--quiet", cwd=assets)
    assert done.returncode == 1
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"f.npz": "older", "p.png": "older"}


def test_outputs_replace_older_files_whole(assets: Path, whole: Path, tmp_path: Path) -> None:
    (tmp_path / "j").write_text("older " * 10000)
    assert score("ref.obj", "shaken.obj", *SMALL, "--json", tmp_path / "j", cwd=assets).returncode == 0
    assert without_seconds(read_json(tmp_path / "j")) == without_seconds(read_json(whole / "all.json"))
    assert [path.name for path in tmp_path.iterdir()] == ["j"]


@pytest.mark.parametrize(
    ("flag", "name"),
    [
        ("--json", "../assets/mesh.obj"), ("--csv", "base.obj"), ("--journal", "mesh.obj"), ("--junit", "given.png"),
        ("--csv", "pairs.csv"), ("--picture", "named.png"), ("--csv", "named.png"), ("--csv", "all.json"),
    ],
)  # fmt: skip
def test_outputs_do_not_replace_inputs(tmp_path: Path, flag: str, name: str) -> None:
    """What the row names, what the mesh names, the manifest; nor each other."""
    folder = tmp_path / "assets"
    folder.mkdir()
    for image in ("named.png", "given.png"):
        write_png(folder / image, noise())
    for mesh in ("base", "mesh"):
        write_torus(folder, mesh, "named.png")
    (folder / "pairs.csv").write_text("reference,distorted,ref_texture\nbase.obj,mesh.obj,given.png\n")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    pair = ("base.obj", "mesh.obj", "--ref-texture", "given.png")
    pairs = ("--manifest", "pairs.csv") if flag == "--csv" else pair
    outputs = {"--json": "all.json"} | {flag: name}
    done = score(*pairs, *SMALL, "--quiet", *(word for item in outputs.items() for word in item), cwd=folder)
    assert done.returncode == 2 and flag in one_line(done.stderr)
    after = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert {name: after[name] for name in before} == before


@pytest.mark.once
def test_one_kind_of_text_goes_to_stdout(assets: Path, whole: Path, tmp_path: Path) -> None:
    for flag in ("--csv", "--junit"):
        done = score(assets / "ref.obj", assets / "shaken.obj", *SMALL, flag, "-", "--quiet", cwd=tmp_path)
        assert done.returncode == 0 and not list(tmp_path.iterdir())
        kind = done.stdout.partition("\n")[0]
        assert kind == (whole / "all.csv").read_text().partition("\n")[0] or kind.startswith("<?xml")
    done = score("ref.obj", "shaken.obj", *SMALL, "--json", "-", "--csv", "-", cwd=assets)
    assert done.returncode == 2 and "--json and --csv both" in one_line(done.stderr)


# What is not installed


def without(module: str, folder: Path) -> dict[str, str]:
    """An environment whose Python cannot import a module."""
    (folder / "sitecustomize.py").write_text(f"import sys\nsys.modules[{module!r}] = None\n")
    return {"PYTHONPATH": str(folder)}


@pytest.mark.once
def test_without_pillow_only_the_picture_is_missing(assets: Path, whole: Path, tmp_path: Path) -> None:
    env = without("PIL", tmp_path)
    out = tmp_path / "out"
    out.mkdir()
    outputs = ("--json", out / "j", "--csv", out / "c", "--save-fields", out / "f.npz", "--quiet")
    assert score("ref.obj", "shaken.obj", *SMALL, *outputs, cwd=assets, env=env).returncode == 0
    done = score("ref.obj", "shaken.obj", *SMALL, *outputs, "--picture", out / "p.png", cwd=assets, env=env)
    assert done.returncode == 1 and "Pillow" in one_line(done.stderr)
    assert done.stdout == (whole / "stdout").read_text(encoding="utf-8")
    assert sorted(path.name for path in out.iterdir()) == ["c", "f.npz", "j", "j.journal.jsonl"]
    assert without_seconds(read_json(out / "j")) == without_seconds(read_json(whole / "all.json"))


def test_with_pillow_there_is_a_picture(assets: Path, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    assert score("ref.obj", "shaken.obj", *SMALL, "--picture", tmp_path / "p.png", cwd=assets).returncode == 0
    with image.open(tmp_path / "p.png") as picture:
        assert picture.format == "PNG"


def test_without_bpy_it_says_what_to_do(assets: Path, tmp_path: Path) -> None:
    done = score("ref.obj", "shaken.obj", cwd=assets, env=without("bpy", tmp_path))
    assert done.returncode == 1 and done.stdout == ""
    assert "make demo" in one_line(done.stderr)


def test_arguments_after_two_dashes_belong_to_the_script(assets: Path) -> None:
    """As under Blender, whose own arguments come before them."""
    code = (
        "import sys; script = sys.argv[1]; sys.argv = ['blender', '-b', '--python', script, '--', *sys.argv[2:]]; "
        "exec(open(script).read(), {'__name__': '__main__', '__file__': script})"
    )
    done = score("ref.obj", "ref.obj", *SMALL, "--quiet", command=(sys.executable, "-c", code, str(SCORE)), cwd=assets)
    assert done.returncode == 0 and "1.0000" in done.stdout
