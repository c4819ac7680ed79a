# SPDX-License-Identifier: GPL-3.0-or-later
"""Distorted versions of a model as files, with a manifest for score.py. For scripts: the session is replaced."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ..folders import own_folder, take_place
from ..metric.colorspace import encode_srgb
from ..metric.errors import FileError, FMQMError
from ..metric.geometry import Floats
from ..report.atomic_files import write_text
from .distortions import DISTORTIONS, Distortion
from .meshes import diagonal, rounded, shaken
from .textures import png_bytes, worse_texture

# bpy.types of these names, which bpy has no stubs for; this room is imported without Blender.
BlenderObject: TypeAlias = Any
BlenderMesh: TypeAlias = Any
BlenderImage: TypeAlias = Any
UVLayer: TypeAlias = Any

MANIFEST = "manifest.csv"
COLUMNS = ("id", "reference", "distorted", "kind", "level")
_JOINED = 1e-6  # of the longest side: vertices that importers have split are this near to each other at most


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

    path, part = split_spec(spec)
    stem = "_".join(filter(None, (Path(path).stem, part)))
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(f"{folder}: cannot be made ({error.strerror or error})") from error
    _check_place(path, folder)
    objects = _opened(spec)
    has_texture, has_coordinates = bool(_textures(objects)), all(each.data.uv_layers for each in objects)
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
    from ..blender.scene.decimate import add_modifiers

    if distortion.kept < 1:
        for each in objects:
            if distortion.seams:
                _split_at_seams(each.data)
                each.modifiers.new("Decimate", "DECIMATE").ratio = distortion.kept
            else:
                add_modifiers(each, distortion.kept)
        _apply_modifiers(objects)
    if distortion.noise or distortion.position_bits:
        positions, places = _world_positions(objects)
        if distortion.noise:
            positions = shaken(positions, distortion.noise * diagonal(positions), rng)
        if distortion.position_bits:
            positions = rounded(positions, distortion.position_bits)
        _move_vertices(objects, positions, places)
    if distortion.uv_bits:
        _round_coordinates(objects, distortion.uv_bits)
    if distortion.on_texture:
        for image in _textures(objects):
            _replace_texture(image, distortion)


def _apply_modifiers(objects: Iterable[BlenderObject]) -> None:
    import bpy

    graph = bpy.context.evaluated_depsgraph_get()
    graph.update()
    made = [bpy.data.meshes.new_from_object(each.evaluated_get(graph), depsgraph=graph) for each in objects]
    for each, mesh in zip(objects, made, strict=True):
        each.modifiers.clear()
        each.data = mesh


def _split_at_seams(mesh: BlenderMesh) -> None:
    """Cuts a mesh open where its texture coordinates jump: decimation keeps borders nearly where they are."""
    import bmesh

    edit = bmesh.new()
    try:
        edit.from_mesh(mesh)
        corners = [vertex.co for vertex in edit.verts]
        extent = max(max(axis) - min(axis) for axis in zip(*corners, strict=True))
        bmesh.ops.remove_doubles(edit, verts=edit.verts[:], dist=_JOINED * extent)
        layer = edit.loops.layers.uv.active
        if layer is not None:
            inner = [edge for edge in edit.edges if len(edge.link_loops) == 2]
            seams = [edge for edge in inner if _is_seam(edge.link_loops[0], edge.link_loops[1], layer)]
            bmesh.ops.split_edges(edit, edges=seams)
        edit.to_mesh(mesh)
    finally:
        edit.free()


def _is_seam(one: Any, other: Any, layer: Any) -> bool:
    """Whether the two faces of an edge have other texture coordinates at one of its ends.

    Args:
        one, other: the edge's first corners in the two faces.
    """
    ends = {each.vert: each[layer].uv for each in (one, one.link_loop_next)}
    return any(ends[each.vert] != each[layer].uv for each in (other, other.link_loop_next))


def _world_positions(objects: Sequence[BlenderObject]) -> tuple[Floats, list[slice]]:
    """(N, 3) float64 of all vertices, and where those of each object are."""
    from ..blender import arrays

    parts, places, first = [], [], 0
    for each in objects:
        matrix = np.array(each.matrix_world)
        own = arrays.read(each.data.vertices, "co", 3, np.float32).astype(np.float64)
        parts.append(own @ matrix[:3, :3].T + matrix[:3, 3])
        places.append(slice(first, first + len(own)))
        first += len(own)
    return np.concatenate(parts), places


def _move_vertices(objects: Sequence[BlenderObject], positions: Floats, places: Sequence[slice]) -> None:
    from ..blender import arrays

    for each, place in zip(objects, places, strict=True):
        matrix = np.array(each.matrix_world)
        own = np.linalg.solve(matrix[:3, :3], (positions[place] - matrix[:3, 3]).T).T
        arrays.write(each.data.vertices, "co", own.astype(np.float32))
        each.data.update()


def _round_coordinates(objects: Sequence[BlenderObject], bits: int) -> None:
    """Each mesh's own, over the box around them."""
    from ..blender import arrays

    for layer in _layers(objects):
        own = arrays.read(layer.uv, "vector", 2, np.float32).astype(np.float64)
        arrays.write(layer.uv, "vector", rounded(own, bits).astype(np.float32))


def _layers(objects: Sequence[BlenderObject]) -> Iterator[UVLayer]:
    for each in objects:
        yield from each.data.uv_layers


def _textures(objects: Sequence[BlenderObject]) -> list[BlenderImage]:
    from ..blender.materials.color_images import color_images

    return color_images(list(objects))


def _replace_texture(image: BlenderImage, distortion: Distortion) -> None:
    """By a PNG of what a decoder gives back, which everybody reads alike."""
    import bpy

    from ..blender import arrays

    width, height = image.size
    values = arrays.read_pixels(image).reshape(height, width, image.channels)[::-1]
    if image.channels < 3:
        values = np.repeat(values[..., :1], 3, axis=2)
    if image.is_float:  # linear light
        values = np.concatenate([encode_srgb(values[..., :3]), values[..., 3:]], axis=2)
    pixels = np.round(np.clip(values, 0.0, 1.0) * 255).astype(np.uint8)
    data = png_bytes(worse_texture(pixels, distortion))
    worse = bpy.data.images.new(image.name, 1, 1)
    worse.pack(data=data, data_len=len(data))
    worse.source = "FILE"
    worse.colorspace_settings.name = "sRGB" if image.is_float else image.colorspace_settings.name
    worse.alpha_mode = image.alpha_mode
    image.user_remap(worse)
