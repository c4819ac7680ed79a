# SPDX-License-Identifier: GPL-3.0-or-later
"""What a glTF file's JSON promises, added up before it is expanded."""

from __future__ import annotations

import json
import os
import struct
from typing import Any
from urllib.parse import unquote

from ...metric.errors import FileError
from ..limits import MAX_BYTES, MAX_DEPTH, MAX_KEYS, MAX_OBJECTS, MAX_TRIANGLES, MAX_ZEROS

_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_SIZES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}  # bytes of a component
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


def check_gltf(path: str) -> tuple[str, ...]:
    """A glTF file's accessors, nodes and meshes must not add up to too much.

    What is malformed the importer refuses, accessors beyond their buffers too. How much a Draco primitive decodes to
    is known only once it is decoded: there the counts of its accessors are believed.

    Raises:
        FileError: they do.
    """
    try:
        document, binary = _parsed(path)
    except RecursionError as error:
        raise FileError(f"{path}: its JSON is nested too deeply; export it again") from error
    except (ValueError, struct.error):
        return ()  # the importer says what is wrong
    if isinstance(document, dict):
        promises = _Promises(path, document, binary)
        promises.check_bytes()
        promises.check_nodes()
        promises.check_meshes()
    return ()


def _parsed(path: str) -> tuple[Any, int]:
    """The JSON, and the length of a GLB's binary chunk."""
    with open(path, "rb") as file:
        magic, _, _ = struct.unpack("<4sII", file.read(12).ljust(12))
        if magic != b"glTF":
            file.seek(0)
            return json.loads(file.read().decode()), 0
        size = os.fstat(file.fileno()).st_size
        length, kind = struct.unpack("<I4s", file.read(8))
        if kind != b"JSON" or length > size:
            raise ValueError("not a GLB")
        document = json.loads(file.read(length).decode())
        chunk = file.read(8)
        length, kind = struct.unpack("<I4s", chunk) if len(chunk) == 8 else (0, b"")
        return document, min(length, size - file.tell()) if kind == b"BIN\0" else 0


def _count(value: Any) -> int:
    """0 where it is no whole number: the importer refuses it."""
    return value if type(value) is int else 0


def _element(accessor: dict[str, Any]) -> int:
    """Bytes of an element."""
    return _COMPONENTS.get(str(accessor.get("type")), 0) * _SIZES.get(_count(accessor.get("componentType")), 0)


class _Promises:
    """A document's parts. What is not of the type that glTF has there counts as missing."""

    def __init__(self, path: str, document: dict[str, Any], binary: int) -> None:
        self._path = path
        self._document = document
        self._accessors = self._list("accessors")
        self._views = self._list("bufferViews")
        self._nodes = self._list("nodes")
        self._lengths = [self._buffer_length(k, each, binary) for k, each in enumerate(self._list("buffers"))]

    def check_bytes(self) -> None:
        """What accessors without data promise, and what is unpacked, against the limits; and no stride is negative."""
        unpacked = sum(length for length in self._lengths if length is not None)  # one file may be named many times
        for view in self._views:
            packings = [_dict(_dict(view, "extensions"), name) for name in _MESHOPT]
            if min(_count(each.get("byteStride")) for each in (view, *packings)) < 0:
                raise self._refused("a buffer view has a negative stride")  # numpy would read the memory before it
            for packed in packings:
                unpacked += max(_count(packed.get("count")) * _count(packed.get("byteStride")), 0)
        empty = [accessor for accessor in self._accessors if accessor.get("bufferView") is None]
        zeros = sum(max(_count(accessor.get("count")), 0) * _element(accessor) for accessor in empty)
        if zeros > MAX_ZEROS:
            raise self._refused(f"its accessors promise {zeros:,} bytes without data", MAX_ZEROS)
        if unpacked > MAX_BYTES:
            raise self._refused(f"its buffers unpack to {unpacked:,} bytes", MAX_BYTES)

    def check_nodes(self) -> None:
        """Nodes in one another, and how many objects come of them."""
        instances = sum(self._instances(node) for node in self._nodes)
        depth, listed = self._depth_and_listed()
        if depth > MAX_DEPTH:
            raise self._refused(f"its nodes are nested {depth:,} deep", MAX_DEPTH)
        if max(len(self._nodes) + instances, listed) > MAX_OBJECTS:
            count = max(len(self._nodes) + instances, listed)
            raise self._refused(f"its nodes, instances and scenes make {count:,} objects", MAX_OBJECTS)

    def check_meshes(self) -> None:
        """Corners and keys: primitives, nodes and channels may share what they name."""
        counts = [self._corners_and_keys(mesh) for mesh in self._list("meshes")]
        shown = 0
        skins: set[tuple[int, Any]] = set()
        for node in self._nodes:
            mesh = node.get("mesh")
            if type(mesh) is int and 0 <= mesh < len(counts):
                shown += counts[mesh][0] * (self._instances(node) or 1)
                skin = node.get("skin")
                skins.add((mesh, skin if type(skin) is int else None))
        made = sum(counts[mesh][0] for mesh, _ in skins)  # once for each skin
        if max(shown, made) // 3 > MAX_TRIANGLES:
            raise self._refused(f"its meshes and instances make {max(shown, made) // 3:,} triangles", MAX_TRIANGLES)
        total = sum(keys for _, keys in counts) + sum(map(self._keys, self._list("animations")))
        if total > MAX_KEYS:
            raise self._refused(f"its animations and morph targets hold {total:,} keys", MAX_KEYS)

    def _corners_and_keys(self, mesh: dict[str, Any]) -> tuple[int, int]:
        corners = keys = 0
        for primitive in _list(mesh, "primitives"):
            vertices = self._elements(_dict(primitive, "attributes").get("POSITION"))
            indices = vertices if primitive.get("indices") is None else self._elements(primitive["indices"])
            strips = primitive.get("mode") in (5, 6)  # each vertex makes a triangle
            corners += indices * (3 if strips else 1)
            keys += min(vertices, indices) * len(_list(primitive, "targets"))
        return corners, keys

    def _keys(self, animation: dict[str, Any]) -> int:
        samplers = _list(animation, "samplers")
        chosen = [_count(channel.get("sampler")) for channel in _list(animation, "channels")]
        return sum(self._elements(samplers[each].get("output")) for each in chosen if 0 <= each < len(samplers))

    def _depth_and_listed(self) -> tuple[int, int]:
        """How deep nodes lie in one another, and how many all scenes list, those below counted again in each.

        Nodes in rings, or with two parents, the importer refuses.
        """
        children = [_list(node, "children", int) for node in self._nodes]
        parents = {child: node for node, below in enumerate(children) for child in below}
        depths = dict.fromkeys((node for node in range(len(children)) if node not in parents), 1)
        order = list(depths)
        for node in order:  # which grows
            for child in children[node]:
                if 0 <= child < len(children) and child not in depths:
                    depths[child] = depths[node] + 1
                    order.append(child)
        below = [1 + self._instances(node) for node in self._nodes]
        for node in reversed(order):
            if node in parents:
                below[parents[node]] += below[node]
        roots = [root for scene in self._list("scenes") for root in _list(scene, "nodes", int)]
        listed = sum(below[root] for root in roots if 0 <= root < len(below))
        return max(depths.values(), default=0), listed

    def _instances(self, node: dict[str, Any]) -> int:
        attributes = _dict(_dict(_dict(node, "extensions"), "EXT_mesh_gpu_instancing"), "attributes")
        return max(map(self._elements, attributes.values()), default=0)

    def _elements(self, accessor: Any) -> int:
        known = type(accessor) is int and 0 <= accessor < len(self._accessors)
        return _count(self._accessors[accessor].get("count")) if known else 0

    def _buffer_length(self, number: int, buffer: dict[str, Any], binary: int) -> int | None:
        """Bytes that are there; None where that is not known. What the buffer says of itself the importer ignores."""
        uri = buffer.get("uri")
        if not isinstance(uri, str):
            return binary if number == 0 and uri is None else None
        if uri.startswith("data:"):
            _, found, data = uri.partition(";base64,")
            return len(data) * 3 // 4 if found else None
        try:
            return os.stat(os.path.join(os.path.dirname(self._path), unquote(uri))).st_size
        except (OSError, ValueError):
            return None  # missing, as the importer says

    def _list(self, name: str) -> list[dict[str, Any]]:
        return _list(self._document, name)

    def _refused(self, what: str, limit: int | None = None) -> FileError:
        remedy = "export it again" if limit is None else f"at most {limit:,} are measured; divide the file"
        return FileError(f"{self._path}: {what}; {remedy}")


def _list(holder: dict[str, Any], name: str, kind: type = dict) -> list[Any]:
    """Members in their places; those of another kind are empty ones."""
    found = holder.get(name)
    return [each if type(each) is kind else kind() for each in found] if isinstance(found, list) else []


def _dict(holder: dict[str, Any], name: str) -> dict[str, Any]:
    found = holder.get(name)
    return found if isinstance(found, dict) else {}
