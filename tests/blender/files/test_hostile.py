# SPDX-License-Identifier: GPL-3.0-or-later
"""Malformed and odd files: each is scored, 1 against itself, or refused in one line that names it; nothing remains."""

from __future__ import annotations

import json
import os
import re
import shutil
import struct
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import bpy
import pytest

from fmqm_addon.blender.files.load import SUFFIXES, load_asset
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.comparison.alignment import align
from fmqm_addon.comparison.measurement import Measurement
from fmqm_addon.metric.errors import FMQMError
from fmqm_addon.metric.settings import Settings
from tests.blender import scenes
from tests.blender.script import noise, read_json, score, write_png, write_torus

from .hostile_files import TETRAHEDRON, Outcome, all_files

FILES = all_files()
TINY = Settings(samples=320, patches=5, color_units=10)
TINY_FLAGS = ("--quiet", "--samples", "320", "--patches", "5", "--color-units", "10")
SECONDS = 600  # that nothing takes which ends: machines are busy

# The files of the shared folder "hostile".
REAL: dict[str, Outcome] = {
    "glb_alpha_modes/AlphaBlendModeTest.glb": 1.0,
    "glb_draco/heart_draco.glb": (1.0, "the importer broke off"),
    "glb_inf_coords/BoxWithInfinites.glb": (1.0, "zero area"),
    "glb_multi_uv/MultiUVTest.glb": 1.0,
    "glb_vertex_colour_and_texture/chr_knight.glb": 1.0,
    "gltf_instances/three_cubes_instances.gltf": 1.0,
    "gltf_missing_bin/BoxTextured.gltf": "Missing resource",
    "gltf_primitive_modes/Mesh_PrimitiveMode_00.gltf": "no faces",
    "gltf_primitive_modes/Mesh_PrimitiveMode_01.gltf": "no faces",
    "gltf_primitive_modes/Mesh_PrimitiveMode_02.gltf": "no faces",
    "gltf_primitive_modes/Mesh_PrimitiveMode_03.gltf": "no faces",
    "gltf_primitive_modes/Mesh_PrimitiveMode_04.gltf": 1.0,
    "gltf_primitive_modes/Mesh_PrimitiveMode_05.gltf": 1.0,
    "gltf_primitive_modes/Mesh_PrimitiveMode_06.gltf": 1.0,
    "gltf_primitive_modes/Mesh_PrimitiveMode_07.gltf": "no faces",
    "gltf_sparse/SimpleSparseAccessor.gltf": 1.0,
    "gltf_texture_transform/TextureTransformTest.gltf": 1.0,
    "gltf_wrong_types/badArray.gltf": "parse glTF",
    "gltf_wrong_types/badString.gltf": "parse glTF",
    "gltf_wrong_types/badUint.gltf": 1.0,
    "obj_concave_polygon/concave_polygon.obj": 1.0,
    "obj_empty_header/empty.obj": "no mesh",
    "obj_empty_header/empty.ply": "no vertices",
    "obj_empty_header/ply_empty_header.ply": "no vertices",
    "obj_index_out_of_range/malformed.obj": 1.0,
    "obj_index_out_of_range/malformed2.obj": 1.0,
    "obj_missing_files/model.obj": "base-color image is missing",
    "obj_missing_files/model2.obj": 1.0,
    "obj_mtl_file_missing/jacked.obj": 1.0,
    "obj_nan_coords/test-nan.obj": 1.0,
    "obj_negative_indices/negative_indices.obj": 1.0,
    "obj_ngons_multitexture/simple-multitexture-polygon.obj": 1.0,
    "obj_no_uv/CubeTriangleFaces.obj": 1.0,
    "obj_nonconvex_quad/non_convex_quad.obj": 1.0,
    "obj_nonmanifold_edge/nonmanifold_edge.obj": 1.0,
    "obj_nonmanifold_edge/nonmanifold_vertex.obj": 1.0,
    "obj_nonmanifold_edge/nonoriented_edge.obj": 1.0,
    "obj_number_formats/number_formats.obj": "zero area",
    "obj_partial_vertex_colours/cube_with_vertexcolors.obj": 1.0,
    "obj_partial_vertex_colours/only_a_part_of_vertexcolors.obj": 1.0,
    "obj_truncated/spot_cut.obj": 1.0,
    "obj_windows_paths_spider/spider.obj": 1.0,
    "ply_moebius/moebius-160-10.ply": 1.0,
    "ply_two_textures/TextureDouble.ply": 1.0,
    "ply_two_textures/TextureSingle.ply": 1.0,
    "space_names_gltf/CubeImageUriMultipleSpaces.gltf": 1.0,
    "space_names_gltf/CubeImageUriSpaces.gltf": 1.0,
    "tex_exr_alpha/cube.obj": 1.0,
    "tex_hdr/cube.obj": 1.0,
    "tex_jpg_exif_rotated/cube.obj": 1.0,
    "tex_png16_grey_trns/cube.obj": 1.0,
    "tex_png1_grey/cube.obj": 1.0,
    "tex_png_1x1/cube.obj": 1.0,
    "tex_png_garbage/cube.obj": "the image promises",
    "tex_png_palette_alpha/cube.obj": 1.0,
    "tex_png_rgb_trns/cube.obj": 1.0,
    "tex_png_truncated/cube.obj": "base-color image is broken",
    "udim/plane_udim.blend": 1.0,
    "udim/usdUdims.usda": "holds no image",
}


# What Blender leaves out of some of them without a word.
TOLD = {
    "obj_index_out_of_range/malformed.obj": "2 of 6 faces were left out",
    "obj_index_out_of_range/malformed2.obj": "no material file describes DefaultDoesNotExist",
    "obj_missing_files/model2.obj": "the material file model2.mtl, which is missing",
    "obj_mtl_file_missing/jacked.obj": "the material file nonexistent.mtl, which is missing",
    "obj_nonmanifold_edge/nonmanifold_edge.obj": "the material file nonmanivold_edge.mtl, which is missing",
    "obj_nonmanifold_edge/nonmanifold_vertex.obj": "the material file nonmanivold_vertex.mtl, which is missing",
    "obj_nonmanifold_edge/nonoriented_edge.obj": "the material file nonoriented_edge.mtl, which is missing",
    "obj_partial_vertex_colours/only_a_part_of_vertexcolors.obj": "vertex colors were left out",
    "obj_truncated/spot_cut.obj": "1 of 4266 faces were left out",
    "ply_two_textures/TextureDouble.ply": "names the image <this>_A.png, <this>_B.png",
    "ply_two_textures/TextureSingle.ply": "names the image TextureDouble_A.png",
}


def outcome(path: Path | str) -> float | str:
    """The score of a file against itself, or the line that refuses it."""
    try:
        reference = load_asset(str(path))
        measurement = Measurement(reference.world(), BVHQuery, TINY)
        measurement.prepare().run()
        scores = measurement.compare(align(reference, load_asset(str(path))).mesh).run().scores
    except FMQMError as error:
        assert len(str(error).splitlines()) == 1
        assert Path(path).name in str(error)
        return str(error)
    assert len(set(scores)) == 1, scores
    return float(scores[0])


def expected(found: float | str, wanted: Outcome) -> bool:
    if isinstance(wanted, tuple):
        return any(expected(found, each) for each in wanted)
    return wanted in found if isinstance(found, str) and isinstance(wanted, str) else found == wanted


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All files of hostile_files, and a good pair."""
    made = tmp_path_factory.mktemp("hostile")
    for name, (content, _) in FILES.items():
        (made / name).write_bytes(content)
    write_png(made / "noise.png", noise())
    write_torus(made, "good_1", "noise.png")
    write_torus(made, "good_2", "noise.png", shake=0.03)
    return made


def good_scores(folder: Path) -> list[float]:
    reference = load_asset(str(folder / "good_1.obj"))
    measurement = Measurement(reference.world(), BVHQuery, TINY)
    measurement.prepare().run()
    return list(measurement.compare(align(reference, load_asset(str(folder / "good_2.obj"))).mesh).run().scores)


@pytest.fixture(scope="module")
def good(folder: Path) -> list[float]:
    """What the good pair scores before anything else was opened."""
    scenes.clear()
    return good_scores(folder)


@pytest.fixture
def unharmed(folder: Path, good: list[float]) -> Iterator[None]:
    """Nothing stays in the session, and the good pair scores what it did, to the last bit."""
    before = scenes.blocks()
    yield
    assert scenes.blocks() == before
    assert good_scores(folder) == good


@pytest.mark.parametrize("kind", sorted({Path(name).suffix for name in FILES}))
def test_each_file_is_scored_or_refused(folder: Path, unharmed: None, kind: str) -> None:
    """One after the other in one process."""
    before = scenes.blocks()
    for name in sorted(FILES):
        if Path(name).suffix == kind:
            found = outcome(folder / name)
            assert expected(found, FILES[name][1]), f"{name}: {found}"
            assert scenes.blocks() == before, name


def test_a_run_goes_on_after_hostile_files(folder: Path) -> None:
    """The script: a line for each, and the good pair between them as if it were alone."""
    bad = [folder / name for name in sorted(FILES) if FILES[name][1] == "the importer broke off"]
    assert len(bad) > 9
    good = folder / "good_2.obj"
    done = score(folder / "good_1.obj", good, *bad, good, *TINY_FLAGS)
    alone = score(folder / "good_1.obj", good, *TINY_FLAGS)
    assert done.returncode == 1 and alone.returncode == 0
    rows = [line.split()[-5:] for line in done.stdout.splitlines() if line.split()[0].endswith("good_2.obj")]
    assert rows == [alone.stdout.splitlines()[1].split()[-5:]] * 2
    said = [line for line in done.stderr.splitlines() if line.startswith("score.py: ") and "warning" not in line]
    assert [name.name in line for name, line in zip(bad, said, strict=True)] == [True] * len(bad)


# Paths


def test_paths_that_are_no_files(tmp_path: Path, unharmed: None) -> None:
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "ring.obj").symlink_to(tmp_path / "ring.obj")
    (tmp_path / "nowhere.glb").symlink_to(tmp_path / "gone.glb")
    os.mkfifo(tmp_path / "pipe.ply")
    for name, words in (
        ("folder.obj", "a file is wanted"),
        ("pipe.ply", "a file is wanted"),
        ("ring.obj", "no such file"),
        ("nowhere.glb", "no such file"),
    ):
        assert words in str(outcome(tmp_path / name))


def test_links_beside_a_file_may_lead_anywhere(tmp_path: Path, unharmed: None) -> None:
    (tmp_path / "shape.obj").write_text(TETRAHEDRON, encoding="utf-8")
    for name, target in (("circle", "circle"), ("nowhere", "gone.png"), ("here", ".")):
        (tmp_path / name).symlink_to(target)
    assert outcome(tmp_path / "shape.obj") == 1.0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
@pytest.mark.parametrize("pipe", ["named.mtl", "shape.mtl", "image one.png", "textures/skin.png", "shape.bin"])
def test_pipes_and_devices_that_files_name(tmp_path: Path, unharmed: None, pipe: str) -> None:
    """Importers would wait for ever at them. Others that lie there do not matter."""
    (tmp_path / "textures").mkdir()
    (tmp_path / "named.mtl").write_text("newmtl M\nmap_Kd image one.png\nmap_d textures/skin.png\n")
    (tmp_path / "shape.obj").write_text("mtllib named.mtl\nusemtl M\n" + TETRAHEDRON)
    gltf = {"asset": {"version": "2.0"}, "buffers": [{"uri": "shape.bin", "byteLength": 9}]}
    gltf |= {"images": [{"uri": "image%20one.png"}, {"uri": "textures/skin.png"}]}
    (tmp_path / "shape.gltf").write_text(json.dumps(gltf))
    (tmp_path / "other.obj").write_text(TETRAHEDRON)
    (tmp_path / pipe).unlink(missing_ok=True)
    os.mkfifo(tmp_path / pipe)
    (tmp_path / "nothing.png").symlink_to("gone.png")
    path = tmp_path / ("shape.gltf" if pipe.endswith(".bin") else "shape.obj")
    for asked in {path, tmp_path / "shape.gltf"} if pipe.endswith(".png") else {path}:
        assert outcome(asked) == f"{asked}: it names {tmp_path / pipe}; a file is wanted, not a pipe or a device"
    assert outcome(tmp_path / "other.obj") == 1.0


@pytest.mark.skipif(os.sep == "\\", reason="on Windows these are the separators")
def test_backslash_in_the_name_of_an_image(tmp_path: Path, unharmed: None) -> None:
    path = write_torus(tmp_path, "ring", "a\\b.png")
    write_png(tmp_path / "a\\b.png", noise(17))
    assert "takes for a slash" in str(outcome(path))


@pytest.mark.skipif(bpy.app.version >= (5, 2), reason="this Blender survives it")
def test_image_at_which_an_importer_crashes(tmp_path: Path, unharmed: None) -> None:
    pillow = pytest.importorskip("PIL.Image")
    pillow.new("LA", (24, 20)).save(tmp_path / "grey.jp2")
    path = write_torus(tmp_path, "ring", "grey.jp2")
    assert "crashes at a JPEG 2000" in str(outcome(path))


@pytest.mark.parametrize("rows", [b"", b"\xff" * 8, struct.pack(">II", 520, 3)], ids=["none", "huge", "short"])
def test_packed_sgi_image_whose_rows_are_elsewhere(tmp_path: Path, unharmed: None, rows: bytes) -> None:
    """Blender 5.2 would end the process."""
    header = struct.pack(">HBBHHHH", 474, 1, 1, 3, 3, 1, len(rows) // 8)
    (tmp_path / "image.sgi").write_bytes(header.ljust(512, b"\0") + rows)
    path = write_torus(tmp_path, "ring", "image.sgi")
    assert "image.sgi: the image is broken, its rows are not where it says" in str(outcome(path))


def test_collections_that_multiply(tmp_path: Path, unharmed: None) -> None:
    """Each instances the next ten times: refused before Blender unfolds them."""
    scenes.clear()
    held = bpy.data.collections.new("0")
    scenes.cube(collection=held)
    for level in range(1, 8):
        outer = bpy.data.collections.new(str(level))
        for number in range(10):
            made = bpy.data.objects.new(f"{level} {number}", None)
            made.instance_type, made.instance_collection = "COLLECTION", held
            outer.objects.link(made)
        held = outer
    bpy.context.scene.collection.children.link(held)
    path = scenes.export(tmp_path, "blend")
    scenes.clear()
    assert outcome(path) == (
        f"{path}: its collections show 21,111,100 objects by instancing each other; at most 1,000,000 are measured"
    )


@pytest.mark.parametrize("name", ["two\nlines", "tab\t%s{0}", "\u202e\U0001f480", "-dash", "x" * 240, "a:b", " "])
def test_names_of_files(tmp_path: Path, unharmed: None, name: str) -> None:
    path = tmp_path / f"{name}.obj"
    path.write_text(TETRAHEDRON)
    assert outcome(path) == 1.0
    path.write_text("v 0 0 0\n")
    with pytest.raises(FMQMError) as caught:
        load_asset(str(path))
    assert len(str(caught.value).splitlines()) == 1


def test_name_that_is_not_utf_8(tmp_path: Path, unharmed: None) -> None:
    path = os.fsdecode(os.fsencode(tmp_path) + b"/\xff\xfe.obj")
    Path(path).write_text(TETRAHEDRON)
    assert expected(outcome(path), (1.0, "only names in UTF-8"))


def test_names_in_what_the_script_writes(tmp_path: Path) -> None:
    """A line each in the table and on stderr; JSON holds them as they are, but for bytes that are not UTF-8."""
    names = ["two\nlines", "\x1b[31mred", os.fsdecode(b"\xff")]
    for name in names:
        (tmp_path / f"{name}.obj").write_text("mtllib gone.mtl\n" + TETRAHEDRON)
    paths = [tmp_path / f"{name}.obj" for name in names]
    done = score(paths[0], *paths, *TINY_FLAGS, "--json", tmp_path / "out.json")
    assert len(done.stdout.splitlines()) == 1 + len(paths)
    assert all(line.startswith("score.py: ") for line in done.stderr.splitlines())
    assert (done.stdout + done.stderr).replace("\n", "").isprintable()
    document = read_json(tmp_path / "out.json")
    json.dumps(document, ensure_ascii=False).encode()  # refuses half characters, as other programs do
    assert [pair["distorted"] for pair in document["pairs"]] == [*map(str, paths[:2]), f"{tmp_path}/\\udcff.obj"]


# Real files


def real_files(shared_data: Path) -> list[Path]:
    return sorted(p for p in (shared_data / "hostile").rglob("*") if p.suffix.lower() in SUFFIXES and p.is_file())


def test_every_real_file_is_in_the_table(shared_data: Path) -> None:
    names = {path.relative_to(shared_data / "hostile").as_posix() for path in real_files(shared_data)}
    assert names == set(REAL)


def test_real_files_in_one_process(shared_data: Path, unharmed: None) -> None:
    before = scenes.blocks()
    for name, wanted in REAL.items():
        found = outcome(shared_data / "hostile" / name)
        assert expected(found, wanted), f"{name}: {found}"
        assert scenes.blocks() == before, name


def test_what_is_left_out_of_real_files_is_said(shared_data: Path) -> None:
    """Of the others that can be loaded, none says such a thing of the file itself."""
    for name, wanted in REAL.items():
        path = shared_data / "hostile" / name
        if path.suffix in (".obj", ".ply") and wanted == 1.0:
            told = " ".join(w for w in load_asset(str(path)).mesh.warnings if w.startswith(f"{path.name}: "))
            assert bool(told) == (name in TOLD) and TOLD.get(name, "") in told, f"{name}: {told}"


@pytest.mark.once
def test_real_files_in_a_process_each(shared_data: Path) -> None:
    """A line of the table or one line on stderr that names the file, and nothing else but warnings."""

    def scored(name: str) -> tuple[str, float | str]:
        path = shared_data / "hostile" / name
        done = score(path, path, *TINY_FLAGS, timeout=SECONDS)
        said = [line for line in done.stderr.splitlines() if line.startswith("score.py: ")]
        errors = [line for line in said if not line.startswith("score.py: warning: ")]
        if done.returncode == 0:
            assert not errors
            return name, float(re.split(r"\s+", done.stdout.splitlines()[1].strip())[-5])
        assert done.returncode == 1 and len(errors) == 1 and path.name in errors[0], done.stderr
        return name, errors[0]

    with ThreadPoolExecutor(2) as pool:
        for name, found in pool.map(scored, REAL):
            assert expected(found, REAL[name]), f"{name}: {found}"


def test_a_copy_elsewhere_is_the_same_file(shared_data: Path, tmp_path: Path, unharmed: None) -> None:
    shutil.copytree(shared_data / "hostile" / "obj_windows_paths_spider", tmp_path / "a b")
    assert outcome(tmp_path / "a b" / "spider.obj") == 1.0
