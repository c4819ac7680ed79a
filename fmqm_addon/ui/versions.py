# SPDX-License-Identifier: GPL-3.0-or-later
"""What the buttons that make versions of the active object share: the search, and filling the list and the rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import bpy

from ..blender.materials.types import Reading
from ..blender.scene.decimate import add_version
from ..blender.scene.fingerprint import fingerprint
from ..blender.scene.target import target_of
from ..blender.scene.versions import FoundVersions, attempting, finding_versions
from ..comparison.alignment import location_counts
from ..comparison.decimation import DecimationGoal
from ..comparison.pair import PairOptions
from ..metric.errors import FMQMError
from ..metric.stepper import Stepper
from . import session, stale
from .modal import SteppedOperator, scene_of
from .operators.inputs import reference_of, set_compared, set_reference
from .operators.measure import asked_of, show_rows, write_row
from .operators.polls import allowed
from .properties.items import item_target
from .properties.rows import row_targets


@dataclass(frozen=True)
class Search:
    """What is searched for.

    Attributes:
        goal: targets and limits. base, suffixes: of the versions' names, as of versions.finding_versions.
        called: the name that the original gets once they are found.
    """

    goal: DecimationGoal
    base: str
    suffixes: tuple[str, ...]
    called: str


class VersionsOperator(SteppedOperator):
    """A part of operators that make decimated versions of the active object."""

    bl_options: ClassVar = {"UNDO"}  # no REGISTER: adjusting the last operation would search all over again

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, _why_not(context))

    def asked(self, context: bpy.types.Context, options: PairOptions, reading: Reading) -> Search:
        """What the properties ask for.

        Raises:
            FMQMError: it cannot be.
        """
        raise NotImplementedError

    def begin(self, context: bpy.types.Context) -> bool:
        self._name = context.active_object.name_full
        try:
            options, reading, self._settings_text = asked_of(context.scene.fmqm)
            self.search = search = self.asked(context, options, reading)
        except FMQMError as error:
            self.report({"ERROR"}, str(error))
            return False
        context.view_layer.update()  # or a transform that is still to be applied would pass for a change
        original = target_of(context.active_object)
        self._scene, self._mark = context.scene.name_full, fingerprint(original, False)
        searching = finding_versions(
            original, search.base, search.suffixes, search.goal, options, reading, search.called
        )
        self.stepper = Stepper(attempting(searching))
        return True

    def keep(
        self, context: bpy.types.Context, scene: bpy.types.Scene, original: bpy.types.Object, found: FoundVersions
    ) -> set[str]:
        """Makes what was found, in one undo step, and reports it."""
        raise NotImplementedError

    def finish(self, context: bpy.types.Context) -> set[str]:
        there = self._found()
        return {"CANCELLED"} if there is None else self.keep(context, *there)

    def _found(self) -> tuple[bpy.types.Scene, bpy.types.Object, FoundVersions] | None:
        """The scene, the original and what was found; None, and the reason is reported: there is nothing to make."""
        result = self.stepper.result
        if isinstance(result, FMQMError):
            self.report({"WARNING"}, str(result))
            return None
        original = next((object_ for object_ in bpy.data.objects if object_.name_full == self._name), None)
        scene = scene_of(self._scene)
        if original is None or scene is None:
            gone = self._name if original is None else "The scene"
            self.report({"WARNING"}, f"{gone} is gone, and what was found with it")
            return None
        if fingerprint(target_of(original), False) != self._mark:
            self.report({"WARNING"}, f"{self._name} was changed meanwhile; search again")
            return None
        return scene, original, result

    def make(
        self, context: bpy.types.Context, scene: bpy.types.Scene, original: bpy.types.Object, found: FoundVersions
    ) -> list[bpy.types.Object]:
        """The versions as objects, with the list and their rows filled in."""
        made = [
            add_version(original, found.members, each.version, self.search.base + each.suffix, each.suffix)
            for each in found.versions
        ]
        _rename(original, self.search.called)
        context.view_layer.update()
        fmqm, reference = scene.fmqm, target_of(original)
        known = [] if reference_of(fmqm) != original or fmqm.bare_reference else list(map(item_target, fmqm.compared))
        stale.forget_deleted(scene)
        set_reference(fmqm, original)
        set_compared(fmqm, [*(item for item in known if item is not None and item not in made), *made])
        outcomes = []
        for object_, each in zip(made, found.versions, strict=True):
            target, pair = target_of(object_), each.outcome.pair_result
            place_counts = pair is not None and location_counts(pair.alignment.label)
            marks = fingerprint(reference, place_counts), fingerprint(target, place_counts)
            outcomes.append(replace(each.outcome, reference_target=reference, target=target, fingerprint=marks))
            write_row(fmqm, outcomes[-1], self._settings_text)
        if outcomes:
            fmqm.compared_index = len(fmqm.compared) - len(made)
            show_rows(scene, outcomes[0])
        return made


def _why_not(context: bpy.types.Context) -> str:
    """Why there is nothing to decimate, for the greyed-out button; "" if there is."""
    active = context.active_object
    if session.job is not None:
        return "A measurement is running"
    if active is None or active.type != "MESH":
        return "Make a mesh object the active one"
    return "" if active.mode == "OBJECT" else "Leave the object's edit or paint mode"


def hide(context: bpy.types.Context, objects: Sequence[bpy.types.Object], behind: bpy.types.Object) -> str:
    """Hides objects, which would flicker, each as near to the viewer as the one that is chosen instead; what to say of
    it. In another scene, or where a collection is excluded, they stay as they are."""
    there = context.view_layer.objects
    if any(object_.name not in there for object_ in (*objects, behind)):
        return ""
    for object_ in context.selected_objects:
        object_.select_set(False)
    behind.hide_set(False)
    there.active = behind
    behind.select_set(True)
    for object_ in objects:
        object_.hide_set(True)
    if len(objects) == 1:
        return f"; {objects[0].name} is hidden, Alt H shows it"
    return f"; they are hidden behind {behind.name}, Alt H shows them"


def _rename(object_: bpy.types.Object, name: str) -> None:
    """Gives an object a name; rows of all scenes go on meaning it."""
    if object_.name == name:
        return
    before = target_of(object_)
    object_.name = name
    after = target_of(object_)
    for row in (row for scene in bpy.data.scenes for row in scene.fmqm.rows):
        reference, target = row_targets(row)
        if (reference.kind, reference.name) == (before.kind, before.name):
            row.reference_name = after.name
        if target == before:
            row.name = after.name
