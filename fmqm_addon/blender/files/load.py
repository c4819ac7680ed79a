# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening files as measurable meshes. For scripts: a file replaces what the session holds."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass, replace
from io import StringIO
from pathlib import Path

import bpy
import numpy as np

from ...comparison.alignment import AssetMesh
from ...metric.errors import FileError, FMQMError, ImageMissingError, MeshError, one_line
from ...metric.geometry import Floats
from ...metric.surface import MeshArrays
from ..access import check_asset
from ..materials.image_files import image_path
from ..materials.images import TextureCache
from ..materials.types import Reading
from ..scene.lods import find_chains
from ..scene.members import check_instances
from ..scene.mesh_arrays import AS_FOUND, to_bake
from ..scene.parts import parts_of
from ..scene.target import asset_mesh
from .asset_path import SUFFIXES, split_spec
from .clips import gltf_hook, set_frame
from .far import in_world, moved_copy, offset_of
from .fbx_groups import mark_groups
from .import_warnings import left_out
from .loaded import before_evaluation, check_loaded, mute_imports
from .named import check_names
from .preflight import check_beside
from .preflight_file import check_file
from .textures import find_textures
from .undecodable import why_no_image, why_not_imported


def load_mesh(spec: str, reading: Reading = AS_FOUND) -> MeshArrays:
    """The asset in a file as one mesh in its world frame; as load_asset."""
    return load_asset(spec, reading).world()


def load_asset(spec: str, reading: Reading = AS_FOUND, announce: Callable[[str], None] = lambda _: None) -> AssetMesh:
    """The asset in a file as one mesh, with its place; nothing stays in the session.

    Args:
        spec: a path, or "file.glb:Name" for an object with those below it, hidden or not, or for a collection. Of a
            whole file the render-visible objects of the active scene count.
        reading: how it is read.
        announce: gets a line before what takes a while.

    Raises:
        FileError: the file is missing, unreadable or of an unknown kind, or has no such object.
        MeshError: it holds nothing that can be measured.
    """
    path, object_name = split_spec(spec)
    try:
        offset = offset_of(path) if os.path.isfile(path) else None
        opened = open_file(path, reading, offset)
        block = named(object_name, path) if object_name else None
        omissions = (*opened.warnings, *left_out(path, reading.texture is None))
        name, cache = object_name or Path(path).name, TextureCache()
        try:
            parts = parts_of(block, reading)
            objects = parts.objects
            if not objects:
                raise MeshError("no mesh in it; a surface is wanted")
            check_instances(objects)
            baked = to_bake(objects, reading, cache)
            if baked:
                announce(f"baking {', '.join(baked)} (materials of {name})")
            origin = block if isinstance(block, bpy.types.Object) else None
            found = _moved_back(asset_mesh(objects, name, reading, origin, cache), path, offset)
        except FMQMError as error:
            why = f" ({'; '.join(omissions)})" if omissions else ""
            said = isinstance(error, ImageMissingError) and why_no_image(path)
            raise type(error)(f"{spec}: {said or str(error).removeprefix(f'{name}: ')}{why}") from error
        warnings, notes = (
            tuple(one_line(f"{Path(path).name}: {text}") for text in said)
            for said in (omissions, (*opened.notes, *parts.notes))
        )
        mesh = replace(found.mesh, warnings=(*warnings, *found.mesh.warnings), notes=(*notes, *found.mesh.notes))
        return replace(found, mesh=mesh)
    finally:
        _clear_session()


@dataclass(frozen=True)
class Opened:
    """What is to be said of a file in the session.

    Attributes:
        warnings: what it refers to and Blender cannot find, as far as that must be asked before, and what was muted.
        notes: what misleads nobody.
    """

    warnings: tuple[str, ...]
    notes: tuple[str, ...] = ()


def open_file(path: str, reading: Reading = AS_FOUND, offset: Floats | None = None) -> Opened:
    """Opens or imports a file into an emptied session. Nodes of it that read other files are muted.

    Imported files stand in the pose that their nodes give, without a clip, as files.clips has it.

    Args:
        reading: what it may name, how large its images may be, and the frame of its first clip that is wanted.
        offset: (3,) taken off a text file's vertices, as files.far has it.

    Raises:
        FileError: the file is missing, unreadable or of an unknown kind, or names what must not be opened.
        MeshError: an image exceeds the limits; none was decoded.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise FileError(f"{path}: unknown file ending {suffix or '(none)'}; known: {' '.join(SUFFIXES)}")
    if not os.path.isfile(path):
        what = "it is a folder or a device; a file is wanted" if os.path.exists(path) else "no such file"
        raise FileError(f"{path}: {what}")
    if not os.access(path, os.R_OK):
        raise FileError(f"{path}: permission denied; the file cannot be read")
    check_asset(path, reading.access)
    check_names(path, reading.access)
    check_beside(path)
    with _silent(suffix in _NOISY):
        unresolved = check_file(path)
    _clear_session()
    try:
        # Blender prints the tracebacks of importers written in Python, each folder where it looks for an image, and
        # what USD finds odd.
        with redirect_stderr(StringIO()), _silent(suffix in _NOISY):
            muted, notes = _open(path, suffix, reading, offset)
            notes = (*notes, *set_frame(suffix, reading.frame))
    except RuntimeError as error:
        said = last_line(error)
        why = why_not_imported(path, said) or f"{said}; check the file, or export it again"
        raise FileError(f"{path}: {why}") from error
    except UnicodeEncodeError as error:
        raise FileError(f"{path}: Blender takes only names in UTF-8; rename the file or its folder") from error
    except OSError as error:
        raise FileError(f"{path}: no room for a temporary copy of it ({error.strerror}); free some") from error
    return Opened((*unresolved, *muted), notes)


def _moved_back(found: AssetMesh, path: str, offset: Floats | None) -> AssetMesh:
    """With the offset of its file added again, in double precision."""
    if offset is None:
        return found
    shift = np.linalg.inv(found.origin[:3, :3]) @ in_world(path, offset)
    return replace(found, mesh=replace(found.mesh, positions=found.mesh.positions + shift))


def chains_of_file(path: str, reading: Reading = AS_FOUND) -> list[tuple[str, list[tuple[int, str]]]]:
    """The chains of detail in a file: name, and level and object or collection from fine to coarse.

    Raises:
        FileError: as open_file.
    """
    try:
        open_file(path, reading)
        return [
            (chain.name, [(level, asset.name) for level, asset in chain.levels])
            for chain in find_chains(bpy.context.scene)
        ]
    finally:
        _clear_session()


def _clear_session() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@contextmanager
def _silent(silent: bool) -> Iterator[None]:
    """Lets nothing through to the process's standard error, not even from C."""
    try:
        kept = os.dup(2) if silent else None
    except OSError:
        kept = None  # it is closed
    if kept is None:
        yield
        return
    sys.stderr.flush()
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _open(asset: str, suffix: str, reading: Reading, offset: Floats | None) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Opens or imports a file into the empty session; says what was muted, and which images were found elsewhere."""
    path, muted = os.path.abspath(asset), list[str]()

    def look() -> None:
        muted.extend(mute_imports())
        try:
            check_loaded(asset, reading)
        except MeshError as error:
            raise type(error)(f"{asset}: {error}") from error

    if suffix == ".blend":
        with before_evaluation(look):
            bpy.ops.wm.open_mainfile(filepath=path, load_ui=False, use_scripts=False)
        return tuple(muted), ()
    operator = _IMPORTERS[suffix]()
    try:
        operator.get_rna_type()
    except KeyError as error:
        raise FileError(
            f"{path}: this Blender has no importer for {suffix}; convert the file, for example to .glb"
        ) from error
    options: dict[str, bool | float] = dict(_OPTIONS.get(suffix, {}))
    if suffix == ".fbx":  # a clip's frame 0 is where glTF files have it
        options |= {"use_anim": reading.frame is not None, "anim_offset": 0.0}
    with moved_copy(path, offset) as copy:
        with gltf_hook(reading.frame is not None):
            result = operator(filepath=copy, **options)
        for image in bpy.data.images if copy != path else ():
            image.filepath = image_path(image)  # as long as the copy's folder is there, which it begins with
    if "FINISHED" not in result:
        raise FileError(f"{path}: the importer refused it ({', '.join(result).lower()})")
    for image in bpy.data.images if suffix == ".usdz" else ():
        if image.source == "FILE" and image.packed_file is not None:  # by way of a folder with a name by chance
            image.filepath_raw = os.path.join(path, os.path.basename(image.filepath))
    if suffix == ".fbx":
        mark_groups(path)
    notes = find_textures(asset, reading.access)
    look()
    return tuple(muted), notes


_IMPORTERS: dict[str, Callable[[], bpy.types.Operator]] = {
    ".obj": lambda: bpy.ops.wm.obj_import,
    ".ply": lambda: bpy.ops.wm.ply_import,
    ".stl": lambda: bpy.ops.wm.stl_import,
    ".glb": lambda: bpy.ops.import_scene.gltf,
    ".gltf": lambda: bpy.ops.import_scene.gltf,
    ".fbx": lambda: bpy.ops.wm.fbx_import,
    ".usd": lambda: bpy.ops.wm.usd_import,
    ".usda": lambda: bpy.ops.wm.usd_import,
    ".usdc": lambda: bpy.ops.wm.usd_import,
    ".usdz": lambda: bpy.ops.wm.usd_import,
    ".abc": lambda: bpy.ops.wm.alembic_import,
}
# These importers do not mend meshes unless told to, and Blender would read beyond the ends of their arrays.
_USD = (".usd", ".usda", ".usdc", ".usdz")
_OPTIONS = dict.fromkeys((*_USD, ".abc"), {"validate_meshes": True})
_NOISY = {".fbx", ".obj", *_USD}


def named(name: str, path: str) -> bpy.types.Object | bpy.types.Collection:
    """The object, else the collection of an opened file that has a name.

    Raises:
        FileError: there is none.
    """
    found = bpy.data.objects.get(name) or bpy.data.collections.get(name)
    if found is None:
        raise FileError(f"{path}: no object or collection named {name} in it")
    return found


def last_line(error: RuntimeError, program: str = "the importer") -> str:
    """What happened: the last line of the report, or of the whole traceback, that an operator put into its error."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip() and not line.startswith("Location:")]
    if not lines:
        return f"{program} failed without saying why"
    if any(line.endswith("Traceback (most recent call last):") for line in lines):
        return f"{program} broke off ({_asserted(lines) if lines[-1] == 'AssertionError' else lines[-1]})"
    return lines[-1].removeprefix("Error: ").rstrip(".")


def _asserted(lines: list[str]) -> str:
    """What an importer's assertion means that says nothing itself, by the lines of its traceback."""
    code = next((line for line in reversed(lines) if line.startswith("assert ")), "")
    known = next((meaning for part, meaning in _ASSERTIONS.items() if part in code), "")
    return known or code.removeprefix("assert ") or "AssertionError"


# Of the glTF importer, by what it asserts.
_ASSERTIONS = {
    "parent is None": "one of its nodes is the child of two",
    "MAT2": "it has an accessor of MAT2 or MAT3, which Blender does not read",
    "stride": "the stride of an accessor is no multiple of its elements' size",
}
