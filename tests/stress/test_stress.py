# SPDX-License-Identifier: GPL-3.0-or-later
"""A part of `make stress`, small enough for every run of the tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.stress import corpus, kills

# Each would crash, hang or swell the process if it were not refused before its import.
WORST = (
    "count_without_data.gltf",
    "instances_by_the_thousands.gltf",
    "stride_negative.gltf",
    "very_deep_nodes.gltf",
    "very_deep_prims.usda",
    "deeper_than_their_reader_can.usda",
    "point_instancers_in_one_another.usda",
    "900_million_in_text.ply",
)


@pytest.mark.once
def test_rounds_of_kills_and_damaged_journals() -> None:
    """The same bytes as if nothing had happened."""
    _, failed = kills.run(4, seed=1)
    assert not failed


@pytest.mark.once
def test_worst_files_under_limits(tmp_path: Path) -> None:
    made = corpus.write_made(tmp_path)
    worst = [path for path in made if path.name in WORST]
    assert len(worst) == len(WORST)
    counts, wrong = corpus.run([*worst, *corpus.real_files([corpus.SHARED / "cases" / "security"])])
    assert not wrong and counts["refused"] == counts.total()
