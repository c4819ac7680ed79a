# SPDX-License-Identifier: GPL-3.0-or-later
"""Every test starts in an empty session, as in tests/blender."""

from tests.blender.conftest import empty_session

__all__ = ["empty_session"]
