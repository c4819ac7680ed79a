# SPDX-License-Identifier: GPL-3.0-or-later
"""Both readings of real models: as an independent implementation's, 1 against themselves, and still under moves."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from fmqm_addon.blender.files.load import load_mesh, open_file
from fmqm_addon.blender.materials.images import load_texture
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.members import scene_members
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays
from fmqm_addon.comparison.measurement import Comparison, Measurement
from fmqm_addon.metric.errors import FileError
from fmqm_addon.metric.evaluation import COLUMNS
from fmqm_addon.metric.perceived import PERCEIVED_COLUMNS
from fmqm_addon.metric.settings import PRESETS, Settings
from fmqm_addon.metric.surface import MeshArrays
from tests.blender import scenes

PAPER, FAST = (Settings(**PRESETS[name]) for name in ("paper", "fast"))
MODELS = ("spot", "egyptian_cat", "bob", "low_poly_tree")
PAIRED = MODELS[:2]
DISTORTIONS = ("gn_3", "swt_3", "ds_3", "tmc_3")
SAME_CONTENT = np.array([1e-3, 1e-3, 1e-3, 1e-2, 2e-3, *[1e-3] * 6])  # points tie at UV seams; gradients feel 1e-7
MOVED = 2e-3


def prepared(reference: MeshArrays, settings: Settings, repeats: int = 1) -> Measurement:
    measurement = Measurement(reference, BVHQuery, settings, repeats)
    measurement.prepare().run()
    return measurement


def scores(measurement: Measurement, distorted: MeshArrays) -> np.ndarray:
    """All ten columns, the paper's, then the perceived ones, and perceived's 10th percentile."""
    comparison = measurement.compare(distorted).run()
    return np.concatenate([comparison.scores, comparison.perceived])


def model(shared_data: Path, name: str) -> Path:
    return shared_data / "objpng" / name / f"{name}.obj"


def distorted(shared_data: Path, name: str, distortion: str) -> Path:
    return shared_data / "pairs" / name / distortion / "mesh.obj"


@pytest.fixture(scope="module", params=PAIRED)
def three_seeds(request: pytest.FixtureRequest, shared_data: Path) -> tuple[str, dict[str, Comparison]]:
    measurement = prepared(load_mesh(str(model(shared_data, request.param))), PAPER, repeats=3)
    return request.param, {
        distortion: measurement.compare(load_mesh(str(distorted(shared_data, request.param, distortion)))).run()
        for distortion in DISTORTIONS
    }


@pytest.mark.parametrize("distortion", DISTORTIONS)
def test_pair_agrees_with_an_independent_implementation(
    shared_data: Path, three_seeds: tuple[str, dict[str, Comparison]], distortion: str
) -> None:
    name, compared = three_seeds
    expected = json.loads((shared_data / "expected.json").read_text(encoding="utf-8"))
    assert tuple(expected["columns"]) == COLUMNS
    wanted, mine = expected["pairs"][f"{name}/{distortion}"], np.array(compared[distortion].scores)
    print(name, distortion, *np.round(mine, 4))
    assert (np.abs(mine - wanted["mean"]) <= 2 * np.array(wanted["std"]) + 0.003).all()


@pytest.mark.parametrize("distortion", DISTORTIONS)
def test_perceived_agrees_with_an_independent_implementation(
    shared_data: Path, three_seeds: tuple[str, dict[str, Comparison]], distortion: str
) -> None:
    name, compared = three_seeds
    expected = json.loads((shared_data / "expected_perceived.json").read_text(encoding="utf-8"))
    wanted, deviation = np.array([expected[f"{name}/{distortion}"][column] for column in PERCEIVED_COLUMNS]).T
    perceived = compared[distortion].perceived
    mine = np.array([*perceived[1:5], perceived.score])
    print(name, distortion, *np.round(mine, 5))
    assert (np.abs(mine - wanted) <= 2 * deviation + 0.001).all()
    assert mine[-1] < 1, "below the model's own score"
    assert perceived.p10 < perceived.score


def test_repeats_have_the_mean_of_each_seed(three_seeds: tuple[str, dict[str, Comparison]], shared_data: Path) -> None:
    name, compared = three_seeds
    alone = []
    for seed in range(3):
        measurement = prepared(load_mesh(str(model(shared_data, name))), PAPER.with_seed(seed))
        one = measurement.compare(load_mesh(str(distorted(shared_data, name, "gn_3")))).run()
        assert one.perceived_stderr is None
        alone.append([*one.perceived, one.fmqm_p10])
    mean = [*compared["gn_3"].perceived, compared["gn_3"].fmqm_p10]
    np.testing.assert_allclose(mean, np.mean(alone, axis=0), rtol=1e-12)
    error = np.std(alone, axis=0, ddof=1)[:-1] / 3**0.5
    np.testing.assert_allclose(compared["gn_3"].perceived_stderr, error, rtol=1e-9)


def test_noise_that_nobody_sees(shared_data: Path) -> None:
    """A plain color with noise of one 8-bit step: the paper's number sees all structure lost, the perceived none."""
    flat = shared_data / "cases" / "flat"
    measurement = prepared(load_mesh(str(flat / "ref.obj")), PAPER)
    mine = scores(measurement, load_mesh(str(flat / "noise1.obj")))
    print(*np.round(mine, 4))
    assert mine[4] < 0.5 and mine[5] >= 0.99
    assert scores(measurement, load_mesh(str(flat / "ref.obj"))).tolist() == [1.0] * 11


# A mesh against itself


@pytest.mark.parametrize("name", MODELS)
def test_model_against_itself_scores_exactly_1(shared_data: Path, name: str) -> None:
    first, second = (load_mesh(str(model(shared_data, name))) for _ in range(2))
    assert scores(prepared(first, PAPER), second).tolist() == [1.0] * 11


ASSETS = (
    "egyptian_cat/egyptian_cat.glb", "chess_board/chess_board_draco.glb", "sheen_cloth/sheen_cloth.glb",
    "tree_alpha/scene.gltf", "low_poly_tree/low_poly_tree.glb", "bob/bob_tri.obj",
)  # fmt: skip


@pytest.mark.parametrize("name", ASSETS)
def test_real_asset_against_itself_scores_exactly_1(shared_data: Path, name: str) -> None:
    try:
        first, second = (load_mesh(str(shared_data / name)) for _ in range(2))
    except FileError as error:
        if "draco" not in name or "draco" not in str(error):
            raise
        pytest.skip(f"this bpy comes without the Draco decoder: {error}")
    assert scores(prepared(first, FAST), second).tolist() == [1.0] * 11


def test_quads_with_a_given_texture_score_exactly_1(shared_data: Path) -> None:
    """spot's quads name no image; as triangles they are another surface, but nearly the same."""
    image = str(shared_data / "objpng" / "spot" / "spot.png")
    quads = [
        load_mesh(str(shared_data / "spot" / "spot_quadrangulated.obj"), Reading(texture=load_texture(image)))
        for _ in range(2)
    ]
    measurement = prepared(quads[0], FAST)
    assert scores(measurement, quads[1]).tolist() == [1.0] * 11
    assert scores(measurement, load_mesh(str(model(shared_data, "spot"))))[[4, 9]].min() > 0.9


# The same content in another form


def shuffled(mesh: MeshArrays, seed: int = 0) -> MeshArrays:
    """Vertices, faces and the corners of each face in another order."""
    rng = np.random.default_rng(seed)
    new_place, faces = rng.permutation(len(mesh.positions)), rng.permutation(len(mesh.triangles))
    positions = np.empty_like(mesh.positions)
    positions[new_place] = mesh.positions
    corner = (rng.integers(0, 3, (len(faces), 1)) + np.arange(3)) % 3
    row = faces[:, None]
    return replace(
        mesh,
        positions=positions,
        triangles=new_place[mesh.triangles[row, corner]],
        corners=mesh.corners[row, corner],
        material=mesh.material[faces],
    )


@pytest.fixture(scope="module", params=MODELS)
def fast(request: pytest.FixtureRequest, shared_data: Path) -> tuple[Path, MeshArrays, Measurement]:
    path = model(shared_data, request.param)
    mesh = load_mesh(str(path))
    return path, mesh, prepared(mesh, FAST)


def test_another_order_is_the_same_mesh(fast: tuple[Path, MeshArrays, Measurement]) -> None:
    _, mesh, measurement = fast
    mine = scores(measurement, shuffled(mesh))
    print(mesh.name, 1 - mine)
    assert (1 - mine <= SAME_CONTENT).all() and (mine <= 1).all()


@pytest.mark.parametrize("kind", ["obj", "ply", "glb", "fbx", "usdc", "blend"])
def test_another_format_is_the_same_mesh(fast: tuple[Path, MeshArrays, Measurement], tmp_path: Path, kind: str) -> None:
    """PLY names no image; it gets the same one by hand."""
    path, mesh, measurement = fast
    open_file(str(path))
    again = load_mesh(
        str(scenes.export(tmp_path, kind)), Reading(texture=mesh.materials[0].color if kind == "ply" else None)
    )
    mine = scores(measurement, again)
    print(mesh.name, kind, 1 - mine)
    assert (1 - mine <= SAME_CONTENT).all() and (mine <= 1).all()


# Both moved together

SHIFT = np.array([6.0, -0.5, 8.0]) * 1e4  # in diagonals: 1e5 long


def still(mesh: MeshArrays, diagonal: float) -> MeshArrays:
    return mesh


def shifted(mesh: MeshArrays, diagonal: float) -> MeshArrays:
    return replace(mesh, positions=mesh.positions + SHIFT * diagonal)


def scaled(factor: float) -> Callable[[MeshArrays, float], MeshArrays]:
    def move(mesh: MeshArrays, diagonal: float) -> MeshArrays:
        return replace(mesh, positions=mesh.positions * factor)

    move.__name__ = f"scaled by {factor:g}"
    return move


def small_and_far(mesh: MeshArrays, diagonal: float) -> MeshArrays:
    return replace(mesh, positions=mesh.positions * 1e-5 + SHIFT * diagonal * 1e-5)


@pytest.fixture(scope="module", params=[("spot", "swt_3"), ("egyptian_cat", "gn_3")], ids="/".join)
def unmoved(request: pytest.FixtureRequest, shared_data: Path) -> tuple[Path, Path, np.ndarray]:
    paths = model(shared_data, request.param[0]), distorted(shared_data, *request.param)
    reference, other = (load_mesh(str(path)) for path in paths)
    return *paths, scores(prepared(reference, FAST), other)


def diagonal_of(mesh: MeshArrays) -> float:
    return float(np.linalg.norm(np.ptp(mesh.positions, axis=0)))


@pytest.mark.parametrize(
    "move", [still, shifted, scaled(1e-5), scaled(1e5), small_and_far], ids=lambda move: move.__name__
)
def test_arrays_moved_together(
    unmoved: tuple[Path, Path, np.ndarray], move: Callable[[MeshArrays, float], MeshArrays]
) -> None:
    *paths, wanted = unmoved
    reference, other = (load_mesh(str(path)) for path in paths)
    diagonal = diagonal_of(reference)
    mine = scores(prepared(move(reference, diagonal), FAST), move(other, diagonal))
    print(move.__name__, mine - wanted)
    assert np.abs(mine - wanted).max() <= (0 if move is still else MOVED)


MATRICES = {
    "shifted": lambda diagonal: Matrix.Translation(SHIFT * diagonal),
    "scaled by 1e-5": lambda diagonal: Matrix.Scale(1e-5, 4),
    "scaled by 1e5": lambda diagonal: Matrix.Scale(1e5, 4),
    "large and far": lambda diagonal: Matrix.Translation(SHIFT * diagonal * 1e4) @ Matrix.Scale(1e4, 4),
}


@pytest.mark.parametrize("name", MATRICES)
def test_objects_moved_together(unmoved: tuple[Path, Path, np.ndarray], name: str) -> None:
    """By the transforms of Blender's objects, which are float32."""
    *paths, wanted = unmoved
    diagonal = diagonal_of(load_mesh(str(paths[0])))
    meshes = []
    for path in paths:
        open_file(str(path))
        (object_,) = scene_members()
        bpy.context.view_layer.update()
        object_.matrix_world = MATRICES[name](diagonal) @ object_.matrix_world
        meshes.append(mesh_arrays([object_], path.name))
    mine = scores(prepared(meshes[0], FAST), meshes[1])
    print(name, mine - wanted)
    assert np.abs(mine - wanted).max() <= MOVED
