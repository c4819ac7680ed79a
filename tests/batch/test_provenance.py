# SPDX-License-Identifier: GPL-3.0-or-later
"""The digest of the code that decides scores. Needs no Blender."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import fmqm_addon
from fmqm_addon.batch.rows import BatchOptions
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.settings import Settings
from fmqm_addon.provenance import PARTS, code_digest, provenance

PACKAGE = Path(fmqm_addon.__file__).parent


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The package once more, at another place."""
    return Path(shutil.copytree(PACKAGE, tmp_path / "copy", ignore=shutil.ignore_patterns("__pycache__")))


def test_it_is_the_same_at_another_place_and_with_other_line_endings(copy: Path) -> None:
    assert code_digest(copy) == code_digest() == provenance("5")["fmqm_code"]
    code_digest.cache_clear()
    for path in copy.rglob("*.py"):
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    (copy / "metric" / "__pycache__").mkdir()
    (copy / "metric" / "__pycache__" / "score.cpython-311.pyc").write_bytes(b"x")
    assert code_digest(copy) == code_digest()


@pytest.mark.parametrize("part", PARTS)
def test_any_change_of_what_decides_scores_shows(copy: Path, part: str) -> None:
    before = code_digest(copy)
    changed = sorted((copy / part).rglob("*.py"))[-1]
    changed.write_bytes(changed.read_bytes().replace(b"a", b"b", 1))
    code_digest.cache_clear()
    assert code_digest(copy) != before


def test_what_only_shows_scores_does_not_count(copy: Path) -> None:
    before = code_digest(copy)
    (copy / "report" / "records.py").write_text("")
    code_digest.cache_clear()
    assert code_digest(copy) == before


def test_options_travel_with_it() -> None:
    made_by = BatchOptions(pair=PairOptions(settings=Settings())).made_by({"fmqm_code": "c"})
    assert made_by == BatchOptions(pair=PairOptions(settings=Settings()), report="folder").made_by(
        {"fmqm_code": "c"}
    ), "it changes no score"
    assert made_by != BatchOptions(pair=PairOptions(repeats=2)).made_by({"fmqm_code": "c"})
    assert made_by != BatchOptions(pair=PairOptions(settings=Settings(seed=1))).made_by({"fmqm_code": "c"})
