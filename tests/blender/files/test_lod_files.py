# SPDX-License-Identifier: GPL-3.0-or-later
"""Levels of detail that files tell otherwise than by names."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy
import pytest

from fmqm_addon.blender.files.load import chains_of_file, load_asset
from tests.blender import scenes

LEVELS = ("stone fine", "stone middle", "stone far")  # by name the order is another


def stones(*others: str) -> bpy.types.Object:
    """A group of spheres with 224, 80 and 24 triangles, in this order; and cubes."""
    group = bpy.data.objects.new("Statue", None)
    bpy.context.scene.collection.objects.link(group)
    for name, segments in zip(LEVELS, (16, 10, 6), strict=True):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=segments, ring_count=segments // 2)
        bpy.context.object.name = name
        bpy.context.object.parent = group
    for name in others:
        scenes.cube(name)
    return group


def as_lod_group(path: Path) -> None:
    """Makes the empty of an exported FBX file a LOD group, with its levels in their order."""
    from io_scene_fbx import encode_bin, parse_fbx

    add = {
        "B": "bool", "C": "char", "Z": "int8", "Y": "int16", "I": "int32", "F": "float32", "D": "float64", "L": "int64",
        "R": "bytes", "S": "string", "f": "float32_array", "i": "int32_array", "d": "float64_array",
        "l": "int64_array", "b": "bool_array", "c": "byte_array",
    }  # fmt: skip
    root, version = parse_fbx.parse(str(path))
    numbers: dict[bytes, int] = {}

    def remade(old: Any) -> Any:
        new = encode_bin.FBXElem(old.id)
        values = list(old.props)
        if old.id == b"Model":
            numbers[values[1].partition(b"\x00")[0]] = values[0]
            if values[1].startswith(b"Statue\x00"):
                values[2] = b"LodGroup"
        for kind, value in zip(old.props_type, values, strict=True):
            getattr(new, f"add_{add[chr(kind)]}")(value)
        children = list(old.elems)
        if old.id == b"Connections":
            order = {numbers[name.encode()]: index for index, name in enumerate(LEVELS)}
            children.sort(key=lambda each: order.get(each.props[1], -1))
        new.elems = [remade(each) for each in children]
        return new

    encode_bin.write(str(path), remade(root), version)


def test_a_lod_group_of_a_binary_fbx(tmp_path: Path) -> None:
    path = tmp_path / "statue.fbx"
    stones("Plinth")
    bpy.ops.export_scene.fbx(filepath=str(path))
    assert len(load_asset(str(path)).mesh.triangles) == 224 + 80 + 24 + 12
    as_lod_group(path)
    found = load_asset(str(path)).mesh
    assert len(found.triangles) == 224 + 12
    assert "stone fine is measured" in found.notes[0] and "stone middle, stone far" in found.notes[0]
    assert chains_of_file(str(path)) == [("Statue", list(enumerate(LEVELS)))] or chains_of_file(str(path)) == [
        ("statue", list(enumerate(LEVELS)))
    ]


TEXT = """; FBX 7.4.0 project file
FBXHeaderExtension:  {
	FBXVersion: 7400
}
Objects:  {
%s
}
Connections:  {
%s
}
"""
QUAD = """	Geometry: %d, "Geometry::", "Mesh" {
		Vertices: *12 {
			a: 0,0,0,1,0,0,1,1,0,0,1,%s
		}
		PolygonVertexIndex: *%d {
			a: %s
		}
	}
"""


def test_a_lod_group_of_a_text_fbx(tmp_path: Path) -> None:
    objects = '	Model: 1, "Model::Stand", "LodGroup" {\n	}\n'
    objects += '	Model: 2, "Model::b", "Mesh" {\n	}\n	Model: 3, "Model::a", "Mesh" {\n	}\n'
    objects += QUAD % (4, "0", 6, "0,1,-3,0,2,-4") + QUAD % (5, "0", 4, "0,1,2,-4")
    links = "\n".join(f'	C: "OO",{child},{parent}' for child, parent in ((1, 0), (2, 1), (3, 1), (4, 2), (5, 3)))
    path = tmp_path / "stand.fbx"
    path.write_text(TEXT % (objects, links))
    ((_, levels),) = chains_of_file(str(path))
    assert levels == [(0, "b"), (1, "a")]
    assert "b is measured" in load_asset(str(path)).mesh.notes[0]


@pytest.mark.parametrize("among", [True, False])
def test_levels_of_a_gltf_node(tmp_path: Path, among: bool) -> None:
    """MSFT_lod names the coarser nodes, which may be in the scene's tree or not."""
    path = tmp_path / "statue.gltf"
    stones("Plinth")
    bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLTF_SEPARATE")
    file = json.loads(path.read_text())
    rows = {node["name"]: index for index, node in enumerate(file["nodes"])}
    fine, *coarser = (rows[name] for name in LEVELS)
    file["nodes"][fine]["extensions"] = {"MSFT_lod": {"ids": coarser}}
    if not among:
        file["nodes"][rows["Statue"]]["children"] = [fine]
    path.write_text(json.dumps(file))
    found = load_asset(str(path)).mesh
    told = [note for note in found.notes if "no material" not in note]
    assert len(found.triangles) == 224 + 12 and bool(told) == among
    assert chains_of_file(str(path)) == [("stone fine", list(enumerate(LEVELS)))]
    assert len(load_asset(f"{path}:stone far").mesh.triangles) == 24


@pytest.mark.parametrize("told", [{}, {"ids": None}, {"ids": [-1, 99, "x", 1.5, True]}, {"ids": "all"}])
def test_nonsense_about_levels_is_no_level(tmp_path: Path, told: object) -> None:
    path = tmp_path / "statue.gltf"
    stones()
    bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLTF_SEPARATE")
    file = json.loads(path.read_text())
    file["nodes"][0]["extensions"] = {"MSFT_lod": told}
    path.write_text(json.dumps(file))
    assert len(load_asset(str(path)).mesh.triangles) == 224 + 80 + 24
