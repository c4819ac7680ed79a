# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects, materials and images for the tests."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

from fmqm_addon.metric.surface import MeshArrays

from .script import noise, write_png

__all__ = ["noise", "write_png"]  # for the tests, beside what is defined here

# Unlike in every axis, so that a swap or a mirror shows.
PLACED = Matrix.LocRotScale((1.0, 2.0, 3.0), Matrix.Rotation(0.7, 3, (0.3, 0.2, 0.5)), (1.0, 2.0, 0.5))
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]  # as corners run: its UVs are x and y
CUBE_CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
CUBE_FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def clear() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def blocks() -> set[tuple[str, str]]:
    """Every data-block there is: its collection in bpy.data and its name."""
    names = [prop.identifier for prop in bpy.types.BlendData.bl_rna.properties if prop.type == "COLLECTION"]
    return {(name, block.name_full) for name in names for block in getattr(bpy.data, name)}


def add(
    name: str,
    vertices: Sequence[Sequence[float]],
    faces: Sequence[Sequence[int]],
    uv: bool = True,
    collection: bpy.types.Collection | None = None,
    materials: Iterable[bpy.types.Material | None] = (),
) -> bpy.types.Object:
    """An object in the scene, or in the collection. Its UVs are each face's own square, corner after corner."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    if uv:
        corners = [SQUARE[k % 4][:2] for face in faces for k in range(len(face))]
        mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", np.array(corners, np.float32).ravel())
    for material_ in materials:
        mesh.materials.append(material_)
    object_ = bpy.data.objects.new(name, mesh)
    (collection or bpy.context.scene.collection).objects.link(object_)
    return object_


def skeleton() -> bpy.types.Object:
    """Of one upright bone of length 1, "Bone"."""
    object_ = bpy.data.objects.new("Skeleton", bpy.data.armatures.new("Skeleton"))
    bpy.context.scene.collection.objects.link(object_)
    bpy.context.view_layer.objects.active = object_
    bpy.ops.object.mode_set(mode="EDIT")
    object_.data.edit_bones.new("Bone").tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    return object_


def hang(object_: bpy.types.Object, skeleton_: bpy.types.Object, count: int | None = None) -> None:
    """The first vertices of a mesh, or all of them, move with the bone."""
    vertices = range(len(object_.data.vertices) if count is None else count)
    object_.vertex_groups.new(name="Bone").add(vertices, 1.0, "REPLACE")
    object_.modifiers.new("Armature", "ARMATURE").object = skeleton_


def square(name: str = "Square", **options: object) -> bpy.types.Object:
    return add(name, SQUARE, [(0, 1, 2, 3)], **options)  # type: ignore[arg-type]


def cube(name: str = "Cube", **options: object) -> bpy.types.Object:
    """Six quads from -1 to 1."""
    return add(name, CUBE_CORNERS, CUBE_FACES, **options)  # type: ignore[arg-type]


def monkey(name: str = "Monkey", materials: Iterable[bpy.types.Material] = ()) -> bpy.types.Object:
    """Blender's own 968 triangles, with their UV map, turned and stretched."""
    bpy.ops.mesh.primitive_monkey_add()
    object_ = bpy.context.object
    object_.name = name
    object_.matrix_world = PLACED
    for material_ in materials:
        object_.data.materials.append(material_)
    return object_


def material(name: str = "Material", color: Sequence[float] | None = None) -> bpy.types.Material:
    """A Principled BSDF with a plain base color, linear."""
    made = bpy.data.materials.new(name)
    if made.node_tree is None:  # 5.0 and later always have one
        made.use_nodes = True
    if color is not None:
        base_color(made).default_value = (*color, 1.0)
    return made


def base_color(of: bpy.types.Material) -> bpy.types.NodeSocket:
    return next(node for node in of.node_tree.nodes if node.type == "BSDF_PRINCIPLED").inputs["Base Color"]


def image_node(of: bpy.types.Material, image: bpy.types.Image | None, link: bool = True) -> bpy.types.Node:
    node = of.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    if link:
        of.node_tree.links.new(node.outputs["Color"], base_color(of))
    return node


def textured(path: Path, name: str = "Textured") -> bpy.types.Material:
    made = material(name)
    image_node(made, bpy.data.images.load(str(path)))
    return made


def write_exr(path: Path, pixels: np.ndarray) -> Path:
    """(H, W, 3 or 4) float32, row 0 at the top: an uncompressed OpenEXR. (Blender 4.5's own save encodes them.)"""
    height, width, count = pixels.shape
    names = (b"A", b"B", b"G", b"R")[-count:]
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(name + b"\0" + struct.pack("<4i", 2, 0, 1, 1) for name in names) + b"\0"
    attributes = (
        (b"channels", b"chlist", channels), (b"compression", b"compression", b"\0"),
        (b"dataWindow", b"box2i", window), (b"displayWindow", b"box2i", window), (b"lineOrder", b"lineOrder", b"\0"),
        (b"pixelAspectRatio", b"float", struct.pack("<f", 1)),
        (b"screenWindowCenter", b"v2f", struct.pack("<2f", 0, 0)),
        (b"screenWindowWidth", b"float", struct.pack("<f", 1)),
    )  # fmt: skip
    header = struct.pack("<2i", 20000630, 2)
    header += b"".join(n + b"\0" + k + b"\0" + struct.pack("<i", len(v)) + v for n, k, v in attributes) + b"\0"
    rows = [row[:, ::-1].T.astype("<f4").tobytes() for row in pixels]  # A, B, G, R, each the whole row
    first = len(header) + 8 * height
    offsets = b"".join(struct.pack("<Q", first + y * (8 + len(rows[0]))) for y in range(height))
    scanlines = b"".join(struct.pack("<2i", y, len(row)) + row for y, row in enumerate(rows))
    path.write_bytes(header + offsets + scanlines)
    return path


EXPORTERS: dict[str, Callable[[str], object]] = {
    "obj": lambda path: bpy.ops.wm.obj_export(filepath=path),
    "ply": lambda path: bpy.ops.wm.ply_export(filepath=path),
    "stl": lambda path: bpy.ops.wm.stl_export(filepath=path),
    "glb": lambda path: bpy.ops.export_scene.gltf(filepath=path, export_format="GLB"),
    "gltf": lambda path: bpy.ops.export_scene.gltf(filepath=path, export_format="GLTF_SEPARATE"),
    "fbx": lambda path: bpy.ops.export_scene.fbx(filepath=path, path_mode="COPY", embed_textures=True),
    "usd": lambda path: bpy.ops.wm.usd_export(filepath=path),
    "usda": lambda path: bpy.ops.wm.usd_export(filepath=path),
    "usdc": lambda path: bpy.ops.wm.usd_export(filepath=path),
    "usdz": lambda path: bpy.ops.wm.usd_export(filepath=path),
    "abc": lambda path: bpy.ops.wm.alembic_export(filepath=path),
    "blend": lambda path: bpy.ops.wm.save_as_mainfile(filepath=path),
}
COLORED = tuple(kind for kind in EXPORTERS if kind not in {"ply", "stl", "abc"})  # the others name no image


def export(folder: Path, kind: str, stem: str = "asset") -> Path:
    """The session's scene as a file of a kind of EXPORTERS."""
    path = folder / f"{stem}.{kind}"
    EXPORTERS[kind](str(path))
    assert path.is_file()
    return path


def same(a: MeshArrays, b: MeshArrays) -> bool:
    """The same arrays, but for the name."""
    pairs = [(getattr(a, name), getattr(b, name)) for name in ("positions", "triangles", "corners", "material")]
    pairs += [
        (getattr(x.color, "pixels", x.color), getattr(y.color, "pixels", y.color))
        for x, y in zip(a.materials, b.materials, strict=True)
    ]
    return all(np.array_equal(x, y) for x, y in pairs)


def area(arrays: MeshArrays) -> float:
    a, b, c = (arrays.positions[arrays.triangles[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)
