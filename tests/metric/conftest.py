# SPDX-License-Identifier: GPL-3.0-or-later
"""No silent 0/0."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest


@pytest.fixture(autouse=True)
def floating_point_errors_raise() -> Iterator[None]:
    """The metric decides 0/0 and empty means itself; numpy must never have to."""
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield
