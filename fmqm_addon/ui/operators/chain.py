# SPDX-License-Identifier: GPL-3.0-or-later
"""LOD Chain: versions of the active object, each as cheap as its quality allows."""

from __future__ import annotations

import bpy

from ...blender.materials.types import Reading
from ...blender.scene.lod_names import lod_of_name, without_level_0
from ...blender.scene.versions import FoundVersions
from ...comparison.decimation import DecimationGoal
from ...comparison.judge import Judge
from ...comparison.pair import PairOptions
from ...metric.errors import SettingsError
from .. import stale
from ..properties.settings import plain
from ..versions import Search, VersionsOperator, hide


class FMQM_OT_lod_chain(VersionsOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.lod_chain"
    bl_label = "Make LOD Chain"
    bl_description = (
        "Copy the active object once for each quality, as _LOD1, _LOD2 and so on, with live Decimate modifiers as "
        "strong as the quality allows; the copies are measured, and hidden behind the original. Esc cancels"
    )
    noun = "LOD Chain"

    def asked(self, context: bpy.types.Context, _: PairOptions, __: Reading) -> Search:
        fmqm, active = context.scene.fmqm, context.active_object
        qualities = tuple(map(plain, fmqm.chain.qualities))[: fmqm.chain.levels]
        for level, (one, next_one) in enumerate(zip(qualities, qualities[1:], strict=False), 1):
            if next_one >= one:
                raise SettingsError(f"LOD{level + 1} is to score {next_one:g} and LOD{level} {one:g}; let them fall")
        base, suffixes = without_level_0(active.name), tuple(f"_LOD{level + 1}" for level in range(len(qualities)))
        told = lod_of_name(base)
        if told is not None and told.sure:
            raise SettingsError(f"{active.name}: by its name it is a level of a chain; rename it, or choose the finest")
        called = f"{base}_LOD0" if fmqm.chain.name_original and base == active.name else active.name
        if called != active.name and active.library is not None:
            raise SettingsError(f"{active.name}: it is linked from another file and keeps its name")
        stale.forget_deleted(context.scene)
        wanted = {base + suffix for suffix in suffixes} | ({called} - {active.name})
        for taken in (bpy.data.objects[name] for name in sorted(wanted) if name in bpy.data.objects):
            if taken.users_scene:
                raise SettingsError(f"{taken.name}: there is such an object; delete or rename it first")
            taken.name = f"{taken.name} (deleted)"
        return Search(DecimationGoal(qualities, judge=Judge[fmqm.judge]), base, suffixes, called)

    def keep(
        self, context: bpy.types.Context, scene: bpy.types.Scene, original: bpy.types.Object, found: FoundVersions
    ) -> set[str]:
        """The LODs and their rows, in one undo step."""
        made = self.make(context, scene, original, found)
        hidden = hide(context, made, original)
        counts = ", ".join(f"{each.outcome.triangles:,}" for each in found.versions)
        names = made[0].name if len(made) == 1 else f"{made[0].name} to {made[-1].name}"
        told = f"{names}: {counts} of {found.result.triangles:,} triangles{hidden}"
        whole = [
            f"{object_.name} has all of them, as fewer miss {each.searched.last.target:g}"
            for object_, each in zip(made, found.versions, strict=True)
            if each.version.ratio == 1
        ]
        self.report({"WARNING" if whole else "INFO"}, ". ".join([told, *whole]))
        return {"FINISHED"}


CLASSES = (FMQM_OT_lod_chain,)
