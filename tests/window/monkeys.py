# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scripts that run in Blender's window measure."""

from __future__ import annotations

import bpy
import numpy as np


def texture() -> bpy.types.Material:
    image = bpy.data.images.new("Checks", 64, 64)
    pixels = np.ones((64, 64, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(0).random((8, 8, 3)).repeat(8, axis=0).repeat(8, axis=1)
    image.pixels.foreach_set(pixels.ravel())
    material = bpy.data.materials.new("Checks")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    node = nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    links.new(node.outputs["Color"], shader.inputs["Base Color"])
    return material


def build(samples: int, patches: int) -> None:
    """To be compared: a monkey, and beside it the same one of which the left half has lost many of its triangles."""
    for object_ in [o for o in bpy.data.objects if o.type == "MESH"]:
        bpy.data.objects.remove(object_)
    material = texture()
    objects = []
    for name, x in (("Monkey_LOD0", 0.0), ("Monkey_LOD1", 2.6)):
        bpy.ops.mesh.primitive_monkey_add(location=(x, 0, 0))
        object_ = bpy.context.object
        object_.name = name
        object_.data.materials.append(material)
        object_.modifiers.new("Fine", "SUBSURF").levels = 2
        objects.append(object_)
    left = objects[1].vertex_groups.new(name="Left")
    left.add([v.index for v in objects[1].data.vertices if v.co.x < 0], 1.0, "REPLACE")
    decimate = objects[1].modifiers.new("Coarse", "DECIMATE")
    decimate.ratio, decimate.vertex_group = 0.55, "Left"
    bpy.ops.mesh.primitive_cube_add(location=(5.2, 0, 0))
    fmqm = bpy.context.scene.fmqm
    fmqm.reference = objects[0]
    fmqm.compared.add().object = objects[1]
    fmqm.settings.samples, fmqm.settings.patches = samples, patches
