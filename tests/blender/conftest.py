# SPDX-License-Identifier: GPL-3.0-or-later
"""Every test starts in an empty session of Blender's factory settings."""

from __future__ import annotations

import pytest

from . import scenes


@pytest.fixture(autouse=True)
def empty_session() -> None:
    scenes.clear()
