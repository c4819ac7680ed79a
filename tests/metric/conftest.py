# SPDX-License-Identifier: GPL-3.0-or-later
"""The same examples on every run, and no silent 0/0."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

settings.register_profile(
    "metric",
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("metric")


@pytest.fixture(autouse=True)
def floating_point_errors_raise() -> Iterator[None]:
    """The metric decides 0/0 and empty means itself; numpy must never have to."""
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield
