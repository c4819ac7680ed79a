# SPDX-License-Identifier: GPL-3.0-or-later
"""The sub-panels that show a result in the scene: Look, Worst Places, NCF Debugging. What they do is in show.py."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)

from ...blender.display import scene_objects
from ...metric.errors import FMQMError
from ...report.visual import layers
from .. import session
from ..properties import settings as properties
from ..view import cloud as show
from ..view import overlay

PARENT = "FMQM_PT_main"
_REACH = 14  # pixels around the mouse in which a sample is picked
_SLICE_REST = 0.12  # seconds after which a moved slice is drawn again
_STATUS = "Click: Choose Sample    Esc, Right Click: Finish"

_LAYER_ITEMS = [(layer.name, layer.label, layer.description) for layer in layers.LAYERS.values()]
_FIELD_ITEMS = [item for item in _LAYER_ITEMS if not layers.LAYERS[item[0]].per_patch]


def _recolor(look: FMQMLook, _: bpy.types.Context) -> None:
    show.recolor_cloud(look.id_data)
    show.recolor_painted(look.id_data)


def _rerange(look: FMQMLook, context: bpy.types.Context) -> None:
    _recolor(look, context)
    _draw_slice(look, context)


def _draw_slice(look: FMQMLook, _: bpy.types.Context) -> None:
    _quietly(lambda: show.draw_slice(look.id_data))


def _rebuild_slice(look: FMQMLook, _: bpy.types.Context) -> None:
    if scene_objects.find_object(look.id_data, scene_objects.SLICE) is not None:
        _quietly(lambda: show.show_slice(look.id_data))


def _resize(look: FMQMLook, _: bpy.types.Context) -> None:
    show.resize_cloud(look.id_data)


def _move(look: FMQMLook, _: bpy.types.Context) -> None:
    _quietly(lambda: show.move_shown(look.id_data))


def _focus(look: FMQMLook, context: bpy.types.Context) -> None:
    if not show.choosing:
        _quietly(lambda: show.focus_patch(look.id_data, context.area))


def _quietly(act: Callable[[], object]) -> None:
    """A changed property has nowhere to say that the samples are gone; the panel does."""
    with suppress(FMQMError):
        act()


class FMQMWorstPatch(bpy.types.PropertyGroup):
    """One of the lowest patches of the row that is shown."""

    name: StringProperty(name="Name", description="Number of the patch")
    patch: IntProperty(name="Patch", description="Number of the patch", min=0)
    score: FloatProperty(name="FMQM", description="Score of the patch", min=0.0, max=1.0)
    blame: StringProperty(name="To Blame", description="Feature that falls furthest below its mean over all patches")
    value: FloatProperty(name="Value", description="That feature in this patch", min=0.0, max=1.0)


class FMQMLook(bpy.types.PropertyGroup):
    """What of the chosen result is shown, and how."""

    layer: EnumProperty(
        name="Color By", description="What the colors of the points mean", items=_LAYER_ITEMS, update=_recolor
    )
    range: EnumProperty(
        name="Range",
        description="Which values the ends of the color map stand for",
        items=[
            ("FIXED", "Fixed", "0 to 1 for scores and colors; 1 or 2 % of the reference's size for distances"),
            ("FITTED", "Fitted", "The values that occur, so that small differences show"),
        ],
        update=_rerange,
    )
    place: EnumProperty(
        name="Place",
        description="Where the points are shown",
        items=[
            ("REFERENCE", "Reference", "Where the reference stands"),
            ("COMPARED", "Compared", "Where the compared object stands"),
        ],
        update=_move,
    )
    point_size: FloatProperty(
        name="Point Size",
        description="Radius of a point, by the radius at which neighbors just touch",
        default=1.0, min=0.05, max=10.0, soft_min=0.2, soft_max=3.0, step=5, precision=2, subtype="FACTOR",
        update=_resize,
    )  # fmt: skip
    worst: CollectionProperty(name="Worst Places", description="The patches of the lowest FMQM", type=FMQMWorstPatch)
    worst_index: IntProperty(
        name="Worst Place", description="Frames this patch and shows only its points", min=0, update=_focus
    )
    worst_uid: StringProperty(name="Row", description="Which result the worst places belong to")
    focused: BoolProperty(name="One Patch Only", description="Only one patch is shown", default=False)
    shell_field: EnumProperty(
        name="Surface",
        description="Whose colors the shells show",
        items=[
            ("REFERENCE", "Reference", "Colors of the reference around it"),
            ("COMPARED", "Compared", "Colors of the compared object around it"),
        ],
    )
    shell_layout: EnumProperty(
        name="Layout",
        description="How the five shells are arranged",
        items=[
            ("PEELED", "Peeled", "Around the surface, each one ending before the one below it"),
            ("ROW", "In a Row", "Side by side, as in the paper's figure"),
        ],
    )
    shell_distance: FloatProperty(
        name="Distance",
        description="Between two shells, in percent of the reference's size",
        default=2.0, min=0.001, max=100.0, soft_max=10.0, step=10, precision=2, subtype="PERCENTAGE",
    )  # fmt: skip
    shell_points: IntProperty(
        name="Points", description="Points of each shell", default=30_000, min=100, max=2_000_000, soft_max=200_000
    )
    unit_sample: IntProperty(name="Sample", description="The sample whose units are shown", default=0, min=0)
    slice_layer: EnumProperty(
        name="Field", description="What is drawn on the slice", items=_FIELD_ITEMS, update=_draw_slice
    )
    slice_resolution: EnumProperty(
        name="Resolution",
        description="Pixels along each side of the slice",
        items=[
            ("128", "128", "Quick"),
            ("192", "192", "Between the two"),
            ("256", "256", "Fine"),
            ("512", "512", "Very fine; slow to move"),
        ],
        default="128",
        update=_rebuild_slice,
    )


# --- Operators


def _has_samples(cls: type, context: bpy.types.Context) -> bool:
    try:
        show.measured_row(context.scene)
    except FMQMError as reason:
        text = str(reason)
        cls.poll_message_set(text[:1].upper() + text[1:])  # type: ignore[attr-defined]
        return False
    return True


class _Shows:
    """What the operators have in common: they need the samples of the chosen row, and report why not."""

    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return _has_samples(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        try:
            self.act(context)
        except FMQMError as reason:
            self.report({"ERROR"}, str(reason))  # type: ignore[attr-defined]
            return {"CANCELLED"}
        return {"FINISHED"}

    def act(self, context: bpy.types.Context) -> None:
        raise NotImplementedError


class FMQM_OT_look(_Shows, bpy.types.Operator):  # noqa: N801 Blender's naming
    bl_idname = "fmqm.look"
    bl_label = "Show Points"
    bl_description = "Show the samples of the chosen result as a cloud of colored points"

    def act(self, context: bpy.types.Context) -> None:
        show.show_cloud(context.scene)


class FMQM_OT_paint_surface(_Shows, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.paint_surface"
    bl_label = "Paint Surface"
    bl_description = "Paint the same values on a copy of the reference's surface, smooth between patches"

    def act(self, context: bpy.types.Context) -> None:
        show.paint_surface(context.scene)


class FMQM_OT_worst_step(_Shows, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.worst_step"
    bl_label = "Next Worst Place"
    bl_description = "Frame the next of the lowest patches and show only its points"

    step: IntProperty(name="Step", description="How far along the list", default=1, min=-1000, max=1000)

    @classmethod
    def description(cls, _: bpy.types.Context, properties: Any) -> str:
        which = "next" if properties.step > 0 else "previous" if properties.step < 0 else "chosen one"
        return f"Frame the {which} of the lowest patches and show only its points"

    def act(self, context: bpy.types.Context) -> None:
        look = show.look_of(context.scene)
        uid, _, _ = show.measured_row(context.scene)
        if look.worst_uid != uid or scene_objects.find_object(context.scene, scene_objects.CLOUD) is None:
            show.show_cloud(context.scene)
        if look.focused and look.worst:  # the first press shows the worst one
            show.choose_worst(look, (look.worst_index + self.step) % len(look.worst))
        show.focus_patch(context.scene, context.area)


class FMQM_OT_worst_all(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.worst_all"
    bl_label = "Show All Patches"
    bl_description = "Show the points of every patch again"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not show.look_of(context.scene).focused:
            cls.poll_message_set("All patches are shown")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        show.show_all_patches(context.scene)
        return {"FINISHED"}


class FMQM_OT_shells(_Shows, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.shells"
    bl_label = "Show Shells"
    bl_description = "Show the color field (NCF) in five layers of points at growing distances from the surface"

    def act(self, context: bpy.types.Context) -> None:
        show.show_shells(context.scene)


class FMQM_OT_slice(_Shows, bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.slice"
    bl_label = "Show Slice"
    bl_description = "Add a plane on which the fields are drawn; move, turn or scale it and it is drawn again"

    def act(self, context: bpy.types.Context) -> None:
        show.show_slice(context.scene)


class FMQM_OT_unit_step(_Shows, bpy.types.Operator):  # noqa: N801
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
        show.step_unit(context.scene, self.step)


class FMQM_OT_unit_pick(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.unit_pick"
    bl_label = "Pick Sample"
    bl_description = "Click on points in the view to see the normal and the tangent unit of the sample there"
    bl_options: set[str] = set()

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.area is None or context.area.type != "VIEW_3D":
            cls.poll_message_set("Needs a 3D viewport")
            return False
        return _has_samples(cls, context)

    def invoke(self, context: bpy.types.Context, _: bpy.types.Event) -> set[str]:
        self._area = context.area
        if scene_objects.find_object(context.scene, scene_objects.CLOUD) is None:
            show.show_cloud(context.scene)
        context.window.cursor_modal_set("CROSSHAIR")
        context.workspace.status_text_set(_STATUS)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        self.report({"ERROR"}, "Picking needs the mouse; use Next Sample")
        return {"CANCELLED"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type in {"ESC", "RIGHTMOUSE", "RET"}:
            return self._finish(context)
        if event.type != "LEFTMOUSE" or event.value != "PRESS":
            return {"PASS_THROUGH"}
        region = next((r for r in self._area.regions if r.type == "WINDOW"), None)
        if region is None or not _holds(self._area, region, event):
            return {"PASS_THROUGH"}  # buttons go on working
        at = (event.mouse_x - region.x, event.mouse_y - region.y)
        reach = _REACH * context.preferences.system.ui_scale
        try:
            view = self._area.spaces.active.region_3d
            sample = show.nearest_sample(context.scene, region, view, at, reach)
            if sample is not None:
                show.show_unit(context.scene, sample)
        except FMQMError as reason:  # the row was cleared meanwhile
            self.report({"WARNING"}, str(reason))
            return self._finish(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context: bpy.types.Context) -> None:
        self._finish(context)

    def _finish(self, context: bpy.types.Context) -> set[str]:
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        return {"FINISHED"}


def _holds(area: bpy.types.Area, window: bpy.types.Region, event: bpy.types.Event) -> bool:
    """Whether the mouse is in the view and not over a toolbar or the sidebar."""

    def within(region: bpy.types.Region) -> bool:
        return (
            region.x <= event.mouse_x < region.x + region.width and region.y <= event.mouse_y < region.y + region.height
        )

    others = (region for region in area.regions if region != window and region.width > 1 and region.height > 1)
    return within(window) and not any(within(region) for region in others)


class FMQM_OT_clear(bpy.types.Operator):  # noqa: N801
    bl_idname = "fmqm.clear"
    bl_label = "Clear View"
    bl_description = "Remove all points, surfaces and slices that were added, and restore the views' colors"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, _: bpy.types.Context) -> bool:
        if not show.anything():
            cls.poll_message_set("Nothing is shown")
            return False
        return True

    def execute(self, _: bpy.types.Context) -> set[str]:
        show.clear()
        return {"FINISHED"}


# --- Panels


class _SubPanel:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "FMQM"
    bl_parent_id = PARENT


class FMQM_UL_worst(bpy.types.UIList):  # noqa: N801
    def draw_item(  # Blender counts the arguments
        self, _context: Any, layout: Any, _data: Any, item: Any, _icon: int, _active: Any, _property: str
    ) -> None:
        split = layout.split(factor=0.24)
        split.label(text=f"{item.score:.3f}")
        split = split.split(factor=0.72)
        split.label(text=item.blame)
        split.label(text=f"#{item.patch}")

    def draw_filter(self, _context: bpy.types.Context, _layout: Any) -> None:
        """Twenty rows in their order need no filter."""


class FMQM_PT_look(_SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_look"
    bl_label = "Look"
    bl_order = 3

    def draw(self, context: bpy.types.Context) -> None:
        layout, look = self.layout, show.look_of(context.scene)
        layout.use_property_split, layout.use_property_decorate = True, False
        _say_if_gone(layout, context)
        column = layout.column()
        column.prop(look, "layer")
        column.row().prop(look, "range", expand=True)
        column.row().prop(look, "place", expand=True)
        column.prop(look, "point_size", slider=True)
        column = layout.column(align=True)
        column.operator(FMQM_OT_look.bl_idname, icon="POINTCLOUD_DATA")
        column.operator(FMQM_OT_paint_surface.bl_idname, icon="BRUSH_DATA")
        layout.operator(FMQM_OT_clear.bl_idname, icon="TRASH")


class FMQM_PT_worst(_SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_worst"
    bl_label = "Worst Places"
    bl_order = 4

    def draw(self, context: bpy.types.Context) -> None:
        layout, look = self.layout, show.look_of(context.scene)
        if len(look.worst):
            layout.template_list("FMQM_UL_worst", "", look, "worst", look, "worst_index", rows=4, maxrows=8)
        row = layout.row(align=True)
        row.operator(FMQM_OT_worst_step.bl_idname, text="Previous", icon="TRIA_LEFT").step = -1
        row.operator(FMQM_OT_worst_step.bl_idname, text="Next", icon="TRIA_RIGHT").step = 1
        layout.operator(FMQM_OT_worst_all.bl_idname)


class FMQM_PT_ncf(_SubPanel, bpy.types.Panel):  # noqa: N801
    bl_idname = "FMQM_PT_ncf"
    bl_label = "NCF Debugging"
    bl_order = 5
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, look = self.layout, show.look_of(context.scene)
        layout.use_property_split, layout.use_property_decorate = True, False
        column = layout.column(align=True)
        column.label(text="Units of One Sample")
        column.operator(FMQM_OT_unit_pick.bl_idname, icon="EYEDROPPER")
        row = column.row(align=True)
        row.operator(FMQM_OT_unit_step.bl_idname, text="Previous", icon="TRIA_LEFT").step = -1
        row.operator(FMQM_OT_unit_step.bl_idname, text="Next", icon="TRIA_RIGHT").step = 1
        column = layout.column()
        column.label(text="Slice")
        column.prop(look, "slice_layer")
        column.prop(look, "slice_resolution")
        column.operator(FMQM_OT_slice.bl_idname, icon="MESH_PLANE")
        column = layout.column()
        column.label(text="Shells")
        column.row().prop(look, "shell_field", expand=True)
        column.row().prop(look, "shell_layout", expand=True)
        column.prop(look, "shell_distance")
        column.prop(look, "shell_points")
        column.operator(FMQM_OT_shells.bl_idname, icon="MOD_THICKNESS")


def _say_if_gone(layout: Any, context: bpy.types.Context) -> None:
    row = properties.active_row(context.scene)
    if row is not None and not row.error and session.get(row.uid) is None:
        layout.label(text="Samples are gone: Measure Again", icon="INFO")


# The groups come first: other modules' groups hold them. The parent panel is registered before these.
CLASSES: tuple[type, ...] = (
    FMQMWorstPatch,
    FMQMLook,
    FMQM_OT_look,
    FMQM_OT_paint_surface,
    FMQM_OT_worst_step,
    FMQM_OT_worst_all,
    FMQM_OT_shells,
    FMQM_OT_slice,
    FMQM_OT_unit_step,
    FMQM_OT_unit_pick,
    FMQM_OT_clear,
    FMQM_UL_worst,
    FMQM_PT_look,
    FMQM_PT_worst,
    FMQM_PT_ncf,
)


def row_chosen(scene: bpy.types.Scene) -> None:
    """For the results list: what is shown becomes that of the row just chosen or measured."""
    _quietly(lambda: show.follow_row(scene))


def _watch_slice() -> None:
    """Called at each drawing of a view; the work waits for a timer, outside of the drawing."""
    if show.slice_has_moved(bpy.context.scene) and not bpy.app.timers.is_registered(_redraw_slice):
        bpy.app.timers.register(_redraw_slice, first_interval=_SLICE_REST)


def _redraw_slice() -> None:
    for scene in bpy.data.scenes:
        if show.slice_has_moved(scene):
            _quietly(partial(show.draw_slice, scene))


def register() -> None:
    overlay.register()
    overlay.on_draw = _watch_slice


def unregister() -> None:
    show.clear()  # nothing could take it away later
    overlay.on_draw = None
    overlay.unregister()
    if bpy.app.timers.is_registered(_redraw_slice):
        bpy.app.timers.unregister(_redraw_slice)
