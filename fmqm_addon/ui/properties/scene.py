# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene.fmqm: all that the add-on keeps in a file, in one place."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    IntProperty,
    PointerProperty,
)

from ...comparison.judge import Judge
from .decimate import FMQMChain, FMQMDecimate
from .items import FMQMItem, can_be_picked
from .rows import FMQMRow
from .settings import FMQMSettings
from .sizes import FMQMSizes
from .view import FMQMLook, notify


class FMQMScene(bpy.types.PropertyGroup):
    """Inputs, settings, results and the look of them."""

    reference_kind: EnumProperty(
        name="Original Kind",
        description="What the original is",
        items=[
            ("OBJECT", "Object", "An object with a surface, or an empty with all below it", "OBJECT_DATA", 0),
            ("COLLECTION", "Collection", "All objects of a collection", "OUTLINER_COLLECTION", 1),
        ],
    )
    reference: PointerProperty(
        name="Original",
        description="The finest version. An empty stands for all below it",
        type=bpy.types.Object,
        poll=can_be_picked,
    )
    reference_collection: PointerProperty(
        name="Original Collection",
        description="The finest version: all objects of the collection as one",
        type=bpy.types.Collection,
    )
    bare_reference: BoolProperty(
        name="Without Modifiers",
        description="The original is its mesh without modifiers. With the same object in the list, "
        "this shows what its modifiers do",
        default=False,
    )
    compared: CollectionProperty(name="LODs", description="What is scored against the original", type=FMQMItem)
    compared_index: IntProperty(name="Active LOD", description="Chosen row of the list", default=0, min=0)
    settings: PointerProperty(name="Settings", description="How it is measured", type=FMQMSettings)
    rows: CollectionProperty(name="Results", description="One row per LOD", type=FMQMRow)
    row_index: IntProperty(
        name="Active Result", description="Chosen row of the results", default=0, min=0, update=notify("row_index")
    )
    judge: EnumProperty(
        name="Judge",
        description="Which of the two readings decides: shown in the list, sorted by, aimed at, and the worst places",
        items=[
            ("FMQM", "FMQM", "The paper's number"),
            ("PERCEIVED", "Perceived", "The second reading: whether people would see the difference"),
        ],
        update=notify("judge"),
    )
    sizes: PointerProperty(name="Screen Sizes", description="The engine that sizes on screen are for", type=FMQMSizes)
    look: PointerProperty(name="Look", description="What of the chosen result is shown", type=FMQMLook)
    chain: PointerProperty(name="LOD Chain", description="The LODs that are made of an object", type=FMQMChain)
    decimate: PointerProperty(
        name="Decimate", description="Search for the fewest triangles that are good enough", type=FMQMDecimate
    )


CLASSES = (FMQMScene,)


assert [Judge[item] for item in ("FMQM", "PERCEIVED")] == list(Judge)


def register() -> None:
    bpy.types.Scene.fmqm = PointerProperty(name="FMQM", description="Mesh quality", type=FMQMScene)


def unregister() -> None:
    del bpy.types.Scene.fmqm
