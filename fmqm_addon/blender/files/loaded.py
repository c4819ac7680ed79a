# SPDX-License-Identifier: GPL-3.0-or-later
"""What a file has brought into the session, looked through before anything is evaluated or decoded."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import bpy

from ...metric.errors import FileError, FMQMError
from ..access import Access, check_folder, check_named
from ..materials.image_files import check_limits, image_path
from ..materials.types import Reading
from ..scene.shaping import check_memory

_IMPORTS = "GeometryNodeImport"  # how the types of nodes begin that read files: CSV, OBJ, PLY, STL, Text, VDB
# Whose files nothing reads that is measured; of Geometry Nodes only the muted ones have some.
_UNREAD = (
    bpy.types.Text,
    bpy.types.Scene,
    bpy.types.WindowManager,
    bpy.types.Screen,
    bpy.types.WorkSpace,
    bpy.types.GeometryNodeTree,
)
_UNSEEN = (*_UNREAD[:-1], bpy.types.World, bpy.types.Light)  # what shows images that are never decoded


@contextmanager
def before_evaluation(check: Callable[[], None]) -> Iterator[None]:
    """Calls check as soon as a .blend file is read, before Blender evaluates what it holds.

    Raises:
        FMQMError: what check raises; then nothing was evaluated, and the session holds no objects.
    """
    raised: list[FMQMError] = []

    @bpy.app.handlers.persistent  # type: ignore[untyped-decorator]
    def look(*_: object) -> None:
        try:
            check()
        except Exception as error:  # Blender would print it, and go on
            raised.append(error if isinstance(error, FMQMError) else FileError(f"{type(error).__name__}: {error}"))
            bpy.data.batch_remove(list(bpy.data.objects))
            for scene in bpy.data.scenes:
                scene.sequence_editor_clear()

    handlers = bpy.app.handlers.load_post
    handlers.append(look)
    try:
        yield
    finally:
        handlers.remove(look)
    if raised:
        raise raised[0]


def check_loaded(asset: str, reading: Reading) -> None:
    """Refuses what the loaded file names and must not open, and images that exceed the limits.

    Raises:
        FileError, OutsideError: as access.check_named. ImageSizeError, MeshError: as images.check_limits.
    """
    folder = os.path.dirname(os.path.abspath(asset))
    names = [library.filepath for library in bpy.data.libraries if not _is_packed(library)]
    check_named(asset, map(bpy.path.abspath, names), folder, reading.access)
    for block, names in bpy.data.file_path_map().items():
        if not isinstance(block, (bpy.types.Library, *_UNREAD)) and not _is_packed(block):
            check_named(asset, sorted(_absolute(name, block) for name in names), folder, reading.access)
    for object_ in bpy.data.objects:
        for modifier in object_.modifiers:
            if modifier.type == "NODES":
                _check_bakes(asset, folder, object_, modifier, reading.access)
    unseen = (*_UNSEEN, bpy.types.Material) if reading.texture is not None else _UNSEEN
    users = bpy.data.user_map(key_types={"IMAGE"}) if bpy.data.images else {}
    for image in bpy.data.images:
        if not all(isinstance(user, unseen) for user in users.get(image, ())):
            check_limits(image, reading.limits)
    check_memory(bpy.data.objects)


def mute_imports() -> tuple[str, ...]:
    """Mutes the nodes that read files whenever they are evaluated; says so in one line."""
    muted: dict[str, None] = {}
    for tree in bpy.data.node_groups:
        for node in tree.nodes:
            if not node.bl_idname.startswith(_IMPORTS):
                continue
            muted[node.bl_label or node.bl_idname] = None
            node.mute = True
            for link in [each for each in tree.links if each.from_node == node]:
                tree.links.remove(link)  # a muted node would pass the path on as the text
    if not muted:
        return ()
    return (f"its nodes {', '.join(sorted(muted))} are not evaluated: the nodes of a file read no others",)


def _is_packed(block: bpy.types.ID) -> bool:
    return bool(getattr(block, "packed_file", None) or getattr(block, "packed_files", None))


def _absolute(name: str, block: bpy.types.ID) -> str:
    if isinstance(block, bpy.types.Image) and not block.library and name == block.filepath:
        return image_path(block) or name
    return bpy.path.abspath(name, library=block.library)


def _check_bakes(
    asset: str, folder: str, object_: bpy.types.Object, modifier: bpy.types.Modifier, access: Access
) -> None:
    """Folders of what Geometry Nodes have kept on disk."""
    own = [bake.directory for bake in modifier.bakes if bake.use_custom_path]
    for name in filter(None, (modifier.bake_directory, *own)):
        check_folder(asset, bpy.path.abspath(name, library=object_.library), folder, access)
