# SPDX-License-Identifier: GPL-3.0-or-later
"""Live: the chosen pair is measured again by itself while it is worked on.

Nothing of it is in the file: no property, no undo step, no mark that it was changed. Handlers only note that something
has changed; after a short rest a timer works in small steps, and not while the changes go on, as during a drag.
"""

from __future__ import annotations

import time

import bpy

from ..blender.display import viewport
from ..blender.materials.types import Reading
from ..blender.scene.repeated import PairReading, PairState, RepeatedPair, state_of
from ..blender.scene.target import Target, target_of
from ..comparison.judge import Judge
from ..comparison.pair import PairOptions
from ..metric.errors import FMQMError
from ..metric.settings import PRESETS, Settings
from ..metric.stepper import Stepper
from ..report.numbers import score_text
from ..report.words import LABELS, PRESET_LABELS
from . import handlers, session
from .operators.inputs import reference_of
from .properties.items import item_target
from .properties.rows import active_row, row_targets
from .properties.settings import patterns_of
from .stale import WATCHED

REST = 0.3  # seconds without a change before anything is done
SLICE = 0.02  # seconds of work per tick: a drag stays smooth
TICK = 0.01  # seconds between ticks, for Blender to draw and listen
WAIT = 0.5  # seconds until it is tried again, while something else is measured
MOST = 2.0  # processor seconds that a pair may take
TOLD = 10.0  # seconds for which it is said why it was switched off
_PLACES = 3  # of the score
_QUICK = Settings(**PRESETS["fast"])


def chosen_pair(scene: bpy.types.Scene) -> tuple[Target, Target] | None:
    """The original and the LOD that are looked at: the chosen result, if it is one of the list's pairs or there is no
    list, else the list's chosen LOD; None: there is no pair. Cheap: asked at each drawing."""
    fmqm, row = scene.fmqm, active_row(scene)
    listed = [item_target(item) for item in fmqm.compared]
    reference = reference_of(fmqm)
    pairs = []
    if reference is not None:
        original = target_of(reference, fmqm.bare_reference)
        pairs = [None if each is None else (original, target_of(each)) for each in listed]
    of_row = None if row is None else row_targets(row)
    if of_row is not None and (of_row in pairs or not any(pairs)):
        return of_row
    chosen = pairs[fmqm.compared_index] if fmqm.compared_index < len(pairs) else None
    return chosen or next(filter(None, pairs), None)


class Live:
    """The measurement that repeats itself. Whoever owns it calls touch() after changes, and tick().

    Attributes:
        reading: the last scores of the pair that state tells; None: there are none yet. error: why there are none.
        is_too_slow: the pair takes longer than MOST.
    """

    def __init__(self, settings: Settings = _QUICK) -> None:
        self.reading: PairReading | None = None
        self.state: PairState | None = None
        self.error = ""
        self.is_too_slow = False
        self._settings = settings
        self._pair = RepeatedPair()
        self._work: Stepper[PairReading] | None = None
        self._spent = 0.0
        self._is_due = True
        self._is_working = self._is_looking = False
        self._touched = float("-inf")

    @property
    def is_busy(self) -> bool:
        """Whether what is shown is that of before a change."""
        return self._is_due or self._work is not None

    def touch(self, now: float) -> None:
        """Something may have changed, at a time in seconds. Cheap."""
        if self._is_looking:
            return  # what looking evaluates is no change
        self._is_due = True
        if not self._is_working:
            self._touched = now

    def tick(self, now: float) -> float | None:
        """Does a little; the seconds until it wants to go on, or None: until it is touched."""
        if now - self._touched < REST:
            return REST - (now - self._touched)
        if session.job is not None:
            return WAIT
        if self._is_due:
            self._is_due, self._is_looking = False, True
            try:
                self._look()
                _flush_edit_mode()
            finally:
                self._is_looking = False
        if self._work is not None:
            self._is_working = True
            try:
                self._slice(self._work)
                _flush_edit_mode()
            finally:
                self._is_working = False
        return TICK if self.is_busy and not self.is_too_slow else None

    def follow(self, scene: bpy.types.Scene) -> bool:
        """Whether another pair is chosen than the one that is measured. Cheap."""
        known = None if self.state is None else (self.state.reference, self.state.target)
        return chosen_pair(scene) != known

    def stop(self) -> None:
        """Ends the work and lets go of the arrays."""
        if self._work is not None:
            self._work.cancel()
        self._work = self.state = self.reading = None
        self._pair = RepeatedPair()
        self.error = ""

    def _look(self) -> None:
        """Goes on with the work if nothing has changed, or begins anew."""
        scene = bpy.context.scene
        pair = chosen_pair(scene)
        if pair is None:
            self.stop()
            self.error = "choose an original and an LOD"
            return
        state = state_of(*pair, *self._asked(scene))
        if state == self.state:
            return
        if self._work is not None:
            self._work.cancel()
        if self.state is None or (self.state.reference, self.state.target) != pair:
            self.reading = None
        self.state, self._work, self.error = state, None, ""
        gone = [target.name for target, mark in zip(pair, state.marks, strict=True) if not mark]
        if gone:
            self.error = f"{gone[0]} is gone"
        else:
            self._work, self._spent = Stepper(self._pair.measuring(state)), 0.0

    def _asked(self, scene: bpy.types.Scene) -> tuple[PairOptions, Reading]:
        settings = scene.fmqm.settings
        options = PairOptions(
            settings=self._settings.with_seed(settings.seed),
            space=settings.space.lower(),
            match_scale=settings.match_scale,
        )
        # Baking renders: too slow, and Blender waits for it.
        patterns = patterns_of(settings.include), patterns_of(settings.exclude)
        return options, Reading(bake=0, include=patterns[0], exclude=patterns[1])

    def _slice(self, work: Stepper[PairReading]) -> None:
        began, more = time.perf_counter(), True
        while more:
            before = time.thread_time()
            try:
                more = work.step()
            except FMQMError as error:
                self.error, self.reading, self._work = str(error), None, None
                return
            self._spent += 0.0 if self._pair.is_new else time.thread_time() - before
            if self._spent > MOST:
                self.is_too_slow = True
                work.cancel()
                return
            if time.perf_counter() - began >= SLICE:
                break
        if not more:
            self.reading, self._work = work.result, None


current: Live | None = None  # None: it is off
notice = ""  # why it was switched off


def turn_on(settings: Settings = _QUICK) -> None:
    """Begins to watch."""
    global current, notice
    turn_off()
    current, notice = Live(settings), ""
    if bpy.app.background:
        return
    handlers.add(_HANDLERS)
    bpy.app.timers.register(_run, first_interval=0)
    viewport.redraw()


def turn_off(why: str = "") -> None:
    """Stops it and lets go of everything.

    Args:
        why: what is shown for a while.
    """
    global current, notice
    if current is not None:
        current.stop()
    current, notice = None, why
    handlers.remove(_HANDLERS)
    for timer in (_run, _forget_notice):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
    if not bpy.app.background:
        if why:
            bpy.app.timers.register(_forget_notice, first_interval=TOLD)
        viewport.redraw()


def _flush_edit_mode() -> None:
    """Reading what is being edited counts as a change of it, which would be told later, and be taken for the user's."""
    if bpy.context.mode.startswith("EDIT"):
        bpy.context.view_layer.update()


def texts(scene: bpy.types.Scene) -> list[str]:
    """What stands in the corner of a view; nothing while it is off and there is nothing to say."""
    live = current
    if live is None:
        return [notice] if notice else []
    if live.error:
        return [f"Live: {live.error}"]
    if live.reading is None or live.state is None:
        return ["Live: measuring..."]
    judge = Judge[scene.fmqm.judge]
    score = score_text(judge.score(live.reading.readings), places=_PLACES)
    about = f"{live.state.target.label}, {live.reading.triangles:,} triangles, {PRESET_LABELS['fast']}"
    return [f"{LABELS[judge.column]} {score}{' ...' if live.is_busy else ''}", about]


def touch() -> None:
    """Something may have changed. Cheap: called by handlers."""
    if current is None:
        return
    current.touch(time.monotonic())
    if not bpy.app.background and not bpy.app.timers.is_registered(_run):
        bpy.app.timers.register(_run, first_interval=REST)


def _run() -> float | None:
    live = current
    if live is None:
        return None
    before = texts(bpy.context.scene)
    try:
        wait = live.tick(time.monotonic())
    except BaseException:
        turn_off()
        raise
    if live.is_too_slow:
        assert live.state is not None
        turn_off(f"Live is off: {live.state.target.label} takes more than {MOST:.0f} s to measure")
        return None
    if texts(bpy.context.scene) != before:
        viewport.redraw()
    return wait


def _forget_notice() -> None:
    global notice
    notice = ""
    viewport.redraw()


@handlers.kept
def _on_change(_: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if any(isinstance(update.id, WATCHED) for update in depsgraph.updates):
        touch()


@handlers.kept
def _on_undo(*_: object) -> None:
    touch()


@handlers.kept
def _before_load(*_: object) -> None:
    if current is not None:
        current.stop()


@handlers.kept
def _after_load(*_: object) -> None:
    touch()  # which begins a timer anew: opening a file has ended it


_HANDLERS = (
    ("depsgraph_update_post", _on_change),
    ("undo_post", _on_undo),
    ("redo_post", _on_undo),
    ("load_pre", _before_load),
    ("load_post", _after_load),
)
