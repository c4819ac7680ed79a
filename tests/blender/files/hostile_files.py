# SPDX-License-Identifier: GPL-3.0-or-later
"""Small malformed and odd files, such as test suites of other programs hold, and what becomes of each.

A file's expected outcome is 1.0, its score against itself, or words of the one line that refuses it; several
where the versions of Blender differ.
"""

from __future__ import annotations

import base64
import gzip
import io
import json
import struct
import zipfile
import zlib
from typing import Any

import numpy as np

Outcome = float | str | tuple[float | str, ...]

# Wavefront OBJ

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

OBJ: dict[str, tuple[str, Outcome]] = {
    "index_0": (TETRAHEDRON + "f 0 1 2\n", 1.0),
    "index_beyond_all_numbers": (TETRAHEDRON + "f 1 2 99999999999999999999\n", 1.0),
    "index_before_the_first": (TETRAHEDRON + "f -1 -2 -99\n", 1.0),
    "only_bad_indices": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 0 0\nf 7 8 9\n", "no faces"),
    "faces_of_1_and_2": (TETRAHEDRON + "f 1\nf 1 2\nf\n", 1.0),
    "faces_that_repeat_a_vertex": (TETRAHEDRON + "f 1 1 1\nf 1 2 1\n", 1.0),
    "only_repeated_vertices": ("v 0 0 0\nv 1 0 0\nf 1 1 2\n", "no faces"),
    "uv_index_beyond": (TETRAHEDRON + "vt 0 0\nf 1/9/9 2/9/9 3/9/9\n", 1.0),
    "empty_index_parts": (TETRAHEDRON + "f 1// 2// 3//\nf 1/ 2/ 3/\n", 1.0),
    "vertices_after_faces": ("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces"),
    "curves": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\ncstype bezier\ndeg 3\ncurv 0 1 1 2 3 4\nend\n", "no faces"),
    "surfaces": ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\ncstype bezier\ndeg 1 1\nsurf 0 1 0 1 1 2 3 4\nend\n", "no faces"),
    "points": ("v 0 0 0\nv 1 0 0\np 1 2\n", "no faces"),
    "words_for_numbers": (TETRAHEDRON + "v one two three\nvt x\nvn\nf a b c\n", 1.0),
    "too_few_numbers": ("v 0\nv 1 0\nv 0 1\nv\nf 1 2 3\n", 1.0),
    "beyond_float32": ("v 1e39 0 0\nv 0 1e308 0\nv 0 0 1e999\nf 1 2 3\n", "zero area"),
    "one_vertex_beyond_float32": (TETRAHEDRON + "v 1e39 0 0\nf 1 2 5\n", 1.0),
    "far_vertex": (TETRAHEDRON + "v 3e38 0 0\nf 1 2 5\n", "zero area"),
    "crlf": (TETRAHEDRON.replace("\n", "\r\n"), 1.0),
    "cr": (TETRAHEDRON.replace("\n", "\r"), "no faces"),
    "no_newline_at_end": (TETRAHEDRON.rstrip(), 1.0),
    "continued_lines": (TETRAHEDRON.replace("f 1 ", "f 1 \\n"), 1.0),
    "byte_order_mark": ("\ufeff" + TETRAHEDRON, 1.0),
    "nul_bytes": (TETRAHEDRON + "\0\0\0\n# \0\n", 1.0),
    "comment_flood": ("# " + "x" * 200000 + "\n" + "#\n" * 20000 + TETRAHEDRON, 1.0),
    "long_line": ("f" + " 1" * 100000 + "\n" + TETRAHEDRON, 1.0),
    "unknown_lines": ("bevel on\nc_interp off\ncall x.mod\nlod 3\nshadow_obj y\n" + TETRAHEDRON, 1.0),
    "many_names": ("".join(f"o {k}\ng {k} x\nusemtl m{k}\ns {k}\n" for k in range(300)) + TETRAHEDRON, 1.0),
    "odd_name": ("o \u202e\u0000\t\U0001f480%s%n{0}\n" + TETRAHEDRON, 1.0),
    "material_library_is_the_file": ("mtllib material_library_is_the_file.obj\nusemtl x\n" + TETRAHEDRON, 1.0),
    "material_library_is_a_folder": ("mtllib .\nmtllib /\nmtllib\nusemtl x\n" + TETRAHEDRON, 1.0),
    "same_face_many_times": (TETRAHEDRON + "f 1 2 3\n" * 500, 1.0),
    "not_text": ("\x00\x01\x02PK\x03\x04" * 50, "no mesh"),
}

# PLY

PLY_VERTICES = "element vertex {}\nproperty float x\nproperty float y\nproperty float z\n"
PLY_FACES = "element face {}\nproperty list uchar int vertex_indices\n"
CORNERS = "0 0 0\n1 0 0\n0 1 0\n"


def ply(vertices: object, faces: object, body: str, format_: str = "ascii 1.0", extra: str = "") -> bytes:
    header = (
        f"ply\nformat {format_}\n{extra}" + PLY_VERTICES.format(vertices) + PLY_FACES.format(faces) + "end_header\n"
    )
    return (header + body).encode()


def binary_ply(order: str, faces: list[tuple[int, ...]], vertices: int = 3) -> bytes:
    name = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    body = struct.pack(order + "9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    body += b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in faces)
    return ply(vertices, len(faces), "", f"{name} 1.0") + body


PLY: dict[str, tuple[bytes, Outcome]] = {
    "big_endian": (binary_ply(">", [(0, 1, 2)]), 1.0),
    "little_endian": (binary_ply("<", [(0, 1, 2)]), 1.0),
    "binary_index_beyond": (binary_ply("<", [(0, 1, 2), (0, 1, 900)]), 1.0),
    "binary_index_negative": (binary_ply("<", [(0, 1, 2), (0, 1, -1)]), 1.0),
    "binary_lists_of_0_and_2": (binary_ply("<", [(), (0, 1), (0, 1, 2)]), "unknown error"),
    "binary_list_of_255": (binary_ply("<", [(0, 1, 2) * 85]), "no faces"),
    "binary_repeated_index": (binary_ply("<", [(0, 1, 2), (0, 0, 0), (0, 1, 0)]), 1.0),
    "lists_of_0_1_and_2": (ply(3, 4, CORNERS + "0\n1 0\n2 0 1\n3 0 1 2\n"), "unknown error"),
    "index_beyond": (ply(3, 2, CORNERS + "3 0 1 2\n3 0 1 900\n"), 1.0),
    "index_negative": (ply(3, 2, CORNERS + "3 0 1 2\n3 0 1 -1\n"), 1.0),
    "list_that_promises_more": (ply(3, 1, CORNERS + "200 0 1 2\n"), "no faces"),
    "more_vertices_promised": (ply(2_000_000_000, 1, CORNERS + "3 0 1 2\n"), "the PLY header"),
    "more_faces_promised": (ply(3, 2_000_000_000, CORNERS + "3 0 1 2\n"), "the PLY header"),
    "900_million_in_text": (ply(900_000_000, 1, CORNERS + "3 0 1 2\n"), "promises more elements than the file holds"),
    "more_than_2_to_the_31": (ply(9_999_999_999, 1, CORNERS + "3 0 1 2\n"), "the PLY header"),
    "more_than_2_to_the_64": (ply(10**25, 1, CORNERS + "3 0 1 2\n"), "the PLY header"),
    "binary_promises": (ply(2_000_000_000, 1, "", "binary_little_endian 1.0") + b"x" * 50, "the PLY header"),
    "count_negative": (ply(-3, -1, CORNERS + "3 0 1 2\n"), "no vertices"),
    "count_not_a_number": (ply("three", "one", CORNERS + "3 0 1 2\n"), "the PLY header"),
    "no_faces": (ply(3, 0, CORNERS), "no faces"),
    "comment_flood": (
        ply(3, 1, CORNERS + "3 0 1 2\n", extra="comment " + "x" * 5000 + "\n" + "comment\nobj_info\n" * 5000),
        1.0,
    ),
    "crlf": (ply(3, 1, CORNERS + "3 0 1 2\n").replace(b"\n", b"\r\n"), 1.0),
    "cr": (ply(3, 1, CORNERS + "3 0 1 2\n").replace(b"\n", b"\r"), "Invalid PLY header"),
    "nan": (ply(4, 2, CORNERS + "nan inf -inf\n3 0 1 2\n3 0 1 3\n"), 1.0),
    "words_for_numbers": (ply(3, 1, "a b c\nd e f\ng h i\n3 0 1 2\n"), "zero area"),
    "version_2": (ply(3, 1, CORNERS + "3 0 1 2\n", "ascii 2.0"), 1.0),
    "format_unknown": (ply(3, 1, CORNERS + "3 0 1 2\n", "morse 1.0"), "unknown error"),
    "no_format": (ply(3, 1, CORNERS + "3 0 1 2\n").replace(b"format ascii 1.0\n", b""), "unknown error"),
    "no_end_of_header": (ply(3, 1, "").replace(b"end_header\n", b""), "No end_header"),
    "header_alone": (b"ply\n", "No end_header"),
    "no_z": (ply(3, 1, CORNERS + "3 0 1 2\n").replace(b"property float z\n", b"property float w\n"), "unknown error"),
    "property_of_unknown_type": (ply(3, 1, CORNERS + "3 0 1 2\n").replace(b"float z", b"quaternion z"), 1.0),
    "faces_before_vertices": (
        b"ply\nformat ascii 1.0\n"
        + (PLY_FACES.format(1) + PLY_VERTICES.format(3)).encode()
        + b"end_header\n3 0 1 2\n"
        + CORNERS.encode(),
        1.0,
    ),
    "strips": (
        ply(3, 0, "", extra="").replace(
            b"element face 0\nproperty list uchar int vertex_indices",
            b"element tristrips 1\nproperty list int int vertex_indices",
        )
        + (CORNERS + "4 0 1 2 -1\n").encode(),
        1.0,
    ),
    "unknown_element": (
        ply(3, 1, CORNERS + "3 0 1 2\n7\n").replace(b"end_header", b"element sheep 1\nproperty int legs\nend_header"),
        1.0,
    ),
    "properties_of_doubles": (ply(3, 1, CORNERS + "3 0 1 2\n").replace(b"float", b"double"), 1.0),
    "list_of_floats": (ply(3, 1, CORNERS + "3 0 1 2\n").replace(b"uchar int", b"float float"), 1.0),
    "faces_without_a_list": (
        ply(3, 1, CORNERS + "3\n").replace(b"property list uchar int vertex_indices", b"property int flag"),
        "unknown error",
    ),
    "element_without_properties": (
        b"ply\nformat ascii 1.0\nelement vertex 3\nelement face 1\nend_header\n",
        "unknown error",
    ),
    "property_before_elements": (b"ply\nformat ascii 1.0\nproperty float x\nend_header\n", "the PLY header"),
    "short_rows": (ply(3, 1, "0 0\n1\n\n3 0 1 2\n"), "unknown error"),
}

# STL

STL_FACET = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
STL_TEXT = (
    "solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid x\n"
)


def stl(count: int, body: bytes, header: bytes = b"") -> bytes:
    return header.ljust(80, b"\0") + struct.pack("<I", count) + body


STL: dict[str, tuple[bytes, Outcome]] = {
    "binary": (stl(1, STL_FACET), 1.0),
    "binary_named_solid": (stl(1, STL_FACET, b"solid but binary"), 1.0),
    "more_facets_promised": (stl(7, STL_FACET), "no faces"),
    "4_billion_facets_promised": (stl(2**32 - 1, STL_FACET), "no faces"),
    "fewer_facets_promised": (stl(1, STL_FACET * 3), "no faces"),
    "no_facets": (stl(0, b""), "no faces"),
    "cut_facet": (stl(1, STL_FACET[:-9]), "no faces"),
    "nan": (stl(2, STL_FACET + struct.pack("<12fH", 0, 0, 1, *(float("nan"),) * 9, 0)), 1.0),
    "only_infinite": (stl(1, struct.pack("<12fH", 0, 0, 1, *(float("inf"),) * 9, 0)), "no faces"),
    "text": (STL_TEXT.encode(), 1.0),
    "text_in_capitals": (STL_TEXT.upper().encode(), "no faces"),
    "text_without_end": (STL_TEXT.partition("endfacet")[0].encode(), 1.0),
    "text_of_two_solids": (STL_TEXT.encode() * 2, 1.0),
    "text_of_2_vertices": (STL_TEXT.replace("vertex 0 1 0\n", "").encode(), "no faces"),
    "text_of_4_vertices": (STL_TEXT.replace("endloop", "vertex 1 1 0\nendloop").encode(), 1.0),
    "text_with_words": (STL_TEXT.replace("1 0 0", "a b c").encode(), "no faces"),
    "text_with_nan": (STL_TEXT.replace("1 0 0", "nan inf 0").encode(), "zero area"),
    "text_with_crlf": (STL_TEXT.replace("\n", "\r\n").encode(), 1.0),
    "text_on_one_line": (STL_TEXT.replace("\n", " ").encode(), "no faces"),
    "solid_alone": (b"solid\nendsolid\n", "Failed to read file"),
    "only_header": (b"x" * 80, "Failed to read file"),
}

# glTF

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
INDICES = struct.pack("<4H", 0, 1, 2, 0)


def uri(data: bytes, kind: str = "application/octet-stream") -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def document(positions: bytes = TRIANGLE, indices: bytes = INDICES, **changes: Any) -> dict[str, Any]:
    """A triangle; the changes replace whole parts, None takes them away."""
    parts: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)},
        ],
        "buffers": [{"byteLength": len(positions) + len(indices), "uri": uri(positions + indices)}],
    }
    return {key: value for key, value in (parts | changes).items() if value is not None}


def changed(part: str, index: int, **values: Any) -> dict[str, Any]:
    """The triangle with values of one of its parts replaced."""
    result = document()
    result[part][index] |= values
    return result


def primitive(**values: Any) -> dict[str, Any]:
    return document(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1} | values]}])


def colored(image: dict[str, Any] | None = None, **texture: Any) -> dict[str, Any]:
    result = primitive(material=0)
    result["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0} | texture}}]
    result["textures"] = [{"source": 0}]
    result["images"] = [image] if image else []
    return result


def png(width: int, height: int) -> bytes:
    """Black."""
    rows = b"".join(b"\0" + b"\0" * (3 * width) for _ in range(height))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    packed = (struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(packed)


def nested(depth: int) -> list[dict[str, Any]]:
    return [{"children": [k + 1]} for k in range(depth)] + [{"mesh": 0}]


def sparse(changed_count: int, count: int, view: int = 1, offset: int = 0) -> dict[str, Any]:
    """The triangle, whose first accessor changes some of its elements."""
    values = {"bufferView": 0}
    indices = {"bufferView": view, "byteOffset": offset, "componentType": 5123}
    return changed("accessors", 0, count=count, sparse={"count": changed_count, "indices": indices, "values": values})


def instances(count: int) -> dict[str, Any]:
    """The triangle, at so many places that all are the origin."""
    result = document(
        nodes=[{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}}}]
    )
    result["accessors"].append({"componentType": 5126, "count": count, "type": "VEC3"})
    return result | {"extensionsUsed": ["EXT_mesh_gpu_instancing"]}


MESHOPT = {"byteStride": 12, "count": 10**10, "mode": "ATTRIBUTES"}

GLTF: dict[str, tuple[Any, Outcome]] = {
    "plain": (document(), 1.0),
    "version_1": (document(asset={"version": "1.0"}), "glTF version must be 2.0"),
    "version_3": (document(asset={"version": "3.0", "minVersion": "3.0"}), "glTF version must be 2.0"),
    "no_asset": (document(asset=None), "Bad glTF"),
    "no_scene": (document(scene=None, scenes=None), 1.0),
    "scene_beyond": (document(scene=7), "the importer broke off"),
    "no_nodes": (document(nodes=None), "the importer broke off"),
    "node_beyond": (document(scenes=[{"nodes": [0, 9]}]), "the importer broke off"),
    "node_negative": (document(scenes=[{"nodes": [-1]}]), "the importer broke off"),
    "node_in_itself": (document(nodes=[{"mesh": 0, "children": [0]}]), "the importer broke off"),
    "nodes_in_a_ring": (
        document(nodes=[{"mesh": 0, "children": [1]}, {"children": [2]}, {"children": [0]}]),
        "the importer broke off",
    ),
    "child_of_two": (
        document(scenes=[{"nodes": [0, 1]}], nodes=[{"children": [2]}, {"children": [2]}, {"mesh": 0}]),
        "the importer broke off",
    ),
    "deep_nodes": (document(nodes=nested(150)), 1.0),
    "very_deep_nodes": (document(nodes=nested(20_000)), "nested 20,001 deep; at most 500"),
    "scale_zero": (document(nodes=[{"mesh": 0, "scale": [0, 0, 0]}]), "zero area"),
    "scale_zero_on_one_axis": (document(nodes=[{"mesh": 0, "scale": [1, 1, 0]}]), 1.0),
    "scale_negative": (document(nodes=[{"mesh": 0, "scale": [-1, 2, 3]}]), 1.0),
    "matrix_of_zeros": (document(nodes=[{"mesh": 0, "matrix": [0] * 16}]), "zero area"),
    "matrix_too_short": (document(nodes=[{"mesh": 0, "matrix": [1, 0]}]), "the importer broke off"),
    "matrix_of_nan": (document(nodes=[{"mesh": 0, "matrix": [float("nan")] * 16}]), "Bad glTF"),
    "translation_of_infinity": (document(nodes=[{"mesh": 0, "translation": [float("inf"), 0, 0]}]), "Bad glTF"),
    "rotation_of_zeros": (document(nodes=[{"mesh": 0, "rotation": [0, 0, 0, 0]}]), 1.0),
    "mesh_beyond": (document(nodes=[{"mesh": 5}]), "no mesh"),
    "camera_alone": (
        document(nodes=[{"camera": 0}], cameras=[{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]),
        "no mesh",
    ),
    "no_primitives": (document(meshes=[{"primitives": []}]), "no faces"),
    "mode_unknown": (primitive(mode=99), "the importer broke off"),
    "attributes_empty": (primitive(attributes={}), "no faces"),
    "accessor_beyond": (primitive(attributes={"POSITION": 12}), "the importer broke off"),
    "accessor_negative": (primitive(attributes={"POSITION": -1}), "the importer broke off"),
    "indices_beyond": (document(indices=struct.pack("<4H", 0, 1, 60000, 0)), "the importer broke off"),
    "indices_of_floats": (changed("accessors", 1, componentType=5126, count=1), "the importer broke off"),
    "count_beyond_buffer": (changed("accessors", 0, count=4000), "the importer broke off"),
    "count_huge": (changed("accessors", 0, count=10**13), "the importer broke off"),
    "count_zero": (changed("accessors", 0, count=0), "the importer broke off"),
    "count_negative": (changed("accessors", 0, count=-3), 1.0),
    "count_without_data": (changed("accessors", 0, bufferView=None, count=400_000_000), "without data; at most"),
    "stride_negative": (changed("bufferViews", 0, byteStride=-4), "a negative stride"),
    "offset_negative": (changed("accessors", 0, byteOffset=-12), "the importer broke off"),
    "sparse_count_beyond": (sparse(9, 3), "the importer broke off"),
    "sparse_indices_beyond": (sparse(3, 3, view=1, offset=4), "the importer broke off"),
    "sparse": (sparse(1, 3), 1.0),
    "instances": (instances(3), 1.0),
    "instances_by_the_thousands": (instances(200_000), "make 200,001 objects; at most 100,000"),
    "scenes_that_list_all_again": (
        document(scenes=[{"nodes": [0]}] * 900, nodes=[*nested(150)]),
        "make 135,900 objects",
    ),
    "nodes_that_share_a_mesh": (
        document(scenes=[{"nodes": list(range(500))}], nodes=[{"mesh": 0}] * 500),
        1.0,
    ),
    "primitives_that_share_vertices": (
        document(
            meshes=[{"primitives": [{"attributes": {"POSITION": 2}}] * 40}],
            accessors=[{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}] * 2
            + [{"componentType": 5126, "count": 80_000_000, "type": "VEC3"}],
        ),
        "make 1,066,666,666 triangles; at most 200,000,000",
    ),
    "nodes_that_multiply_triangles": (
        document(
            scenes=[{"nodes": list(range(300))}],
            nodes=[{"mesh": 0}] * 300,
            meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 2}]}],
            accessors=[*document()["accessors"], {"componentType": 5121, "count": 3_000_000, "type": "SCALAR"}],
        ),
        "make 300,000,000 triangles; at most 200,000,000",
    ),
    "targets_that_multiply_keys": (
        document(
            meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "targets": [{"POSITION": 0}] * 300}]}],
            accessors=[{"componentType": 5126, "count": 80_000, "type": "VEC3"}],
        ),
        "hold 24,000,000 keys; at most 20,000,000",
    ),
    "meshopt_that_promises": (
        document(
            bufferViews=[
                {
                    "buffer": 0,
                    "byteLength": 36,
                    "extensions": {"EXT_meshopt_compression": {"buffer": 0, "byteLength": 9} | MESHOPT},
                }
            ]
            * 2
        ),
        "its buffers unpack to",
    ),
    "meshopt_of_negative_stride": (
        document(
            bufferViews=[
                {
                    "buffer": 0,
                    "byteLength": 36,
                    "extensions": {"EXT_meshopt_compression": {"buffer": 0} | MESHOPT | {"byteStride": -12}},
                }
            ]
            * 2
        ),
        "a negative stride",
    ),
    "accessor_without_view": (
        document(
            accessors=[
                {"componentType": 5126, "count": 3, "type": "VEC3"},
                {"componentType": 5123, "count": 3, "type": "SCALAR"},
            ]
        ),
        "no faces",
    ),
    "component_type_unknown": (changed("accessors", 0, componentType=7), "the importer broke off"),
    "type_unknown": (changed("accessors", 0, type="VEC9"), "the importer broke off"),
    "positions_of_2": (changed("accessors", 0, type="VEC2"), "the importer broke off"),
    "view_beyond_buffer": (changed("bufferViews", 0, byteLength=10**9), 1.0),
    "view_offset_beyond": (changed("bufferViews", 0, byteOffset=10**6), "the importer broke off"),
    "stride_zero": (changed("bufferViews", 0, byteStride=0), 1.0),
    "stride_huge": (changed("bufferViews", 0, byteStride=10**6), "the importer broke off"),
    "buffer_beyond": (changed("bufferViews", 0, buffer=9), "the importer broke off"),
    "buffer_of_broken_base64": (
        document(buffers=[{"byteLength": 44, "uri": "data:application/octet-stream;base64,%%%"}]),
        "the importer broke off",
    ),
    "buffer_on_the_web": (
        document(buffers=[{"byteLength": 44, "uri": "http://localhost:9/x.bin"}]),
        "Missing resource",
    ),
    "buffer_is_a_folder": (document(buffers=[{"byteLength": 44, "uri": "."}]), "Missing resource"),
    "buffer_without_uri": (document(buffers=[{"byteLength": 44}]), "the importer broke off"),
    "buffer_shorter": (document(buffers=[{"byteLength": 44, "uri": uri(TRIANGLE[:20])}]), "the importer broke off"),
    "nan_positions": (document(np.array([[0, 0, 0], [1, 0, 0], [np.nan, 1, 0]], "<f4").tobytes()), (1.0, "zero area")),
    "flat_positions": (document(bytes(36)), "zero area"),
    "extension_required": (
        document(extensionsRequired=["VENDOR_sheep"], extensionsUsed=["VENDOR_sheep"]),
        "is not available",
    ),
    "meshopt_required": (
        document(extensionsRequired=["EXT_meshopt_compression"], extensionsUsed=["EXT_meshopt_compression"]),
        ("EXT_meshopt_compression, which this Blender does not decode", 1.0),
    ),
    "draco_of_noise": (
        document(
            extensionsRequired=["KHR_draco_mesh_compression"],
            extensionsUsed=["KHR_draco_mesh_compression"],
            meshes=[
                {
                    "primitives": [
                        {
                            "attributes": {"POSITION": 0},
                            "indices": 1,
                            "extensions": {
                                "KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}
                            },
                        }
                    ]
                }
            ],
        ),
        (1.0, "the importer broke off"),
    ),
    "morph_targets": (
        document(
            meshes=[
                {
                    "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "targets": [{"POSITION": 0}]}],
                    "weights": [0.5],
                }
            ]
        ),
        1.0,
    ),
    "morph_target_beyond": (primitive(targets=[{"POSITION": 44}]), "the importer broke off"),
    "skin_beyond": (document(nodes=[{"mesh": 0, "skin": 3}]), "the importer broke off"),
    "skin_without_joints": (document(nodes=[{"mesh": 0, "skin": 0}], skins=[{"joints": []}]), "the importer broke off"),
    "animation_beyond": (
        document(animations=[{"channels": [{"sampler": 9, "target": {"node": 77, "path": "scale"}}], "samplers": []}]),
        1.0,  # clips are not imported
    ),
    "material_beyond": (primitive(material=8), "the importer broke off"),
    "texture_without_image": (colored(), "the importer broke off"),
    "image_of_noise": (colored({"uri": uri(b"noise" * 20, "image/png")}), "base-color image is broken"),
    "image_missing": (colored({"uri": "nowhere.png"}), "base-color image is missing"),
    "image_without_uvs": (colored({"uri": uri(png(2, 2), "image/png")}), 1.0),
    "image_of_0_pixels": (colored({"uri": uri(png(0, 0), "image/png")}), "base-color image is broken"),
    "image_uv_set_beyond": (colored({"uri": uri(png(2, 2), "image/png")}, texCoord=7), 1.0),
    "names_of_many_kinds": (
        document(
            nodes=[{"mesh": 0, "name": "a\nb\r\x00\u202e%s {0}"}],
            meshes=[{"name": "x" * 3000, "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        ),
        1.0,
    ),
    "name_is_a_number": (document(nodes=[{"mesh": 0, "name": 5}]), "parse glTF"),
    "list_for_object": ([1, 2, 3], "Bad glTF"),
    "null": (None, "Bad glTF"),
    "number": (5, "Bad glTF"),
    "empty_object": ({}, "Bad glTF"),
}
GLTF_TEXT: dict[str, tuple[str, Outcome]] = {
    "deep_json": ("[" * 100000, "nested too deeply"),
    "trailing_comma": ('{"asset": {"version": "2.0"},}', "Bad glTF"),
    "utf16": (json.dumps(document()).encode("utf-16").decode("latin-1"), "Bad glTF"),
    "bom": ("\ufeff" + json.dumps(document()), "Bad glTF"),
    "twice": (json.dumps(document()) * 2, "Bad glTF"),
}


def glb(
    binary: bytes = TRIANGLE + INDICES,
    version: int = 2,
    length: int | None = None,
    json_length: int | None = None,
    binary_length: int | None = None,
    kind: bytes = b"JSON",
) -> bytes:
    """A GLB of the triangle, with lengths that lie where they are given."""
    text = json.dumps(document(buffers=[{"byteLength": len(binary)}])).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I", len(text) if json_length is None else json_length) + kind + text
    chunks += struct.pack("<I", len(binary) if binary_length is None else binary_length) + b"BIN\0" + binary
    return struct.pack("<4sII", b"glTF", version, 12 + len(chunks) if length is None else length) + chunks


GLB: dict[str, tuple[bytes, Outcome]] = {
    "plain": (glb(), 1.0),
    "version_1": (glb(version=1), "GLB version must be 2"),
    "version_9": (glb(version=9), "GLB version must be 2"),
    "length_zero": (glb(length=0), "Bad GLB"),
    "length_huge": (glb(length=2**32 - 1), "Bad GLB"),
    "json_length_huge": (glb(json_length=2**32 - 1), "Bad GLB"),
    "json_length_zero": (glb(json_length=0), "Bad glTF"),
    "binary_length_huge": (glb(binary_length=2**32 - 1), "Bad GLB"),
    "binary_length_zero": (glb(binary_length=0), "the importer broke off"),
    "first_chunk_unknown": (glb(kind=b"ABCD"), "Bad GLB"),
    "magic_alone": (b"glTF", "the importer broke off"),
    "header_alone": (struct.pack("<4sII", b"glTF", 2, 12), "the importer broke off"),
    "text": (json.dumps(document()).encode(), 1.0),
    "trailing_bytes": (glb() + b"x" * 33, "Bad GLB"),
}

# USD

MESH = """def Mesh "Mesh" {{
    int[] faceVertexCounts = [{counts}]
    int[] faceVertexIndices = [{indices}]
    point3f[] points = [{points}]
    {more}
}}"""
POINTS = "(0,0,0), (1,0,0), (0,1,0)"


def usd(counts: str = "3", indices: str = "0,1,2", points: str = POINTS, more: str = "") -> str:
    return "#usda 1.0\n" + MESH.format(counts=counts, indices=indices, points=points, more=more)


SHARP = "int[] cornerIndices = [{}]\nfloat[] cornerSharpnesses = [1]"


def shaders(count: int, last: str) -> str:
    """A red triangle, whose roughness is an image by way of so many transforms."""
    sources = [*(f"T{k}" for k in range(1, count)), last]
    transforms = "".join(
        f'def Shader "T{k}" {{\nuniform token info:id = "UsdTransform2d"\n'
        f"float2 inputs:in.connect = </M/{source}.outputs:result>\nfloat2 outputs:result\n}}\n"
        for k, source in enumerate(sources)
    )
    return (
        usd(more="rel material:binding = </M>")
        + '\ndef Material "M" {\ntoken outputs:surface.connect = </M/S.outputs:surface>\n'
        'def Shader "S" {\nuniform token info:id = "UsdPreviewSurface"\n'
        "color3f inputs:diffuseColor = (1,0,0)\nfloat inputs:roughness.connect = </M/I.outputs:r>\n"
        "token outputs:surface\n}\n"
        'def Shader "I" {\nuniform token info:id = "UsdUVTexture"\nasset inputs:file = @noise.png@\n'
        "float2 inputs:st.connect = </M/T0.outputs:result>\nfloat outputs:r\n}\n"
        'def Shader "Reader" {\nuniform token info:id = "UsdPrimvarReader_float2"\n'
        'string inputs:varname = "st"\nfloat2 outputs:result\n}\n' + transforms + "}\n"
    )


def laughs(levels: int, arc: str = "references") -> str:
    """Classes of ten that refer to the class before: 10 ** levels triangles."""
    classes = ['class "L0" {\n' + usd().partition("\n")[2] + "\n}\n"]
    for level in range(1, levels + 1):
        children = "".join(f'def Xform "c{k}" (\n{arc} = </L{level - 1}>\n) {{\n}}\n' for k in range(10))
        classes.append(f'class "L{level}" {{\n{children}}}\n')
    return "#usda 1.0\n" + "".join(classes) + f'def Xform "root" (\n{arc} = </L{levels}>\n) {{\n}}\n'


def deep(depth: int, between: str = "") -> str:
    """A mesh below so many prims; between: what stands in each of these."""
    inner = usd().partition("\n")[2] + "\n"
    return "#usda 1.0\n" + f'def Xform "a" {{\n{between}\n' * depth + inner + "}\n" * depth


def scattered(points: int, prototype: str = "", levels: int = 1) -> str:
    """A triangle, or what is given, by point instancers in one another."""
    inner = prototype or usd().partition("\n")[2] + "\n"
    for level in range(levels):
        inner = (
            f'def PointInstancer "I{level}" {{\nrel prototypes = <P{level}>\n'
            f"int[] protoIndices = [{', '.join('0' * points)}]\n"
            f"point3f[] positions = [{', '.join(f'({k}, {level}, 0)' for k in range(points))}]\n"
            f'def Xform "P{level}" {{\n{inner}}}\n}}\n'
        )
    return "#usda 1.0\n" + inner


USDA: dict[str, tuple[str, Outcome]] = {
    "references_in_references": (laughs(2), 1.0),
    "references_without_end": (laughs(8), "compose more than 100,000 prims"),
    "payloads_without_end": (laughs(8, "payload"), "compose more than 100,000 prims"),
    "inherits_without_end": (laughs(8, "inherits"), "compose more than 100,000 prims"),
    "instances_of_instances": (laughs(8, "instanceable = true\nreferences"), "prims; at most 1,000,000"),
    "deep_prims": (deep(200), 1.0),
    "very_deep_prims": (deep(20_000), "deep; at most 500"),
    "deeper_than_their_reader_can": (deep(100_000), "deep; at most 500"),
    "deep_behind_comments": (deep(1000, '# }\n// }\n/* } */\nstring s = "}"'), "deep; at most 500"),
    "brackets_in_texts": (usd(more='string s = """' + "{" * 900 + '"""\n# ' + "(" * 900), 1.0),
    "point_instancer": (scattered(4), 1.0),
    "point_instancers_in_one_another": (scattered(300, levels=3), "prims; at most 1,000,000"),
    "no_default_prim": (usd(), 1.0),
    "index_beyond": (usd(indices="0,1,900"), "no faces"),
    "index_negative": (usd(indices="0,1,-1"), "no faces"),
    "counts_of_0_and_2": (usd(counts="0,2,3", indices="0,1,0,1,2"), (1.0, "no faces")),
    "count_negative": (usd(counts="-3,3"), "are listed"),
    "corners_beyond_indices": (usd(counts="3,3"), "are listed"),
    "count_huge": (usd(counts="2000000000"), "are listed"),
    "no_indices": (usd(indices=""), "are listed"),
    "second_mesh_beyond_indices": (
        usd() + "\n" + MESH.replace('"Mesh"', '"Second"').format(counts="4", indices="0", points="", more=""),
        "are listed",
    ),
    "beyond_indices_at_a_time": (
        usd().replace("faceVertexCounts = [3]", "faceVertexCounts.timeSamples = { 1: [3, 30000000] }"),
        "are listed",
    ),
    "beyond_indices_with_a_comment": (usd(counts="# three\n3, 30000000"), "are listed"),
    "count_not_a_number": (usd(counts="3-"), "Could not open USD"),
    "no_points": (usd(points=""), "no faces"),
    "nothing": ("#usda 1.0\n", "no mesh"),
    "nan_points": (usd(points="(0,0,0), (1,0,0), (nan,inf,0)"), "zero area"),
    "uvs_of_wrong_length": (usd(more='texCoord2f[] primvars:st = [(0,0)] ( interpolation = "faceVarying" )'), 1.0),
    "uv_index_beyond": (
        usd(
            more='texCoord2f[] primvars:st = [(0,0)] ( interpolation = "faceVarying" )\n'
            "int[] primvars:st:indices = [5,6,7]"
        ),
        1.0,
    ),
    "colors_of_wrong_length": (
        usd(more="color3f[] primvars:displayColor = [(1,0,0), (0,1,0), (0,0,1), (0,0,0), (1,1,1)]"),
        1.0,
    ),
    "normals_of_wrong_length": (usd(more="normal3f[] normals = [(0,0,1)]"), 1.0),
    "left_handed": (usd(more='uniform token orientation = "leftHanded"'), 1.0),
    "invisible": (usd(more='token visibility = "invisible"'), "no mesh"),
    "guide": (usd(more='uniform token purpose = "guide"'), "no mesh"),
    "subdivided": (usd(more='uniform token subdivisionScheme = "catmullClark"'), 1.0),
    "material_missing": (usd(more="rel material:binding = </Nowhere>"), 1.0),
    "scale_zero": (
        usd(more='double3 xformOp:scale = (0,0,0)\nuniform token[] xformOpOrder = ["xformOp:scale"]'),
        "zero area",
    ),
    "payload_missing": ('#usda 1.0\ndef "A" ( payload = @nowhere.usda@ ) {}\n', "no mesh"),
    "references_itself": ('#usda 1.0\ndef "A" ( references = </A> ) {}\n', "no mesh"),
    "sublayer_is_itself": ("#usda 1.0\n( subLayers = [@sublayer_is_itself.usda@] )\n", "no mesh"),
    "default_prim_missing": ('#usda 1.0\n( defaultPrim = "Nobody" )\n' + usd().partition("\n")[2], 1.0),
    "instancer": (
        '#usda 1.0\ndef PointInstancer "I" {\nrel prototypes = [</I/P/Mesh>]\n'
        'int[] protoIndices = [0, 0]\npoint3f[] positions = [(0,0,0), (3,0,0)]\ndef Scope "P" {\n'
        + usd().partition("\n")[2]
        + "\n}\n}",
        1.0,
    ),
    "instancer_index_beyond": (
        '#usda 1.0\ndef PointInstancer "I" {\nrel prototypes = [</I/P/Mesh>]\n'
        'int[] protoIndices = [0, 9]\npoint3f[] positions = [(0,0,0)]\ndef Scope "P" {\n'
        + usd().partition("\n")[2]
        + "\n}\n}",
        1.0,
    ),
    "instancer_of_itself": (
        '#usda 1.0\ndef PointInstancer "I" {\nrel prototypes = [</I>]\n'
        "int[] protoIndices = [0]\npoint3f[] positions = [(0,0,0)]\n}",
        "no mesh",
    ),
    "syntax_error": ('#usda 1.0\ndef Mesh "Mesh" { int[] faceVertexCounts = [', "Could not open USD"),
    "version_99": ("#usda 99.0\n", ("no mesh", "Could not open USD")),
    "curves": (
        '#usda 1.0\ndef BasisCurves "C" {\nint[] curveVertexCounts = [9]\npoint3f[] points = [(0,0,0)]\n}',
        "are listed",
    ),
    "curves_of_negative_length": (
        '#usda 1.0\ndef BasisCurves "C" {\nint[] curveVertexCounts = [-9, 9]\npoint3f[] points = [(0,0,0)]\n}',
        "are listed",
    ),
    "sharp_corner": (usd(more=SHARP.format(2)), 1.0),
    "sharp_corner_beyond": (usd(more=SHARP.format(3)), "has a sharp corner at 3"),
    "sharp_corner_of_moving_points": (
        usd(more=SHARP.format(2)).replace(f"points = [{POINTS}]", f"points.timeSamples = {{ 1: [{POINTS}] }}"),
        1.0,
    ),
    "sharp_corner_beyond_at_a_time": (
        usd(more=SHARP.format(2).replace("s = [2]", "s.timeSamples = { 1: [2], 5: [900000] }")),
        "has a sharp corner at 900000",
    ),
    "instance_beyond_indices": (
        '#usda 1.0\ndef "I" ( instanceable = true\nreferences = </Shape> ) {}\nclass "Shape" {\n'
        + usd(counts="3, 3000000").partition("\n")[2]
        + "\n}",
        "are listed",
    ),
    "shader_in_itself": (shaders(1, "T0"), "in a row or a ring"),
    "shaders_in_a_ring": (shaders(3, "T0"), "in a row or a ring"),
    "shaders_in_a_row": (shaders(20, "Reader"), 1.0),
    "shaders_in_a_long_row": (shaders(300, "Reader"), "in a row or a ring"),
    "sphere": ('#usda 1.0\ndef Sphere "S" {\ndouble radius = 1\n}', 1.0),
    "sphere_of_nan": ('#usda 1.0\ndef Cube "S" {\ndouble size = nan\n}', "not finite"),
    "deep": ("#usda 1.0\n" + 'def Xform "X" {\n' * 300 + usd().partition("\n")[2] + "\n}" * 300, 1.0),
    "skeleton_missing": (
        '#usda 1.0\ndef SkelRoot "R" {\n'
        + usd(
            more="rel skel:skeleton = </None>\n"
            "int[] primvars:skel:jointIndices = [9] ( elementSize = 1 )\n"
            "float[] primvars:skel:jointWeights = [1] ( elementSize = 1 )"
        ).partition("\n")[2]
        + "\n}",
        1.0,
    ),
}


def zipped(**files: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return out.getvalue()


OTHERS: dict[str, tuple[bytes, Outcome]] = {
    "text_in_it.usdz": (zipped(readme=b"hello"), "Could not open USD"),
    "empty_archive.usdz": (zipped(), "Could not open USD"),
    "cut_archive.usdz": (zipped(**{"a.usda": usd().encode() * 50})[:300], "Could not open USD"),
    "broken_scene.usdz": (zipped(**{"a.usda": b"#usda 1.0\ndef"}), "Could not open USD"),
    "magic_alone.usdc": (b"PXR-USDC", "Could not open USD"),
    "noise_after_magic.usdc": (b"PXR-USDC\0\x08\0\0\0\0\0\0" + bytes(range(256)) * 4, "Could not open USD"),
    "text.usdc": (usd().encode(), "Could not open USD"),
    "text.usd": (usd().encode(), 1.0),
    "hdf5.abc": (b"\x89HDF\r\n\x1a\n" + bytes(500), "the importer refused it"),
    "zeros.abc": (b"Ogawa\xff\0\x01" + struct.pack("<Q", 16) + bytes(500), "the importer refused it"),
    "root_in_itself.abc": (b"Ogawa\xff\0\x01" + struct.pack("<QQQQQ", 16, 3, 16, 16, 16), "hold each other"),
    "noise.abc": (
        b"Ogawa\xff\0\x01"
        + struct.pack("<QQ", 16, 6)
        + b"".join(struct.pack("<Q", k) for k in (40, 1 << 63, 48, 3 | 1 << 63, 0, 99))
        + bytes(range(200)),
        "the importer refused it",
    ),
    "text.fbx": (b"; FBX 7.3.0 project file\nFBXHeaderExtension: {\n FBXVersion: 7300\n}\nObjects: {\n}\n", "no mesh"),
    "old_text.fbx": (b"; FBX 6.1.0 project file\nFBXHeaderExtension:  {\n\tFBXVersion: 6100\n}\n", "no mesh"),
    "magic_alone.fbx": (b"Kaydara FBX Binary  \0\x1a\0", "Unsupported version"),
    "no_nodes.fbx": (b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400) + bytes(200), "no mesh"),
    "version_huge.fbx": (b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 2**31) + bytes(200), "no mesh"),
    "lengths_huge.fbx": (b"Kaydara FBX Binary  \0\x1a\0" + struct.pack("<I", 7400) + b"\xff" * 300, "Failed to load"),
    "header_alone.blend": (b"BLENDER-v405", "Missing DNA block"),
    "newer.blend": (b"BLENDER-v999" + b"ENDB" + bytes(20), "Missing DNA block"),
    "new_header_format.blend": (b"BLENDER17-01v0999" + b"ENDB" + bytes(28), "Missing DNA block"),
    "no_dna.blend": (b"BLENDER-v405" + b"ENDB" + bytes(20), "Missing DNA block"),
    "big_endian.blend": (b"BLENDER-V279" + b"ENDB" + bytes(20), ("Missing DNA block", "Big Endian")),
    "pointers_of_4.blend": (b"BLENDER_v249" + b"ENDB" + bytes(16), "Missing DNA block"),
    "gzip_of_noise.blend": (gzip.compress(b"noise" * 99, mtime=0), "File format is not supported"),
    "gzip_cut.blend": (gzip.compress(b"BLENDER-v279" + bytes(range(256)) * 40, mtime=0)[:60], "Missing DNA block"),
    "zstd_magic.blend": (b"\x28\xb5\x2f\xfd" + bytes(range(200)), "File format is not supported"),
    "block_huge.blend": (b"BLENDER-v405DATA" + struct.pack("<iQii", 2**31 - 1, 1, 0, 1), "Missing DNA block"),
    "block_negative.blend": (b"BLENDER-v405DATA" + struct.pack("<iQii", -5, 1, 0, 1) + bytes(99), "Missing DNA block"),
}


def all_files() -> dict[str, tuple[bytes, Outcome]]:
    """By file name: content and expected outcome."""
    found: dict[str, tuple[bytes, Outcome]] = {}
    for suffix, table in (("obj", OBJ), ("usda", USDA), ("gltf", GLTF_TEXT)):
        for name, (text, wanted) in table.items():
            found[f"{name}.{suffix}"] = text.encode("latin-1" if name == "utf16" else "utf-8"), wanted
    for suffix, binary in (("ply", PLY), ("stl", STL), ("glb", GLB)):
        found |= {f"{name}.{suffix}": entry for name, entry in binary.items()}
    found |= {f"{name}.gltf": (json.dumps(parts).encode(), wanted) for name, (parts, wanted) in GLTF.items()}
    return found | OTHERS
