# SPDX-License-Identifier: GPL-3.0-or-later
"""Files with fewer triangles and smaller textures: opened, decimated, saved. For scripts: the session is replaced."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from io import StringIO
from pathlib import Path

import bpy

from ...apart import check_apart
from ...comparison.decimation import Version, VersionReader
from ...folders import own_folder, take_place
from ...metric.errors import FileError, MeshError, SettingsError
from ...metric.surface import MeshArrays
from ..materials.color_images import color_images, falling_sides, images_of, shrink
from ..materials.types import Reading
from ..scene.decimate import add_modifiers, scene_reader
from ..scene.members import instanced, lineage
from ..scene.mesh_arrays import AS_FOUND
from ..scene.parts import parts_of
from .asset_path import split_spec
from .flatten import flatten_objects
from .load import last_line, load_mesh, named, open_file
from .loaded import mute_imports

_ENDINGS = {"JPEG": ".jpg", "TARGA": ".tga", "TARGA_RAW": ".tga", "OPEN_EXR": ".exr", "TIFF": ".tif"}


def open_asset(spec: str, reading: Reading = AS_FOUND) -> list[bpy.types.Object]:
    """Opens a file, as files.load_asset names it, and leaves it open; the objects that are measured.

    Raises:
        FileError: it cannot be opened, or has no such object.
        MeshError: there is no mesh in it that could be decimated.
    """
    path, name = split_spec(spec)
    open_file(path, reading)
    objects = parts_of(named(name, path) if name else None, reading).objects
    if not any(object_.type == "MESH" for object_ in objects):
        if any(instanced(object_) for object_ in objects):
            raise MeshError(f"{spec}: it shows only instances; make them real (Object > Apply > Make Instances Real)")
        raise MeshError(f"{spec}: no mesh in it; a mesh is wanted, since nothing else can be decimated")
    return objects


def file_reader(spec: str, reading: Reading = AS_FOUND) -> VersionReader:
    """Reads versions of a file; textures cannot grow again, so that another size opens the file again."""
    names: list[str] = []
    opened: int | None = -1

    def read(version: Version) -> MeshArrays:
        nonlocal names, opened
        if version.texture != opened or not bpy.data.objects:  # reading back what was written leaves nothing open
            objects = open_asset(spec, reading)
            names, opened = [object_.name_full for object_ in objects], version.texture
            shrink_textures(objects, version.texture)
        return scene_reader(names, spec)(version)

    return read


def texture_sizes(spec: str, reading: Reading = AS_FOUND) -> list[int]:
    """The longest side of the largest color image, and the powers of two below it; opens the file.

    Raises:
        MeshError: no material has a color image.
    """
    return list(falling_sides(open_asset(spec, reading), spec))


def shrink_textures(objects: list[bpy.types.Object], size: int | None) -> None:
    """Scales color images whose longest side exceeds size down to it, in place, and packs them.

    Images of other data (normals, roughness) are left alone: the metric does not see what that would do.
    """
    if size is None:
        return
    for image in color_images(objects):
        shrink(image, size)


def written_reader(spec: str, path: str, reading: Reading = AS_FOUND) -> VersionReader:
    """Reads versions of a file as save_version writes them to path, from files beside it that do not stay."""

    def read(version: Version) -> MeshArrays:
        with _aside(path) as folder:
            written = folder / Path(path).name
            _export(spec, version, path, written, reading)
            return load_mesh(str(written))

    return read


def save_version(spec: str, version: Version, path: str, reading: Reading = AS_FOUND) -> tuple[str, ...]:
    """Opens a file, decimates what is measured of it, and saves that; a .blend keeps its scene, the modifiers live.

    Returns:
        What should be known of the written file.

    Raises:
        FileError: the file cannot be written, or would replace one that the asset is read from.
    """
    target = Path(path)
    with _aside(path) as folder:
        warnings, inputs = _export(spec, version, path, folder / target.name, reading)
        written = [file for file in folder.rglob("*") if file.is_file()]
        written.sort(key=lambda file: file.name == target.name)  # the one that names the others is moved last
        places = [target.parent / file.relative_to(folder) for file in written]
        check_apart([(f"{path} writes", str(place)) for place in places], inputs, FileError)
        for file, place in zip(written, places, strict=True):
            place.parent.mkdir(exist_ok=True)
            take_place(file, place)
    return warnings


def files_read(spec: str, reading: Reading = AS_FOUND) -> list[str]:
    """The file of an asset, and the images and material files that it names; opens it.

    Raises:
        FileError, MeshError: as open_asset.
    """
    open_asset(spec, reading)
    return _inputs(spec)


def check_ending(path: str) -> str:
    """The ending, in lower case.

    Raises:
        SettingsError: Blender does not write such files.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in EXPORTERS:
        raise SettingsError(f"{path}: unknown file ending {suffix or '(none)'}; wanted: {' '.join(EXPORTERS)}")
    return suffix


# .ply and .stl hold no image.
EXPORTERS: dict[str, Callable[[str], object]] = {
    ".glb": lambda path: bpy.ops.export_scene.gltf(
        filepath=path, export_format="GLB", use_active_scene=True, export_animations=False
    ),
    ".obj": lambda path: bpy.ops.wm.obj_export(filepath=path, path_mode="STRIP"),
    ".ply": lambda path: bpy.ops.wm.ply_export(filepath=path),
    ".stl": lambda path: bpy.ops.wm.stl_export(filepath=path),
    ".fbx": lambda path: bpy.ops.export_scene.fbx(
        filepath=path, path_mode="COPY", embed_textures=True, bake_anim=False
    ),
    ".usd": lambda path: bpy.ops.wm.usd_export(filepath=path, relative_paths=True),
    ".blend": lambda path: _save_blend(path),
}
_NAMING_IMAGES = (".obj", ".fbx", ".usd")  # their exporters want files of the images; .obj goes on naming them


def _export(
    spec: str, version: Version, path: str, written: Path, reading: Reading
) -> tuple[tuple[str, ...], list[str]]:
    """Opens and decimates a file, and writes it, with the files that it names beside it.

    Args:
        path: what errors call it.

    Returns:
        What should be known of it, and the files that the asset was read from.
    """
    suffix = check_ending(path)
    objects = open_asset(spec, reading)
    inputs, alone = _inputs(spec), bool(split_spec(spec)[1])
    warnings = tuple(f"{path}: {told}" for told in mute_imports()) if suffix == ".blend" else ()
    shrink_textures(objects, version.texture)
    for object_ in objects:
        add_modifiers(object_, version.ratio)
    if suffix != ".blend":
        if any(map(_moves, objects)):
            warnings = (f"{path}: it holds the pose as it stands, no skeleton, shape keys or animation; a .blend does",)
        objects = flatten_objects(objects, alone)
    elif alone:
        _leave_only(objects)
    with own_folder() as images:
        if suffix in _NAMING_IMAGES:
            _write_images(objects, written.parent if suffix == ".obj" else images, written.stem)
        try:
            with redirect_stderr(StringIO()):  # Blender prints the tracebacks of exporters written in Python
                EXPORTERS[suffix](str(written))
        except RuntimeError as error:
            raise FileError(f"{path}: Blender cannot export it ({last_line(error, 'the exporter')})") from error
    if not written.is_file():
        raise FileError(f"{path}: Blender has exported nothing; try another ending")
    return warnings, inputs


@contextmanager
def _aside(path: str) -> Iterator[Path]:
    """A folder beside a file, which is removed.

    Raises:
        FileError: within it something cannot be written.
    """
    try:
        with own_folder(Path(path).parent) as folder:
            (folder / "files").mkdir()  # with nothing of the folder's own beside them
            yield folder / "files"
    except OSError as error:
        raise FileError(f"{path}: cannot be written ({error.strerror or error})") from error


def _inputs(spec: str) -> list[str]:
    """The files that the session was filled from."""
    path, _ = split_spec(spec)
    files = [path, *bpy.utils.blend_paths(absolute=True, packed=False)]
    if path.lower().endswith(".obj"):
        named = re.findall(rb"^[ \t]*mtllib[ \t]+(.+?)\s*$", Path(path).read_bytes(), re.MULTILINE)
        names = [*(os.fsdecode(name.strip(b'"')) for name in named), f"{Path(path).stem}.mtl"]  # read even if not named
        files += [os.path.join(os.path.dirname(path), name) for name in names]
    return [file for file in files if os.path.exists(file)]


def _moves(object_: bpy.types.Object) -> bool:
    """Whether there is more to an object than its pose."""
    return (
        getattr(object_.data, "shape_keys", None) is not None
        or any(modifier.type == "ARMATURE" for modifier in object_.modifiers)
        or any(each.type == "ARMATURE" or each.animation_data is not None for each in lineage(object_))
    )


def _save_blend(path: str) -> None:
    """With the images in it, and no path in it that depends on where it is."""
    bpy.ops.file.make_paths_absolute()
    for image in bpy.data.images:
        if image.source == "FILE" and image.packed_file is None and max(image.size):
            image.pack()
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True, relative_remap=False)


def _leave_only(objects: Sequence[bpy.types.Object]) -> None:
    """Only these objects stay in the session's scene, where they are and shown; what they use stays in the session.

    Collections are taken out whole, as modifiers may use one of them.
    """
    scene = bpy.context.scene
    for object_ in objects:
        if object_ not in scene.collection.objects[:]:
            scene.collection.objects.link(object_)
        object_.hide_render = False
    for other_scene in list(bpy.data.scenes):
        if other_scene != scene:
            bpy.data.scenes.remove(other_scene)
    bpy.context.view_layer.update()
    _keep_used(objects)
    for other in list(scene.collection.objects):
        if other not in objects:
            scene.collection.objects.unlink(other)
    for collection in list(scene.collection.children):
        scene.collection.children.unlink(collection)
    bpy.context.view_layer.update()


def _keep_used(objects: Sequence[bpy.types.Object]) -> None:
    """Modifiers, constraints and drivers do not count as users of objects: files would be saved without these."""
    users = bpy.data.user_map()
    reached: set[bpy.types.ID] = set(objects)
    grown = True
    while grown:
        found = {block for block, by in users.items() if by & reached and not isinstance(block, bpy.types.Scene)}
        grown = not found <= reached
        reached |= found
    for block in reached:
        if isinstance(block, bpy.types.Object) and block.library is None:
            block.use_fake_user = True


def _write_images(objects: list[bpy.types.Object], folder: Path, stem: str) -> None:
    """The materials' images as files in a folder, under names that overwrite no other asset's beside it."""
    taken: set[str] = set()
    for image in images_of(objects):
        if image.source not in {"FILE", "GENERATED"} or not max(image.size):
            continue
        if image.source == "GENERATED" and image.packed_file is None:
            image.pack()
        if image.packed_file is None:
            data, ending = Path(bpy.path.abspath(image.filepath)).read_bytes(), Path(image.filepath).suffix
        else:
            data, ending = image.packed_file.data, _ENDINGS.get(image.file_format, f".{image.file_format.lower()}")
        base = f"{stem}_{re.sub(r'[^A-Za-z0-9_-]+', '_', Path(image.name).stem)}"
        name, number = base + ending, 1
        while name in taken:
            name, number = f"{base}_{number}{ending}", number + 1
        taken.add(name)
        (folder / name).write_bytes(data)
        image.filepath_raw = str(folder / name)
        if image.packed_file is not None:
            image.unpack(method="REMOVE")
