# SPDX-License-Identifier: GPL-3.0-or-later
"""Random meshes, materials and transforms through everything: numbers in [0, 1], or a refusal; nothing remains."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mathutils import Matrix

from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.target import asset_mesh
from fmqm_addon.comparison.alignment import SPACES, align
from fmqm_addon.comparison.measurement import Measurement
from fmqm_addon.metric.errors import FMQMError
from fmqm_addon.metric.settings import Settings
from tests.blender import scenes

TINY = Settings(samples=320, patches=5, color_units=10)
COORDINATES = st.sampled_from([0.0, 0.0, 1.0, -1.0, 0.5, 1e-7, 1e6, np.nan, np.inf]) | st.floats(-2, 2, width=32)
UVS = st.sampled_from([0.0, 1.0, 0.5, -3.0, 1e6, 1e30, np.nan]) | st.floats(0, 1, width=32)
SCALES = st.sampled_from([1.0, 1.0, -1.0, 0.0, 1e-6, 1e6, 3.0])
LOOKS = st.sampled_from(["nothing", "empty slot", "plain", "image", "tint", "vertex colors", "image without UVs"])


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return scenes.write_png(tmp_path_factory.mktemp("images") / "noise.png", scenes.noise(8))


@st.composite
def shapes(draw: st.DrawFn) -> tuple[list[tuple[float, float, float]], list[tuple[int, ...]]]:
    """Few vertices in any place, and faces of three to five of them, each once in a face."""
    vertices = draw(st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES), min_size=3, max_size=10))
    index = st.integers(0, len(vertices) - 1)
    faces = draw(st.lists(st.lists(index, min_size=3, max_size=min(5, len(vertices)), unique=True), max_size=12))
    return vertices, [tuple(face) for face in faces]


def material(look: str, image: Path) -> bpy.types.Material | None:
    if look == "empty slot":
        return None
    if look == "plain":
        return scenes.material(color=(0.2, 0.5, 0.9))
    if look.startswith("image"):
        return scenes.textured(image)
    made = scenes.material()
    source = made.node_tree.nodes.new("ShaderNodeVertexColor")
    color = source.outputs["Color"]
    if look == "tint":
        mix = made.node_tree.nodes.new("ShaderNodeMix")
        mix.data_type, mix.blend_type = "RGBA", "MULTIPLY"
        mix.inputs["Factor"].default_value = 1.0
        factors = [socket for socket in mix.inputs if socket.type == "RGBA"]
        made.node_tree.links.new(color, factors[0])
        made.node_tree.links.new(
            scenes.image_node(made, bpy.data.images.load(str(image)), False).outputs[0], factors[1]
        )
        color = next(socket for socket in mix.outputs if socket.type == "RGBA")
    made.node_tree.links.new(color, scenes.base_color(made))
    return made


@st.composite
def objects(draw: st.DrawFn) -> dict[str, object]:
    """What add_object makes an object of; Blender's own data cannot be drawn, since each example has its session."""
    vertices, faces = draw(shapes())
    corners = sum(map(len, faces))
    return {
        "vertices": vertices,
        "faces": faces,
        "uv": draw(st.lists(UVS, min_size=2 * corners, max_size=2 * corners)),
        "look": draw(LOOKS),
        "scale": draw(st.tuples(SCALES, SCALES, SCALES)),
        "location": draw(st.sampled_from([(0, 0, 0), (5, 0, 0), (1e7, -1e7, 1)])),
    }


def add_object(drawn: dict[str, object], image: Path) -> bpy.types.Object:
    look = str(drawn["look"])
    made = scenes.add("Drawn", drawn["vertices"], drawn["faces"], uv=False)  # type: ignore[arg-type]
    if look != "nothing":
        made.data.materials.append(material(look, image))
    if look != "image without UVs":
        made.data.uv_layers.new(name="UVMap").uv.foreach_set("vector", np.array(drawn["uv"], np.float32))
    if look in ("tint", "vertex colors"):
        colors = made.data.color_attributes.new("Col", "FLOAT_COLOR", "CORNER")
        values = np.random.default_rng(0).uniform(-0.5, 2, 4 * len(colors.data)).astype(np.float32)
        colors.data.foreach_set("color", values)
    made.matrix_world = Matrix.LocRotScale(drawn["location"], None, drawn["scale"])
    return made


@settings(max_examples=60)
@given(first=objects(), second=objects(), space=st.sampled_from(SPACES), match_scale=st.booleans())
def test_anything_is_measured_or_refused(
    image: Path, first: dict[str, object], second: dict[str, object], space: str, match_scale: bool
) -> None:
    scenes.clear()
    one, other = add_object(first, image), add_object(second, image)
    before = scenes.blocks()
    try:
        reference = asset_mesh([one], "first")
        measurement = Measurement(reference.world(), BVHQuery, TINY)
        measurement.prepare().run()
        itself = align(reference, asset_mesh([one], "first"), space, match_scale)
        assert list(measurement.compare(itself.mesh).run().scores) == [1.0] * 5
        compared = align(reference, asset_mesh([other], "second"), space, match_scale)
        scores = measurement.compare(compared.mesh).run().scores
        assert len(scores) == 5 and all(0 <= score <= 1 for score in scores)
    except FMQMError as error:
        assert len(str(error).splitlines()) == 1
    assert scenes.blocks() == before


def test_objects_of_the_scene_are_placed_as_files_are() -> None:
    """Turned in its vertices, with another pivot, and askew: in the window and in Python as on the command line."""
    from mathutils import Euler

    from fmqm_addon import api

    reference, turned, askew = (scenes.monkey(name) for name in ("Reference", "Turned", "Askew"))
    for each in (reference, turned, askew):
        each.matrix_world = Matrix()
    turned.data.transform(Matrix.Translation((0, 0, 3)) @ Matrix.Rotation(np.pi, 4, "Z"))
    askew.data.transform(Euler((0.05, 0.02, -0.06)).to_matrix().to_4x4())
    small = api.Settings(samples=3000, patches=20)
    (outcome,) = api.measure(reference, turned, small)
    assert outcome.pair_result is not None and outcome.pair_result.alignment.turn == "180 degrees about Z"
    assert outcome.scores is not None and outcome.scores.FMQM > 0.99
    plain, refined = (api.measure(reference, askew, small, align=align)[0].scores for align in ("none", "icp"))
    assert plain is not None and refined is not None and refined.FMQM > 0.99 > plain.FMQM
