# SPDX-License-Identifier: GPL-3.0-or-later
"""The metric's spatial query, answered by Geometry Nodes on all cores.

A node tree asks the same kind of tree in the same float32 arithmetic as BVHTree, for thousands of points at once and
with as many threads as Blender has. Its objects must stand in a scene: a temporary one with a view layer of its own,
so that nothing of the user's is evaluated. It is there while many questions are asked, and no longer.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...metric.geometry import Floats, Ints
from ...metric.queries import loosened
from ...metric.surface import SurfaceQuery
from .. import arrays
from .bvh import BVHQuery

NAME = ".FMQM queries"  # of all that is made here; menus leave out what begins with a dot
SETTING = "FMQM_QUERIES"  # environment variable: "python" keeps the plain loop
BATCH = 16384  # questions of a step: some milliseconds, where an evaluation alone takes a third of one
LARGE = 50_000  # triangles, of which a question takes several times as long
WORTH_IT = 256  # fewer questions are answered sooner by a tree that is there
# Beyond, bounds save the plain loop as much as two cores do, and a second tree, to ask again, would take its time and
# memory. Nodes interpolate a triangle's number in float32, which up to here is exact enough, too.
MOST_TRIANGLES = 250_000
_HANDLERS = ("save_pre", "load_pre", "undo_pre", "redo_pre")


def surface_query(vertices: Floats, triangles: Ints) -> SurfaceQuery:
    """The query of a surface's triangles: by nodes, or by the plain loop where they are many.

    Where FMQM_QUERIES is "python", by the plain loop, with a ray for each sample.
    """
    if os.environ.get(SETTING) == "python":
        return BVHQuery(vertices, triangles)
    if len(triangles) > MOST_TRIANGLES:
        return BVHQuery(vertices, triangles, every_ray=False)
    return NodeQuery(vertices, triangles)


class NodeQuery:
    """Nearest triangles and ray hits of a triangle mesh; a metric.queries.BatchQuery.

    Between `with query.opened()` nodes answer, else, and where they fail, a BVHQuery, which is built when it is needed.
    """

    def __init__(self, vertices: Floats, triangles: Ints) -> None:
        self.batch = BATCH if len(triangles) <= LARGE else BATCH // 2
        self._vertices, self._triangles = vertices, triangles
        self._plain: BVHQuery | None = None
        self._open = self._failed = False
        self._stage: _Stage | None = None

    @contextlib.contextmanager
    def opened(self) -> Iterator[None]:
        """As BatchQuery.opened."""
        self._open = True
        for name in _HANDLERS:
            getattr(bpy.app.handlers, name).append(self._leave)
        try:
            yield
        finally:
            self._open = False
            self._leave()
            for name in _HANDLERS:
                handlers = getattr(bpy.app.handlers, name)
                if self._leave in handlers:  # opening a file removes them
                    handlers.remove(self._leave)

    def nearest(self, points: Floats, bounds: Floats | None) -> Ints:
        """As BVHQuery.nearest; the bounds are of no use to nodes."""
        found = self._ask(points, None)
        if found is None:
            return self.plain.nearest(points, bounds)
        triangle = np.rint(found[:, 0]).astype(np.int64) - 1
        unknown = np.flatnonzero(triangle < 0)
        if unknown.size:
            triangle[unknown] = self.plain.nearest(points[unknown], None)
        return triangle

    def first_hit(self, origins: Floats, directions: Floats) -> tuple[Ints, Floats]:
        """As SurfaceQuery.first_hit."""
        found = self._ask(origins, directions)
        if found is None:
            return self.plain.first_hit(origins, directions)
        triangle, hit = np.rint(found[:, 0]).astype(np.int64) - 1, found[:, 2] > 0
        return np.where(hit, triangle, -1), np.where(hit, found[:, 1], np.inf).astype(np.float64)

    def one_by_one(self, points: Floats, bounds: Floats) -> Ints:
        """As BatchQuery.one_by_one: as the plain loop finds them."""
        return self.plain.nearest(points, loosened(bounds))

    @property
    def plain(self) -> BVHQuery:
        """The plain loop over the same triangles."""
        if self._plain is None:
            self._plain = BVHQuery(self._vertices, self._triangles)
        return self._plain

    def _ask(self, points: Floats, directions: Floats | None) -> NDArray[np.float32] | None:
        """What the nodes answer; None: ask the plain loop."""
        if self._failed or not self._open or (self._plain is not None and len(points) < WORTH_IT):
            return None
        try:
            if self._stage is None:
                self._stage = _Stage(self._vertices, self._triangles)
            return self._stage.ask(points, directions)
        except (AttributeError, KeyError, ReferenceError, RuntimeError, TypeError, ValueError):
            self._failed = True  # a Blender whose nodes differ, or an add-on's handler that deletes what it sees
            self._leave()
            return None

    def _leave(self, *_: object) -> None:
        """Takes the temporary scene away; before files are saved or opened and before undo, too. The next question
        makes another."""
        if self._stage is not None:
            self._stage = None
            sweep()


def sweep() -> None:
    """Removes whatever of temporary scenes is in the file: undo steps and files of a crash may bring some back."""
    for blocks in (bpy.data.scenes, bpy.data.objects, bpy.data.meshes, bpy.data.node_groups):
        for block in [block for block in blocks if block.name.startswith(NAME)]:
            blocks.remove(block)


@dataclass(frozen=True)
class _Cloud:
    """An object of points, whose modifier answers in the attribute "found"."""

    object: bpy.types.Object
    mesh: bpy.types.Mesh


class _Stage:
    """A temporary scene in which a surface stands, and the points that ask it."""

    def __init__(self, vertices: Floats, triangles: Ints) -> None:
        self._scene = bpy.data.scenes.new(NAME)
        self._layer = self._scene.view_layers[0]
        mesh = bpy.data.meshes.new(NAME)
        arrays.fill(mesh, vertices, triangles)
        # On corners, where nodes look for it: from elsewhere all of it would be copied for each evaluation.
        # From 1: what finds nothing answers 0.
        number = mesh.attributes.new("number", "FLOAT", "CORNER")
        arrays.write(number.data, "value", np.arange(1, len(triangles) + 1, dtype=np.float32).repeat(3))
        self._surface = self._stand(mesh)
        self._clouds: dict[bool, list[_Cloud]] = {}

    def ask(self, points: Floats, directions: Floats | None) -> NDArray[np.float32]:
        """(N, 3) for each point the number of a triangle; of rays also the distance, and 1 where they hit."""
        clouds = self._clouds_of(directions is not None)[: max(1, len(points) // WORTH_IT)]
        bounds = [len(points) * k // len(clouds) for k in range(len(clouds) + 1)]
        asked = list(zip(clouds, map(slice, bounds[:-1], bounds[1:]), strict=True))
        for cloud, here in asked:
            _put(cloud.mesh, points[here], None if directions is None else directions[here])
        self._layer.update()
        found = np.empty((len(points), 3), np.float32)
        for cloud, here in asked:
            answers = cloud.object.evaluated_get(self._layer.depsgraph).data
            found[here] = arrays.read_attribute(answers, "found", "vector", 3, np.float32)
        return found

    def _clouds_of(self, rays: bool) -> list[_Cloud]:
        """The points that ask; only those that do are evaluated.

        Blender evaluates objects on all cores. What asks for nearest points is spread over them in small pieces, too,
        but rays in pieces of 10,000: these stand in as many objects as there are cores.
        """
        if rays not in self._clouds:
            for other in (cloud for clouds in self._clouds.values() for cloud in clouds):
                other.object.hide_viewport = True
            group = _node_group(self._surface, rays)
            self._clouds = {rays: [self._cloud(group) for _ in range(_cores() if rays else 1)]}
        return self._clouds[rays]

    def _cloud(self, group: bpy.types.NodeTree) -> _Cloud:
        mesh = bpy.data.meshes.new(NAME)
        owner = self._stand(mesh)
        owner.modifiers.new(NAME, "NODES").node_group = group
        return _Cloud(owner, mesh)

    def _stand(self, mesh: bpy.types.Mesh) -> bpy.types.Object:
        owner = bpy.data.objects.new(NAME, mesh)
        self._scene.collection.objects.link(owner)
        return owner


def _put(mesh: bpy.types.Mesh, points: Floats, directions: Floats | None) -> None:
    """Gives a cloud's mesh the points that ask."""
    if len(mesh.vertices) != len(points):
        mesh.clear_geometry()
        mesh.vertices.add(len(points))
        if directions is not None:
            mesh.attributes.new("direction", "FLOAT_VECTOR", "POINT")
    arrays.write(mesh.attributes["position"].data, "vector", points.astype(np.float32))
    if directions is not None:
        arrays.write(mesh.attributes["direction"].data, "vector", directions.astype(np.float32))
    mesh.update_tag()


def _cores() -> int:
    """How many this process may use."""
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(allowed, BATCH // WORTH_IT)


def _node_group(surface: bpy.types.Object, rays: bool) -> bpy.types.NodeTree:
    """Nodes that store in "found", of each point, what the surface answers, as _Stage.ask has it.

    One vector, since each attribute that is stored would ask the tree anew.
    """
    group = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    new: Callable[[str], Any] = group.nodes.new
    link = group.links.new
    number = _named(new, "number", "FLOAT")
    target = new("GeometryNodeObjectInfo")
    target.inputs["Object"].default_value = surface
    together = new("ShaderNodeCombineXYZ")
    if rays:
        cast = new("GeometryNodeRaycast")
        cast.data_type = "FLOAT"
        if hasattr(cast, "mapping"):  # before 5.0
            cast.mapping = "NEAREST"
        else:
            cast.inputs["Interpolation"].default_value = "Nearest"
        cast.inputs["Ray Length"].default_value = np.finfo(np.float32).max
        link(target.outputs["Geometry"], cast.inputs["Target Geometry"])
        link(number, cast.inputs["Attribute"])
        link(_named(new, "direction", "FLOAT_VECTOR"), cast.inputs["Ray Direction"])
        link(cast.outputs["Attribute"], together.inputs["X"])
        link(cast.outputs["Hit Distance"], together.inputs["Y"])
        link(cast.outputs["Is Hit"], together.inputs["Z"])
    else:
        sample = new("GeometryNodeSampleNearestSurface")
        sample.data_type = "FLOAT"
        link(target.outputs["Geometry"], sample.inputs["Mesh"])
        link(number, sample.inputs["Value"])
        link(sample.outputs["Value"], together.inputs["X"])
    store = new("GeometryNodeStoreNamedAttribute")
    store.data_type, store.domain = "FLOAT_VECTOR", "POINT"
    store.inputs["Name"].default_value = "found"
    link(new("NodeGroupInput").outputs[0], store.inputs["Geometry"])
    link(together.outputs["Vector"], store.inputs["Value"])
    link(store.outputs["Geometry"], new("NodeGroupOutput").inputs[0])
    return group


def _named(new: Callable[[str], Any], name: str, data_type: str) -> Any:
    """The output of a node that reads an attribute."""
    node = new("GeometryNodeInputNamedAttribute")
    node.data_type = data_type
    node.inputs["Name"].default_value = name
    return node.outputs["Attribute"]
