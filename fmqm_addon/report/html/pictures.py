# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of one pair for the report's page, written while its surfaces are still at hand."""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...comparison.judge import Judge
from ...comparison.normals import corner_normals
from ...comparison.places import place_name
from ...metric.errors import FileError, OutputError
from ...metric.evaluation import Result
from ...metric.geometry import Floats
from ...metric.surface import Surface
from ..atomic_files import check_writable, replaced
from ..heat import FRONT, heat_of
from ..picture_files import SUFFIXES, encode, require_encoder, shrunk
from ..render import Camera, Pixels, is_seen, natural_aspect, render, render_all
from ..texture_memory import texture_bytes
from ..visual.heat_map import histogram
from ..visual.worst import WorstPatch, patch_view, worst_patches
from .kept import FRONT_VIEW, KINDS, LOSS, MESHES
from .viewer.files import has_viewer_data

PICTURES = "pictures"  # the folder beside the page
LONG_SIDE = 1024  # pixels of a view of the whole
THUMBNAIL = 320  # pixels of its smaller copy, the longer side
CLOSE_UP = 320  # pixels; width and height of a close-up
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
    is_whole = all(os.path.exists(os.path.join(folder, name)) for name in picture_files(pictures))
    return is_whole and has_viewer_data(folder, record.get("viewer"))


def picture_files(pictures: Mapping[str, Any]) -> Iterator[str]:
    """Every picture of a pair, relative to the report's folder."""
    for group, kinds in ((pictures["views"], KINDS), ([pictures["thumbnails"]], KINDS), (pictures["worst"], MESHES)):
        yield from (each[kind] for each in group for kind in kinds)


def picture_stem(*parts: str) -> str:
    """What the names of a pair's pictures begin with: safe in any file system, and its own for its own parts.

    Args:
        parts: what tells the pair from the others; the last part is what people know it by.
    """
    readable = re.sub(r"[^A-Za-z0-9]+", "-", Path(parts[-1]).stem).strip("-")[:40]
    digest = hashlib.sha256("\0".join(parts).encode("utf-8", "backslashreplace")).hexdigest()
    return f"{readable or 'pair'}-{digest[:10]}"


def write_pair_pictures(
    folder: str,
    stem: str,
    reference: Surface,
    distorted: Surface,
    result: Result,
    judge: Judge,
    side: tuple[float, float],
) -> dict[str, Any]:
    """Both surfaces and the heat map, from the side of the loss and from the front, and the worst patches in close-up.

    The heat map's colors and the worst patches are the judge's.

    Args:
        folder: of the report, made by open_report_folder. stem: by picture_stem. side: by heat.side_of_loss.

    Returns:
        What JSON can hold, for write_page: paths relative to the folder, with / in between, and what the captions say.

    Raises:
        OutputError: a picture cannot be written.
    """
    heat = heat_of(reference, result, judge)
    sides = {FRONT_VIEW: FRONT} if side == FRONT else {LOSS: side, FRONT_VIEW: FRONT}
    views = [_View(name, *_framed(reference, distorted, each)) for name, each in sides.items()]
    close_ups = _worst(result, judge)
    for each in close_ups:
        seed = result.patch_centers[each.worst.patch]
        each.marks.extend(
            view.camera.place_of(seed) if is_seen(reference, view.camera, seed) else None for view in views
        )
    drawn: dict[str, Pixels] = {}
    normals = corner_normals(reference)
    for view in views:
        own, painted = render_all(reference, view.camera, view.size, (None, heat.paint), normals)
        drawn |= {f"{view.name}-reference": own, f"{view.name}-heat": painted}
    drawn |= _drawn_close_ups("reference", reference, close_ups, normals)
    normals = corner_normals(distorted)
    for view in views:
        drawn[f"{view.name}-distorted"] = render(distorted, view.camera, view.size, normals=normals)
    drawn |= _drawn_close_ups("distorted", distorted, close_ups, normals)
    # The meshes from the front, so that levels can be compared; the heat map from where it says most.
    of_views = {**dict.fromkeys(MESHES, FRONT_VIEW), "heat": views[0].name}
    thumbnails = {f"thumbnail-{kind}": _smaller(drawn[f"{view}-{kind}"]) for kind, view in of_views.items()}
    named = {name: _write(folder, f"{stem}-{name}", pixels) for name, pixels in (drawn | thumbnails).items()}
    return {
        "views": [
            {"name": view.name, "size": list(view.size), **{kind: named[f"{view.name}-{kind}"] for kind in KINDS}}
            for view in views
        ],
        "thumbnails": {kind: named[f"thumbnail-{kind}"] for kind in KINDS},
        "range": [heat.low, heat.high],
        "histogram": histogram(heat.values, heat.low, heat.high).tolist(),
        "has_gaps": heat.has_gaps,
        "judge": str(judge),
        "worst": [
            {kind: named[f"worst{number}-{kind}"] for kind in MESHES} | each.as_dict(reference, result)
            for number, each in enumerate(close_ups, 1)
        ],
        "triangles": [surface.preparation.given for surface in (reference, distorted)],
        "texture_bytes": [texture_bytes(surface) for surface in (reference, distorted)],
    }


@dataclass(frozen=True)
class _View:
    """Of the whole: LOSS or FRONT_VIEW."""

    name: str
    camera: Camera
    size: tuple[int, int]


def _framed(reference: Surface, distorted: Surface, side: tuple[float, float]) -> tuple[Camera, tuple[int, int]]:
    azimuth, elevation = side
    aspect = natural_aspect(reference, distorted, azimuth=azimuth, elevation=elevation)
    size = (round(LONG_SIDE / max(aspect, 1)), round(LONG_SIDE * min(aspect, 1)))
    camera = Camera.framing(reference, distorted, aspect=size[1] / size[0], azimuth=azimuth, elevation=elevation)
    return camera, size


@dataclass(frozen=True)
class _CloseUp:
    """Of a worst patch; marks are its places in the views, None where it is hidden."""

    worst: WorstPatch
    camera: Camera
    marks: list[tuple[float, float] | None]

    def as_dict(self, reference: Surface, result: Result) -> dict[str, Any]:
        """What its caption says."""
        patch = self.worst.patch
        low, high = reference.vertices.min(axis=0), reference.vertices.max(axis=0)
        return {
            **{each.column: float(result.of_patches(each.column)[patch]) for each in Judge},
            "blame": self.worst.blame,
            "value": self.worst.value,
            "place": place_name(result.patch_centers[patch], low, high),
            "object": _object_of(reference, result, patch),
            "at": [None if mark is None else list(mark) for mark in self.marks],
        }


def _worst(result: Result, judge: Judge) -> list[_CloseUp]:
    """The worst patches, as far as anything is lost there."""
    found = []
    for worst in worst_patches(result, CLOSE_UPS, judge):
        if worst.score < 1:
            center, diagonal, normal = patch_view(result, worst.patch)
            found.append(_CloseUp(worst, Camera.facing(center, normal, CLOSE_UP_MARGIN * diagonal), []))
    return found


def _drawn_close_ups(kind: str, surface: Surface, close_ups: Sequence[_CloseUp], normals: Floats) -> dict[str, Pixels]:
    size = (CLOSE_UP, CLOSE_UP)
    return {
        f"worst{number}-{kind}": render(surface, each.camera, size, normals=normals)
        for number, each in enumerate(close_ups, 1)
    }


def _object_of(reference: Surface, result: Result, patch: int) -> str | None:
    """The name of the object that most of a patch belongs to; None where there is only one."""
    if len(reference.objects) < 2:
        return None
    parents = result.patch_mesh.parent[result.patches[patch].faces]
    return reference.objects[int(np.bincount(reference.object[parents]).argmax())]


def _smaller(view: Pixels) -> Pixels:
    height, width = view.shape[:2]
    share = THUMBNAIL / max(height, width)
    return shrunk(view, (max(round(width * share), 1), max(round(height * share), 1)))


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
