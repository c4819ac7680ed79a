# SPDX-License-Identifier: GPL-3.0-or-later
"""What is packed in files is counted before it is unpacked, and honest files pass."""

from __future__ import annotations

import gzip
import struct
import zlib
from pathlib import Path

import bpy
import pytest

from fmqm_addon.blender.files import preflight_packed
from fmqm_addon.blender.files.load import load_asset
from fmqm_addon.blender.files.preflight_file import check_file
from fmqm_addon.blender.scene import mesh_arrays
from fmqm_addon.metric.errors import FileError, MeshError
from tests.blender import scenes

LIMIT = 10_000_000


@pytest.fixture
def small_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that the tests' bombs are small."""
    monkeypatch.setattr(preflight_packed, "MAX_BYTES", LIMIT)


def fbx(values: int, packed: bytes, arrays: int = 1) -> bytes:
    """Arrays of doubles that promise so many values."""
    data = b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400)
    for _ in range(arrays):
        content = b"d" + struct.pack("<III", values, 1, len(packed)) + packed
        data += struct.pack("<IIIB", len(data) + 14 + len(content), 1, len(content), 1) + b"V" + content
    return data + bytes(13)


def zstd(blocks: int) -> bytes:
    """A frame that repeats one byte 131,071 times in each block."""
    block = (128 * 1024 - 1) << 3 | 1 << 1
    return b"\x28\xb5\x2f\xfd\0\x58" + (block.to_bytes(3, "little") + b"\0") * blocks + b"\1\0\0"


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("many.fbx", fbx(LIMIT // 16, zlib.compress(bytes(LIMIT // 2)), arrays=3)),
        ("zstd.blend", zstd(LIMIT // 131_071 + 1)),
        ("gzip.blend", gzip.compress(bytes(LIMIT + 1))),
        ("two_streams.blend", gzip.compress(bytes(LIMIT // 2)) + gzip.compress(bytes(LIMIT // 2 + 1))),
    ],
)
def test_what_unpacks_to_more_than_the_limit(tmp_path: Path, small_limit: None, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FileError, match=rf"{name}: .* to more than 10,000,000 bytes; divide the file"):
        check_file(str(tmp_path / name))


@pytest.mark.parametrize("content", [zstd(LIMIT // 131_071), gzip.compress(bytes(LIMIT))], ids=["zstd", "gzip"])
def test_what_unpacks_to_the_limit_is_blenders_to_judge(tmp_path: Path, small_limit: None, content: bytes) -> None:
    (tmp_path / "noise.blend").write_bytes(content)
    assert check_file(str(tmp_path / "noise.blend")) == ()


def test_array_that_cannot_hold_what_it_promises(tmp_path: Path) -> None:
    (tmp_path / "lies.fbx").write_bytes(fbx(2**32 - 1, b"x" * 99))
    with pytest.raises(FileError, match="lies.fbx: its arrays unpack to more than"):
        load_asset(str(tmp_path / "lies.fbx"))
    (tmp_path / "lies.fbx").write_bytes(fbx(10**6, b"x" * 99))
    with pytest.raises((FileError, MeshError), match="lies.fbx: "):
        load_asset(str(tmp_path / "lies.fbx"))


def test_groups_of_an_alembic_archive_that_share_a_group(tmp_path: Path) -> None:
    """Eight levels of ten would be read a hundred million times."""
    root = struct.pack("<QQQ", 2, 40, 40)
    (tmp_path / "shared.abc").write_bytes(b"Ogawa\xff\0\x01" + struct.pack("<Q", 16) + root + struct.pack("<Q", 0))
    with pytest.raises(FileError, match="hold each other"):
        check_file(str(tmp_path / "shared.abc"))


@pytest.mark.parametrize("kind", ["blend", "fbx", "abc", "usdc", "glb"])
def test_honest_files_pass(tmp_path: Path, kind: str) -> None:
    scenes.clear()
    scenes.cube()
    path = str(tmp_path / f"cube.{kind}")
    if kind == "abc":
        bpy.ops.wm.alembic_export(filepath=path)
    elif kind == "blend":
        bpy.ops.wm.save_as_mainfile(filepath=path, compress=True)
    else:
        path = str(scenes.export(tmp_path, kind))
    scenes.clear()
    assert len(load_asset(path).mesh.triangles) == 12


def test_instances_that_multiply_triangles(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(mesh_arrays, "MAX_TRIANGLES", 30)
    scenes.clear()
    for _ in range(3):
        scenes.cube()
    path = str(scenes.export(tmp_path, "blend"))
    scenes.clear()
    with pytest.raises(MeshError, match="show more than 30 triangles"):
        load_asset(path)
