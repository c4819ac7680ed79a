# SPDX-License-Identifier: GPL-3.0-or-later
"""What the add-on puts into the scene where it is asked to keep it, made from arrays: points and surfaces with a color
at every place.

Points are small tetrahedra in one mesh: Solid shading draws point clouds grey and loose vertices black.
Everything is tagged, so that a second one replaces the first and clear() finds it whatever its name.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ...metric.colorspace import decode_srgb
from ...metric.geometry import Floats, Ints
from .. import arrays

TAG = "fmqm"  # custom property of every data-block of ours: what it is for
COLLECTION = "FMQM"
COLOR = "FMQM"  # name of the color attribute
CLOUD, CLOUD_LOD, PAINTED, PAINTED_LOD = "cloud", "cloud lod", "painted", "painted lod"
SLICE, SLICE_LOD, SHELLS = "slice", "slice lod", "shells"

# A regular tetrahedron around the origin, of radius 1, its faces outwards.
_CORNERS = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], np.float32) / np.sqrt(np.float32(3))
_FACES = np.array([(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)], np.int32)


def objects(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """Our objects in a scene."""
    return (object_ for collection in _collections(scene) for object_ in collection.objects)


def find_object(scene: bpy.types.Scene, kind: str) -> bpy.types.Object | None:
    """Our object of a kind in a scene."""
    return next((object_ for object_ in objects(scene) if object_.get(TAG) == kind), None)


def build_cloud(
    scene: bpy.types.Scene, kind: str, name: str, positions: Floats, normals: Floats, matrix: Floats, size: float
) -> bpy.types.Object:
    """The cloud of a kind in the scene; one that is there gets new points.

    Args:
        positions: (N, 3). normals: (N, 3) unit, which light the points as the surface would be.
        matrix: (4, 4) from the positions to the world. size: radius of a point, in the positions' units.
    """
    mesh = _cloud_mesh(name, positions, normals, size)
    return _place(scene, kind, name, mesh, matrix)


def build_surface(
    scene: bpy.types.Scene, kind: str, name: str, vertices: Floats, triangles: Ints, matrix: Floats
) -> bpy.types.Object:
    """A smooth surface of a kind in the scene, ready for recolor(); one that is there is replaced.

    Args:
        vertices: (V, 3). triangles: (T, 3). matrix: (4, 4) from the vertices to the world.
    """
    mesh = _mesh(name, vertices.astype(np.float32), triangles.astype(np.int32))
    return _place(scene, kind, name, mesh, matrix)


def recolor(object_: bpy.types.Object, colors: Floats) -> None:
    """Gives each point of a cloud, or each vertex of a surface, another color; nothing is added.

    Args:
        colors: (N, 3) encoded (sRGB) in [0, 1].
    """
    mesh: bpy.types.Mesh = object_.data
    linear = np.ones((len(colors), 4), np.float32)
    linear[:, :3] = decode_srgb(colors)
    repeat, rest = divmod(len(mesh.vertices), len(colors))
    if rest:
        raise ValueError(f"{len(colors)} colors do not fit the {len(mesh.vertices)} vertices of {object_.name}")
    arrays.write(mesh.attributes[COLOR].data, "color", np.repeat(linear, repeat, axis=0))
    mesh.update()


def tetrahedra(positions: Floats, size: float) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """(N, 4, 3) corners of points of a radius, and their (4 N, 3) triangles."""
    corners = positions.astype(np.float32)[:, None, :] + np.float32(size) * _CORNERS
    first = 4 * np.arange(len(positions), dtype=np.int32)
    return corners, (first[:, None, None] + _FACES).reshape(-1, 3)


def reveal(object_: bpy.types.Object, layer: bpy.types.ViewLayer) -> None:
    """Shows an object of ours in a view layer, where it, or our collection, was hidden or left out."""
    for found in _layer_collections(layer.layer_collection):
        if found.collection in object_.users_collection and TAG in found.collection:
            if found.exclude:
                found.exclude = False
            found.hide_viewport = found.collection.hide_viewport = False
    object_.hide_viewport = False
    if object_.name in layer.objects:
        object_.hide_set(False, view_layer=layer)


def clear() -> int:
    """Removes every data-block of ours; how many there were."""
    count = 0
    for blocks in _all_blocks():
        for block in list(_ours(blocks)):
            blocks.remove(block)
            count += 1
    return count


def anything() -> bool:
    """Whether the file has a data-block of ours."""
    return any(True for blocks in _all_blocks() for _ in _ours(blocks))


def _all_blocks() -> tuple[bpy.types.bpy_prop_collection, ...]:
    data = bpy.data  # owners before what they own
    return (data.objects, data.meshes, data.materials, data.images, data.node_groups, data.collections)


def _ours(blocks: bpy.types.bpy_prop_collection) -> Iterator[bpy.types.ID]:
    return (block for block in blocks if block.library is None and TAG in block)


def _place(scene: bpy.types.Scene, kind: str, name: str, mesh: bpy.types.Mesh, matrix: Floats) -> bpy.types.Object:
    """The object of a kind, with this mesh; the mesh it had is removed."""
    mesh[TAG] = kind
    mesh.materials.append(_material())
    object_ = find_object(scene, kind)
    if object_ is None:
        object_ = bpy.data.objects.new(name, mesh)
        object_[TAG] = kind
    else:
        before = object_.data
        object_.data = mesh
        if not before.users:
            bpy.data.meshes.remove(before)
        mesh.name = object_.name = name  # the name was the old mesh's until now
    object_.matrix_world = Matrix(matrix.tolist())
    _link(scene, object_)
    return object_


def _link(scene: bpy.types.Scene, object_: bpy.types.Object) -> None:
    collection = next(_collections(scene), None)
    if collection is None:
        collection = bpy.data.collections.new(COLLECTION)
        collection[TAG] = "collection"
        scene.collection.children.link(collection)
    if object_.name not in collection.objects:
        collection.objects.link(object_)


def _collections(scene: bpy.types.Scene) -> Iterator[bpy.types.Collection]:
    """Ours in a scene; each scene has its own, because each has results of its own."""
    return (found for found in _ours(bpy.data.collections) if found in scene.collection.children_recursive)


def _layer_collections(layer: bpy.types.LayerCollection) -> Iterator[bpy.types.LayerCollection]:
    yield layer
    for child in layer.children:
        yield from _layer_collections(child)


def _cloud_mesh(name: str, positions: Floats, normals: Floats, size: float) -> bpy.types.Mesh:
    vertices, triangles = tetrahedra(positions, size)
    mesh = _mesh(name, vertices.reshape(-1, 3), triangles)
    normal = mesh.attributes.new("custom_normal", "FLOAT_VECTOR", "POINT")
    arrays.write(normal.data, "vector", np.repeat(normals.astype(np.float32), 4, axis=0))
    return mesh


def _mesh(name: str, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> bpy.types.Mesh:
    """A smooth mesh with a white color attribute."""
    mesh = bpy.data.meshes.new(name)
    arrays.fill(mesh, vertices, triangles)
    mesh.color_attributes.new(COLOR, "FLOAT_COLOR", "POINT")
    mesh.color_attributes.active_color_index = 0
    mesh.color_attributes.render_color_index = 0
    mesh.update(calc_edges=True)
    return mesh


def _material() -> bpy.types.Material:
    """Glows in the color of the attribute: for Material Preview, EEVEE and Cycles."""
    found = next(_ours(bpy.data.materials), None)
    if found is not None:
        return found
    material = bpy.data.materials.new("FMQM Color")
    material[TAG] = "material"
    if material.node_tree is None:  # 5.0 and later always have one
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    color = nodes.new("ShaderNodeVertexColor")
    color.layer_name = COLOR
    glow = nodes.new("ShaderNodeEmission")
    output = nodes.new("ShaderNodeOutputMaterial")
    for x, node in enumerate((color, glow, output)):
        node.location = (220 * x, 0)
    links.new(color.outputs["Color"], glow.inputs["Color"])
    links.new(glow.outputs["Emission"], output.inputs["Surface"])
    return material
