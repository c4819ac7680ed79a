# SPDX-License-Identifier: GPL-3.0-or-later
"""FMQM for Blender: does this LOD still look like the original?"""

VERSION = "0.1.0"


def register() -> None:
    """Nothing to show in Blender's window yet: the scores come from scripts/score.py."""


def unregister() -> None:
    """Leaves nothing behind."""
