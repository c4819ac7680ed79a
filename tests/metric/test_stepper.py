# SPDX-License-Identifier: GPL-3.0-or-later
"""Steps and their result."""

from __future__ import annotations

from fmqm_addon.metric.stepper import Progress, Stepper, Work, as_part


def counting() -> Work[int]:
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


def sharing() -> Work[str]:
    yield Progress("", 0.5)
    return "done"


def test_all_that_yields_progress_can_be_a_part() -> None:
    """A stepper, a generator of its progress, and one whose only stage has no name."""
    for part, stage, result in ((counting(), "half", 7), (Stepper(counting()), "half", 7), (sharing(), "", "done")):
        stepper = Stepper(as_part(part, 0.25, 0.5))
        assert stepper.step() and stepper.progress == Progress(stage, 0.5)
        assert stepper.run() == result
    assert next(as_part(sharing(), 0.0, 1.0, "mine")) == Progress("mine", 0.5)
