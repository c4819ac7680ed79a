# SPDX-License-Identifier: GPL-3.0-or-later
"""The files behind Blender's images: where they lie, what they promise, what they hold; nothing here decodes any."""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import re
from collections.abc import Iterator

import bpy
import numpy as np

from ...metric.errors import ImageSizeError, MeshError
from ...metric.texture import ImageFacts
from .. import arrays
from .image_headers import Header, ImageLimits, file_header, read_header

_IS_OLD = bpy.app.version < (5, 2)
_SMALL = 2**24  # bytes that a process has
_FRAME = re.compile(r"(.*?)(\d+)(\D*)", re.DOTALL)


def image_path(image: bpy.types.Image) -> str:
    """The absolute path of an image's file, "" for an image made in Blender."""
    if image.source == "GENERATED" or not image.filepath:
        return ""
    path = bpy.path.abspath(image.filepath, library=image.library)
    if "\\" in path and not os.path.exists(path):  # written on Windows, as Blender reads it elsewhere
        path = path.replace("\\", "/")
    return os.path.normpath(path)


def image_paths(image: bpy.types.Image) -> list[str]:
    """The absolute paths of an image's files: of a UDIM set's tiles, of others one."""
    if image.source == "TILED":
        return [tile_path(image, tile.number) for tile in image.tiles]
    return [image_path(image)]


def same_content(one: bpy.types.Image, other: bpy.types.Image) -> bool:
    """Whether Cycles takes two images for one: read from one file in one way."""
    if one == other or other is None:
        return one == other

    def way(image: bpy.types.Image) -> tuple[str, ...]:
        return image_path(image), image.source, image.colorspace_settings.name, image.alpha_mode

    held = any(each.packed_file or each.is_dirty or each.source == "GENERATED" for each in (one, other))
    return not held and way(one) == way(other)


def tile_path(image: bpy.types.Image, number: int) -> str:
    """The absolute path of a tile's file, after Blender's two ways to number them."""
    column, row = tile_place(number)
    path = image_path(image)
    return path.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{column + 1}_v{row + 1}")


def tile_place(number: int) -> tuple[int, int]:
    """Column and row of a tile: 1001 is (0, 0), 1002 (1, 0), 1011 (0, 1)."""
    return (number - 1001) % 10, (number - 1001) // 10


def why_unread(image: bpy.types.Image) -> str:
    """Which image could not be read and what is wrong with it, for messages."""
    path = image_path(image)
    what = "is broken or of a kind that Blender cannot read"
    if image.packed_file is None and not os.path.exists(path):
        what = "is missing"
    elif "\\" in path and os.sep == "/":
        what = "has a backslash in its name, which Blender takes for a slash"
    elif kind := _foreign_kind(image, path):
        what = f"is in {kind}, which Blender does not decode: convert it to a PNG"
    return f"{path or image.name}: the base-color image {what}"


def _foreign_kind(image: bpy.types.Image, path: str) -> str:
    """The kind of an image that is known and that no Blender decodes, with a tool that does; "" of others."""
    start = b""
    if image.packed_file is not None:
        start = image.packed_file.data[:16]
    elif os.path.isfile(path):
        with contextlib.suppress(OSError), open(path, "rb") as file:
            start = file.read(16)
    return next((kind for place, magic, kind in _FOREIGN if start[place : place + len(magic)] == magic), "")


_FOREIGN = (
    (4, b"ftypavif", "AVIF (avifdec in.avif out.png)"),
    (4, b"ftypheic", "HEIC (heif-convert in.heic out.png)"),
    (0, b"\xabKTX 20\xbb", "KTX2 (ktx extract --transcode rgba8 in.ktx2 out.png)"),
)


def check_limits(image: bpy.types.Image, limits: ImageLimits) -> None:
    """Refuses an image before anything decodes it.

    Raises:
        ImageSizeError: its header promises more than the limits.
        MeshError: Blender would crash, or wait for ever, at its file; or there is no room for its pixels.
    """
    name = image_path(image) or image.name
    needed = 0
    for place, header in _all_headers(image):
        if header is not None:
            _check(header, place or name, limits)
            needed = max(needed, header.decoded)
    if not image.has_data:
        reserve(needed, f"{name}: the image")


def _all_headers(image: bpy.types.Image) -> Iterator[tuple[str, Header | None]]:
    """Path and header of everything that may be decoded for an image: all tiles, all frames; "" is the image itself.

    Raises:
        MeshError: a path leads to a pipe or a device.
    """
    if image.source == "GENERATED" or image.packed_files:
        yield "", image_header(image)
        for file in image.packed_files:
            if file.packed_file is not None:
                yield "", read_header(io.BytesIO(file.packed_file.data))
        return
    paths = image_paths(image)
    if image.source == "SEQUENCE":
        paths += _frames(paths[0])
    for path in paths:
        if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path)):
            raise MeshError(f"{path}: the image is a pipe or a device; a file is wanted")
        yield path, file_header(path)


def _frames(path: str) -> list[str]:
    """The files beside one that differ from it only in the last number of its name."""
    folder, name = os.path.split(path)
    match = _FRAME.fullmatch(name)
    if match is None:
        return []
    wanted = re.compile(re.escape(match[1]) + r"\d+" + re.escape(match[3]))
    try:
        return sorted(os.path.join(folder, each) for each in os.listdir(folder) if wanted.fullmatch(each))
    except OSError:
        return []


def reserve(size: int, what: str) -> None:
    """Tells whether there is room for so many bytes: Blender and Cycles go on without an image that they find none for.

    Raises:
        MeshError: there is not.
    """
    if size < _SMALL:
        return
    try:
        np.empty(size, np.uint8)
    except MemoryError as error:
        raise MeshError(
            f"{what} would take {size:,} bytes once decoded, more than there is memory for; allow more memory, or make "
            "the image smaller"
        ) from error


def crashes(header: Header | None) -> str:
    """Why an image with such a header must not be loaded: a Blender would crash; "" where it may."""
    if _IS_OLD and header is not None and header.kind == "jp2" and header.is_grey_with_alpha:
        return "Blender before 5.2 crashes at a JPEG 2000 image of grey and alpha; save it as a PNG"
    if header is not None and header.is_cut:
        return "the image is broken, its rows are not where it says; save it again"
    return ""


def _check(header: Header, name: str, limits: ImageLimits) -> None:
    if why := crashes(header):
        raise MeshError(f"{name}: {why}")
    size = f"{header.width} x {header.height} pixels"
    if max(header.width, header.height) > limits.side:
        raise ImageSizeError(f"{name}: the image promises {size}, more than the {limits.side} a side that are allowed")
    if header.decoded > limits.decoded:
        raise ImageSizeError(
            f"{name}: the image promises {size}, {header.decoded} bytes once decoded, more than the {limits.decoded} "
            "that are allowed"
        )


def image_header(image: bpy.types.Image) -> Header | None:
    """Size and kind of an image (a UDIM set's first tile) without decoding it; None where that cannot be known."""
    if image.source == "GENERATED":
        return Header(image.generated_width, image.generated_height, image.use_generated_float)
    if image.packed_file is not None:
        return read_header(io.BytesIO(image.packed_file.data))
    path = image_path(image)
    return file_header(tile_path(image, image.tiles[0].number) if image.source == "TILED" else path)


def image_facts(image: bpy.types.Image, role: str, digest: str) -> ImageFacts:
    """What a report says about an image; nothing is decoded."""
    header = image_header(image)
    return ImageFacts(
        role=role,
        name=image.name,
        path=image_path(image),
        width=header.width if header is not None else 0,
        height=header.height if header is not None else 0,
        color_space=image.colorspace_settings.name,
        missing=not digest,
        digest=digest,
    )


def image_digest(image: bpy.types.Image) -> str:
    """A digest of an image's content: of painted or generated images the pixels, else the file's bytes, of UDIM sets
    all tiles' files; "" where there is nothing."""
    digest = hashlib.blake2b(digest_size=16)
    if image.source == "GENERATED" and not image.is_dirty:
        kind = image.generated_type, image.generated_width, image.generated_height, image.use_generated_float
        return hashlib.blake2b(repr((kind, tuple(image.generated_color))).encode(), digest_size=16).hexdigest()
    if image.is_dirty:
        digest.update(arrays.read_pixels(image).tobytes())
        return digest.hexdigest()
    found = False
    for block in _blocks(image):
        digest.update(block)
        found = True
    return digest.hexdigest() if found else ""


def _blocks(image: bpy.types.Image) -> Iterator[bytes]:
    """The bytes of an image's files, in pieces."""
    packed = [file.packed_file.data for file in image.packed_files]
    if packed:
        yield from packed
        return
    for path in image_paths(image):
        if os.path.isfile(path) and os.access(path, os.R_OK):
            try:
                with open(path, "rb") as file:
                    while block := file.read(2**20):
                        yield block
            except OSError as error:
                raise MeshError(f"{path}: the image cannot be read ({error.strerror})") from error


def has_pixels(image: bpy.types.Image | None) -> bool:
    """Whether Cycles, as far as is known before it bakes, has something to show of an image."""
    if image is None:
        return False
    if image.source == "SEQUENCE":  # of which Blender tells no size
        return os.path.isfile(image_path(image)) or image.packed_file is not None
    return bool(image.size[0]) or image.type == "MULTILAYER"
