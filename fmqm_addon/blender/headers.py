# SPDX-License-Identifier: GPL-3.0-or-later
"""What an image's file promises, before anything decodes it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    """What an image may promise: pixels a side, and bytes once decoded (4 a pixel, 16 in float images)."""

    side: int = 32768
    decoded: int = 2**30
