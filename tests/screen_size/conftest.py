# SPDX-License-Identifier: GPL-3.0-or-later
"""The same examples on every run, and no silent 0/0, as in tests/metric."""

from tests.metric.conftest import floating_point_errors_raise

__all__ = ["floating_point_errors_raise"]
