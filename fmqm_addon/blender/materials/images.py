# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of Blender's images, as Cycles would sample them."""

from __future__ import annotations

import os
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...metric.colorspace import encode_srgb
from ...metric.errors import FileError
from ...metric.texture import ImageFacts, Texture
from .. import arrays
from .expressions import BRIGHTEST
from .image_files import check_limits, crashes, image_digest, image_facts, image_header, tile_path
from .image_headers import DEFAULT_LIMITS, ImageLimits, file_header

LINEAR_SPACES = frozenset({"Non-Color", "Linear Rec.709", "scene_linear"})
_LIGHT_FORMATS = frozenset({"OPEN_EXR", "OPEN_EXR_MULTILAYER", "HDR", "DPX", "CINEON"})  # hold linear light
_IS_OLD = bpy.app.version < (5, 2)
_ODD_KINDS = frozenset({"bmp", "jp2", "sgi", "webp"})  # whose colors an old Cycles does not multiply by alpha
DARKEST = 1e-4  # what is not black of floats: as linear light, less than bytes can tell from it
_BLOCK = 2**18  # floats that are converted at a time: what a processor's cache holds


@dataclass(frozen=True)
class Pixels:
    """What an image holds.

    Attributes:
        values: (H, W, 3 or 4) uint8, or float32 within BRIGHTEST; row 0 at the top; a fourth channel is alpha.
        linear: the values are linear light, not encoded for display.
        associated: Cycles wants the colors multiplied by alpha, and they are.
        unusual: the colors are not what Cycles samples: how it treats alpha depends here on how the file came to
            Blender, and on Blender's version; or it decodes them only after it has interpolated.
        solid: to Cycles they have no alpha, beyond the image's edges either.
    """

    values: NDArray[np.uint8] | NDArray[np.float32]
    linear: bool
    associated: bool
    unusual: bool
    solid: bool


# Pixels that were read and that some asset may still hold, by content and by how Blender reads it.
_held: dict[tuple[str, str, str, bool], tuple[weakref.ref[NDArray[Any]], tuple[bool, bool, bool, bool]]] = {}


class TextureCache:
    """What was read of an asset's images and materials: once for all its slots and objects."""

    def __init__(self) -> None:
        self._pixels: dict[tuple[int, int], Pixels | None] = {}
        self._digests: dict[int, str] = {}
        self.looks: dict[int, Any] = {}  # by material.read_look alone

    def pixels(self, image: bpy.types.Image, limits: ImageLimits) -> Pixels | None:
        """As read_pixels; what another asset still holds of the same content is shared."""
        return self._once((image.as_pointer(), 0), lambda: self._shared(image, limits))

    def tile(self, image: bpy.types.Image, number: int, limits: ImageLimits) -> Pixels | None:
        """As read_tile."""
        return self._once((image.as_pointer(), number), lambda: read_tile(image, number, limits))

    def facts(self, image: bpy.types.Image, role: str) -> ImageFacts:
        """As image_facts, with the content looked through once."""
        return image_facts(image, role, self._digest(image))

    def _digest(self, image: bpy.types.Image) -> str:
        key = image.as_pointer()
        if key not in self._digests:
            self._digests[key] = image_digest(image)
        return self._digests[key]

    def _shared(self, image: bpy.types.Image, limits: ImageLimits) -> Pixels | None:
        """LODs mostly carry the reference's own images: decoding and keeping them again would cost twice."""
        stale = image.has_data and image.packed_file is None  # what Blender holds may be older than the file
        if image.source != "FILE" or image.is_dirty or stale or not self._digest(image):
            return read_pixels(image, limits)
        space, packed = image.colorspace_settings.name, image.packed_file is not None
        key = (self._digest(image), space, image.alpha_mode, packed)
        held = _held.get(key)
        values = None if held is None else held[0]()
        if held is not None and values is not None:
            check_limits(image, limits)
            return Pixels(values, *held[1])
        pixels = read_pixels(image, limits)
        if pixels is not None:
            facts = pixels.linear, pixels.associated, pixels.unusual, pixels.solid
            _held[key] = weakref.ref(pixels.values), facts
        return pixels

    def _once(self, key: tuple[int, int], read: Callable[[], Pixels | None]) -> Pixels | None:
        if key not in self._pixels:
            self._pixels[key] = read()
        return self._pixels[key]


def read_pixels(image: bpy.types.Image, limits: ImageLimits = DEFAULT_LIMITS) -> Pixels | None:
    """The pixels of an image that is no UDIM set; None where it is missing or broken. Only what was decoded for this
    is given back to Blender: freeing other buffers would erase unsaved painting.

    Raises:
        ImageSizeError: the image promises more than the limits; nothing was decoded.
        MeshError: it cannot be touched; see check_limits.
    """
    check_limits(image, limits)
    was_there = image.has_data
    try:
        width, height = image.size
        if not width or not height:
            return None
        values = arrays.read_pixels(image).reshape(height, width, image.channels)
        return _float_pixels(image, values) if image.is_float else _byte_pixels(image, values)
    finally:
        if not was_there and image.source == "FILE" and not image.is_dirty:
            image.buffers_free()


def _float_pixels(image: bpy.types.Image, values: NDArray[np.float32]) -> Pixels:
    """Blender holds floats as linear light, the colors multiplied by alpha. Works in place: they are large."""
    for top in range(len(values) // 2):
        values[[top, -1 - top]] = values[[-1 - top, top]]
    np.nan_to_num(values, copy=False, nan=0.0, posinf=BRIGHTEST, neginf=-BRIGHTEST)
    np.clip(values, -BRIGHTEST, BRIGHTEST, out=values)
    if values.shape[2] < 3:
        values = np.repeat(values[:, :, :1], 3, axis=2)
    has_alpha = _has_alpha(image, values)
    if values.shape[2] == 4:
        values[:, :, 3] = np.clip(values[:, :, 3], 0, 1) if has_alpha else 1
    associated = _associates(image)
    is_light, from_file = image.file_format in _LIGHT_FORMATS, _is_from_file(image)
    # Of files, Cycles samples 16-bit integers as they are encoded; of what Blender holds, as linear light.
    encoded = from_file and not (is_light or is_linear(image))
    usual = is_light if image.alpha_mode == "PREMUL" else encoded
    unusual = has_alpha and associated and (not usual or _has_odd_alpha(image))
    if encoded:
        for row in values:
            alpha = np.where(row[:, 3:] > 0, row[:, 3:], 1) if has_alpha and associated else 1
            row[:, :3] = encode_srgb(row[:, :3] / alpha) * alpha
    late = from_file and is_light and image.colorspace_settings.name == "sRGB"
    return Pixels(values, not encoded, associated, unusual or late, _is_solid(image))


def _byte_pixels(image: bpy.types.Image, values: NDArray[np.float32]) -> Pixels:
    """The values are the file's bytes / 255; kept are those, at a quarter of the size."""
    height, width, depth = values.shape
    has_alpha = _has_alpha(image, values)
    associated = _associates(image)
    result: NDArray[np.uint8] = np.empty((height, width, 4 if has_alpha else 3), np.uint8)
    upwards = result[::-1]
    for rows in _row_blocks(values):
        values[rows] *= 255
        values[rows] += 0.5
        block = values[rows].astype(np.uint8)
        upwards[rows] = block[:, :, : result.shape[2]] if depth >= 3 else block[:, :, :1]
        if has_alpha and associated:  # rounded down, as Cycles does
            color = upwards[rows, :, :3]
            color[...] = color.astype(np.uint16) * block[:, :, 3:] // 255
    unusual = has_alpha and associated and (image.alpha_mode == "PREMUL" or _has_odd_alpha(image))
    return Pixels(result, is_linear(image), associated, unusual, _is_solid(image))


def _is_from_file(image: bpy.types.Image) -> bool:
    """Whether Cycles opens the file of an image by itself, instead of taking what Blender holds."""
    return image.source == "FILE" and not (image.packed_file or image.is_dirty)


def _is_solid(image: bpy.types.Image) -> bool:
    """Whether Cycles keeps an image, whose pixels are there, in a single channel."""
    return bool(image.depth == (32 if image.is_float else 8)) and _is_from_file(image)


def _has_alpha(image: bpy.types.Image, values: NDArray[np.float32]) -> bool:
    """Whether an image's alpha counts and is somewhere below 1."""
    if values.shape[2] < 4 or image.alpha_mode == "NONE":
        return False
    return any(values[rows, :, 3].min() < 1 for rows in _row_blocks(values))


def _row_blocks(values: NDArray[Any]) -> list[slice]:
    """The rows of an image in blocks that are small beside it, where it is large."""
    height, width, depth = values.shape
    step = max(1, _BLOCK // (width * depth))
    return [slice(first, first + step) for first in range(0, height, step)]


def black_warnings(name: str, values: NDArray[Any]) -> tuple[str, ...]:
    """A warning where an image shows nothing but black: its alpha is 0, or Blender cannot decode it and calls it
    loaded."""
    darkest = 1 if values.dtype == np.uint8 else DARKEST
    if any((values[rows, :, :3] >= darkest).any() for rows in _row_blocks(values)):
        return ()
    if values.shape[2] == 4 and not any(values[rows, :, 3].any() for rows in _row_blocks(values)):
        return (
            f"{name} has an alpha of 0 all over, so that Blender shows black; save it without alpha to show its color",
        )
    return (f"{name} is black all over; unless it is meant to be, Blender could not decode it: save it as a PNG",)


def is_linear(image: bpy.types.Image) -> bool:
    """Whether the values of a byte image are linear light."""
    return image.colorspace_settings.is_data or image.colorspace_settings.name in LINEAR_SPACES


def _associates(image: bpy.types.Image) -> bool:
    """Whether Cycles wants the colors of an image multiplied by its alpha."""
    return not image.colorspace_settings.is_data and image.alpha_mode in {"STRAIGHT", "PREMUL"}


def _has_odd_alpha(image: bpy.types.Image) -> bool:
    """Whether Cycles does not multiply the colors of an image's file by alpha where it does those of others."""
    header = image_header(image) if _is_from_file(image) else None
    return header is not None and (header.is_grey_with_alpha or (_IS_OLD and header.kind in _ODD_KINDS))


def read_tile(image: bpy.types.Image, number: int, limits: ImageLimits = DEFAULT_LIMITS) -> Pixels | None:
    """The pixels of one tile of a UDIM set, by its number (1001 ...); None where it is missing or broken.

    Raises:
        MeshError: as read_pixels.
    """
    with _tile_image(image, number) as tile:
        return None if tile is None else read_pixels(tile, limits)


@contextmanager
def _tile_image(image: bpy.types.Image, number: int) -> Iterator[bpy.types.Image | None]:
    """A tile as an image of its own, for a while; Blender shows only the first tile's pixels to Python."""
    packed = next((file.packed_file for file in image.packed_files if file.tile_number == number), None)
    path = tile_path(image, number)
    if packed is not None:
        own = bpy.data.images.new("FMQM tile", 1, 1)
        own.pack(data=packed.data, data_len=len(packed.data))
        own.source = "FILE"
    elif os.path.isfile(path) and os.access(path, os.R_OK) and not crashes(file_header(path)):
        own = bpy.data.images.load(path, check_existing=False)
    else:
        yield None
        return
    try:
        own.colorspace_settings.name = image.colorspace_settings.name
        own.alpha_mode = image.alpha_mode
        yield own
    finally:
        bpy.data.images.remove(own)


def load_texture(path: str, limits: ImageLimits = DEFAULT_LIMITS) -> Texture:
    """An image file as a repeating texture; its alpha does not count; nothing stays in bpy.data.

    Raises:
        FileError: it cannot be read.
        MeshError: it promises more than the limits.
    """
    if not os.path.isfile(path):
        raise FileError(f"{path}: no such image file")
    if why := crashes(file_header(path)):
        raise FileError(f"{path}: {why}")
    try:
        image = bpy.data.images.load(path, check_existing=False)
    except RuntimeError as error:
        raise FileError(f"{path}: not an image that Blender can read") from error
    try:
        image.alpha_mode = "NONE"
        pixels = read_pixels(image, limits)
    finally:
        bpy.data.images.remove(image)
    if pixels is None:
        raise FileError(f"{path}: not an image that Blender can read")
    return Texture(pixels.values, linear=pixels.linear)
