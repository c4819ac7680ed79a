# SPDX-License-Identifier: GPL-3.0-or-later
"""What headers promise is what Blender decodes; garbage promises nothing."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import bpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.blender.materials.image_headers import Header, file_header, read_header
from tests.blender import scenes

FORMATS = (
    "PNG",
    "JPEG",
    "WEBP",
    "BMP",
    "TARGA",
    "TARGA_RAW",
    "TIFF",
    "OPEN_EXR",
    "HDR",
    "IRIS",
    "DPX",
    "CINEON",
)


def saved(path: Path, kind: str, depth: str = "") -> None:
    """A picture of 37 x 21 pixels, as Blender writes it."""
    image = bpy.data.images.new("picture", 37, 21, float_buffer=depth in {"16", "32"} or kind in {"OPEN_EXR", "HDR"})
    scene = bpy.context.scene
    settings = scene.render.image_settings
    settings.file_format = kind
    if depth:
        settings.color_depth = depth
    image.save_render(str(path), scene=scene)
    bpy.data.images.remove(image)


@pytest.mark.parametrize("kind", FORMATS)
def test_what_blender_writes(tmp_path: Path, kind: str) -> None:
    saved(tmp_path / "image", kind)
    image = bpy.data.images.load(str(tmp_path / "image"))
    assert tuple(image.size) == (37, 21)
    assert file_header(str(tmp_path / "image")) == Header(37, 21, image.is_float)


@pytest.mark.parametrize(("kind", "depth"), [("PNG", "16"), ("TIFF", "16"), ("OPEN_EXR", "32")])
def test_deep_images_are_floats(tmp_path: Path, kind: str, depth: str) -> None:
    saved(tmp_path / "image", kind, depth)
    header = file_header(str(tmp_path / "image"))
    assert header == Header(37, 21, True) and header.decoded == 37 * 21 * 16


def test_by_hand() -> None:
    """Kinds that Blender only reads, and variants that it does not write."""
    psd = b"8BPS\0\1" + bytes(6) + struct.pack(">HIIHH", 3, 21, 37, 8, 3)
    dds = b"DDS " + struct.pack("<IIII", 124, 7, 21, 37)
    lossless = b"RIFF\0\0\0\0WEBPVP8L\0\0\0\0\x2f" + struct.pack("<I", 36 | 20 << 14)
    extended = b"RIFF\0\0\0\0WEBPVP8X" + bytes(8) + bytes([36, 0, 0, 20, 0, 0])
    stream = b"\xff\x4f\xff\x51" + struct.pack(">HHIIII", 47, 0, 37, 21, 0, 0) + bytes(18) + b"\7"
    boxed = b"\0\0\0\x0cjP  \r\n\x87\n" + bytes(4) + b"ihdr" + struct.pack(">IIHB", 21, 37, 3, 7)
    tall = b"BM" + bytes(12) + struct.pack("<Iii", 40, 37, -21)
    for data in (psd, dds, lossless, extended, stream, boxed, tall):
        assert read_header(io.BytesIO(data)) == Header(37, 21), data


@pytest.mark.parametrize("kind", ["png", "tif", "tga", "jp2", "j2k"])
def test_grey_with_alpha(tmp_path: Path, kind: str) -> None:
    pillow = pytest.importorskip("PIL.Image")
    path = tmp_path / f"image.{kind}"
    for mode in ("L", "LA", "RGB", "RGBA"):
        pillow.new(mode, (37, 21)).save(path)
        found = file_header(str(path))
        assert found == Header(37, 21, is_grey_with_alpha=mode == "LA")
        assert found.kind == {"tif": "tiff", "j2k": "jp2"}.get(kind, kind)


def test_size_of_a_jpeg_behind_a_thumbnail_of_another_size(tmp_path: Path) -> None:
    saved(tmp_path / "image", "JPEG")
    whole = (tmp_path / "image").read_bytes()
    thumbnail = b"\xff\xd8\xff\xc0\0\x11\x08\0\5\0\6" + bytes(30000)
    wrapped = whole[:2] + b"\xff\xe1" + struct.pack(">H", len(thumbnail) + 2) + thumbnail + whole[2:]
    assert read_header(io.BytesIO(wrapped)) == Header(37, 21)


@pytest.mark.parametrize(("start", "length", "cut"), [(520, 3, False), (520, 4, True), (2**32 - 1, 9, True)])
def test_rows_of_a_packed_sgi(start: int, length: int, cut: bool) -> None:
    header = struct.pack(">HBBHHHH", 474, 1, 1, 3, 3, 1, 1).ljust(512, b"\0")
    data = header + struct.pack(">II", start, length) + bytes(3)
    assert read_header(io.BytesIO(data)) == Header(3, 1, is_cut=cut)
    assert read_header(io.BytesIO(data[:515])) == Header(3, 1, is_cut=True)
    assert read_header(io.BytesIO(data[:2] + b"\0" + data[3:])) == Header(3, 1)  # not packed


def test_what_is_not_there_promises_nothing(tmp_path: Path) -> None:
    assert file_header(str(tmp_path / "none.png")) is None
    assert file_header(str(tmp_path)) is None
    assert read_header(io.BytesIO(b"")) is None


@given(
    st.sampled_from(
        [b"", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"RIFF\0\0\0\0WEBPVP8X", b"RIFF\0\0\0\0WEBPVP8 ", b"BM", b"II*\0",
         b"MM\0+", b"\x76\x2f\x31\x01\2\0\0\0", b"#?RADIANCE\n", b"8BPS", b"DDS ", b"\0\0\0\x0cjP  ihdr",
         b"\xff\x4f\xff\x51", b"\x01\xda", b"SDPX", b"\0\0\2"]
    ),
    st.binary(max_size=300),
)  # fmt: skip
def test_garbage_never_raises(magic: bytes, rest: bytes) -> None:
    found = read_header(io.BytesIO(magic + rest))
    assert found is None or (found.width > 0 and found.height > 0)


@given(st.integers(0, 2000))
def test_a_file_that_ends_early_never_raises(length: int) -> None:
    pixels = np.zeros((3, 5, 3), np.float32)
    folder = Path(bpy.app.tempdir)
    whole = scenes.write_exr(folder / "image.exr", pixels).read_bytes()
    found = read_header(io.BytesIO(whole[:length]))
    assert found in (None, Header(5, 3, True))
