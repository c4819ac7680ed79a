# SPDX-License-Identifier: GPL-3.0-or-later
"""What importers leave out without a word is said, and nothing is said of files that they take whole."""

from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.files.load import load_asset
from fmqm_addon.blender.materials.images import black_warnings, load_texture
from fmqm_addon.blender.scene.mesh_arrays import AS_FOUND
from fmqm_addon.metric.errors import MeshError
from tests.blender import scenes
from tests.blender.script import noise, write_png, write_torus

from .hostile_files import TETRAHEDRON

RED = "newmtl red\nKd 1 0 0\n"
WITH_COLORS = TETRAHEDRON.replace("v 0 0 0\n", "v 0 0 0 1 0 0\n")


def told(path: Path) -> list[str]:
    """The warnings of the file itself, not of the objects in it."""
    start = f"{path.name}: "
    return [each.removeprefix(start) for each in load_asset(str(path)).mesh.warnings if each.startswith(start)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (TETRAHEDRON, []),
        (TETRAHEDRON.replace("v", "  v").replace("f ", " \tf\t").replace("1 3 2", "1 \\\n3 2"), []),
        ("mtllib sub.mtl\nusemtl red\n" + TETRAHEDRON, []),
        ('mtllib "sub.mtl"  \r\nusemtl red\r\n' + TETRAHEDRON, []),
        ("mtllib two words.mtl\n\tusemtl red\n" + TETRAHEDRON, []),
        (
            "mtllib gone.mtl\nusemtl red\n" + TETRAHEDRON,
            ["names the material file gone.mtl, which is missing or cannot be read"],
        ),
        ("mtllib .\n" + TETRAHEDRON, ["names the material file ., which is missing or cannot be read"]),
        (
            f"mtllib {'x' * 300}\nmtllib \0\n" + TETRAHEDRON,
            [f"names the material file {name}, which is missing or cannot be read" for name in ("x" * 300, "\\x00")],
        ),
        (
            "mtllib sub.mtl\nusemtl blue\n" + TETRAHEDRON + "usemtl red\nv 2 2 2\nf 1 2 5\n",
            ["no material file describes blue, which it uses; Blender's default is taken"],
        ),
        (
            TETRAHEDRON + "f 1 2 9\nf 3 3 1\n",
            ["2 of 6 faces were left out by Blender's importer, as broken or repeated"],
        ),
        ("mtllib sub.mtl\nusemtl blue\nusemtl red\n" + TETRAHEDRON, []),
        ("mtllib \\\nsub.mtl\nusemtl \\ \r\n red\n" + TETRAHEDRON, []),
        ("mtllib sub.mtl\nusemtl \n" + TETRAHEDRON, []),
        (WITH_COLORS, ["its vertex colors were left out by Blender's importer, since not all vertices have one"]),
        (WITH_COLORS.replace("v 1 0 0\nv 0 1 0\nv 0 0 1", "v 1 0 0 1 1 1\nv 0 1 0 1 1 1\nv 0 0 1 0 0 0"), []),
    ],
)
def test_obj(tmp_path: Path, text: str, expected: list[str]) -> None:
    for name in ("sub.mtl", "two words.mtl"):
        (tmp_path / name).write_text(RED)
    path = tmp_path / "shape.obj"
    path.write_bytes(text.encode())
    assert told(path) == expected


@pytest.mark.parametrize("before", ["", TETRAHEDRON])
def test_line_at_which_blender_gives_up(tmp_path: Path, before: str) -> None:
    path = tmp_path / "long.obj"
    path.write_text(f"{before}g {'x ' * 2**18}\n{TETRAHEDRON}")
    try:
        said = told(path)
    except MeshError as error:
        said = [str(error)]
        assert said[0].startswith(f"{path}: no mesh in it; a surface is wanted (")
    late = bpy.app.version >= (5, 2)
    assert any("4 of" in each and "no lines of 262,144 bytes" in each for each in said) != late, said


def test_missing_libraries(tmp_path: Path) -> None:
    """All of the file, or a part of it, is left out by Blender."""
    scenes.clear()
    linked = scenes.square("Linked", materials=[scenes.material("Skin")])
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {linked})
    for own in (False, True):
        scenes.clear()
        with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (_, wanted):
            wanted.objects, wanted.materials = ["Linked"], ["Skin"]
        bpy.context.scene.collection.objects.link(bpy.data.objects["Linked"])
        if own:
            scenes.square("Own", materials=[bpy.data.materials["Skin"]])
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / f"{own}.blend"))
    assert not told(tmp_path / "True.blend")
    (tmp_path / "library.blend").unlink()
    where = f"from {tmp_path / 'library.blend'}, which is missing"
    (said,) = told(tmp_path / "True.blend")
    assert said.startswith("links ") and "Linked" in said and said.endswith(where)
    assert any(
        "Skin is missing from its library" in each for each in load_asset(str(tmp_path / "True.blend")).mesh.warnings
    )
    with pytest.raises(MeshError, match="no mesh in it") as caught:
        load_asset(str(tmp_path / "False.blend"))
    assert where in str(caught.value)


USD_TRIANGLE = """def Mesh "A" {
  int[] faceVertexCounts = [3]
  int[] faceVertexIndices = [0, 1, 2]
  point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
}
"""


@pytest.mark.parametrize("how", ["references", "payload", "subLayers"])
def test_missing_parts_of_usd(tmp_path: Path, how: str) -> None:
    bpy.utils.expose_bundled_modules()
    pytest.importorskip("pxr")  # which Debian's Blender 5 lacks
    names = f"({how} = {'[@part.usda@]' if how == 'subLayers' else '@part.usda@'})\n"
    layer, prim = (names, "") if how == "subLayers" else ("", names)
    (tmp_path / "part.usda").write_text(f'#usda 1.0\n(defaultPrim = "A")\n{USD_TRIANGLE}')
    (tmp_path / "whole.usda").write_text(f'#usda 1.0\n{layer}def "B" {prim}{{\n}}\n{USD_TRIANGLE}')
    (tmp_path / "empty.usda").write_text(f'#usda 1.0\n{layer}def "B" {prim}{{\n}}\n')
    assert not told(tmp_path / "whole.usda")
    (tmp_path / "part.usda").unlink()
    said = "refers to part.usda, which is missing or cannot be read"
    assert told(tmp_path / "whole.usda") == [said]
    with pytest.raises(MeshError, match=f"no mesh in it.*{said}"):
        load_asset(str(tmp_path / "empty.usda"))


def test_missing_image_of_usd(tmp_path: Path) -> None:
    """The importer makes an image node without an image of it, and prints its name only for programmers."""
    bpy.utils.expose_bundled_modules()
    pytest.importorskip("pxr")
    path, image = tmp_path / "shape.usda", write_png(tmp_path / "skin.png", noise())
    path.write_text(
        f"#usda 1.0\n{USD_TRIANGLE}"
        'def Shader "S" {\nuniform token info:id = "UsdUVTexture"\nasset inputs:file = @./skin.png@\n}\n'
        'def Shader "Tiles" {\nuniform token info:id = "UsdUVTexture"\nasset inputs:file = @./tile.<UDIM>.png@\n}\n'
    )
    assert not told(path)
    image.unlink()
    assert told(path) == ["refers to ./skin.png, which is missing or cannot be read"]


def test_the_namesake_counts_as_named(tmp_path: Path) -> None:
    (tmp_path / "shape.mtl").write_text(RED)
    (tmp_path / "shape.obj").write_text("usemtl red\n" + TETRAHEDRON)
    mesh = load_asset(str(tmp_path / "shape.obj")).mesh
    assert not mesh.warnings
    np.testing.assert_allclose(mesh.materials[0].color.lookup(np.zeros((1, 2))), [[1, 0, 0]], atol=1e-6)


def test_images_and_faces_of_a_ply(tmp_path: Path) -> None:
    path = tmp_path / "scan.ply"
    path.write_text(
        "ply\nformat ascii 1.0\ncomment TextureFile skin 1.png\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    names = "names the image skin 1.png, which Blender does not read from a PLY"
    assert told(path) == [names]
    path.write_text(path.read_text().replace("face 1", "face 3") + "3 0 1 9\n3 0 0 1\n")
    assert told(path) == ["2 of 3 faces were left out by Blender's importer, as broken or repeated", names]


def test_why_nothing_remains_of_a_file(tmp_path: Path) -> None:
    """The error names the file once, and what was left out."""
    path = tmp_path / "shape.obj"
    path.write_text("v 0 0 0\nf 1 1 1\n")
    with pytest.raises(MeshError) as caught:
        load_asset(str(path))
    said = "1 of 1 faces were left out by Blender's importer, as broken or repeated"
    assert str(caught.value) == f"{path}: the mesh has no faces; a surface is wanted ({said})"


@pytest.mark.parametrize(
    ("lines", "unread"),
    [
        ("Kd 1 .5 -0\r", ""),
        ("Kd\t1.0e-1 0.5  0 # red", ""),
        ("Kd 1 0 0\nmap_Ka image.png\nmap_Kd image.png", ""),
        ("kd 1 0 0", "kd 1 0 0"),
        ("map_kd image.png", "map_kd image.png"),
        ("Kd 0 0 0\nmap_Ka image.png", "map_Ka image.png"),
        ("Kd 0,5 0,5 0,5", "Kd 0,5 0,5 0,5"),
        ("Kd 0.5", "Kd 0.5"),
        ("Kd spectral red.rfl", "Kd spectral red.rfl"),
        ("Kd 1 1 1\nnewmtl other\nkd 0 0 0", ""),
    ],
)
def test_unread_colors_of_a_material_file(tmp_path: Path, lines: str, unread: str) -> None:
    write_png(tmp_path / "image.png", noise())
    path = write_torus(tmp_path, "ring", "image.png")
    name = (tmp_path / "ring.mtl").read_text().split()[1]
    (tmp_path / "ring.mtl").write_text(f"newmtl {name}\n{lines}\n")
    said = f"its material file says {unread}, which Blender does not read as a color"
    assert told(path) == ([said] if unread else [])


def test_left_out_facets_of_an_stl(tmp_path: Path) -> None:
    corners = ("0 0 0", "1 0 0", "0 1 0")
    good, bad = (
        "facet normal 0 0 1\nouter loop\n" + "".join(f"vertex {each}\n" for each in facet) + "endloop\nendfacet\n"
        for facet in (corners, corners[:2] + corners[:1])
    )
    path = tmp_path / "shape.stl"
    path.write_text(f"solid facet normal\n{good}endsolid\n")
    assert told(path) == []
    said = "1 of 2 faces were left out by Blender's importer, as broken or repeated"
    path.write_text(f"solid\n{good}{bad}endsolid\n")
    assert told(path) == [said]
    facets = [(0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0), (0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0)]
    path.write_bytes(bytes(80) + struct.pack("<I", 2) + b"".join(struct.pack("<12fH", *each) for each in facets))
    assert told(path) == [said]


@pytest.mark.parametrize("kind", ["NurbsPatch", "Volume"])
def test_what_blender_does_not_read_of_usd(tmp_path: Path, kind: str) -> None:
    bpy.utils.expose_bundled_modules()
    pytest.importorskip("pxr")
    path = tmp_path / "shape.usda"
    path.write_text(f'#usda 1.0\n{USD_TRIANGLE}class {kind} "C" {{}}\ndef {kind} "D" {{}}\n')
    assert told(path) == [f"holds 1 of type {kind}, which Blender does not read as surfaces"]


def test_floats_that_are_all_but_black_are_told() -> None:
    """As whole numbers of 32 bits are, where they count to 255."""
    assert black_warnings("image.tif", np.full((2, 2, 3), 255 / 2**31, np.float32))
    assert not black_warnings("image.exr", np.full((2, 2, 3), 0.001, np.float32))


def test_a_given_texture_makes_missing_materials_unimportant(tmp_path: Path) -> None:
    path = write_torus(tmp_path, "ring", "noise.png")
    (tmp_path / "ring.mtl").unlink()
    given = replace(AS_FOUND, texture=load_texture(str(write_png(tmp_path / "noise.png", noise()))))
    assert told(path) == ["names the material file ring.mtl, which is missing or cannot be read"]
    assert not load_asset(str(path), given).mesh.warnings


def test_names_of_many_lines_are_one_line_in_warnings(tmp_path: Path) -> None:
    path = tmp_path / "two\nlines.obj"
    path.write_text("mtllib gone.mtl\n" + TETRAHEDRON)
    assert load_asset(str(path)).mesh.warnings[0].startswith("two\\nlines.obj: names the material file")
