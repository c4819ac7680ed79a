# SPDX-License-Identifier: GPL-3.0-or-later
"""Images that shape meshes: of modifiers' textures and Geometry Nodes. Where one has no pixels, Blender goes on
without it and says nothing."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Iterable

import bpy

from ...metric.errors import MeshError
from ..materials.image_files import image_header, image_path, reserve

# The ways from an object to what it is made of; not to its looks.
_FOLLOWED = (
    bpy.types.Object,
    bpy.types.Collection,
    bpy.types.GeometryNodeTree,
    bpy.types.Texture,
    bpy.types.TextureNodeTree,
    bpy.types.ParticleSettings,
)


def shaping_images(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Image]:
    """The images that modifiers and particles of objects depend on, and those of the objects that these depend on."""
    if not bpy.data.images:
        return []
    used: dict[bpy.types.ID, list[bpy.types.ID]] = defaultdict(list)
    for block, users in bpy.data.user_map().items():
        for user in users:
            if isinstance(user, _FOLLOWED) and getattr(user, "data", None) != block:
                used[user].append(block)
    waiting = [
        each for each in objects if any(modifier.show_viewport or modifier.show_render for modifier in each.modifiers)
    ]
    seen = set(waiting)
    while waiting:
        for block in used[waiting.pop()]:
            if block not in seen:
                seen.add(block)
                waiting.append(block)
    return sorted((each for each in seen if isinstance(each, bpy.types.Image)), key=lambda image: image.name_full)


def check_shaping_images(objects: Iterable[bpy.types.Object]) -> None:
    """What shapes a mesh must be there.

    Raises:
        MeshError: an image is missing, broken or was not decoded for lack of memory.
    """
    for image in shaping_images(objects):
        if image.source in {"SEQUENCE", "MOVIE"}:  # of which Blender tells no size
            there = image.packed_file is not None or os.path.isfile(image_path(image))
        else:
            there = bool(image.size[0]) or image.type == "MULTILAYER"
        if not there and image.source != "VIEWER":
            raise MeshError(
                f"{image_path(image) or image.name}: the image, which a modifier or Geometry Nodes read, is missing or "
                "could not be decoded; repair it"
            )


def check_memory(objects: Iterable[bpy.types.Object]) -> None:
    """There must be room for what shapes meshes, which Blender decodes to bytes and then to floats.

    Raises:
        MeshError: there is not.
    """
    headers = [image_header(image) for image in shaping_images(objects) if not image.has_data]
    total = sum(header.decoded + 16 * header.width * header.height for header in headers if header is not None)
    reserve(total, "the images that modifiers and Geometry Nodes read")
