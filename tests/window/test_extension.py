# SPDX-License-Identifier: GPL-3.0-or-later
"""The built extension's life in the real program: installed, enabled, measuring, disabled, uninstalled."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.house.test_extension import live, package  # noqa: F401  the fixture

pytestmark = pytest.mark.program


def test_life_in_the_program(blender: str, package: Path, tmp_path: Path) -> None:  # noqa: F811
    live(package, tmp_path, command=(blender, "-b", "-q", "--python"), before=("--",))
