# SPDX-License-Identifier: GPL-3.0-or-later
"""Distorted versions of a model as files, with a manifest for score.py. For scripts: the session is replaced."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ..folders import own_folder, take_place
from ..metric.errors import FileError, FMQMError
from ..report.atomic_files import write_text
from .distortions import DISTORTIONS, Distortion
from .meshes import diagonal, rounded, shaken
from .textures import png_bytes, worse_texture

BlenderObject: TypeAlias = Any  # bpy.types.Object: this room stands without Blender, of which blender/ knows all

MANIFEST = "manifest.csv"
COLUMNS = ("id", "reference", "distorted", "kind", "level")


def degrade(
    spec: str,
    folder: Path,
    seed: int = 0,
    wanted: Sequence[Distortion] = DISTORTIONS,
    announce: Callable[[str], None] = lambda _: None,
) -> list[dict[str, Any]]:
    """Writes a model as it is and distorted, as NAME.glb and NAME_KIND_LEVEL.glb, and MANIFEST; the manifest's rows.

    What is scored against is NAME.glb, so that what a .glb cannot hold of the model counts as no distortion. The same
    arguments and Blender give the same bytes.

    Args:
        spec: a path, or "file.blend:Object name". folder: is made.
        announce: gets a line for what cannot be done to the model.

    Raises:
        FileError: the model cannot be read, or a file cannot be written.
        MeshError: there is no mesh in it.
    """
    from ..blender.files.asset_path import split_spec
    from ..blender.materials.color_images import color_images

    path, part = split_spec(spec)
    stem = "_".join(filter(None, (Path(path).stem, part)))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder}: cannot be made ({error.strerror or error})") from error
    _check_place(path, folder)
    objects = _opened(spec)
    has_texture, has_coordinates = bool(color_images(objects)), all(each.data.uv_layers for each in objects)
    _write(objects, folder / f"{stem}.glb")
    rows = []
    for distortion in wanted:
        lacks = "a texture" * (distortion.on_texture and not has_texture)
        lacks = lacks or "texture coordinates" * (distortion.on_coordinates and not has_coordinates)
        if lacks:
            announce(f"{distortion.name} is left out: {spec} has not {lacks}")
            continue
        name = f"{stem}_{distortion.name}"
        objects = _opened(spec)
        _distort(objects, distortion, np.random.default_rng([seed, DISTORTIONS.index(distortion)]))
        _write(objects, folder / f"{name}.glb")
        values = (name, f"{stem}.glb", f"{name}.glb", distortion.kind, distortion.level)
        rows.append(dict(zip(COLUMNS, values, strict=True)))
    text = io.StringIO()
    writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(str(folder / MANIFEST), text.getvalue())
    return rows


def _check_place(path: str, folder: Path) -> None:
    """Raises FMQMError where NAME.glb would replace the model itself."""
    place = folder / f"{Path(path).stem}.glb"
    if place.exists() and Path(path).exists() and place.samefile(path):
        raise FMQMError(f"{folder}: the model itself is there, and would be replaced; name another folder")


def _opened(spec: str) -> list[BlenderObject]:
    """The model's objects as they are evaluated, each with a mesh of its own."""
    from ..blender.files.asset_path import split_spec
    from ..blender.files.export import open_asset
    from ..blender.files.flatten import flatten_objects

    found = flatten_objects(open_asset(spec), bool(split_spec(spec)[1]))
    objects = [each for each in found if each.type == "MESH" and len(each.data.polygons)]
    for each in objects:
        if each.data.users > 1:
            each.data = each.data.copy()
    return objects


def _write(objects: Sequence[BlenderObject], path: Path) -> None:
    from ..blender.files.export import EXPORTERS
    from ..blender.files.flatten import flatten_objects

    flatten_objects(objects, False)
    try:
        with own_folder(path.parent) as folder:
            EXPORTERS[".glb"](str(folder / path.name))
            take_place(folder / path.name, path)
    except (OSError, RuntimeError) as error:
        raise FileError(f"{path}: cannot be written ({getattr(error, 'strerror', None) or error})") from error


def _distort(objects: Sequence[BlenderObject], distortion: Distortion, rng: np.random.Generator) -> None:
    from ..blender.files import edit
    from ..blender.materials.color_images import color_images
    from ..blender.scene.decimate import add_modifiers

    if distortion.kept < 1:
        for each in objects:
            if distortion.seams:
                edit.split_at_seams(each.data)
                each.modifiers.new("Decimate", "DECIMATE").ratio = distortion.kept
            else:
                add_modifiers(each, distortion.kept)
        edit.apply_modifiers(objects)
    if distortion.noise or distortion.position_bits:
        positions, places = edit.world_positions(objects)
        if distortion.noise:
            positions = shaken(positions, distortion.noise * diagonal(positions), rng)
        if distortion.position_bits:
            positions = rounded(positions, distortion.position_bits)
        edit.move_vertices(objects, positions, places)
    if distortion.uv_bits:  # each layer over the box around it
        edit.change_coordinates(objects, lambda own: rounded(own, distortion.uv_bits))
    if distortion.on_texture:
        for image in color_images(objects):
            # By a PNG of what a decoder gives back, which everybody reads alike.
            edit.replace_image(image, png_bytes(worse_texture(edit.pixels_of(image), distortion)))
