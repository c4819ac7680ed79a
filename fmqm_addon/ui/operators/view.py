# SPDX-License-Identifier: GPL-3.0-or-later
"""Buttons that show a result in the 3D view."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import IntProperty

from ...metric.errors import FMQMError
from ..view import heat, kept, shown, units, worst
from ..view.result import look_of
from .polls import allowed, no_samples


class ShowOperator:
    """What the operators have in common: they need the samples of the chosen row, and report why not."""

    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, no_samples(context))

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            self.act(context)
        except FMQMError as reason:
            self.report({"ERROR"}, str(reason))  # type: ignore[attr-defined]
            return {"CANCELLED"}
        return {"FINISHED"}

    def act(self, context: bpy.types.Context) -> None:
        raise NotImplementedError


class FMQM_OT_keep(ShowOperator, bpy.types.Operator):  # noqa: N801 Blender's naming
    bl_idname = "fmqm.keep"
    bl_label = "Keep as Objects"
    bl_description = (
        "Make objects of what is shown, the slice and the shells too, for renders and export: their material glows "
        "in the colors. "
        "Solid shading shows these by Color > Attribute. Clear View removes them"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        look = look_of(context.scene)
        is_off = look.show == heat.OFF and not look.show_slice and not look.show_shells
        why = "Choose Surface or Points first, a slice or shells" if is_off else no_samples(context)
        return allowed(cls, why)

    def act(self, context: bpy.types.Context) -> None:
        kept.keep_as_objects(context.scene)


class FMQM_OT_worst_step(ShowOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.worst_step"
    bl_label = "Next Worst Place"
    bl_description = "Frame the next of the lowest patches and show only it"

    step: IntProperty(name="Step", description="How far along the list", default=1, min=-1000, max=1000)

    @classmethod
    def description(cls, _: bpy.types.Context, properties: Any) -> str:
        which = "next" if properties.step > 0 else "previous" if properties.step < 0 else "chosen one"
        return f"Frame the {which} of the lowest patches and show only it"

    def act(self, context: bpy.types.Context) -> None:
        worst.step_worst(context.scene, context.area, self.step)


class FMQM_OT_worst_all(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.worst_all"
    bl_label = "Show All Patches"
    bl_description = "Show every patch again"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, "" if look_of(context.scene).focused else "All patches are shown")

    def execute(self, context: bpy.types.Context) -> set[str]:
        worst.show_all_patches(context.scene)
        return {"FINISHED"}


class FMQM_OT_shells(ShowOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.shells"
    bl_label = "Show Shells"
    bl_description = "Show the color field (NCF) in five layers of points at growing distances from the surface"

    def act(self, context: bpy.types.Context) -> None:
        look = look_of(context.scene)
        look.show_shells = not look.show_shells


class FMQM_OT_slice(ShowOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.slice"
    bl_label = "Show Slice"
    bl_description = "Show a plane through the original and the LOD on which a field is drawn, or hide it"

    def act(self, context: bpy.types.Context) -> None:
        look = look_of(context.scene)
        look.show_slice = not look.show_slice


class FMQM_OT_unit_step(ShowOperator, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.unit_step"
    bl_label = "Next Sample"
    bl_description = "Show the normal and tangent unit of the next sample"
    bl_options: set[str] = set()

    step: IntProperty(name="Step", description="How many units along", default=1, min=-100_000, max=100_000)

    @classmethod
    def description(cls, _: bpy.types.Context, properties: Any) -> str:
        which = "next" if properties.step > 0 else "previous" if properties.step < 0 else "chosen"
        return f"Show the normal and the tangent unit of the {which} sample that the metric has drawn one for"

    def act(self, context: bpy.types.Context) -> None:
        units.step_unit(context.scene, self.step)


class FMQM_OT_clear(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.clear"
    bl_label = "Clear View"
    bl_description = "Take away the heat map and all objects that were added, and go back to the view before"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, _: bpy.types.Context) -> bool:
        return allowed(cls, "" if shown.anything() else "Nothing is shown")

    def execute(self, _: bpy.types.Context) -> set[str]:
        shown.clear()
        return {"FINISHED"}


CLASSES: tuple[type, ...] = (
    FMQM_OT_keep,
    FMQM_OT_worst_step,
    FMQM_OT_worst_all,
    FMQM_OT_shells,
    FMQM_OT_slice,
    FMQM_OT_unit_step,
    FMQM_OT_clear,
)
