# SPDX-License-Identifier: GPL-3.0-or-later
"""NodeQuery against the plain loop of BVHQuery, and what it leaves behind: nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.files.load import load_mesh
from fmqm_addon.blender.scene import node_queries
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.node_queries import NAME, NodeQuery, surface_query
from fmqm_addon.metric.evaluation import Evaluation, Result
from fmqm_addon.metric.fields import Fields, evaluate_fields
from fmqm_addon.metric.geometry import Floats, Ints, morton_order
from fmqm_addon.metric.queries import BatchQuery
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.stepper import Work, finish
from fmqm_addon.metric.surface import MeshArrays, Surface, prepare_surface
from fmqm_addon.metric.texture import Material, PlainColor

from .. import scenes

FLOAT32 = 1e-6
FEW = Settings(samples=20_000, patches=40)


def random_soup(seed: int, count: int) -> tuple[Floats, Ints]:
    rng = np.random.default_rng(seed)
    return (rng.random((3 * count, 3)) - 0.5) / np.sqrt(3), rng.permutation(3 * count).reshape(-1, 3)


def soup_surface(query: Callable[[Floats, Ints], Any], count: int = 300) -> Surface:
    vertices, triangles = random_soup(1, count)
    flat, white = np.zeros((count, 3, 2)), (Material("white", PlainColor((1.0, 1.0, 1.0))),)
    return prepare_surface(MeshArrays("soup", vertices, triangles, flat, np.zeros(count, np.int64), white), query)


def near(count: int = 3000) -> Floats:
    return (np.random.default_rng(2).random((count, 3)) - 0.5) * 1.5


def temporary() -> list[str]:
    collections = (bpy.data.scenes, bpy.data.objects, bpy.data.meshes, bpy.data.node_groups)
    return [block.name for blocks in collections for block in blocks if block.name.startswith(NAME)]


def handlers() -> int:
    every = [handler for name in node_queries._HANDLERS for handler in getattr(bpy.app.handlers, name)]
    return sum(isinstance(getattr(handler, "__self__", None), NodeQuery) for handler in every)


def test_answers_are_those_of_the_plain_loop() -> None:
    vertices, triangles = random_soup(3, 400)
    plain, nodes = BVHQuery(vertices, triangles), NodeQuery(vertices, triangles)
    points = near()
    directions = np.random.default_rng(4).normal(size=points.shape)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    with nodes.opened():
        assert np.array_equal(nodes.nearest(points, None), plain.nearest(points, None))
        triangle, distance = nodes.first_hit(points, directions)
    assert not nodes._failed
    wanted, wanted_distance = plain.first_hit(points, directions)
    assert np.array_equal(triangle, wanted) and (triangle >= 0).any() and (triangle < 0).any()
    hit = triangle >= 0
    assert distance[hit] == pytest.approx(wanted_distance[hit], abs=FLOAT32)
    assert (distance[~hit] == np.inf).all()


@pytest.mark.parametrize("cores", [1, 3])
def test_rays_are_spread_over_the_cores_however_many_ask(cores: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The pieces of a question before do not answer for those of a smaller one after it."""
    monkeypatch.setattr(node_queries, "_cores", lambda: cores)
    vertices, triangles = random_soup(3, 400)
    plain, nodes = BVHQuery(vertices, triangles), NodeQuery(vertices, triangles)
    with nodes.opened():
        for count in (3000, 700, 100, 1, 2999):
            points = near(count)
            directions = points / np.linalg.norm(points, axis=1, keepdims=True)
            assert np.array_equal(nodes.first_hit(points, -directions)[0], plain.first_hit(points, -directions)[0])
        assert nodes._stage is not None and len(nodes._stage._clouds[True]) == cores
    assert not nodes._failed and not temporary()


MODELS = ("objpng/spot/spot.obj", "objpng/egyptian_cat/egyptian_cat.obj", "objpng/bob/bob.obj", "tree_alpha/scene.gltf")


def compared(reference: Path, distorted: Path, query: Callable[[Floats, Ints], Any]) -> Result:
    surface = prepare_surface(load_mesh(str(reference)), query)
    evaluation = Evaluation(surface, FEW)
    evaluation.prepare().run()
    return evaluation.compare(prepare_surface(load_mesh(str(distorted)), query, surface.frame)).run()


@pytest.mark.parametrize("model", MODELS)
def test_real_models_score_as_with_a_ray_for_each_sample(shared_data: Path, model: str) -> None:
    """The plain loop casts one for each; nodes are asked for few of them where the mesh is closed."""
    reference = shared_data / model
    noisy = shared_data / "pairs" / reference.stem / "gn_3" / "mesh.obj"  # folds and needles
    distorted = noisy if noisy.is_file() else reference
    plain, nodes = (compared(reference, distorted, query) for query in (BVHQuery, NodeQuery))
    for a, b in ((plain.ref, nodes.ref), (plain.dist, nodes.dist)):
        assert np.array_equal(a.sdf < 0, b.sdf < 0)
        np.testing.assert_allclose(a.sdf, b.sdf, rtol=0, atol=1e-9)
    np.testing.assert_allclose(plain.patch_scores, nodes.patch_scores, rtol=0, atol=1e-6)
    np.testing.assert_allclose(plain.patch_perceived, nodes.patch_perceived, rtol=0, atol=1e-6)
    again = compared(reference, distorted, NodeQuery)
    assert again.patch_scores.tobytes() == nodes.patch_scores.tobytes()
    assert again.dist.ncf.tobytes() == nodes.dist.ncf.tobytes()


def begun(shape: Surface, steps: int) -> Work[Fields]:
    """The fields of a surface, some steps in."""
    points = near(30_000)
    work = evaluate_fields(shape, points, morton_order(points))
    for _ in range(steps):
        next(work)
    return work


def test_nothing_stays_after_the_end() -> None:
    before = scenes.blocks(), handlers()
    work = begun(soup_surface(NodeQuery), 1)
    assert temporary()
    finish(work)
    assert (scenes.blocks(), handlers()) == before


def test_nothing_stays_after_cancelling_or_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    before = scenes.blocks(), handlers()
    begun(soup_surface(NodeQuery), 2).close()
    assert (scenes.blocks(), handlers()) == before

    shape = soup_surface(NodeQuery)

    def breaks(*_: object) -> None:
        raise OSError

    work = begun(shape, 1)
    monkeypatch.setattr(type(shape), "color_at", breaks)
    with pytest.raises(OSError):
        finish(work)
    assert (scenes.blocks(), handlers()) == before


def test_nothing_is_in_a_file_that_is_saved_meanwhile(tmp_path: Path) -> None:
    """And the measurement goes on, after another file was opened, too."""
    wanted = finish(begun(soup_surface(NodeQuery), 1))
    work = begun(soup_surface(NodeQuery), 1)
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    with bpy.data.libraries.load(path) as (inside, _):
        names = [*inside.scenes, *inside.objects, *inside.meshes, *inside.node_groups]
    assert not [name for name in names if name.startswith(NAME)]
    next(work)
    assert temporary()
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not temporary()
    found = finish(work)
    assert np.array_equal(found.sdf, wanted.sdf) and not temporary() and not handlers()


def test_what_a_crash_left_is_swept() -> None:
    before = scenes.blocks()
    query = NodeQuery(*random_soup(5, 20))
    with query.opened():
        query.nearest(near(), None)
        assert temporary()
        node_queries.sweep()
        assert scenes.blocks() == before
        assert query.nearest(near(10), None).shape == (10,)  # the plain loop answers
    assert scenes.blocks() == before


def test_where_nodes_fail_the_plain_loop_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    before = scenes.blocks()

    def broken(*_: object) -> None:
        raise RuntimeError

    monkeypatch.setattr(node_queries, "_node_group", broken)
    wanted, found = (finish(begun(soup_surface(query), 0)) for query in (BVHQuery, NodeQuery))
    for name in ("nearest", "triangle", "sdf", "ncf"):
        assert np.array_equal(getattr(wanted, name), getattr(found, name))
    assert scenes.blocks() == before


def test_the_setting_keeps_the_plain_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(node_queries.SETTING, raising=False)
    assert isinstance(surface_query(*random_soup(1, 4)), BatchQuery)
    monkeypatch.setenv(node_queries.SETTING, "python")
    query = surface_query(*random_soup(1, 4))
    assert isinstance(query, BVHQuery) and query.every_ray


def test_many_triangles_keep_the_plain_loop_with_fewer_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(node_queries.SETTING, raising=False)
    monkeypatch.setattr(node_queries, "MOST_TRIANGLES", 3)
    query = surface_query(*random_soup(1, 4))
    assert isinstance(query, BVHQuery) and not query.every_ray
