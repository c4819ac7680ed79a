# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/score.py as a user runs it, and small files for it."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

SCORE = Path(__file__).resolve().parents[2] / "scripts" / "score.py"
SMALL = ("--samples", "3200", "--patches", "20", "--color-units", "20")
COLUMNS = ("FMQM", "geoSSIM", "geoGraSSIM", "colorSSIM", "colorGraSSIM")  # as tables show them
STAGES = ("load", "prepare", "fields", "features", "total")


def score(
    *arguments: object,
    command: tuple[str, ...] = (),
    env: Mapping[str, str] | None = None,
    cwd: Path | None = None,
    timeout: float | None = None,
) -> subprocess.CompletedProcess[str]:
    """Runs the script; in no case may it end in a traceback."""
    full = [*(command or (sys.executable, str(SCORE))), *(str(argument) for argument in arguments)]
    done = subprocess.run(
        full,
        capture_output=True,
        text=True,
        encoding="utf-8",
        env={**os.environ, **(env or {})},
        cwd=cwd,
        timeout=timeout,
        check=False,
    )
    assert "Traceback" not in done.stderr and "Traceback" not in done.stdout, done.stderr
    return done


def strict_json(text: str) -> dict[str, Any]:
    """Refuses NaN and Infinity, which JSON has not."""

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} in JSON")

    return json.loads(text, parse_constant=refuse)


def read_json(path: Path) -> dict[str, Any]:
    return strict_json(path.read_text(encoding="utf-8"))


def without_seconds(document: dict[str, Any]) -> dict[str, Any]:
    return document | {"pairs": [{k: v for k, v in pair.items() if k != "seconds"} for pair in document["pairs"]]}


def numbers(pair: Mapping[str, Any]) -> list[Any]:
    return [pair[name] for name in COLUMNS]


def write_png(path: Path, pixels: np.ndarray) -> Path:
    """(H, W, 1 to 4) uint8 or uint16, row 0 at the top: a PNG of 8 or 16 bits, from first principles."""
    height, width, channels = pixels.shape
    kind = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    rows = pixels.astype(pixels.dtype.newbyteorder(">")).tobytes()
    stride = len(rows) // height
    filtered = b"".join(b"\0" + rows[first : first + stride] for first in range(0, len(rows), stride))
    header = struct.pack(">IIBBBBB", width, height, 8 * pixels.itemsize, kind, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(filtered)), (b"IEND", b""))
    packed = (struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(packed))
    return path


def noise(size: int = 16, seed: int = 0) -> np.ndarray:
    """(size, size, 3) uint8, row 0 at the top."""
    return np.random.default_rng(seed).integers(0, 256, (size, size, 3), np.uint8)


def write_torus(folder: Path, name: str, image: str = "", shake: float = 0.0) -> Path:
    """name.obj of 24 x 12 quads, textured by an image beside it, its vertices shaken by this much."""
    around, across = 24, 12
    u, v = (grid.ravel() for grid in np.meshgrid(np.arange(around + 1), np.arange(across + 1), indexing="ij"))
    a, b = 2 * np.pi * u / around, 2 * np.pi * v / across
    ring = 1 + 0.4 * np.cos(b)
    positions = np.stack([ring * np.cos(a), ring * np.sin(a), 0.4 * np.sin(b)], axis=1)
    offset = np.random.default_rng(1).normal(0, shake, (around, across, 3))
    positions += offset[u % around, v % across]
    row = np.arange(around)[:, None] * (across + 1) + np.arange(across) + 1
    quads = np.stack([row, row + across + 1, row + across + 2, row + 1], axis=2).reshape(-1, 4)
    lines = [f"mtllib {name}.mtl", "usemtl surface"] if image else []
    lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in positions]
    lines += [f"vt {x:.6f} {y:.6f}" for x, y in zip(u / around, v / across, strict=True)]
    lines += ["f " + " ".join(f"{k}/{k}" for k in quad) for quad in quads]
    (folder / f"{name}.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    if image:
        (folder / f"{name}.mtl").write_text(f"newmtl surface\nmap_Kd {image}\n", encoding="utf-8")
    return folder / f"{name}.obj"
