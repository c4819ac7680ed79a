# SPDX-License-Identifier: GPL-3.0-or-later
"""The images that give objects their colors, and smaller versions of them on materials of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import bpy

from ...metric.errors import MeshError
from .. import arrays

NOT_COLOR = "Non-Color"


def images_of(objects: Sequence[bpy.types.Object]) -> list[bpy.types.Image]:
    """The images that the objects' materials use, each once."""
    found = [image for material in _materials(objects) for image in _tree_images(material.node_tree, set())]
    return list(dict.fromkeys(found))


def color_images(objects: Sequence[bpy.types.Object]) -> list[bpy.types.Image]:
    """Those whose size counts: of color, there, and single ones. Normals and roughness are nothing that is measured."""
    return [
        image
        for image in images_of(objects)
        if image.colorspace_settings.name != NOT_COLOR and image.source in {"FILE", "GENERATED"} and max(image.size) > 0
    ]


def falling_sides(objects: Sequence[bpy.types.Object], name: str) -> tuple[int, ...]:
    """The longest side of the largest color image, and the powers of two below it.

    Args:
        name: what the error calls the objects.

    Raises:
        MeshError: no material has a color image.
    """
    largest = max((max(image.size) for image in color_images(objects)), default=0)
    if not largest:
        raise MeshError(f"{name}: no material has a color image; there is no texture to make smaller")
    return (largest, *(2**power for power in reversed(range((largest - 1).bit_length()))))


def shrink(image: bpy.types.Image, side: int) -> None:
    """Scales an image whose longest side exceeds side down to it, in place, and packs it."""
    width, height = image.size
    if max(width, height) > side:
        factor = side / max(width, height)
        image.scale(max(1, round(width * factor)), max(1, round(height * factor)))
        image.pack()


def give_smaller(objects: Sequence[bpy.types.Object], side: int | None) -> list[bpy.types.ID]:
    """Gives objects copies of their materials, on which color images whose longest side exceeds side have it.

    Meshes, materials and images that others use stay as they are: the copies are the objects' own, in their slots.

    Returns:
        What was made; what remove_made takes away. Nothing where no image is too large, or side is None.
    """
    made: list[bpy.types.ID] = []
    try:
        large = [] if side is None else [image for image in color_images(objects) if max(image.size) > side]
        if side is None or not large:
            return made
        smaller: dict[bpy.types.ID, bpy.types.ID] = {image: _smaller(image, side, made) for image in large}
        for slot in [slot for object_ in objects for slot in object_.material_slots]:
            material = slot.material
            if material is None or not _uses(material.node_tree, large):
                continue
            if material not in smaller:
                smaller[material] = _copy(material, f"{material.name} {side}", made)
                _replace(smaller[material].node_tree, smaller, large, side, made)
            slot.link = "OBJECT"
            slot.material = smaller[material]
    except BaseException:
        remove_made(made)
        raise
    return made


def remove_made(made: Sequence[bpy.types.ID]) -> None:
    """Takes away what give_smaller has made, from whoever uses it."""
    bpy.data.batch_remove(made)


def _copy(block: Any, name: str, made: list[bpy.types.ID]) -> Any:
    copy = block.copy()
    made.append(copy)
    copy.name = name
    return copy


def _smaller(image: bpy.types.Image, side: int, made: list[bpy.types.ID]) -> bpy.types.Image:
    stem, suffix = Path(image.name).stem, ".exr" if image.is_float else ".png"
    name = f"{stem} {side}{suffix}"
    if image.is_dirty or image.source == "GENERATED":  # a copy would lose what was painted
        width, height = image.size
        copy = bpy.data.images.new(name, width, height, alpha=True, float_buffer=image.is_float)
        made.append(copy)
        copy.colorspace_settings.name, copy.alpha_mode = image.colorspace_settings.name, image.alpha_mode
        arrays.write_pixels(copy, arrays.read_pixels(image))
    else:
        copy = _copy(image, name, made)
    shrink(copy, side)
    data = copy.packed_file.data
    copy.filepath_raw = f"//{name}"  # or unpacking would write over the original
    copy.pack(data=data, data_len=len(data))
    return copy


def _replace(
    tree: bpy.types.NodeTree,
    smaller: dict[bpy.types.ID, bpy.types.ID],
    large: Sequence[bpy.types.Image],
    side: int,
    made: list[bpy.types.ID],
) -> None:
    """Puts the smaller images into a tree that is a copy, and into copies of its groups."""
    for node in tree.nodes:
        if node.type == "TEX_IMAGE" and node.image in smaller:
            node.image = smaller[node.image]
        elif node.type == "GROUP" and _uses(node.node_tree, large):
            group = node.node_tree
            if group not in smaller:
                smaller[group] = _copy(group, f"{group.name} {side}", made)
                _replace(smaller[group], smaller, large, side, made)
            node.node_tree = smaller[group]


def _uses(tree: bpy.types.NodeTree | None, images: Sequence[bpy.types.Image]) -> bool:
    return any(image in images for image in _tree_images(tree, set()))


def _materials(objects: Sequence[bpy.types.Object]) -> list[bpy.types.Material]:
    return [slot.material for object_ in objects for slot in object_.material_slots if slot.material is not None]


def _tree_images(tree: bpy.types.NodeTree | None, seen: set[str]) -> Iterator[bpy.types.Image]:
    if tree is None or tree.name_full in seen:
        return
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            yield from _tree_images(node.node_tree, seen | {tree.name_full})
        elif node.type == "TEX_IMAGE" and node.image is not None:
            yield node.image
