# SPDX-License-Identifier: GPL-3.0-or-later
"""Good enough, found: the search, what it leaves behind, the files and the button."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Generator
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from fmqm_addon import ui
from fmqm_addon.blender.files.export import (
    EXPORTERS,
    file_reader,
    open_asset,
    save_version,
    texture_sizes,
    written_reader,
)
from fmqm_addon.blender.files.load import load_mesh
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.decimate import DECIMATE, WELD, add_modifiers, scene_reader
from fmqm_addon.comparison.decimation import (
    LEAST_TRIANGLES,
    TOLERANCE,
    DecimationGoal,
    Search,
    Version,
    decimating,
    last_passing,
)
from fmqm_addon.metric.errors import FMQMError, MeshError, SettingsError
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.stepper import Progress, Work, finish
from fmqm_addon.metric.surface import MeshArrays
from fmqm_addon.ui import versions as ui_versions
from tests.blender import scenes
from tests.blender.script import SCORE, noise, read_json, score, strict_json, write_png, write_torus

DECIMATE_SCRIPT = SCORE.with_name("decimate.py")
TINY = Settings(samples=6400, patches=50, color_units=20)  # above 40 patches: searched quickly, then confirmed
SMALL = ("--samples", "6400", "--patches", "50", "--quiet")


@pytest.fixture(scope="module")
def torus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """576 triangles with a texture of 64 x 64."""
    folder = tmp_path_factory.mktemp("torus")
    write_png(folder / "image.png", noise(64))
    return write_torus(folder, "torus", "image.png", shake=0.02)


def decimate(*arguments: object, cwd: Path | None = None) -> Any:
    return score(*arguments, command=(sys.executable, str(DECIMATE_SCRIPT)), cwd=cwd)


# --- The search ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("start, stride", [(0, 1), (50, 25), (99, 1), (30, 3)])
@pytest.mark.parametrize("passing", [0, 1, 7, 50, 99, 100])
def test_the_last_that_passes_is_found_from_anywhere(passing: int, start: int, stride: int) -> None:
    asked = []

    def passes(index: int) -> Work[bool]:
        asked.append(index)
        yield Progress("", 0.0)
        return index < passing

    assert finish(last_passing(100, passes, start, stride)) == passing - 1
    assert len(asked) == len(set(asked)) <= 16, "asks none twice, and not nearly all"
    assert set(asked) >= {passing - 1, passing} & set(range(100)), "both sides of the edge have been looked at"


def test_the_found_version_passes_and_the_next_cheaper_one_does_not() -> None:
    monkey = scenes.monkey()
    result = decimating(scene_reader([monkey.name], "it"), BVHQuery, DecimationGoal((0.9, 0.8)), TINY).run()
    for target, outcome in zip((0.9, 0.8), result.results, strict=True):
        found = outcome.last
        assert found.reached and found.best.fmqm >= target > found.below.fmqm
        assert not found.best.quick and not found.below.quick, "confirmed with all patches"
        assert found.below.triangles >= found.best.triangles * (1 - TOLERANCE) - 2, "the next one"
        assert any(step.quick for step in found.path), "searched with few patches"
    first = result.results[0].last
    assert {first.best, first.below} <= set(first.path), "the path tells all"
    assert result.results[1].last.best.triangles < result.results[0].last.best.triangles < result.triangles == 968


def test_what_the_file_holds_decides() -> None:
    monkey = scenes.monkey()
    read = scene_reader([monkey.name], "it")
    whole = replace(TINY, patches=40)  # so that nothing but the file makes two rounds

    def written(version: Version) -> MeshArrays:
        return read(replace(version, ratio=0.9 * version.ratio))

    alone = decimating(read, BVHQuery, DecimationGoal((0.9,)), whole).run().results[0].last
    found = decimating(read, BVHQuery, DecimationGoal((0.9,)), whole, written).run().results[0].last
    assert found.reached and found.best.fmqm >= 0.9 > found.below.fmqm
    assert found.best.version.ratio > alone.best.version.ratio, "gone up again"
    assert found.best.triangles == len(written(found.best.version).triangles)


def test_ratio_1_is_the_object_itself() -> None:
    monkey = scenes.monkey()
    search = Search(scene_reader([monkey.name], "it"), BVHQuery, TINY)
    finish(search.prepare())
    found = finish(search.find(1.0, search.ratios()[:1]))
    assert found.reached and found.best.fmqm == 1.0 and found.best.triangles == 968


def test_a_target_that_the_most_triangles_allowed_miss() -> None:
    monkey = scenes.monkey()
    found = (
        decimating(scene_reader([monkey.name], "it"), BVHQuery, DecimationGoal((0.99,), max_triangles=100), TINY)
        .run()
        .results[0]
        .last
    )
    assert not found.reached and found.best.triangles <= 100 and found.below is None
    with pytest.raises(SettingsError, match="max-triangles is 3; at least 4 are wanted"):
        DecimationGoal((0.99,), max_triangles=LEAST_TRIANGLES - 1)


def test_what_cannot_be_decimated_counts_toward_the_most_triangles() -> None:
    monkey = scenes.monkey()
    bpy.ops.curve.primitive_bezier_circle_add(radius=2)
    curve = bpy.context.object
    curve.data.bevel_depth = 0.1
    names = [monkey.name, curve.name]
    whole = len(scene_reader(names, "it")(Version()).triangles)
    fixed = whole - 968
    result = decimating(scene_reader(names, "it"), BVHQuery, DecimationGoal((0.01, 0.9999), fixed + 100), TINY).run()
    for found in (outcome.last for outcome in result.results):
        assert all(step.triangles <= fixed + 100 for step in found.path)
        assert found.best.triangles >= fixed
    assert not result.results[1].last.reached and result.results[1].last.best.triangles > fixed + 80, "the dearest"
    with pytest.raises(MeshError, match=f"it cannot be decimated to {fixed - 1} triangles; allow more"):
        decimating(scene_reader(names, "it"), BVHQuery, DecimationGoal((0.5,), fixed - 1), TINY).run()


def test_searching_leaves_nothing_behind_even_when_it_is_cancelled_or_fails() -> None:
    monkey = scenes.monkey()
    before = scenes.blocks()
    stepper = decimating(scene_reader([monkey.name], "it"), BVHQuery, DecimationGoal((0.9,)), TINY)
    while stepper.step() and stepper.progress.done < 0.5:
        pass
    stepper.cancel()
    assert scenes.blocks() == before and not monkey.modifiers
    stepper = decimating(scene_reader([monkey.name], "it"), BVHQuery, DecimationGoal((0.9,)), TINY)
    stepper.step()
    stepper.step()
    bpy.data.objects.remove(monkey)
    with pytest.raises(FMQMError, match="Monkey: it is no longer in the file"):
        stepper.run()


def test_vertices_that_importers_split_are_welded_first() -> None:
    """Collapsing edges of separate triangles would tear holes."""
    corners = [scenes.CUBE_CORNERS[k] for face in scenes.CUBE_FACES for k in face]
    split = scenes.add("Split", corners, [tuple(range(k, k + 4)) for k in range(0, 24, 4)])
    add_modifiers(split, 0.5)
    assert [modifier.name for modifier in split.modifiers] == [WELD, DECIMATE]
    mesh = split.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    assert len(mesh.vertices) <= 8, "joined at the corners"
    whole = scenes.cube()
    add_modifiers(whole, 0.5)
    assert [modifier.name for modifier in whole.modifiers] == [DECIMATE], "not where it would do nothing"
    add_modifiers(whole, 1.0)
    assert len(whole.modifiers) == 1, "ratio 1 leaves it alone"


# --- Files -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", EXPORTERS)
def test_a_saved_version_is_what_was_measured(torus: Path, tmp_path: Path, kind: str) -> None:
    out = tmp_path / f"lod{kind}"
    save_version(str(torus), Version(0.5, 16), str(out))
    assert 250 <= len(load_mesh(str(out)).triangles) <= 288
    if kind not in {".ply", ".stl"}:
        assert texture_sizes(str(out))[0] == 16
    kept = {".obj": {"lod.mtl", "lod_image.png"}, ".usd": {"textures"}}.get(kind, set())
    assert {path.name for path in tmp_path.iterdir()} == {out.name} | kept, "no temporary files, nobody else's names"
    assert texture_sizes(str(torus))[0] == 64, "the original keeps its texture"
    if kind == ".blend":
        scenes.clear()
        bpy.ops.wm.open_mainfile(filepath=str(out))
        assert [modifier.name for modifier in bpy.data.objects["torus"].modifiers][-1] == DECIMATE, "live"


def posed_skeleton() -> bpy.types.Object:
    """Of one bone, which has moved."""
    skeleton = scenes.skeleton()
    skeleton.pose.bones["Bone"].location = (0, 0.7, 0)
    return skeleton


def save_posed(file: Path) -> None:
    """A .blend of all that exporters treat each in their own way."""
    skeleton = posed_skeleton()
    skeleton.scale = (1, 1, 2)
    posed = scenes.cube("Posed")
    posed.parent, posed.rotation_euler = skeleton, (0.5, 0, 0)  # sheared
    scenes.hang(posed, skeleton)
    keyed = scenes.cube("Keyed")
    keyed.location = (4, 0, 0)
    keyed.shape_key_add(name="Basis")
    key = keyed.shape_key_add(name="Key")
    key.data[0].co.z, key.value = 3, 0.7
    smooth = keyed.modifiers.new("Subdivision", "SUBSURF")
    smooth.levels, smooth.render_levels = 2, 3
    scenes.cube("Hidden").location, bpy.data.objects["Hidden"].hide_render = (8, 0, 0), True
    asset = bpy.data.collections.new("Asset")
    scenes.monkey("Inner").location = (0, 0, 0)
    inner = bpy.data.objects["Inner"]
    bpy.context.scene.collection.objects.unlink(inner)
    asset.objects.link(inner)
    for number in range(2):
        shows = bpy.data.objects.new(f"Instance {number}", None)
        shows.instance_type, shows.instance_collection, shows.location = "COLLECTION", asset, (0, 5 + 4 * number, 0)
        bpy.context.scene.collection.objects.link(shows)
    bpy.ops.curve.primitive_bezier_circle_add(location=(0, -5, 0))
    bpy.context.object.data.bevel_depth = 0.1
    bpy.ops.wm.save_as_mainfile(filepath=str(file))


@pytest.mark.parametrize("kind", EXPORTERS)
def test_every_kind_of_file_holds_what_is_measured(tmp_path: Path, kind: str) -> None:
    file, out = tmp_path / "posed.blend", tmp_path / f"out{kind}"
    save_posed(file)
    half = Version(0.5)
    measured = file_reader(str(file))(half)
    warnings = save_version(str(file), half, str(out))
    # Where positions are written in the world's axes, quads that are not flat may be cut along the other diagonal.
    tolerance = 5e-3 if kind in {".obj", ".ply"} else 1e-4
    for written in (load_mesh(str(out)), written_reader(str(file), str(out))(half)):
        assert len(written.triangles) == len(measured.triangles)
        assert scenes.area(written) == pytest.approx(scenes.area(measured), rel=tolerance)
        for of in (np.min, np.max, np.mean):
            ours, theirs = (of(arrays.positions[arrays.triangles], axis=(0, 1)) for arrays in (measured, written))
            assert np.abs(ours - theirs).max() < 1e-3
    assert (kind == ".blend") == (not warnings), "what is baked away is said"
    if kind == ".glb":
        bpy.ops.import_scene.gltf(filepath=str(out))
        names = {object_.name: object_.parent and object_.parent.name for object_ in bpy.data.objects}
        assert names == {
            "Skeleton": None, "Posed": "Skeleton", "Keyed": None, "BézierCircle": None,
            "Instance 0": None, "Inner": "Instance 0", "Instance 1": None, "Inner.001": "Instance 1",
        }  # fmt: skip


@pytest.mark.parametrize("kind", [".glb", ".blend"])
def test_a_hidden_object_that_is_named_is_written(tmp_path: Path, kind: str) -> None:
    file, out = tmp_path / "posed.blend", tmp_path / f"out{kind}"
    save_posed(file)
    save_version(f"{file}:Hidden", Version(), str(out))
    assert len(load_mesh(str(out)).triangles) == 12


def test_only_instances_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "instances.blend"
    save_posed(file)
    for object_ in [object_ for object_ in bpy.context.scene.objects if object_.type != "EMPTY"]:
        bpy.data.objects.remove(object_)
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    with pytest.raises(MeshError, match="only instances; make them real"):
        open_asset(str(file))


@pytest.mark.parametrize("kind", [".glb", ".obj", ".fbx", ".usd", ".blend"])
def test_a_saved_object_keeps_what_its_modifiers_use(tmp_path: Path, kind: str) -> None:
    monkey = scenes.monkey("Rock")
    parent, mirror = (bpy.data.objects.new(name, None) for name in ("Parent", "Mirror"))
    parent.location, mirror.location = (0.5, 0, 0), (3, 0, 0)
    for empty in (parent, mirror):
        bpy.context.scene.collection.objects.link(empty)
    monkey.parent = parent
    monkey.constraints.new("COPY_ROTATION").target = mirror
    monkey.modifiers.new("Mirror", "MIRROR").mirror_object = mirror
    skeleton = posed_skeleton()
    scenes.hang(monkey, skeleton, 100)
    scenes.square("Other")
    file, out = tmp_path / "rocks.blend", tmp_path / f"out{kind}"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    measured = file_reader(f"{file}:Rock")(Version(0.5))
    save_version(f"{file}:Rock", Version(0.5), str(out))
    written = load_mesh(str(out))
    assert len(written.triangles) == len(measured.triangles) > 900, "mirrored, and nothing else"
    for of in (np.min, np.max, np.mean):
        ours, theirs = (of(arrays.positions[arrays.triangles].reshape(-1, 3), axis=0) for arrays in (measured, written))
        assert np.abs(ours - theirs).max() < 1e-3, "placed and posed as it was measured"


@pytest.mark.parametrize("kind", [".glb", ".blend"])
def test_a_saved_object_keeps_a_collection_that_it_uses(tmp_path: Path, kind: str) -> None:
    holes = bpy.data.collections.new("Holes")
    bpy.context.scene.collection.children.link(holes)
    scenes.cube("Hole", collection=holes).location = (1, 1, 1)
    cutting = scenes.cube("Rock").modifiers.new("Boolean", "BOOLEAN")
    cutting.operand_type, cutting.collection = "COLLECTION", holes
    file, out = tmp_path / "rocks.blend", tmp_path / f"out{kind}"
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    measured = file_reader(f"{file}:Rock")(Version())
    save_version(f"{file}:Rock", Version(), str(out))
    assert len(load_mesh(str(out)).triangles) == len(measured.triangles) > 12


@pytest.mark.parametrize("kind", [".glb", ".fbx", ".blend"])
def test_script_decimates_to_a_target_and_says_how(torus: Path, tmp_path: Path, kind: str) -> None:
    out, report = tmp_path / f"out{kind}", tmp_path / "out.json"
    done = decimate(torus, "--target-fmqm", 0.85, "--target-texture", 0.7, "-o", out, "--json", report, *SMALL)
    assert (done.returncode, done.stderr) == (0, "")
    found = read_json(report)["found"][0]
    assert found["file"] == str(out) and f"found, written to {out}" in done.stdout
    geometry, texture = found["geometry"], found["texture"]
    assert geometry["reached"] and geometry["best"]["FMQM"] >= 0.85 > geometry["below"]["FMQM"]
    assert (
        texture["reached"] and texture["best"]["FMQM"] >= 0.7 and texture["best"]["ratio"] == geometry["best"]["ratio"]
    )
    assert done.stdout.count("found") == 2 and f"{geometry['best']['FMQM']:.4f}" in done.stdout
    again = score(torus, out, "--samples", 6400, "--patches", 50, "--json", "-", "--quiet")
    assert strict_json(again.stdout)["pairs"][0]["FMQM"] == pytest.approx(texture["best"]["FMQM"], abs=1e-9)
    assert not [line for line in again.stderr.splitlines() if "its colors differ" not in line]  # a quarter of the side


def test_script_makes_a_chain(torus: Path, tmp_path: Path) -> None:
    done = decimate(torus, "--chain", "0.8,0.6", "-o", tmp_path / "rock.obj", *SMALL)
    assert done.returncode == 0, done.stderr
    first, second = (len(load_mesh(str(tmp_path / f"rock_LOD{level}.obj")).triangles) for level in (1, 2))
    assert 576 > first > second


def test_script_goes_by_the_judge(torus: Path, tmp_path: Path) -> None:
    report = tmp_path / "out.json"
    done = decimate(torus, "--judge", "perceived", "--target", 0.8, "--json", report, *SMALL)
    assert done.returncode == 0, done.stderr
    document = read_json(report)
    geometry = document["found"][0]["geometry"]
    assert document["judge"] == "perceived"
    assert geometry["best"]["perceived"] >= 0.8 > geometry["below"]["perceived"]
    both = decimate(torus, "--target", 0.8, "--target-fmqm", 0.8, *SMALL)
    other = decimate(torus, "--judge", "perceived", "--target-fmqm", 0.8, *SMALL)
    assert both.returncode == other.returncode == 2 and "--target for --judge perceived" in other.stderr


def test_script_says_that_a_target_is_missed(torus: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.glb"
    done = decimate(torus, "--target-fmqm", 0.99, "--max-triangles", 50, "-o", out, "--json", "-", *SMALL)
    assert done.returncode == 1 and not any(tmp_path.iterdir())
    assert len(done.stderr.splitlines()) == 1 and "0.99 is missed even with the 50 triangles" in done.stderr
    found = json.loads(done.stdout)["found"][0]
    assert found["geometry"]["reached"] is False and found["file"] is None


def test_script_writes_no_file_that_cannot_hold_the_asset(torus: Path, tmp_path: Path) -> None:
    done = decimate(torus, "--target-fmqm", 0.9, "-o", tmp_path / "out.stl", *SMALL)
    assert done.returncode == 1 and not any(tmp_path.iterdir())
    assert len(done.stderr.splitlines()) == 1 and "even with all triangles as .stl" in done.stderr


def test_script_replaces_no_input(tmp_path: Path) -> None:
    write_png(tmp_path / "image.png", noise(64))
    model = write_torus(tmp_path, "torus", "image.png")
    write_torus(tmp_path, "other", "image.png")
    model.write_text(model.read_text().replace("torus.mtl", "other.mtl"))
    (tmp_path / "folder").mkdir()
    (tmp_path / "link.glb").symlink_to(model)
    before = {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()}
    for arguments in (
        ("-o", tmp_path / "folder" / ".." / "torus.obj"), ("-o", "link.glb"), ("-o", "other.obj"),
        ("--json", "image.png"), ("-o", "a.glb", "--json", "./a.glb"),
    ):  # fmt: skip
        done = decimate(model, "--target-fmqm", 0.9, *arguments, *SMALL, cwd=tmp_path)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1), done.stderr
    assert {path: path.read_bytes() for path in tmp_path.iterdir() if path.is_file()} == before


@pytest.mark.parametrize(
    "arguments, code, text",
    [
        (("nowhere.glb", "--target-fmqm", 0.9), 1, "nowhere.glb: no such file"),
        (("torus.obj", "--target-fmqm", 0.9, "-o", "out.gltf"), 2, "out.gltf: unknown file ending .gltf"),
        (("torus.obj", "--target-fmqm", 0.9, "-o", "no/out.glb"), 1, "the folder no does not exist"),
        (("torus.obj", "--target-fmqm", 0.9, "--max-triangles", 0), 2, "max-triangles is 0; at least 4"),
        (("torus.obj",), 2, "nothing is asked for"),
        (("torus.obj", "--target-fmqm", 1.5), 2, "the target is 1.5; it must be above 0 and at most 1"),
        (("torus.obj", "--target-fmqm", "nan"), 2, "the target is nan"),
        (("torus.obj", "--chain", "0.9,x"), 2, "0.9,x is no list of numbers"),
        (("torus.obj", "--target-fmqm", 0.9, "--chain", "0.9"), 2, "both given"),
        (("torus.obj", "--target-texture", 0.9, "--max-triangles", 9), 2, "--max-triangles needs"),
    ],
)
def test_script_says_what_is_wrong_in_one_line(
    torus: Path, arguments: tuple[object, ...], code: int, text: str
) -> None:
    done = decimate(*arguments, "--quiet", cwd=torus.parent)
    assert (done.returncode, len(done.stderr.splitlines())) == (code, 1) and text in done.stderr, done.stderr


@pytest.mark.once
def test_real_models(shared_data: Path, tmp_path: Path) -> None:
    """The cat's glb splits its vertices at seams and names WebP textures."""
    model, out = shared_data / "egyptian_cat" / "egyptian_cat.glb", tmp_path / "cat.glb"
    done = decimate(model, "--target-fmqm", 0.8, "--preset", "fast", "--quiet", "-o", out)
    assert done.returncode == 0, done.stderr
    again = score(model, out, "--preset", "fast", "--json", "-", "--quiet")
    assert 0.8 <= strict_json(again.stdout)["pairs"][0]["FMQM"] < 0.81, "as the file holds it"


# --- The button ------------------------------------------------------------------------------------------------------


@pytest.fixture
def addon() -> Generator[None, None, None]:
    ui.register()
    yield
    ui.unregister()


@pytest.mark.usefixtures("addon")
def test_button_makes_a_copy_with_a_live_modifier() -> None:
    monkey = scenes.monkey("Rock")
    fmqm = bpy.context.scene.fmqm
    fmqm.settings.samples, fmqm.settings.patches = 6400, 50
    assert bpy.ops.fmqm.decimate() == {"FINISHED"}
    copy = bpy.context.active_object
    assert copy.name == "Rock FMQM 0.90" and copy.data == monkey.data and copy.matrix_world == monkey.matrix_world
    assert 0 < copy.modifiers[DECIMATE].ratio < 1 and not monkey.modifiers
    assert monkey.hide_get() and not copy.hide_get(), "they would flicker"
    assert "triangles: about 0." in fmqm.decimate.path and fmqm.decimate.path_of == "Rock"
    chosen = fmqm.decimate.path.splitlines()[fmqm.decimate.found]
    triangles, score = chosen.split(" triangles: ")
    assert int(triangles) == len(scene_reader([copy.name], "copy")(Version()).triangles) and float(score) >= 0.9
    fmqm.decimate.limited, fmqm.decimate.max_triangles = True, 20
    before = scenes.blocks()
    assert bpy.ops.fmqm.decimate() == {"CANCELLED"} and scenes.blocks() == before, "missed: nothing is made"
    assert fmqm.decimate.path_of == "Rock FMQM 0.90" and fmqm.decimate.found == -1, "its path is told all the same"
    assert all(int(line.split()[0]) <= 20 for line in fmqm.decimate.path.splitlines())


def during_the_search(monkeypatch: pytest.MonkeyPatch, change: Callable[[], object]) -> None:
    """What the user does while the button works, just before it ends."""

    def attempt(*arguments: Any) -> Any:
        result = yield from searched(*arguments)
        change()
        return result

    searched = ui_versions.attempting
    monkeypatch.setattr(ui_versions, "attempting", attempt)


@pytest.mark.usefixtures("addon")
def test_button_ends_in_another_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    rock, scene = scenes.monkey("Rock"), bpy.context.scene
    scene.fmqm.settings.samples, scene.fmqm.settings.patches = 6400, 50
    during_the_search(monkeypatch, lambda: setattr(bpy.context.window, "scene", bpy.data.scenes.new("Other")))
    assert bpy.ops.fmqm.decimate() == {"FINISHED"}
    assert {object_.name for object_ in scene.objects} == {"Rock", "Rock FMQM 0.90"} and not rock.modifiers
    assert scene.fmqm.decimate.path and not bpy.data.scenes["Other"].fmqm.decimate.path


@pytest.mark.usefixtures("addon")
def test_button_notices_that_the_object_was_changed(monkeypatch: pytest.MonkeyPatch) -> None:
    rock, fmqm = scenes.monkey("Rock"), bpy.context.scene.fmqm
    fmqm.settings.samples, fmqm.settings.patches = 6400, 50
    before = scenes.blocks()
    during_the_search(monkeypatch, lambda: setattr(rock.data.vertices[0].co, "x", 3.0))
    assert bpy.ops.fmqm.decimate() == {"CANCELLED"} and scenes.blocks() == before and not fmqm.decimate.path


@pytest.mark.usefixtures("addon")
def test_button_says_why_it_is_grey() -> None:
    with pytest.raises(RuntimeError, match="Make a mesh object the active one"):
        bpy.ops.fmqm.decimate()
    scenes.monkey()
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="Leave the object's edit or paint mode"):
        bpy.ops.fmqm.decimate()
