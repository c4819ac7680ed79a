# SPDX-License-Identifier: GPL-3.0-or-later
"""Between Blender and numpy there is one way."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_only_arrays_copies_collections() -> None:
    sources = [*(ROOT / "fmqm_addon").rglob("*.py"), *(ROOT / "scripts").glob("*.py")]
    users = {path.relative_to(ROOT).as_posix() for path in sources if "foreach_" in path.read_text(encoding="utf-8")}
    assert users == {"fmqm_addon/blender/arrays.py"}
