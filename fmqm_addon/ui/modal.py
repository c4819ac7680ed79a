# SPDX-License-Identifier: GPL-3.0-or-later
"""What the buttons with long work share: in the window they work between redraws and can be cancelled."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import bpy

from ..metric.stepper import Stepper
from . import session, stale

SLICE = 0.035  # seconds of work per tick of the timer: the window stays smooth
SHOWN_EVERY = 0.2  # seconds between redraws of the progress
TICK = 0.005  # seconds between ticks, for Blender to draw and listen
REST = 4  # times what a redraw has cost until the next: at most a quarter of the time goes into drawing


def scene_of(name_full: str) -> bpy.types.Scene | None:
    """The scene of such a name, linked ones too; None: it is gone."""
    return next((scene for scene in bpy.data.scenes if scene.name_full == name_full), None)


class SteppedOperator:
    """A part of operators that run a stepper; called from Python they run it at once.

    An operator's own begin makes the stepper, or reports why not and returns False; finish uses its result. Operators
    annotate nothing but properties: Blender evaluates the annotations of what it registers, typing remembers what
    `Stepper[list[Outcome]]` came to, and what is remembered longer than bpy keeps Blender 4.5 from ending.

    Attributes:
        noun: what is cancelled, for its message.
    """

    noun = "Measurement"
    stepper: Stepper[Any]
    report: Callable[[set[str], str], None]  # the operator's
    _job: session.Job
    _shown: float = 0.0
    _drawn: float | None = 0.0  # seconds that the last redraw took; None: it is awaited

    def begin(self, context: bpy.types.Context) -> bool:
        raise NotImplementedError

    def finish(self, context: bpy.types.Context) -> set[str]:
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        if not self.begin(context):
            return {"CANCELLED"}
        self.stepper.run()
        return self._finish(context)

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        if not self.begin(context):
            return {"CANCELLED"}
        window_manager, stepper, workspace = context.window_manager, self.stepper, context.workspace
        timer = window_manager.event_timer_add(TICK, window=context.window)

        def stop() -> None:
            """Once; from wherever the end comes."""
            if session.job is not job:
                return
            session.job = None
            stepper.cancel()
            window_manager.event_timer_remove(timer)
            workspace.status_text_set(None)
            stale.redraw()
            stale.soon()

        self._job = job = session.job = session.Job(stop)
        session.longest_tick = 0.0
        window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        job = self._job
        if session.job is not job:  # another file, or the add-on was disabled
            self._let_go()
            return {"CANCELLED"}
        if job.cancelled or (event.type == "ESC" and event.value == "PRESS"):
            job.stop()
            self._let_go()
            self.report({"INFO"}, f"{self.noun} cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        if self._drawn is None:
            self._drawn = max(0.0, time.perf_counter() - self._shown - TICK)
        try:
            more = self._slice()
        except BaseException:
            job.stop()
            raise
        if more:
            self._show(context, job)
            return {"PASS_THROUGH"}
        job.stop()
        return self._finish(context)

    def cancel(self, _: bpy.types.Context) -> None:
        """Blender ends the operator: a window was closed, another file was opened."""
        self._job.stop()
        self._let_go()

    def _finish(self, context: bpy.types.Context) -> set[str]:
        try:
            return self.finish(context)
        finally:
            self._let_go()

    def _let_go(self) -> None:
        """Of the arrays: Blender keeps the last operators, for its history."""
        for name in self.__dict__.keys() & {"stepper", "_job"}:
            delattr(self, name)

    def _slice(self) -> bool:
        """Some milliseconds of work; whether there is more. Ends where something else begins: it may be one long step,
        and should be announced before."""
        began, stage = time.perf_counter(), self.stepper.progress.stage
        more = True
        while more and time.perf_counter() - began < SLICE and self.stepper.progress.stage == stage:
            more = self.stepper.step()
        session.longest_tick = max(session.longest_tick, time.perf_counter() - began)
        return more

    def _show(self, context: bpy.types.Context, job: session.Job) -> None:
        """Progress in sidebar and status bar, some times a second."""
        progress = self.stepper.progress
        job.progress = progress.done
        now = time.perf_counter()
        least = SHOWN_EVERY if progress.stage == job.text else 0.0
        if now - self._shown < max(least, REST * (self._drawn or 0.0)):
            return
        self._shown, self._drawn, job.text = now, None, progress.stage
        context.workspace.status_text_set(f"FMQM: {job.text}, {100 * job.progress:.0f} %        Esc: Cancel")
        stale.redraw()
