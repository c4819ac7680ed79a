# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of one pair for the report's page, written while its surfaces are still at hand."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...comparison.judge import Judge
from ...comparison.normals import corner_normals
from ...metric.errors import FileError, OutputError
from ...metric.evaluation import Result
from ...metric.surface import Surface
from ..atomic_files import check_writable, replaced
from ..picture_files import SUFFIXES, encode, require_encoder
from ..render import (
    Camera,
    Pixels,
    is_seen,
    natural_aspect,
    render,
    score_by_face,
    three_views,
)
from ..texture_memory import texture_bytes
from ..visual.worst import patch_view, worst_patches
from .viewer.files import has_viewer_data

PICTURES = "pictures"  # the folder beside the page
VIEW_AREA = 560**2  # pixels of a view of the whole
CLOSE_UP = 288  # pixels; width and height of a close-up
CLOSE_UPS = 3  # worst patches that are shown
CLOSE_UP_MARGIN = 1.2  # a close-up is so many patch diagonals wide


def open_report_folder(folder: str) -> None:
    """Makes the folder of a report, and says early, before minutes of work, what would fail.

    Raises:
        FMQMError: nothing encodes pictures. FileError: the folder cannot be made or written to.
    """
    require_encoder()
    try:
        os.makedirs(os.path.join(folder, PICTURES), exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder}: this folder cannot be made ({error.strerror or error}); name another") from error
    check_writable(os.path.join(folder, PICTURES, "any"))
    check_writable(os.path.join(folder, "any"))


def has_pictures(folder: str | None, record: Mapping[str, Any], judge: Judge) -> bool:
    """Whether a pair needs no more pictures: there is no report, it has no scores, or the judge's are in the folder."""
    if not folder or record["error"] is not None:
        return True
    pictures = record.get("pictures")
    if pictures is None or pictures["judge"] != judge:
        return False
    return os.path.exists(os.path.join(folder, pictures["heat"])) and has_viewer_data(folder, record.get("viewer"))


def picture_stem(*parts: str) -> str:
    """What the names of a pair's pictures begin with: safe in any file system, and its own for its own parts.

    Args:
        parts: what tells the pair from the others; the last part is what people know it by.
    """
    readable = re.sub(r"[^A-Za-z0-9]+", "-", Path(parts[-1]).stem).strip("-")[:40]
    digest = hashlib.sha256("\0".join(parts).encode("utf-8", "backslashreplace")).hexdigest()
    return f"{readable or 'pair'}-{digest[:10]}"


def write_pair_pictures(
    folder: str, stem: str, reference: Surface, distorted: Surface, result: Result, judge: Judge
) -> dict[str, Any]:
    """Reference, distorted surface and heat map on one camera, and the worst patches of both in close-up.

    The heat map's colors and the worst patches are the judge's.

    Args:
        folder: of the report, made by open_report_folder. stem: by picture_stem.

    Returns:
        What JSON can hold, for write_page: paths relative to the folder, with / in between, and what the captions say.

    Raises:
        OutputError: a picture cannot be written.
    """
    aspect = natural_aspect(reference, distorted)
    width = round((VIEW_AREA / aspect) ** 0.5)
    size = (width, round(width * aspect))
    camera = Camera.framing(reference, distorted, aspect=size[1] / size[0])
    faces = score_by_face(result, reference, judge.column)
    views = three_views(reference, distorted, faces, camera, size)
    names = ("reference", "distorted", "heat")
    return {
        **{name: _write(folder, f"{stem}-{name}", view) for name, view in zip(names, views, strict=True)},
        "size": list(size),
        "has_gaps": bool(np.isnan(faces).any()),
        "judge": str(judge),
        "worst": _close_ups(folder, stem, reference, distorted, result, judge, camera),
        "triangles": [surface.preparation.given for surface in (reference, distorted)],
        "texture_bytes": [texture_bytes(surface) for surface in (reference, distorted)],
    }


def _close_ups(
    folder: str,
    stem: str,
    reference: Surface,
    distorted: Surface,
    result: Result,
    judge: Judge,
    overview: Camera,
) -> list[dict[str, Any]]:
    found = []
    pair = {"reference": reference, "distorted": distorted}
    surfaces = {name: (surface, corner_normals(surface)) for name, surface in pair.items()}
    for number, worst in enumerate(worst_patches(result, CLOSE_UPS, judge), 1):
        if worst.score == 1:  # nothing to see here, nor in those that follow
            break
        center, diagonal, normal = patch_view(result, worst.patch)
        camera = Camera.facing(center, normal, CLOSE_UP_MARGIN * diagonal)
        pictures = {
            name: _write(
                folder, f"{stem}-worst{number}-{name}", render(surface, camera, (CLOSE_UP, CLOSE_UP), normals=normals)
            )
            for name, (surface, normals) in surfaces.items()
        }
        seed = result.patch_centers[worst.patch]
        found.append(
            {
                **pictures,
                **{each.column: float(result.of_patches(each.column)[worst.patch]) for each in Judge},
                "blame": worst.blame,
                "value": worst.value,
                "at": overview.place_of(seed) if is_seen(reference, overview, seed) else None,
            }
        )
    return found


def _write(folder: str, stem: str, view: Pixels) -> str:
    """A picture's file; returns its path relative to the folder."""
    data, kind = encode(view)
    name = f"{stem}{SUFFIXES[kind]}"
    try:
        with replaced(os.path.join(folder, PICTURES, name)) as temporary:
            Path(temporary).write_bytes(data)
    except FileError as error:
        raise OutputError(str(error)) from error
    return f"{PICTURES}/{name}"
