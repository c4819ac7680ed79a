# SPDX-License-Identifier: GPL-3.0-or-later
"""Files with fewer triangles and smaller textures: opened, reduced, exported. For scripts: they replace the session."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy

from ..metric.errors import FileError, MeshError
from ..metric.surface import MeshArrays
from .assets import scene_members
from .decimate import Reader, Version, add_modifiers, scene_reader
from .files import open_file
from .spec import split_spec

NOT_COLOR = "Non-Color"
_ENDINGS = {"JPEG": ".jpg", "TARGA": ".tga", "TARGA_RAW": ".tga", "OPEN_EXR": ".exr", "TIFF": ".tif"}


def open_asset(spec: str) -> list[bpy.types.Object]:
    """Opens a file, as files.load_placed names it, and leaves it open; the objects that are measured.

    Raises:
        FileError: it cannot be opened, or has no such object.
        MeshError: there is no mesh in it.
    """
    path, name = split_spec(spec)
    open_file(path)
    if name and name not in bpy.data.objects:
        raise FileError(f"{path}: no object named {name} in it")
    objects = [bpy.data.objects[name]] if name else scene_members()
    if not any(object_.type == "MESH" for object_ in objects):
        raise MeshError(f"{spec}: no mesh in it; a surface is wanted")
    return objects


def file_reader(spec: str) -> Reader:
    """Reads versions of a file; textures cannot grow again, so that another size opens the file again."""
    names: list[str] = []
    opened: int | None = -1

    def read(version: Version) -> MeshArrays:
        nonlocal names, opened
        if version.texture != opened:
            objects = open_asset(spec)
            names, opened = [object_.name_full for object_ in objects], version.texture
            shrink_textures(objects, version.texture)
        return scene_reader(names, spec)(version)

    return read


def texture_sizes(spec: str) -> list[int]:
    """The longest side of the largest color image, and the powers of two below it; opens the file.

    Raises:
        MeshError: no material has a color image.
    """
    sides = [max(image.size) for image in _color_images(open_asset(spec))]
    if not any(sides):
        raise MeshError(f"{spec}: no material has a color image; there is no texture to make smaller")
    largest = max(sides)
    return [largest, *(2**power for power in reversed(range((largest - 1).bit_length())))]


def shrink_textures(objects: list[bpy.types.Object], size: int | None) -> None:
    """Color images whose longest side exceeds size are scaled down to it, in place, and packed.

    Images of other data (normals, roughness) are left alone: the metric does not see what that would do.
    """
    if size is None:
        return
    for image in _color_images(objects):
        width, height = image.size
        if max(width, height) > size:
            factor = size / max(width, height)
            image.scale(max(1, round(width * factor)), max(1, round(height * factor)))
            image.pack()


def save_version(spec: str, version: Version, path: str) -> None:
    """Opens a file, reduces what is measured of it, and saves its scene; a .blend keeps the modifiers live.

    Raises:
        FileError: the file cannot be written, or its ending is not one of EXPORTERS.
    """
    suffix = check_ending(path)
    objects = open_asset(spec)
    shrink_textures(objects, version.texture)
    for object_ in objects:
        add_modifiers(object_, version.ratio)
    if split_spec(spec)[1]:
        _leave_only(objects[0], live=suffix == ".blend")
    target = Path(path)
    try:
        # Some formats are several files: all are written aside, then moved, the one that names the others last.
        with (
            tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as folder,
            tempfile.TemporaryDirectory() as images,
        ):
            if suffix in _NAMING_IMAGES:
                _write_images(objects, Path(folder if suffix == ".obj" else images), target.stem)
            try:
                EXPORTERS[suffix](os.path.join(folder, target.name))
            except RuntimeError as error:
                raise FileError(f"{path}: Blender cannot export it ({str(error).strip().splitlines()[-1]})") from error
            written = [file for file in Path(folder).rglob("*") if file.is_file()]
            written.sort(key=lambda file: file.name == target.name)
            if not written or written[-1].name != target.name:
                raise FileError(f"{path}: Blender has exported nothing; try another ending")
            for file in written:
                place = target.parent / file.relative_to(folder)
                place.parent.mkdir(exist_ok=True)
                os.replace(file, place)
    except OSError as error:
        raise FileError(f"{path}: cannot be written ({error.strerror or error})") from error


def check_ending(path: str) -> str:
    """The ending, in lower case.

    Raises:
        FileError: Blender does not write such files.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in EXPORTERS:
        raise FileError(f"{path}: unknown file ending {suffix or '(none)'}; wanted: {' '.join(EXPORTERS)}")
    return suffix


# .ply and .stl hold no image. The exporters apply the modifiers.
EXPORTERS: dict[str, Callable[[str], object]] = {
    ".glb": lambda path: bpy.ops.export_scene.gltf(filepath=path, export_format="GLB", export_apply=True),
    ".obj": lambda path: bpy.ops.wm.obj_export(filepath=path, path_mode="STRIP"),
    ".ply": lambda path: bpy.ops.wm.ply_export(filepath=path),
    ".stl": lambda path: bpy.ops.wm.stl_export(filepath=path),
    ".fbx": lambda path: bpy.ops.export_scene.fbx(filepath=path, path_mode="COPY", embed_textures=True),
    ".usd": lambda path: bpy.ops.wm.usd_export(filepath=path, relative_paths=True),
    ".blend": lambda path: _save_blend(path),
}
_NAMING_IMAGES = (".obj", ".fbx", ".usd")  # their exporters want files of the images; .obj goes on naming them


def _save_blend(path: str) -> None:
    """With the images in it, and no path in it that depends on where it is."""
    bpy.ops.file.make_paths_absolute()
    for image in bpy.data.images:
        if image.source == "FILE" and image.packed_file is None and max(image.size):
            image.pack()
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True, relative_remap=False)


def _leave_only(object_: bpy.types.Object, live: bool) -> None:
    """Only this object stays in the session's scene, where it is; what its modifiers use stays in the session.

    Collections are taken out whole, as its modifiers may use one of them.

    Args:
        live: its parent, constraints and armature still move it; exporters need them in the scene, or not at all.
    """
    scene = bpy.context.scene
    if object_ not in scene.collection.objects[:]:
        scene.collection.objects.link(object_)
    for other_scene in list(bpy.data.scenes):
        if other_scene != scene:
            bpy.data.scenes.remove(other_scene)  # glTF has them all
    bpy.context.view_layer.update()
    if live:
        _keep_used(object_)
    else:
        _let_go(object_)
    for other in list(scene.collection.objects):
        if other != object_:
            scene.collection.objects.unlink(other)
    for collection in list(scene.collection.children):
        scene.collection.children.unlink(collection)
    bpy.context.view_layer.update()


def _keep_used(object_: bpy.types.Object) -> None:
    """Modifiers, constraints and drivers do not count as users of objects: files would be saved without these."""
    users = bpy.data.user_map()
    reached: set[bpy.types.ID] = {object_}
    grown = True
    while grown:
        found = {block for block, by in users.items() if by & reached and not isinstance(block, bpy.types.Scene)}
        grown = not found <= reached
        reached |= found
    for block in reached:
        if isinstance(block, bpy.types.Object) and block.library is None:
            block.use_fake_user = True


def _let_go(object_: bpy.types.Object) -> None:
    """What parent, constraints and armature make of an object becomes its own."""
    matrix = object_.matrix_world.copy()
    posed = object_.parent_type == "ARMATURE" or any(modifier.type == "ARMATURE" for modifier in object_.modifiers)
    if posed and object_.type == "MESH":
        # Exporters leave the deforming to a skeleton.
        graph = bpy.context.evaluated_depsgraph_get()
        mesh = bpy.data.meshes.new_from_object(
            object_.evaluated_get(graph), preserve_all_data_layers=True, depsgraph=graph
        )
        object_.modifiers.clear()
        object_.data = mesh
    for constraint in list(object_.constraints):
        object_.constraints.remove(constraint)
    object_.parent = None
    object_.matrix_world = matrix


def _write_images(objects: list[bpy.types.Object], folder: Path, stem: str) -> None:
    """The materials' images as files in a folder, under names that overwrite no other asset's beside it."""
    taken: set[str] = set()
    for image in _images(objects):
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


def _color_images(objects: list[bpy.types.Object]) -> list[bpy.types.Image]:
    return [
        image
        for image in _images(objects)
        if image.colorspace_settings.name != NOT_COLOR and image.source in {"FILE", "GENERATED"} and max(image.size) > 0
    ]


def _images(objects: list[bpy.types.Object]) -> list[bpy.types.Image]:
    """The images that the objects' materials use, each once."""
    materials = [slot.material for object_ in objects for slot in object_.material_slots if slot.material is not None]
    found = [image for material in materials for image in _images_of(material.node_tree, set())]
    return list(dict.fromkeys(found))


def _images_of(tree: bpy.types.NodeTree | None, seen: set[str]) -> Iterator[bpy.types.Image]:
    if tree is None or tree.name_full in seen:
        return
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            yield from _images_of(node.node_tree, seen | {tree.name_full})
        elif node.type == "TEX_IMAGE" and node.image is not None:
            yield node.image
