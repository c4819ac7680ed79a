# SPDX-License-Identifier: GPL-3.0-or-later
"""What of the chosen result is shown, and how."""

from __future__ import annotations

from collections.abc import Callable

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    StringProperty,
)

from ...report.visual import layers

Notified = Callable[[bpy.types.Scene, str, bpy.types.Context], None]
on_change: Notified | None = None  # is told the scene and the property's name; view.updates sets it
_LAYER_ITEMS = [(layer.name, layer.label, layer.description) for layer in layers.LAYERS.values()]
_FIELD_ITEMS = [item for item in _LAYER_ITEMS if not layers.LAYERS[item[0]].per_patch]


def notify(name: str) -> Callable[[bpy.types.PropertyGroup, bpy.types.Context], None]:
    """The update function of a property on which what is shown depends."""

    def update(group: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
        if on_change is not None:
            on_change(group.id_data, name, context)

    return update


def _take_view(look: FMQMLook, context: bpy.types.Context) -> None:
    """The slice turns to its axis, or to how the view looks that was clicked in."""
    space = context.space_data
    if look.slice_axis == "VIEW" and space is not None and space.type == "VIEW_3D":
        look.slice_turn = space.region_3d.view_rotation
    notify("slice_place")(look, context)


class FMQMWorstPatch(bpy.types.PropertyGroup):
    """One of the lowest patches of the row that is shown."""

    name: StringProperty(name="Name", description="Number of the patch")
    patch: IntProperty(name="Patch", description="Number of the patch", min=0)
    score: FloatProperty(name="Score", description="The judge's score of the patch", min=0.0, max=1.0)
    blame: StringProperty(name="To Blame", description="Feature that falls furthest below its mean over all patches")
    value: FloatProperty(name="Value", description="That feature in this patch", min=0.0, max=1.0)


class FMQMLook(bpy.types.PropertyGroup):
    """What of the chosen result is shown, and how."""

    show: EnumProperty(
        name="Heat Map",
        description="How the chosen result is drawn over the view. It is no data of the file: it cannot be selected, "
        "rendered, exported or saved, and changes nothing else",
        items=[
            ("OFF", "Off", "The objects look as ever"),
            ("SURFACE", "Surface", "Colors on the original and the LOD themselves, by the nearest patch"),
            ("POINTS", "Points", "The samples as points, for a close look at the fields"),
        ],
        update=notify("show"),
    )
    show_after: BoolProperty(
        name="Show After Measuring", description="When a measurement ends, the heat map appears", default=True
    )
    layer: EnumProperty(name="Color By", description="What the colors mean", items=_LAYER_ITEMS, update=notify("layer"))
    range: EnumProperty(
        name="Range",
        description="Which values the ends of the color map stand for",
        items=[
            ("FITTED", "Fitted", "Scores from their 5th percentile over all results to 1; other values as they occur"),
            ("CUSTOM", "Custom", "Ends of your own for scores; drag them in the legend"),
            ("FIXED", "Fixed", "0 to 1 for scores and colors; 1 or 2 % of the original's size for distances"),
        ],
        update=notify("range"),
    )
    low: FloatProperty(
        name="Low", description="Score at the hot end", default=0.5, min=0.0, max=0.999, step=1, precision=3,
        update=notify("range"),
    )  # fmt: skip
    high: FloatProperty(
        name="High", description="Score at the dark end", default=1.0, min=0.001, max=1.0, step=1, precision=3,
        update=notify("range"),
    )  # fmt: skip
    only_below: BoolProperty(
        name="Only Below", description="Show only patches with a lower score", default=False, update=notify("show")
    )
    below: FloatProperty(
        name="Below", description="Patches above this score are not shown", default=0.8, min=0.0, max=1.0, step=1,
        precision=3, update=notify("show"),
    )  # fmt: skip
    place: EnumProperty(
        name="Show On",
        description="Where the heat map is shown",
        items=[
            ("BOTH", "Both", "On the original and on the LOD"),
            ("REFERENCE", "Original", "On the original"),
            ("COMPARED", "LOD", "On the LOD"),
        ],
        update=notify("place"),
    )
    point_size: FloatProperty(
        name="Point Size",
        description="Radius of a point, by the radius at which neighbors just touch",
        default=1.0, min=0.05, max=10.0, soft_min=0.2, soft_max=3.0, step=5, precision=2, subtype="FACTOR",
        update=notify("point_size"),
    )  # fmt: skip
    worst: CollectionProperty(name="Worst Places", description="The patches of the lowest scores", type=FMQMWorstPatch)
    worst_index: IntProperty(
        name="Worst Place",
        description="Frames this patch and shows only it",
        min=0,
        update=notify("worst_index"),
    )
    worst_uid: StringProperty(name="Row", description="Which result the worst places belong to")
    focused: BoolProperty(name="One Patch Only", description="Only one patch is shown", default=False)
    show_shells: BoolProperty(
        name="Shells", description="The shells are drawn over the view", default=False, update=notify("shells")
    )
    shell_field: EnumProperty(
        name="Surface",
        description="Whose colors the shells show",
        update=notify("shells"),
        items=[
            ("REFERENCE", "Original", "Colors of the original around it"),
            ("COMPARED", "LOD", "Colors of the LOD around it"),
        ],
    )
    shell_layout: EnumProperty(
        name="Layout",
        description="How the five shells are arranged",
        update=notify("shells"),
        items=[
            ("PEELED", "Peeled", "Around the surface, each one ending before the one below it"),
            ("ROW", "In a Row", "Side by side, as in the paper's figure"),
        ],
    )
    shell_distance: FloatProperty(
        name="Distance",
        description="Between two shells, in percent of the original's size",
        default=2.0, min=0.001, max=100.0, soft_max=10.0, step=10, precision=2, subtype="PERCENTAGE",
        update=notify("shells"),
    )  # fmt: skip
    shell_points: IntProperty(
        name="Points", description="Points of each shell", default=30_000, min=100, max=2_000_000, soft_max=200_000,
        update=notify("shells"),
    )  # fmt: skip
    unit_sample: IntProperty(name="Sample", description="The sample whose units are shown", default=0, min=0)
    show_slice: BoolProperty(
        name="Slice", description="The slice is drawn over the view", default=False, update=notify("slice")
    )
    slice_layer: EnumProperty(
        name="Field", description="What is drawn on the slice", items=_FIELD_ITEMS, update=notify("slice")
    )
    slice_axis: EnumProperty(
        name="Across",
        description="What the slice stands across",
        items=[
            ("X", "X", "Across the X axis: seen from the right"),
            ("Y", "Y", "Across the Y axis: seen from the front"),
            ("Z", "Z", "Across the Z axis: seen from above"),
            ("VIEW", "View", "Across the view as it is when this is clicked"),
        ],
        default="Y",
        update=_take_view,
    )
    slice_offset: FloatProperty(
        name="Offset",
        description="From the middle of the original to its ends; the arrow in the view drags it too",
        default=0.0, min=-100.0, max=100.0, step=100, precision=1, subtype="PERCENTAGE",
        update=notify("slice_place"),
    )  # fmt: skip
    slice_turn: FloatVectorProperty(
        name="Turn", description="How the view was turned", size=4, default=(1, 0, 0, 0), subtype="QUATERNION"
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
        update=notify("slice"),
    )


CLASSES = (FMQMWorstPatch, FMQMLook)
