# SPDX-License-Identifier: GPL-3.0-or-later
"""What a material looks like: read, or Unread, to be baked.

Read is what the importers of glTF, FBX, USD and OBJ build and what artists make of it by hand; all else is baked.
"""

from __future__ import annotations

from dataclasses import replace

import bpy

from ...metric.errors import MeshError
from ...metric.texture import ImageFacts, Material
from .expressions import plain_color
from .images import TextureCache, black_warnings
from .node_graph import NotReadError, color_of, node_count, outputs, surface_of, upstream, uses_nodes
from .node_reader import FIRST_ROLES, MaterialReader
from .types import Look, MeshLayer, Reading, Unread

DEFAULT_GREY = 0.8  # linear base color that Blender gives a surface without a material
MOST_NODES = 100_000  # of a material; renderers copy groups as often as they are used


def read_look(material: bpy.types.Material | None, cache: TextureCache, reading: Reading) -> Look | Unread:
    """The look of a material; the same object for the same material of a cache.

    Raises:
        MeshError: a base-color image cannot be read and reading.stand_in is off, an image exceeds the limits, or
            the nodes are too many.
    """
    key = 0 if material is None else material.original.as_pointer()
    if key not in cache.looks:
        cache.looks[key] = _read_look(material, cache, reading)
    found: Look | Unread = cache.looks[key]
    return found


def _read_look(material: bpy.types.Material | None, cache: TextureCache, reading: Reading) -> Look | Unread:
    if reading.texture is not None:
        name = "" if material is None else material.name
        given = Material(name, reading.texture, how="given", uv=0)
        return Look(given, (MeshLayer("uv", ""),), black_warnings("the image that is given", reading.texture.pixels))
    if material is None:
        grey = plain_color((DEFAULT_GREY,) * 3)
        return Look(
            Material("", grey, how="none"), (), notes=("there is no material; Blender's default grey is taken",)
        )
    surface = surface_of(material)
    if surface is None:
        why = "has no shader" if uses_nodes(material) else "does not use nodes"
        why = "is missing from its library" if material.original.is_missing else why
        return plain_look(material, f"material {material.name} {why}; its viewport color is taken")
    if node_count(material.node_tree) > MOST_NODES:
        raise MeshError(
            f"material {material.name} has more than {MOST_NODES:,} nodes, those of groups counted as often as they "
            "are used; simplify it or bake it to an image"
        )
    reader = MaterialReader(material, surface, cache, reading)
    try:
        color, alpha = reader.look()
    except NotReadError as error:
        if reading.bake:
            reader.check_images()
        return Unread(error.node, error.why, used_images(material, cache), *_said(reader))
    uv = next((reader.channel(layer) for layer in reader.layers if layer.kind == "uv"), None)
    made = Material(material.name, color, alpha, "read", used_images(material, cache), uv)
    return Look(made, tuple(reader.layers), *_said(reader))


def _said(reader: MaterialReader) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Warnings and notes, each once."""
    return tuple(dict.fromkeys(reader.warnings)), tuple(dict.fromkeys(reader.notes))


def plain_look(material: bpy.types.Material, warning: str) -> Look:
    """The plain color of a material that cannot be read where baking is forbidden: that of its first shader that has
    one, which shows where nothing is linked to it, else its viewport color."""
    color = material.diffuse_color
    surface = surface_of(material)
    if surface is not None:
        shaders = [node for node, _ in upstream(surface) if any(socket.type == "SHADER" for socket in node.outputs)]
        socket = next((found for found in map(color_of, shaders) if found is not None), None)
        if socket is not None:
            color = socket.default_value
    return Look(Material(material.name, plain_color(color[:3]), how="plain"), (), (warning,))


def used_images(material: bpy.types.Material, cache: TextureCache) -> tuple[ImageFacts, ...]:
    """Every image that the material's output depends on, once, with all roles that it plays."""
    roles: dict[bpy.types.Image, set[str]] = {}
    for start in outputs(material):
        for node, role in upstream(start):
            image = getattr(node, "image", None)
            if isinstance(image, bpy.types.Image):
                roles.setdefault(image, set()).add(role)
    played = [(image, sorted(each, key=lambda role: (_rank(role), role))) for image, each in roles.items()]
    played.sort(key=lambda item: (_rank(item[1][0]), item[1][0]))
    return tuple(replace(cache.facts(image, each[0]), roles=tuple(each)) for image, each in played)


def _rank(role: str) -> int:
    return FIRST_ROLES.index(role) if role in FIRST_ROLES else len(FIRST_ROLES)
