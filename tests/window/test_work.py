# SPDX-License-Identifier: GPL-3.0-or-later
"""Live, LOD Chain and the Report button in the real program: what only its timers, undo steps and files show.

FMQM_SCREENSHOT is as for test_look.py; no pictures are taken.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.house.test_extension import package  # noqa: F401  the fixture

pytestmark = pytest.mark.program


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory, package: Path) -> dict[str, Any]:  # noqa: F811
    """What the script wrote down."""
    command = os.environ.get("FMQM_SCREENSHOT")
    if not command:
        pytest.skip("FMQM_SCREENSHOT does not name a command that opens Blender's window")
    out = tmp_path_factory.mktemp("work")
    done = subprocess.run(
        [*shlex.split(command), str(Path(__file__).with_name("work_script.py")), str(out / "view")],
        env={**os.environ, "FMQM_ZIP": str(package), "FMQM_OUT": str(out)},
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    error = out / "error.txt"
    assert not error.exists(), error.read_text()
    assert "Traceback" not in done.stdout + done.stderr, done.stdout + done.stderr
    report: dict[str, Any] = json.loads((out / "report.json").read_text())
    report["page"] = (out / "page" / "index.html").read_text(encoding="utf-8")
    return report


def test_live_follows_edits_undo_deletion_and_files(found: dict[str, Any]) -> None:
    """The script has waited after each of them until the corner shows the LOD as it is then."""
    score, about = found["shown"]
    assert score.startswith("FMQM 0.") and about.startswith("Rock_LOD1, 48") and about.endswith(" triangles, Quick")
    assert (found["ratio after undo"], found["ratio after loading"]) == (0.23, 0.5)
    assert found["worked while dragged"] is False
    assert found["deleted"][0].startswith("Live: ")


def test_live_leaves_no_mark(found: dict[str, Any]) -> None:
    assert found["dirty"] is False and found["dirty after loading"] is False
    assert found["left of live"] == [[], False] and found["handlers of live"] == []


def test_a_chain_is_there_or_not(found: dict[str, Any]) -> None:
    assert found["left of a cancelled chain"] == []
    assert found["made"] == ["objects Rock_LOD0", "objects Rock_LOD1", "objects Rock_LOD2"]
    assert found["rows"] == [["Rock_LOD1", ""], ["Rock_LOD2", ""]]
    assert found["after undo"] == ["Rock"], "one step"


def test_the_report_leaves_nothing_in_the_file(found: dict[str, Any]) -> None:
    assert found["left of the report"] == [] and "Rock_LOD2" in found["page"]
