# SPDX-License-Identifier: GPL-3.0-or-later
import csv
import importlib.util
import io
import json
from pathlib import Path

import pytest

pytest.importorskip("scipy", reason="make test installs scipy")

from fmqm_addon.metric.errors import FMQMError

_spec = importlib.util.spec_from_file_location(
    "evaluate_script", Path(__file__).resolve().parents[2] / "scripts" / "evaluate.py"
)
assert _spec and _spec.loader
script = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(script)

ROWS = [
    (f"rock_{kind}_{level}", kind, 1 - level / 10 - (kind == "JPEG") / 50)
    for kind in ("ds", "JPEG")
    for level in range(6)
]


def write(path: Path, rows: list[list[object]]) -> str:
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    return str(path)


@pytest.fixture
def tables(tmp_path: Path) -> tuple[str, str]:
    scores = write(
        tmp_path / "scores.csv",
        [
            ["id", "reference", "FMQM", "flat", "text"],
            *([name, "a/rock.obj", value, 3, "x"] for name, _, value in ROWS),
        ],
    )
    opinions = write(
        tmp_path / "mos.csv",
        [
            ["Stimulus", "MOS", "Kind"],
            *([name, 1 + 4 * value**2, kind] for name, kind, value in ROWS),
            ["other", 3, "ds"],
        ],
    )
    return scores, opinions


def run(*arguments: str) -> tuple[int, str]:
    out = io.StringIO()
    return script.main([*arguments, "--resamples", "100"], out), out.getvalue()


def test_every_numeric_column_is_judged_overall_and_by_kind(
    tables: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "result.json"
    code, text = run(*tables, "--json", str(target))
    assert code == 0
    found = json.loads(target.read_text(encoding="utf-8"))
    assert list(found["metrics"]) == ["FMQM", "flat"]
    overall = found["metrics"]["FMQM"]["overall"]["all"]
    assert overall["rows"] == 12 and overall["SROCC"] == pytest.approx(1) and overall["PLCC"] > 0.999
    assert set(found["metrics"]["FMQM"]["kind"]) == {"ds", "JPEG"}
    assert "same number" in found["metrics"]["flat"]["overall"]["all"]["note"]
    assert found["unscored"] == ["other"]
    assert "other" in capsys.readouterr().err
    assert "flat: the same number everywhere" in text and "nan" not in (text + target.read_text()).lower()


def test_the_same_run_writes_the_same_bytes(tables: tuple[str, str], tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="make test installs matplotlib")
    for name in ("a", "b"):
        assert run(*tables, "--json", str(tmp_path / f"{name}.json"), "--plots", str(tmp_path / name))[0] == 0
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert (tmp_path / "a/FMQM.png").read_bytes() == (tmp_path / "b/FMQM.png").read_bytes()
    assert not (tmp_path / "a/flat.png").exists()


def test_csv_has_a_row_a_metric_and_group(tables: tuple[str, str]) -> None:
    code, text = run(*tables, "--metrics", "FMQM", "--csv", "-")
    rows = list(csv.DictReader(io.StringIO(text)))
    assert code == 0
    assert [(row["grouping"], row["group"]) for row in rows] == [("overall", "all"), ("kind", "ds"), ("kind", "JPEG")]
    assert float(rows[0]["SROCC_low"]) <= float(rows[0]["SROCC"])


def test_json_of_score_py_has_the_names_of_its_csv(tables: tuple[str, str], tmp_path: Path) -> None:
    perceived = {"score": 0.9, "p10": 0.8, "shape": 1.0, "facing": 1.0, "color": 1.0, "detail": 1.0, "stderr": None}
    pairs = [
        {"id": name, "reference": "rock.obj", "FMQM": value, "error": None, "perceived": {**perceived, "score": value}}
        for name, _, value in ROWS
    ]
    path = tmp_path / "scores.json"
    path.write_text(json.dumps({"pairs": pairs}), encoding="utf-8")
    code, text = run(str(path), tables[1], "--compare", "FMQM", "perceived")
    assert code == 0 and "perceived " in text
    assert "FMQM minus perceived, on the same 12 rows:\n  SROCC +0.000" in text


def test_ids_meet_by_the_names_of_files(tables: tuple[str, str], tmp_path: Path) -> None:
    scores = write(tmp_path / "paths.csv", [["id", "FMQM"], *([f"d/{name}.obj", value] for name, _, value in ROWS)])
    code, text = run(scores, tables[1])
    assert code == 0 and text.splitlines()[1].split()[:2] == ["FMQM", "12"]


@pytest.mark.parametrize(
    ("scores", "opinions", "words"),
    [
        ([["id", "a"], ["x", 1]], [["id", "MOS"], ["y", 1]], "share no id"),
        ([["id", "a"], ["x", 1], ["x", 2]], [["id", "MOS"], ["x", 1]], "2 times"),
        ([["id", "a"], ["x", 1]], [["id", "MOS"], ["x", "good"]], "a number is wanted"),
        ([["id", "a"], ["x", 1]], [["id", "taste"], ["x", 1]], "--mos-column"),
        ([["id", "a"], ["x", "one"]], [["id", "MOS"], ["x", 1]], "no column with numbers"),
        ([["id", "a"]], [["id", "MOS"], ["x", 1]], "no rows"),
    ],
)
def test_wrong_tables_give_one_line(
    scores: list[list[object]],
    opinions: list[list[object]],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    paths = write(tmp_path / "s.csv", scores), write(tmp_path / "m.csv", opinions)
    try:
        code = run(*paths)[0]
    except SystemExit as end:
        code = end.code
    except FMQMError:
        pytest.fail("an error that is not told")
    lines = capsys.readouterr().err.splitlines()
    assert code in (1, 2) and len(lines) == 1 and words in lines[0]
