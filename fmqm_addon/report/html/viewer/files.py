# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewer's files beside the page: one for each reference and each level, and the programs that show them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ....comparison.judge import Judge
from ....metric.errors import FileError, OutputError
from ....metric.evaluation import Result
from ....metric.surface import Surface
from ...atomic_files import write_text
from ...render import AZIMUTH, ELEVATION
from ..kept import VIEWER
from .heat import heat_data
from .mesh import mesh_data
from .packing import script_text

PROGRAMS = ("three.js", "viewer.js")
_PARTS = ("shaders.js", "scene.js", "camera.js", "viewer.js")  # of viewer.js
FRONT_RIGHT = (AZIMUTH, ELEVATION)


@dataclass(frozen=True)
class ReferenceFile:
    """A reference's file, for the pairs that share it.

    Attributes:
        path: relative to the report's folder, with / in between. images: digests of those that it holds.
    """

    path: str
    images: frozenset[str]


def write_reference_data(folder: str, stem: str, reference: Surface) -> ReferenceFile:
    """Writes what the viewer shows of a reference, for all pairs that have it.

    Args:
        folder: of the report. stem: by pictures.picture_stem, the reference's own.

    Raises:
        OutputError: it cannot be written.
    """
    data = mesh_data(reference)
    return ReferenceFile(_write(folder, stem, {"mesh": data}), frozenset(data["images"]))


def write_pair_data(
    folder: str,
    stem: str,
    shared: ReferenceFile,
    distorted: Surface,
    result: Result,
    judge: Judge,
    side: tuple[float, float] = FRONT_RIGHT,
) -> dict[str, str]:
    """Writes what the viewer shows of a level: its mesh, and the heat of its comparison.

    Args:
        folder: of the report. stem: by pictures.picture_stem, the pair's own.
        shared: of write_reference_data, of the result's reference.
        side: azimuth and elevation in degrees from which it is seen at first, as render.Camera.framing has them.

    Returns:
        What a record keeps as "viewer": paths relative to the folder.

    Raises:
        OutputError: it cannot be written.
    """
    data = {
        "reference": shared.path,
        "judge": judge.column,
        "side": side,
        "mesh": mesh_data(distorted, shared.images),
        "heat": heat_data(result, judge),
    }
    return {"reference": shared.path, "level": _write(folder, stem, data)}


def has_viewer_data(folder: str, viewer: Mapping[str, Any] | None) -> bool:
    """Whether both files of a record's "viewer" are in a report's folder."""
    return viewer is not None and all(os.path.exists(os.path.join(folder, path)) for path in viewer.values())


def write_programs(folder: str) -> None:
    """Puts the programs beside the data.

    Raises:
        FileError: they cannot be written.
    """
    _make_folder(folder)
    beside = Path(__file__).parent
    for name, parts in zip(PROGRAMS, (("three.js",), _PARTS), strict=True):
        text = "\n".join((beside / part).read_text(encoding="utf-8") for part in parts)
        write_text(os.path.join(folder, VIEWER, name), text)


def _write(folder: str, stem: str, data: Mapping[str, Any]) -> str:
    """A script; returns its path relative to the folder."""
    path = f"{VIEWER}/{stem}.js"
    try:
        _make_folder(folder)
        write_text(os.path.join(folder, VIEWER, f"{stem}.js"), script_text(path, data))
    except FileError as error:
        raise OutputError(str(error)) from error
    return path


def _make_folder(folder: str) -> None:
    path = os.path.join(folder, VIEWER)
    try:
        os.makedirs(path, exist_ok=True)
    except OSError as error:
        raise FileError(f"{path}: this folder cannot be made ({error.strerror or error})") from error
