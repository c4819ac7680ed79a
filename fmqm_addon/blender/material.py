# SPDX-License-Identifier: GPL-3.0-or-later
"""What color a material slot has: the image or plain color that feeds Base Color."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any, Literal

import bpy
import numpy as np
from numpy.typing import NDArray

from ..metric.color import Color, Extension, Material, PlainColor, Texture, encode_srgb
from ..metric.errors import FileError, MeshError
from .headers import Limits

DEFAULT_GREY = 0.8  # linear base color that Blender gives a surface without a material
_EXTENSIONS: dict[str, Extension] = {"REPEAT": "repeat", "EXTEND": "extend", "CLIP": "clip", "MIRROR": "mirror"}


@dataclass(frozen=True)
class SlotColor:
    """What one material slot looks like.

    Attributes:
        color: the texture or the plain color.
        uv_map: name of the UV map that the texture uses, "" for the mesh's active one; None: needs none.
        warnings: what was assumed.
    """

    color: Color
    uv_map: str | None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reading:
    """How an asset's looks are read.

    Attributes:
        texture: replaces everything that the materials say.
        bake: side of baked images in pixels; 0 forbids baking.
        stand_in: a missing base-color image is shown in magenta, as Cycles shows it, instead of being an error.
        limits: of the images.
    """

    texture: Texture | None = None
    bake: int = 1024
    stand_in: bool = False
    limits: Limits = Limits()


@dataclass(frozen=True)
class Layer:
    """What a material wants of a mesh: a UV map (2 channels of MeshArrays.corners) or a color attribute (4, linear
    RGBA). The name "" is the mesh's one that is active for rendering."""

    kind: Literal["uv", "color"]
    name: str


@dataclass(frozen=True)
class Look:
    """A material that was read.

    Attributes:
        material: its samplers read the channels of MeshArrays.corners, layer after layer in the order of layers.
        layers: what the mesh must offer.
        warnings: what was assumed; they name the material.
    """

    material: Material
    layers: tuple[Layer, ...]
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Unread:
    """A material that must be baked: the node that is not read, and why."""

    node: str
    why: str


class TextureCache:
    """Pixels of images, read once for all the slots and objects of an asset."""

    def __init__(self) -> None:
        self._pixels: dict[int, NDArray[np.uint8] | NDArray[np.float32]] = {}
        self.looks: dict[int, Look | Unread] = {}

    def pixels(self, image: bpy.types.Image) -> NDArray[np.uint8] | NDArray[np.float32]:
        key = image.as_pointer()
        if key not in self._pixels:
            self._pixels[key] = read_pixels(image)
        return self._pixels[key]


def read_look(material: bpy.types.Material | None, cache: TextureCache, reading: Reading) -> Look | Unread:
    """The look of a material; the same object for the same material of a cache.

    Raises:
        MeshError: a base-color image cannot be read and reading.stand_in is off, or an image exceeds the limits.
    """
    key = 0 if material is None else material.original.as_pointer()
    if key not in cache.looks:
        if reading.texture is not None:
            name = "" if material is None else material.name
            cache.looks[key] = Look(Material(name, reading.texture, how="given"), (Layer("uv", ""),))
        else:
            seen = slot_color(material, cache, "asset")
            layers = () if seen.uv_map is None else (Layer("uv", seen.uv_map),)
            name = "" if material is None else material.name
            cache.looks[key] = Look(Material(name, seen.color), layers, seen.warnings)
    return cache.looks[key]


def plain_look(material: bpy.types.Material, warning: str) -> Look:
    """The plain color of a material that cannot be read where baking is forbidden."""
    return Look(Material(material.name, _plain(material.diffuse_color[:3]), how="plain"), (), (warning,))


def slot_color(material: bpy.types.Material | None, cache: TextureCache, owner: str) -> SlotColor:
    """The color of a material slot of the object named owner.

    Raises:
        MeshError: the base color names an image that cannot be read, or none.
    """
    if material is None:
        grey = _plain((DEFAULT_GREY,) * 3)
        return SlotColor(
            grey, None, (f"{owner}: a material slot or the object has no material; Blender's default grey is taken",)
        )
    shader = _principled(material)
    if shader is None:
        color = _plain(material.diffuse_color[:3])
        return SlotColor(
            color, None, (f"{owner}: material {material.name} has no Principled BSDF; its viewport color is taken",)
        )
    socket = shader.inputs["Base Color"]
    node = _source(socket)
    if node is None:
        return SlotColor(_plain(socket.default_value[:3]), None)
    warnings: tuple[str, ...] = ()
    if node.type != "TEX_IMAGE":
        found = _first_image_above(node)
        if found is None:
            why = (
                f"{owner}: material {material.name}: Base Color comes from {node.name}, which is not read; "
                "its plain color is taken"
            )
            return SlotColor(_plain(socket.default_value[:3]), None, (why,))
        warnings = (
            f"{owner}: material {material.name}: of what feeds Base Color only the image {found.image.name} is read",
        )
        node = found
    if node.image is None:
        raise MeshError(
            f"{owner}: material {material.name}: {node.name}, which feeds Base Color, holds no image; "
            "give it one (or --texture, --ref-texture)"
        )
    vector = _source(node.inputs["Vector"])
    uv_map = vector.uv_map if vector is not None and vector.type == "UVMAP" else ""
    if vector is not None and vector.type not in {"UVMAP", "TEX_COORD"}:
        warnings += (f"{owner}: material {material.name}: {vector.name} before its image is not read",)
    texture = Texture(
        cache.pixels(node.image),
        extension=_EXTENSIONS[node.extension],
        interpolation="closest" if node.interpolation == "Closest" else "linear",
    )
    return SlotColor(texture, uv_map, warnings)


def read_pixels(image: bpy.types.Image) -> NDArray[np.uint8] | NDArray[np.float32]:
    """(H, W, 3) pixels as encoded for display, row 0 at the top; uint8, or float32 in [0, 1] for float images.

    Raises:
        MeshError: the image is missing or broken; the text names its path.
    """
    width, height = image.size
    if not width or not height:
        path = bpy.path.abspath(image.filepath, library=image.library) or image.name
        state = "is broken or of a kind that Blender cannot read" if os.path.exists(path) else "is missing"
        raise MeshError(f"{path}: the base-color image {state}; repair it or give another (--texture, --ref-texture)")
    values: NDArray[Any] = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    if not image.is_float:  # the values are the file's bytes / 255; keep those, at a quarter of the size
        values *= 255
        values += 0.5
        values = values.astype(np.uint8)
    values = values.reshape(height, width, image.channels)[::-1]
    rgb = values[:, :, :3] if image.channels >= 3 else np.repeat(values[:, :, :1], 3, axis=2)
    if image.is_float:
        rgb = encode_srgb(np.nan_to_num(rgb)).astype(np.float32)
    return np.ascontiguousarray(rgb)


def load_texture(path: str) -> Texture:
    """An image file as a repeating texture; nothing stays in bpy.data.

    Raises:
        FileError: it cannot be read.
    """
    if not os.path.isfile(path):
        raise FileError(f"{path}: no such image file")
    try:
        image = bpy.data.images.load(path, check_existing=False)
    except RuntimeError as error:
        raise FileError(f"{path}: not an image that Blender can read") from error
    try:
        return Texture(read_pixels(image))
    except MeshError as error:
        raise FileError(f"{path}: not an image that Blender can read") from error
    finally:
        bpy.data.images.remove(image)


def _plain(linear: tuple[float, ...]) -> PlainColor:
    red, green, blue = encode_srgb(np.array(linear)).tolist()
    return PlainColor((red, green, blue))


def _principled(material: bpy.types.Material) -> bpy.types.Node | None:
    """The Principled BSDF at the active output, else any in the tree."""
    tree = material.node_tree
    if tree is None:
        return None
    output = tree.get_output_node("ALL")
    shader = _source(output.inputs["Surface"]) if output is not None else None
    if shader is not None and shader.type == "BSDF_PRINCIPLED":
        return shader
    return next((node for node in tree.nodes if node.type == "BSDF_PRINCIPLED"), None)


def _source(socket: bpy.types.NodeSocket) -> bpy.types.Node | None:
    """The node that feeds a socket, through reroutes; None where nothing does."""
    while socket.is_linked:
        node = socket.links[0].from_node
        if node.type != "REROUTE":
            return node
        socket = node.inputs[0]
    return None


def _first_image_above(node: bpy.types.Node) -> bpy.types.Node | None:
    """The nearest image texture upstream of a node, breadth first."""
    queue, seen = [node], set()
    while queue:
        node = queue.pop(0)
        if node.type == "TEX_IMAGE" and node.image is not None:
            return node
        seen.add(node.name)
        sources = (_source(socket) for socket in node.inputs)
        queue += [source for source in sources if source is not None and source.name not in seen]
    return None
