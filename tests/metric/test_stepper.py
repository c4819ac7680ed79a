# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps and their result."""

from __future__ import annotations

from collections.abc import Generator

from fmqm_addon.metric.stepper import Progress, Stepper


def counting() -> Generator[Progress, None, int]:
    yield Progress("half", 0.5)
    return 7


def test_a_stepper_steps_and_ends_with_its_result() -> None:
    stepper = Stepper(counting())
    assert stepper.step()
    assert stepper.progress == Progress("half", 0.5)
    assert not stepper.step()
    assert stepper.result == 7


def test_a_result_stays() -> None:
    stepper = Stepper(counting())
    stepper.run()
    stepper.step()
    assert stepper.result == 7
