# SPDX-License-Identifier: GPL-3.0-or-later
"""Every test starts in an empty session of Blender's factory settings."""

from __future__ import annotations

import pytest

from fmqm_addon.blender.display import viewport

from . import scenes


@pytest.fixture(autouse=True)
def empty_session() -> None:
    viewport.restore_colors()  # an empty session keeps the window's views
    scenes.clear()
