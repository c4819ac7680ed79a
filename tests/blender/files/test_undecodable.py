# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender cannot read is named, with a remedy that works: extensions of glTF, clouds of points, other images."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.files.load import load_asset
from fmqm_addon.metric.errors import FMQMError
from tests.blender.script import write_png, write_torus

from .hostile_files import changed, colored, document

KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n" + bytes(60)
AVIF = b"\0\0\0\x1cftypavif\0\0\0\0avifmif1miaf" + bytes(60)
KTX_COMMAND = "gltf-transform ktxdecompress in.glb out.glb"
AVIF_COMMAND = "gltf-transform png --formats avif in.glb out.glb"


def said(folder: Path, parts: dict[str, Any]) -> str:
    path = folder / "asset.gltf"
    path.write_text(json.dumps(parts))
    with pytest.raises(FMQMError) as caught:
        load_asset(str(path))
    assert str(caught.value).startswith(str(path)) and "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("required", [False, True])
@pytest.mark.parametrize(
    ("extension", "data", "command"),
    [("KHR_texture_basisu", KTX2, KTX_COMMAND), ("EXT_texture_avif", AVIF, AVIF_COMMAND)],
)
def test_textures_in_extensions(tmp_path: Path, extension: str, data: bytes, command: str, required: bool) -> None:
    parts = colored({"uri": "data:image/x;base64," + base64.b64encode(data).decode()})
    parts["textures"] = [{"extensions": {extension: {"source": 0}}}]
    parts |= {"extensionsUsed": [extension]} | ({"extensionsRequired": [extension]} if required else {})
    text = said(tmp_path, parts)
    assert extension in text and command in text


@pytest.mark.parametrize(("data", "kind"), [(KTX2, "KTX2"), (AVIF, "AVIF")])
def test_textures_that_are_none_of_blenders(tmp_path: Path, data: bytes, kind: str) -> None:
    text = said(tmp_path, colored({"uri": "data:image/x;base64," + base64.b64encode(data).decode()}))
    assert f"is in {kind} (" in text and "convert it to a PNG" in text
    write_torus(tmp_path, "torus", "skin.img")
    (tmp_path / "skin.img").write_bytes(data)
    with pytest.raises(FMQMError, match=f"is in {kind}"):
        load_asset(str(tmp_path / "torus.obj"))


@pytest.mark.parametrize("extension", ["EXT_meshopt_compression", "VENDOR_unheard_of"])
def test_other_extensions(tmp_path: Path, extension: str) -> None:
    parts = document() | {"extensionsUsed": [extension], "extensionsRequired": [extension]}
    if extension == "EXT_meshopt_compression" and bpy.app.version >= (5, 2):
        packed = {"buffer": 0, "byteLength": 36, "byteStride": 12, "count": 3, "mode": "ATTRIBUTES"}
        parts["bufferViews"][0]["extensions"] = {extension: packed}
    text = said(tmp_path, parts)
    assert extension in text and "another Blender" not in text
    assert ("gltf-transform copy" in text) == (extension == "EXT_meshopt_compression")


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        (
            document(scenes=[{"nodes": [0, 1]}], nodes=[{"children": [2]}, {"children": [2]}, {"mesh": 0}]),
            "one of its nodes is the child of two",
        ),
        (changed("accessors", 0, type="MAT2", count=2), "an accessor of MAT2 or MAT3"),
    ],
)
def test_assertions_have_reasons(tmp_path: Path, parts: dict[str, Any], reason: str) -> None:
    text = said(tmp_path, parts)
    assert reason in text and "AssertionError" not in text


@pytest.mark.parametrize("position", ["float x\nproperty float y\nproperty float z", "uint packed_position"])
@pytest.mark.parametrize("faces", ["", "element face 0\nproperty list uchar int vertex_indices\n"])
def test_points_and_splats(tmp_path: Path, position: str, faces: str) -> None:
    path = tmp_path / "cloud.ply"
    head = f"ply\nformat ascii 1.0\nelement vertex 2\nproperty {position}\n{faces}end_header\n"
    path.write_text(head + "0 0 0\n1 0 0\n")
    with pytest.raises(FMQMError, match=r"points or splats \(2\), no faces"):
        load_asset(str(path))


@pytest.mark.parametrize("color", [0, 200])
def test_alpha_of_0_all_over_is_said(tmp_path: Path, color: int) -> None:
    """It is a PNG, and was decoded: another remedy than for those that were not."""
    write_torus(tmp_path, "torus", "skin.png")
    write_png(tmp_path / "skin.png", np.full((4, 4, 4), (color, color, color, 0), np.uint8))
    (warning,) = load_asset(str(tmp_path / "torus.obj")).mesh.warnings
    assert "has an alpha of 0 all over" in warning and "PNG" not in warning


def test_the_case_with_alpha_of_0(shared_data: Path) -> None:
    (warning,) = load_asset(str(shared_data / "cases" / "alpha" / "alpha0.obj")).mesh.warnings
    assert "has an alpha of 0 all over" in warning
