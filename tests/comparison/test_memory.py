# SPDX-License-Identifier: GPL-3.0-or-later
"""The estimate of memory: what it counts, and that it is near what a run takes."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmqm_addon.comparison.memory import peak_bytes, peak_text
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.surface import MeshArrays
from fmqm_addon.metric.texture import Material, Texture
from tests.blender.script import SCORE

SIDE = 400  # quads along the square: 320,000 triangles


def mesh(triangles: int, image: np.ndarray) -> MeshArrays:
    materials = tuple(Material(name, Texture(image)) for name in "AB")
    corners = np.zeros((triangles, 3, 2), np.float32)
    return MeshArrays(
        "m", np.zeros((3, 3)), np.zeros((triangles, 3), int), corners, np.zeros(triangles, int), materials
    )


def test_grows_with_triangles_values_and_images() -> None:
    settings = Settings()
    image = np.zeros((1000, 1000, 3), np.uint8)
    one, two = mesh(1_000_000, image), mesh(2_000_000, image)
    assert peak_bytes(two, settings) > peak_bytes(one, settings) + 500e6
    assert peak_bytes(one, settings) == peak_bytes(one, settings, distorted=one)
    assert peak_bytes(one, settings) < peak_bytes(one, settings, distorted=two) < peak_bytes(two, settings)
    wider = replace(one, corners=np.zeros((1_000_000, 3, 4), np.float32))
    assert peak_bytes(wider, settings) > peak_bytes(one, settings) + 100e6
    without = replace(one, materials=())
    assert peak_bytes(one, settings) - peak_bytes(without, settings) == image.nbytes  # once, though two use it
    assert peak_bytes(one, settings, repeats=5) > peak_bytes(one, settings)
    assert "2,000,000 triangles" in peak_text(two, settings) and "GB" in peak_text(two, settings)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process's own peak without its parent's")
def test_near_what_a_run_takes(tmp_path: Path) -> None:
    """A square of 320,000 triangles with vertex colors, as a file."""
    x, y = np.meshgrid(np.linspace(0, 1, SIDE + 1, dtype=np.float32), np.linspace(0, 1, SIDE + 1, dtype=np.float32))
    vertices = np.zeros((SIDE + 1) ** 2, [("xyz", "<f4", 3), ("rgb", "u1", 3)])
    vertices["xyz"] = np.stack([x, y, np.sin(5 * x) / 5], axis=2).reshape(-1, 3)
    corner = (np.arange(SIDE)[:, None] * (SIDE + 1) + np.arange(SIDE)).ravel()
    faces = np.zeros(2 * SIDE * SIDE, [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"] = 3
    faces["corners"][::2] = np.stack([corner, corner + 1, corner + SIDE + 2], axis=1)
    faces["corners"][1::2] = np.stack([corner, corner + SIDE + 2, corner + SIDE + 1], axis=1)
    properties = "".join(f"property float {k}\n" for k in "xyz") + "".join(
        f"property uchar {k}\n" for k in ("red", "green", "blue")
    )
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n{properties}"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path = tmp_path / "square.ply"
    path.write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())
    code = (
        "import re, runpy, sys\n"
        f"sys.argv = ['score.py', {str(path)!r}, {str(path)!r}, '--preset', 'fast', '--quiet']\n"
        "try:\n"
        f"    runpy.run_path({str(SCORE)!r}, run_name='__main__')\n"
        "except SystemExit as end:\n"
        "    assert end.code == 0\n"
        # not ru_maxrss, which a child takes over from its parent: here a worker that has run other tests
        "print(re.search(r'VmHWM:\\s+(\\d+) kB', open('/proc/self/status').read())[1], file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    peak = 1024 * int(done.stderr.split()[-1])
    like = MeshArrays(
        "m", np.zeros((3, 3)), faces["corners"], np.zeros((len(faces), 3, 4), np.float32), np.zeros(len(faces), int), ()
    )
    assert peak == pytest.approx(peak_bytes(like, Settings()), rel=0.3)
