# SPDX-License-Identifier: GPL-3.0-or-later
"""What objects show once Blender has evaluated them: their own surfaces and their instances."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from ...metric.geometry import Floats
from .members import hidden_when_instanced, instanced, metaball_family
from .render_levels import OWN_DATA, differs_in_renders, set_render_levels


@dataclass(frozen=True)
class Evaluated:
    """An object and its evaluated counterpart, in the depsgraph that this belongs to."""

    original: bpy.types.Object
    object: bpy.types.Object
    depsgraph: bpy.types.Depsgraph


@dataclass(frozen=True)
class Shown:
    """A mesh somewhere in the world.

    Attributes:
        owner: the object that shows it.
        object: evaluated, of type MESH; may be temporary, and gone when the next one is asked for.
        matrix: (4, 4) float64, to the world.
        instance: not the owner's own surface. particle: of a particle system.
    """

    owner: Evaluated
    object: bpy.types.Object
    matrix: Floats
    instance: bool
    particle: bool

    @property
    def made(self) -> bool:
        """Whether it is an instance of a mesh that is no object's own: modifiers made it, or the owner is no mesh."""
        return self.instance and self.object.original == self.owner.object.original

    @property
    def edited(self) -> bool:
        """Whether it is in edit mode, as a mesh of its own."""
        return self.object.mode == "EDIT" and self.object.original.type == "MESH" and not self.made

    @property
    def name(self) -> str:
        """Its name as the user knows it: the owner may be evaluated by way of a duplicate."""
        own = self.object.original == self.owner.object.original
        return self.owner.original.name if own else self.object.name


@contextmanager
def evaluated(objects: Sequence[bpy.types.Object]) -> Iterator[list[Evaluated]]:
    """The evaluated counterparts of objects, in their order, as renders show them.

    Objects that the view layer leaves out (excluded collection, disabled or hidden in viewports) show nothing
    there, and Blender gives Python no evaluation for renders; these, and objects that renders show otherwise, are
    evaluated as temporary duplicates in a temporary scene.
    """
    for object_ in objects:
        if object_.mode == "EDIT":
            object_.update_from_editmode()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    depsgraph.update()
    found = [Evaluated(object_, object_.evaluated_get(depsgraph), depsgraph) for object_ in objects]
    now = bpy.context.scene
    absent = [index for index, each in enumerate(found) if not _is_there(each) or differs_in_renders(each.original)]
    if not absent:
        yield found
        return
    scene = bpy.data.scenes.new("FMQM evaluation")
    scene.render.use_simplify = now.render.use_simplify
    scene.render.simplify_subdivision = now.render.simplify_subdivision_render
    made: list[bpy.types.Object] = []
    try:
        scene.frame_current, scene.frame_subframe = now.frame_current, now.frame_subframe
        duplicates = {index: _duplicate(found[index].original, scene, made) for index in absent}
        set_render_levels(made)
        view_layer = scene.view_layers[0]
        view_layer.update()
        aside = view_layer.depsgraph
        yield [
            Evaluated(each.original, duplicates[index].evaluated_get(aside), aside) if index in duplicates else each
            for index, each in enumerate(found)
        ]
    finally:
        own = {each.data for each in made if each.data is not None and each.data.name.startswith(OWN_DATA)}
        for duplicate in made:
            bpy.data.objects.remove(duplicate)
        bpy.data.batch_remove(own)
        bpy.data.scenes.remove(scene)


def shown(objects: Sequence[Evaluated]) -> Iterator[Shown]:
    """The meshes that objects show: Blender lists curves, texts and metaballs as instances of the meshes made of them.

    What renders do not show of an instanced collection is left out, as is an instancer that is not shown itself.
    """
    for depsgraph in dict.fromkeys(each.depsgraph for each in objects):
        owners = {each.object.original.as_pointer(): each for each in objects if each.depsgraph == depsgraph}
        collections = {address: instanced(each.original) for address, each in owners.items()}
        hidden = {
            collection: frozenset() if collection is None else hidden_when_instanced(collection)
            for collection in set(collections.values())
        }
        for entry in depsgraph.object_instances:
            if entry.object.type != "MESH":
                continue
            address = (entry.parent if entry.is_instance else entry.object).original.as_pointer()
            owner = owners.get(address)
            if owner is None:
                continue
            if entry.is_instance:
                if entry.object.original.as_pointer() in hidden[collections[address]]:
                    continue
            elif entry.object.is_instancer and not entry.object.show_instancer_for_render:
                continue
            yield Shown(
                owner,
                entry.object,
                np.array(entry.matrix_world, np.float64),
                entry.is_instance,
                entry.particle_system is not None,
            )


def _is_there(each: Evaluated) -> bool:
    return each.object.is_evaluated and each.original.visible_get()


def _duplicate(object_: bpy.types.Object, scene: bpy.types.Scene, made: list[bpy.types.Object]) -> bpy.types.Object:
    """A visible duplicate in the scene, with what shapes it there; all of them are added to made."""

    def copy(of: bpy.types.Object) -> bpy.types.Object:
        made.append(of.copy())
        made[-1].hide_viewport = False
        scene.collection.objects.link(made[-1])
        return made[-1]

    duplicate = copy(object_)
    if object_.type == "META":  # metaballs flow together by name; a name of their own keeps others out
        family = [other for other in metaball_family(object_) if other != object_]
        for number, ball in enumerate([duplicate, *(copy(other) for other in family)]):
            ball.name = f"FMQM metaball.{number:03d}"
    if object_.instance_type in {"VERTS", "FACES"}:  # it instances its children
        for child in object_.children:
            copy(child).parent = duplicate
    return duplicate
