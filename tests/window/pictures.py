# SPDX-License-Identifier: GPL-3.0-or-later
"""Scripts that run in Blender's window, and the pictures of it that they take.

FMQM_SCREENSHOT names a command `... SCRIPT OUT_PREFIX [arguments of Blender]` that opens Blender's window, runs the
script with shot(name) and done() in builtins, and saves OUT_PREFIX-name.png.
"""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.house.test_extension import ROOT

Pixels = np.ndarray


def run_in_window(script: str, package: Path, out: Path, *arguments: str) -> str:
    """Runs a script of this folder in the window, with the built extension; what it has printed.

    It finds the extension in FMQM_ZIP, a folder for what it writes in FMQM_OUT, and the checkout in FMQM_ROOT.
    """
    command = os.environ.get("FMQM_SCREENSHOT")
    if not command:
        pytest.skip("FMQM_SCREENSHOT does not name a command that takes pictures of Blender's window")
    done = subprocess.run(
        [*shlex.split(command), str(Path(__file__).with_name(script)), str(out / "view"), *arguments],
        env={**os.environ, "FMQM_ZIP": str(package), "FMQM_OUT": str(out), "FMQM_ROOT": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    error = out / "error.txt"
    assert not error.exists(), error.read_text()
    assert "Traceback" not in done.stdout + done.stderr, done.stdout + done.stderr
    print(f"pictures are in {out}")
    return done.stdout


def pictures_in(out: Path) -> dict[str, Pixels]:
    """(H, W, 3) float pictures of the whole window in [0, 1], by name."""
    image = pytest.importorskip("PIL.Image")
    return {
        path.stem.removeprefix("view-"): np.asarray(image.open(path).convert("RGB"), np.float64) / 255
        for path in sorted(out.glob("view-*.png"))
    }


def cut(picture: Pixels, region: list[int], less: int = 0) -> Pixels:
    """A region of the window, whose rows count from below."""
    x, y, width, height = region
    return picture[picture.shape[0] - y - height : picture.shape[0] - y, x : x + width - less]
