# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of every kind to arrays; what cannot be read is said in one line, and costs nothing else."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.files import load as files
from fmqm_addon.blender.files.load import SUFFIXES, load_mesh, split_spec
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.comparison.measurement import Measurement
from fmqm_addon.metric.errors import FileError, FMQMError, MeshError
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.surface import MeshArrays
from fmqm_addon.metric.texture import Texture
from tests.blender import scenes

KINDS = tuple(scenes.EXPORTERS)
PIXELS = scenes.noise()
TINY = Settings(samples=1600, patches=20)


@pytest.fixture(scope="module")
def monkeys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same textured and transformed monkey in every kind of file."""
    folder = tmp_path_factory.mktemp("monkeys")
    scenes.clear()
    image = scenes.write_png(folder / "image.png", PIXELS)
    scenes.monkey(materials=[scenes.textured(image)])
    for kind in KINDS:
        scenes.export(folder, kind, "monkey")
    return folder


@pytest.fixture(scope="module")
def original(monkeys: Path) -> MeshArrays:
    return load_mesh(str(monkeys / "monkey.blend"))


def test_every_kind_is_known() -> None:
    assert {f".{kind}" for kind in KINDS} == set(SUFFIXES)


@pytest.mark.parametrize("kind", KINDS)
def test_kinds_hold_the_same_surface(monkeys: Path, original: MeshArrays, kind: str) -> None:
    arrays = load_mesh(str(monkeys / f"monkey.{kind}"))
    assert len(arrays.triangles) == 968
    for reduce in (np.min, np.max):
        corners = arrays.positions[arrays.triangles].reshape(-1, 3)
        wanted = original.positions[original.triangles].reshape(-1, 3)
        assert reduce(corners, axis=0) == pytest.approx(reduce(wanted, axis=0), abs=2e-5)
    # Exporters that apply the transform let bent quads be cut along their other diagonal.
    assert scenes.area(arrays) == pytest.approx(scenes.area(original), rel=0.01)


@pytest.mark.parametrize("kind", scenes.COLORED)
def test_kinds_hold_the_same_colors(monkeys: Path, original: MeshArrays, kind: str) -> None:
    arrays = load_mesh(str(monkeys / f"monkey.{kind}"))
    color = arrays.materials[0].color
    assert np.array_equal(color.pixels, PIXELS) and not arrays.warnings
    centers = [mesh.corners.reshape(-1, 2).mean(axis=0) for mesh in (arrays, original)]
    assert centers[0] == pytest.approx(centers[1], abs=1e-5)


@pytest.mark.parametrize("kind", sorted(set(KINDS) - set(scenes.COLORED)))
def test_kinds_without_materials_warn(monkeys: Path, kind: str) -> None:
    assert "grey" in load_mesh(str(monkeys / f"monkey.{kind}")).notes[0]


def self_score(mesh: MeshArrays, again: MeshArrays) -> list[float]:
    measurement = Measurement(mesh, BVHQuery, TINY)
    measurement.prepare().run()
    return list(measurement.compare(again).run().scores)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_against_itself_scores_exactly_1(monkeys: Path, tmp_path: Path, kind: str) -> None:
    """As one path twice, and as two files."""
    path = monkeys / f"monkey.{kind}"
    shutil.copytree(monkeys, tmp_path / "copy")
    first, second = load_mesh(str(path)), load_mesh(str(path))
    assert scenes.same(first, second)
    assert self_score(first, second) == [1.0] * 5
    assert self_score(first, load_mesh(str(tmp_path / "copy" / path.name))) == [1.0] * 5


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_stays_in_the_session(monkeys: Path, kind: str) -> None:
    before = scenes.blocks()
    load_mesh(str(monkeys / f"monkey.{kind}"))
    assert scenes.blocks() == before


def test_images_in_an_archive_are_named_by_it(monkeys: Path) -> None:
    """Not by the folder, with a name by chance, where the importer unpacks them."""
    (image,) = load_mesh(str(monkeys / "monkey.usdz")).materials[0].images
    assert image.path == str(monkeys / "monkey.usdz" / "image.png")


def test_paths_with_spaces_and_other_letters(monkeys: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mit Leerzeichen, Grüße"
    shutil.copytree(monkeys, folder)
    for kind in KINDS:
        ending = kind if kind == "usdz" else kind.upper()  # Blender 4.5 takes no .USDZ
        shutil.move(folder / f"monkey.{kind}", folder / f"Äffchen 2.{ending}")
        assert len(load_mesh(str(folder / f"Äffchen 2.{ending}")).triangles) == 968


def test_relative_path(monkeys: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(monkeys)
    assert len(load_mesh("monkey.obj").triangles) == 968
    assert len(load_mesh("monkey.blend:Monkey").triangles) == 968


def test_given_texture_replaces_the_files_own(monkeys: Path) -> None:
    texture = Texture(scenes.noise(seed=9))
    for kind in ("glb", "ply"):
        arrays = load_mesh(str(monkeys / f"monkey.{kind}"), Reading(texture=texture))
        assert arrays.materials[0].color is texture and not arrays.warnings


@pytest.mark.parametrize("kind", ["stl", "abc"])
def test_given_texture_needs_uvs(monkeys: Path, tmp_path: Path, kind: str) -> None:
    scenes.cube("Bald", uv=False)
    path = scenes.export(tmp_path, kind)
    with pytest.raises(MeshError, match="no UV map") as caught:
        load_mesh(str(path), Reading(texture=Texture(PIXELS)))
    assert str(path) in str(caught.value)


# Objects of a file


@pytest.mark.parametrize(
    ("spec", "wanted"),
    [
        ("a.blend", ("a.blend", "")),
        ("a.blend:Cube", ("a.blend", "Cube")),
        ("a.BLEND:Cube", ("a.BLEND", "Cube")),
        ("a.blend:Left: front wheel", ("a.blend", "Left: front wheel")),
        ("a.blend:b.blend:c", ("a.blend", "b.blend:c")),
        ("a.blend: padded ", ("a.blend", " padded ")),
        (r"C:\models\a.blend", (r"C:\models\a.blend", "")),
        (r"C:\models\a.blend:Cube", (r"C:\models\a.blend", "Cube")),
        (r"C:\models\a.obj", (r"C:\models\a.obj", "")),
        ("D:/a b/c.blend:C:x", ("D:/a b/c.blend", "C:x")),
        ("a.obj:Cube", ("a.obj", "Cube")),
        ("a.txt:Cube", ("a.txt:Cube", "")),
        ("a.blender/b.blend:Cube", ("a.blender/b.blend", "Cube")),
        ("a.blend:", ("a.blend:", "")),
    ],
)
def test_split_spec(spec: str, wanted: tuple[str, str]) -> None:
    assert split_spec(spec) == wanted


def test_a_file_that_is_there_is_never_split(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    name = "odd.blend:name.blend"
    try:
        Path(name).write_bytes(b"")
    except OSError:
        pytest.skip("this file system takes no colon in names")
    assert split_spec(name) == (name, "")


NAMES = ["Plain", "Left: front wheel", "x.blend:y", "Ünïcode 車", "Hidden", "Excluded", "Unrendered", "Eye"]


@pytest.fixture(scope="module")
def shop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A .blend whose objects have 12 triangles, 48 with their modifiers, each at a place of its own."""
    scenes.clear()
    path = tmp_path_factory.mktemp("shop") / "shop.blend"
    excluded = bpy.data.collections.new("Left out")
    bpy.context.scene.collection.children.link(excluded)
    for place, name in enumerate(NAMES):
        object_ = scenes.cube(name, collection=excluded if name == "Excluded" else None)
        object_.location.x = 10 * place
        smooth = object_.modifiers.new("Subdivision", "SUBSURF")
        smooth.levels = smooth.render_levels = 1
    bpy.context.view_layer.layer_collection.children["Left out"].exclude = True
    bpy.data.objects["Hidden"].hide_viewport = True
    bpy.data.objects["Unrendered"].hide_render = True
    bpy.data.objects["Eye"].hide_set(True)
    for data, name in ((bpy.data.cameras.new("Camera"), "Camera"), (None, "Empty")):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(name, data))
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


@pytest.mark.parametrize("name", NAMES)
def test_one_object_of_a_blend(shop: Path, name: str) -> None:
    """Hidden or not, always evaluated."""
    arrays = load_mesh(f"{shop}:{name}")
    assert len(arrays.triangles) == 48
    assert arrays.positions[:, 0].mean() == pytest.approx(10 * NAMES.index(name), abs=1e-5)
    assert arrays.name == name


def test_a_whole_blend_is_what_renders_show(shop: Path) -> None:
    """Hidden in viewports counts, off in renders and excluded does not."""
    arrays = load_mesh(str(shop))
    places = np.unique(np.round(arrays.positions[:, 0] / 10)).astype(int).tolist()
    assert [NAMES[place] for place in places] == [n for n in NAMES if n not in ("Excluded", "Unrendered")]
    assert len(arrays.triangles) == 48 * 6


def test_collection_that_is_off_in_renders(tmp_path: Path) -> None:
    scenes.square("Shown")
    for name in ("Off", "Excluded"):
        collection = bpy.data.collections.new(name)
        bpy.context.scene.collection.children.link(collection)
        inner = bpy.data.collections.new(f"In {name}")
        collection.children.link(inner)
        scenes.cube(name, collection=inner)
    bpy.data.collections["Off"].hide_render = True
    bpy.context.view_layer.layer_collection.children["Excluded"].exclude = True
    assert len(load_mesh(str(scenes.export(tmp_path, "blend"))).triangles) == 2


def test_object_in_two_collections_counts_once(tmp_path: Path) -> None:
    object_ = scenes.cube()
    other = bpy.data.collections.new("Other")
    bpy.context.scene.collection.children.link(other)
    other.objects.link(object_)
    assert len(load_mesh(str(scenes.export(tmp_path, "blend"))).triangles) == 12


def test_active_scene_counts(tmp_path: Path) -> None:
    scenes.cube("In the first scene")
    other = bpy.data.scenes.new("Second")
    scenes.square("In the second", collection=other.collection)
    bpy.context.window.scene = other
    path = scenes.export(tmp_path, "blend")
    assert len(load_mesh(str(path)).triangles) == 2
    assert len(load_mesh(f"{path}:In the first scene").triangles) == 12


def test_objects_are_joined_in_the_order_of_their_names(tmp_path: Path) -> None:
    for folder, names in (("a", ["B", "A"]), ("b", ["A", "B"])):
        scenes.clear()
        (tmp_path / folder).mkdir()
        for name in names:
            scenes.square(name).location.x = "AB".index(name)
        scenes.export(tmp_path / folder, "blend")
    first, second = (load_mesh(str(tmp_path / folder / "asset.blend")) for folder in "ab")
    assert np.array_equal(first.positions, second.positions)


@pytest.mark.parametrize(
    ("name", "error", "words"),
    [
        ("Nobody", FileError, "no object or collection named Nobody"),
        ("plain", FileError, "no object or collection named plain"),
        ("Camera", MeshError, "camera"),
        ("Empty", MeshError, "no mesh in it"),
    ],
)
def test_no_such_object(shop: Path, name: str, error: type[FMQMError], words: str) -> None:
    with pytest.raises(error, match=words) as caught:
        load_mesh(f"{shop}:{name}")
    assert_one_line(caught.value, shop)


def test_saved_frame_counts(tmp_path: Path) -> None:
    object_ = scenes.cube("Moving")
    for frame, x in ((1, 0.0), (10, 50.0)):
        object_.location.x = x
        object_.keyframe_insert("location", frame=frame)
    bpy.context.scene.frame_set(10)
    shown = scenes.export(tmp_path, "blend", "shown")
    object_.hide_viewport = True
    hidden = scenes.export(tmp_path, "blend", "hidden")
    for path in (shown, hidden):
        assert load_mesh(str(path)).positions[:, 0].mean() == pytest.approx(50, abs=1e-4)


@pytest.mark.parametrize("trusted", [True, False], ids=["control", "measured"])
def test_scripts_in_a_blend_are_not_run(tmp_path: Path, trusted: bool) -> None:
    """A text block that registers itself runs when a trusted file is opened; here nothing is trusted."""
    trace = tmp_path / "trace"
    text = bpy.data.texts.new("startup.py")
    text.write(f"open({str(trace)!r}, 'w').close()")
    text.use_module = True
    scenes.cube()
    path = scenes.export(tmp_path, "blend")
    assert not trace.exists()
    if trusted:
        bpy.ops.wm.open_mainfile(filepath=str(path), use_scripts=True)
    else:
        load_mesh(str(path))
    assert trace.exists() == trusted


# What cannot be read


def assert_one_line(error: FMQMError, path: Path | str) -> None:
    assert str(path) in str(error) and "\n" not in str(error)


def assert_refused(path: Path | str, good: Path, error: type[FMQMError] = FMQMError) -> str:
    """One clear line; then nothing is left, and a good file gives what it always gave."""
    scenes.clear()
    before = scenes.blocks()
    with pytest.raises(error) as caught:
        load_mesh(str(path))
    assert_one_line(caught.value, split_spec(str(path))[0])
    assert scenes.blocks() == before
    again = load_mesh(str(good))
    assert scenes.same(again, GOOD.setdefault(good, again))
    return str(caught.value)


GOOD: dict[Path, MeshArrays] = {}  # what good files held the first time


def damaged(whole: bytes, how: str) -> bytes:
    return {
        "empty": b"",
        "start": whole[: len(whole) // 50],
        "half": whole[: len(whole) // 2],
        "noise": np.random.default_rng(1).bytes(3000),
    }[how]


@pytest.mark.parametrize("how", ["empty", "start", "half", "noise"])
@pytest.mark.parametrize("kind", KINDS)
def test_damaged_file(monkeys: Path, tmp_path: Path, kind: str, how: str) -> None:
    whole = (monkeys / f"monkey.{kind}").read_bytes()
    path = tmp_path / f"damaged.{kind}"
    path.write_bytes(damaged(whole, how))
    assert_refused(path, monkeys / f"monkey.{kind}")


@pytest.mark.parametrize("missing", [1, 8, 100])
@pytest.mark.parametrize("kind", ["glb", "ply", "blend", "fbx", "stl", "usdc", "abc"])
def test_file_that_lacks_its_end(monkeys: Path, tmp_path: Path, kind: str, missing: int) -> None:
    """Where the importer does not mind, it gives a surface; it never ends the process."""
    path = tmp_path / f"cut.{kind}"
    path.write_bytes((monkeys / f"monkey.{kind}").read_bytes()[:-missing])
    try:
        arrays = load_mesh(str(path))
    except FMQMError as error:
        assert_one_line(error, path)
    else:
        assert kind in {"fbx", "blend"} and len(arrays.triangles) == 968  # whose ends hold nothing


def test_gltf_without_its_buffer(monkeys: Path, tmp_path: Path) -> None:
    shutil.copy(monkeys / "monkey.gltf", tmp_path)
    assert "monkey.bin" in assert_refused(tmp_path / "monkey.gltf", monkeys / "monkey.gltf", FileError)


def test_obj_without_its_image(monkeys: Path, tmp_path: Path) -> None:
    for kind in ("obj", "mtl"):
        shutil.copy(monkeys / f"monkey.{kind}", tmp_path)
    (tmp_path / "image.png").write_bytes(b"")
    text = (tmp_path / "monkey.mtl").read_text(encoding="utf-8")
    lines = ["map_Kd image.png" if line.startswith("map_Kd") else line for line in text.splitlines()]
    (tmp_path / "monkey.mtl").write_text("\n".join(lines), encoding="utf-8")
    path = tmp_path / "monkey.obj"
    assert "image.png: the base-color image is broken" in assert_refused(path, monkeys / "monkey.obj", MeshError)
    (tmp_path / "image.png").unlink()
    assert f"{tmp_path / 'image.png'}: the base-color image is missing" in assert_refused(
        path, monkeys / "monkey.obj", MeshError
    )
    assert len(load_mesh(str(path), Reading(texture=Texture(PIXELS))).triangles) == 968  # unless another is given


@pytest.mark.parametrize("kind", ["blend", "glb", "usda", "abc"])
def test_no_mesh_in_it(monkeys: Path, tmp_path: Path, kind: str) -> None:
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.context.scene.collection.objects.link(camera)
    path = scenes.export(tmp_path, kind)
    assert "no mesh" in assert_refused(path, monkeys / f"monkey.{kind}", MeshError)


def points(tmp_path: Path) -> Path:
    path = tmp_path / "points.ply"
    header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nend_header"
    path.write_text(header + "\n0 0 0\n1 0 0\n0 1 0\n")
    return path


def lines(tmp_path: Path) -> Path:
    path = tmp_path / "lines.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2 3\n")
    return path


def gltf_points(tmp_path: Path) -> Path:
    path = tmp_path / "points.gltf"
    (tmp_path / "points.bin").write_bytes(np.eye(3, dtype="<f4").tobytes())
    accessor = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0] * 3, "max": [1] * 3}
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "mode": 0}]}],
        "accessors": [accessor],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": "points.bin", "byteLength": 36}],
    }
    path.write_text(json.dumps(document))
    return path


def wire_blend(tmp_path: Path) -> Path:
    scenes.add("Wire", scenes.SQUARE, [], uv=False)
    return scenes.export(tmp_path, "blend")


@pytest.mark.parametrize("make", [points, lines, gltf_points, wire_blend], ids=lambda make: make.__name__)
def test_no_faces(monkeys: Path, tmp_path: Path, make: Callable[[Path], Path]) -> None:
    path = make(tmp_path)
    assert "no faces" in assert_refused(path, monkeys / "monkey.obj", MeshError)


def test_missing_file(monkeys: Path, tmp_path: Path) -> None:
    for name in ("nowhere.obj", "nowhere.blend", "nowhere.blend:Cube"):
        text = assert_refused(tmp_path / name, monkeys / "monkey.obj", FileError)
        assert "no such file" in text


@pytest.mark.parametrize("name", ["asset.3ds", "asset", "asset.blend1", "asset.obj.zip", "asset.blend:"])
def test_unknown_ending_says_the_known_ones(monkeys: Path, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    try:
        path.write_bytes(b"")
    except OSError:
        pytest.skip("this file system takes no colon in names")
    text = assert_refused(path, monkeys / "monkey.obj", FileError)
    assert "unknown file ending" in text and all(suffix in text for suffix in SUFFIXES)


def test_folder_is_not_a_file(monkeys: Path, tmp_path: Path) -> None:
    (tmp_path / "folder.obj").mkdir()
    assert_refused(tmp_path / "folder.obj", monkeys / "monkey.obj", FileError)


def test_unreadable_file(monkeys: Path, tmp_path: Path) -> None:
    if not hasattr(os, "geteuid") or os.geteuid() == 0:
        pytest.skip("root, and Windows, read files without permission")
    path = Path(shutil.copy(monkeys / "monkey.obj", tmp_path))
    path.chmod(0)
    assert "permission denied" in assert_refused(path, monkeys / "monkey.obj", FileError)


def test_blender_without_an_importer_says_so(monkeys: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(files._IMPORTERS, ".abc", lambda: bpy.ops.wm.no_such_import)
    assert "no importer for .abc" in assert_refused(monkeys / "monkey.abc", monkeys / "monkey.obj", FileError)
