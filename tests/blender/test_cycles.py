# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read of a material is what Cycles shows: its baker is the oracle, construction by construction."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.bvh import BVHQuery
from fmqm_addon.blender.material import Look, Reading, TextureCache, Unread, read_look
from fmqm_addon.blender.mesh import mesh_arrays
from fmqm_addon.metric.color import encode_srgb
from fmqm_addon.metric.surface import Surface, prepare_surface

from . import scenes

SIDE = 32  # of the bakes
TOLERANCE = 2 / 255

Sockets = tuple[bpy.types.NodeSocket, bpy.types.NodeSocket | None]
Construction = Callable[["Scene"], Sockets]


class Scene:
    """A square with UV maps, color attributes and a material under construction."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.object = scenes.square()
        mesh = self.object.data
        rng = np.random.default_rng(3)
        first = np.array([-0.73, -1.21, 2.13, -0.82, 1.94, 1.37, -0.61, 1.58], np.float32)
        mesh.uv_layers[0].uv.foreach_set("vector", first)
        mesh.uv_layers.new(name="Second").uv.foreach_set("vector", rng.random(8, np.float32))
        bake = mesh.uv_layers.new(name="Bake")  # the square as it lies
        bake.uv.foreach_set("vector", np.array(scenes.SQUARE, np.float32)[:, :2].ravel())
        bake.active = True
        mesh.uv_layers[0].active_render = True
        for name, kind, domain in (("Paint", "FLOAT_COLOR", "CORNER"), ("Bytes", "BYTE_COLOR", "POINT")):
            layer = mesh.color_attributes.new(name, kind, domain)
            layer.data.foreach_set("color", rng.random(16).astype(np.float32))
        mesh.color_attributes.render_color_index = 1
        mesh.update()
        self.material = scenes.material()
        mesh.materials.append(self.material)
        self.tree = self.material.node_tree

    def node(self, kind: str, **settings: object) -> bpy.types.Node:
        made = self.tree.nodes.new(f"ShaderNode{kind}")
        for name, value in settings.items():
            setattr(made, name, value)
        return made

    def link(self, start: bpy.types.NodeSocket, end: bpy.types.NodeSocket) -> None:
        self.tree.links.new(start, end)

    def image(self, pixels: np.ndarray | None = None, space: str = "", mode: str = "STRAIGHT") -> bpy.types.Node:
        """A node with an image of its own, 7 x 5 pixels of noise."""
        pixels = noise() if pixels is None else pixels
        write, name = (scenes.write_exr, "x.exr") if pixels.dtype == np.float32 else (scenes.write_png, "x.png")
        image = bpy.data.images.load(str(write(self.folder / f"{len(bpy.data.images)}{name}", pixels)))
        if space:
            image.colorspace_settings.name = space
        image.alpha_mode = mode
        return self.node("TexImage", image=image)

    def shader(self) -> bpy.types.Node:
        return next(node for node in self.tree.nodes if node.type in {"BSDF_PRINCIPLED", "EMISSION", "BSDF_DIFFUSE"})

    def surface(self) -> Surface:
        return prepare_surface(mesh_arrays([self.object], "asset"), BVHQuery)


def noise(channels: int = 3, kind: type = np.uint8) -> np.ndarray:
    rng = np.random.default_rng(channels)
    if kind is np.float32:
        return rng.random((5, 7, channels), np.float32)
    return rng.integers(0, np.iinfo(kind).max + 1, (5, 7, channels)).astype(kind)


@contextmanager
def cycles(object_: bpy.types.Object) -> Iterator[None]:
    """A scene of its own for the baker, with this one object, selected."""
    scene = bpy.data.scenes.new("bake")
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.collection.objects.link(object_)
    layer = scene.view_layers[0]
    layer.objects.active = object_
    object_.select_set(True, view_layer=layer)
    layer.update()
    chosen = {"object": object_, "active_object": object_}
    chosen |= {"selected_objects": [object_], "selected_editable_objects": [object_]}
    with bpy.context.temp_override(scene=scene, view_layer=layer, **chosen):
        yield
    bpy.data.scenes.remove(scene)


def bake(
    scene: Scene, shown: bpy.types.NodeSocket, alive: bpy.types.NodeSocket | None, as_number: bool = False
) -> np.ndarray:
    """(SIDE, SIDE, 3) linear light that Cycles emits where a socket's color or number is emitted, row 0 at v = 0. The
    other output, which may change what an image's color is, stays in use."""
    tree = scene.tree
    output = tree.get_output_node("ALL")
    before = output.inputs["Surface"].links[0].from_socket
    target = bpy.data.images.new("target", SIDE, SIDE, float_buffer=True, alpha=True, is_data=True)
    added = [scene.node(kind) for kind in ("Emission", "BsdfDiffuse", "AddShader", "TexImage")]
    emission, diffuse, both, node = added
    node.image = target
    tree.nodes.active = node
    emission.inputs["Color"].default_value = (1, 1, 1, 1)
    if shown.is_output:
        scene.link(shown, emission.inputs["Strength" if as_number else "Color"])
    else:
        value = shown.default_value
        emission.inputs["Color"].default_value = (value,) * 4 if shown.type == "VALUE" else tuple(value)
    if alive is not None and alive.is_output:
        scene.link(alive, diffuse.inputs["Color"])
    scene.link(emission.outputs[0], both.inputs[0])
    scene.link(diffuse.outputs[0], both.inputs[1])
    scene.link(both.outputs[0], output.inputs["Surface"])
    with cycles(scene.object):
        assert bpy.ops.object.bake(type="EMIT", margin=0) == {"FINISHED"}
    values = np.empty(SIDE * SIDE * 4, np.float32)
    target.pixels.foreach_get(values)
    scene.link(before, output.inputs["Surface"])
    for node in added:
        tree.nodes.remove(node)
    bpy.data.images.remove(target)
    return values.reshape(SIDE, SIDE, 4)[:, :, :3].astype(float)


def seen(surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """(SIDE, SIDE, 3) colors and (SIDE, SIDE) opacities at the same places of the square."""
    number = np.arange(SIDE)
    # Blender's baker moves its places by this much out of the texels' centers, so that none lies between two triangles.
    x, y = (grid.ravel() for grid in np.meshgrid((number + 0.501) / SIDE, (number + 0.502) / SIDE))
    points = surface.frame.enter(np.stack([x, y, 0 * x], axis=1))
    triangle = surface.query.nearest(points, None)
    corners = surface.vertices[surface.triangles[triangle]]
    bary = np.stack(
        [
            np.linalg.solve(np.hstack([corner[:, :2], [[1], [1], [1]]]).T, np.append(point[:2], 1))
            for corner, point in zip(corners, points, strict=True)
        ]
    )
    assert bary.min() > -1e-6
    color, alpha = surface.color_at(triangle, bary), surface.alpha_at(triangle, bary)
    return color.reshape(SIDE, SIDE, 3), alpha.reshape(SIDE, SIDE)


def source(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    return socket.links[0].from_socket if socket.is_linked else socket


def check(scene: Scene) -> None:
    """What the material shows is read, and is what Cycles bakes: color and alpha."""
    look = read_look(scene.material, TextureCache(), Reading())
    assert isinstance(look, Look), look
    shader = scene.shader()
    color = source(shader.inputs.get("Base Color") or shader.inputs["Color"])
    alpha = source(shader.inputs["Alpha"]) if "Alpha" in shader.inputs else None
    shown, opacity = seen(scene.surface())
    wanted = encode_srgb(bake(scene, color, alpha))
    assert wanted.std() > 0.01 or not color.is_output, "a test that shows nothing"
    np.testing.assert_allclose(shown, wanted, rtol=0, atol=TOLERANCE)
    if alpha is None or not alpha.is_output:
        assert (opacity == (1 if alpha is None else alpha.default_value)).all()
        return
    wanted_alpha = np.clip(bake(scene, alpha, color, as_number=True), 0, 1).mean(axis=2)
    np.testing.assert_allclose(opacity, wanted_alpha, rtol=0, atol=TOLERANCE)


# Each of these builds nodes and gives what feeds Base Color and, where it matters, Alpha.

CONSTRUCTIONS: dict[str, Construction] = {}


def construction(build: Construction) -> Construction:
    CONSTRUCTIONS[build.__name__] = build
    return build


@construction
def vertex_color_for_rendering(scene: Scene) -> Sockets:
    node = scene.node("VertexColor")
    return node.outputs["Color"], node.outputs["Alpha"]


@construction
def vertex_color_by_name(scene: Scene) -> Sockets:
    node = scene.node("VertexColor", layer_name="Paint")
    return node.outputs["Color"], node.outputs["Alpha"]


@construction
def attribute(scene: Scene) -> Sockets:
    node = scene.node("Attribute", attribute_name="Bytes")
    return node.outputs["Color"], node.outputs["Alpha"]


@construction
def attribute_as_vector(scene: Scene) -> Sockets:
    return scene.node("Attribute", attribute_name="Paint").outputs["Vector"], None


@construction
def luminance_as_alpha(scene: Scene) -> Sockets:
    node = scene.image()
    return node.outputs["Color"], node.outputs["Color"]


@construction
def alpha_as_color(scene: Scene) -> Sockets:
    return scene.image(noise(4)).outputs["Alpha"], None


@construction
def generated_image(scene: Scene) -> Sockets:
    image = bpy.data.images.new("generated", 64, 64)
    image.generated_type = "COLOR_GRID"
    return scene.node("TexImage", image=image).outputs["Color"], None


@construction
def painted_image(scene: Scene) -> Sockets:
    image = bpy.data.images.new("painted", 7, 5, alpha=True)
    image.pixels.foreach_set(np.random.default_rng(0).random(140, np.float32))
    image.update()
    node = scene.node("TexImage", image=image)
    return node.outputs["Color"], node.outputs["Alpha"]


@construction
def painted_float_image(scene: Scene) -> Sockets:
    image = bpy.data.images.new("painted", 7, 5, float_buffer=True)
    values = np.random.default_rng(0).random((35, 4), np.float32)
    values[:, 3] = 1
    image.pixels.foreach_set(values.ravel())
    image.update()
    return scene.node("TexImage", image=image).outputs["Color"], None


@construction
def packed_image(scene: Scene) -> Sockets:
    node = scene.image(noise(4))
    node.image.pack()
    return node.outputs["Color"], node.outputs["Alpha"]


@construction
def uv_map_by_attribute(scene: Scene) -> Sockets:
    node = scene.image()
    scene.link(scene.node("Attribute", attribute_name="Second").outputs["Vector"], node.inputs["Vector"])
    return node.outputs["Color"], None


@construction
def two_uv_maps(scene: Scene) -> Sockets:
    mix = scene.node("MixRGB", blend_type="MULTIPLY")
    mix.inputs["Fac"].default_value = 1
    for number, name in ((1, "UVMap"), (2, "Second")):
        node = scene.image()
        scene.link(scene.node("UVMap", uv_map=name).outputs["UV"], node.inputs["Vector"])
        scene.link(node.outputs["Color"], mix.inputs[number])
    return mix.outputs["Color"], None


@construction
def wrapped_apart(scene: Scene) -> Sockets:
    """As the glTF importer builds unlike wrap modes, on a transformed UV map."""
    node, combine, separate = scene.image(), scene.node("CombineXYZ"), scene.node("SeparateXYZ")
    node.extension = "EXTEND"
    wrap, pingpong = scene.node("Math", operation="WRAP"), scene.node("Math", operation="PINGPONG")
    wrap.inputs[1].default_value, wrap.inputs[2].default_value, pingpong.inputs[1].default_value = 0, 1, 1
    mapping = scene.node("Mapping")
    mapping.inputs["Scale"].default_value = (1.3, -0.7, 1)
    for start, end in (
        (scene.node("UVMap", uv_map="UVMap").outputs[0], mapping.inputs["Vector"]),
        (mapping.outputs[0], separate.inputs[0]),
        (separate.outputs["X"], wrap.inputs[0]),
        (separate.outputs["Y"], pingpong.inputs[0]),
        (wrap.outputs[0], combine.inputs["X"]),
        (pingpong.outputs[0], combine.inputs["Y"]),
        (combine.outputs[0], node.inputs["Vector"]),
    ):
        scene.link(start, end)
    return node.outputs["Color"], None


@construction
def chain_of_mappings(scene: Scene) -> Sockets:
    node = scene.image()
    start = scene.node("TexCoord").outputs["UV"]
    for kind, location, rotation, scale in (
        ("POINT", (0.3, -0.2, 0.5), (0.2, 0.4, 0.7), (1.5, 0.6, 2)),
        ("TEXTURE", (-0.4, 0.1, 0.3), (0.5, -0.3, 1.1), (0.8, 1.7, 0.9)),
        ("VECTOR", (9, 9, 9), (0.1, 0.2, -0.4), (0.9, 1.1, 1)),
    ):
        mapping = scene.node("Mapping", vector_type=kind)
        if kind != "VECTOR":
            mapping.inputs["Location"].default_value = location
        mapping.inputs["Rotation"].default_value = rotation
        mapping.inputs["Scale"].default_value = scale
        scene.link(start, mapping.inputs["Vector"])
        start = mapping.outputs[0]
    scene.link(start, node.inputs["Vector"])
    return node.outputs["Color"], None


@construction
def tint_of_vertex_color_and_factor(scene: Scene) -> Sockets:
    """As the glTF importer: texture x vertex color x factor, alpha alike and cut off."""
    image, paint = scene.image(noise(4), mode="CHANNEL_PACKED"), scene.node("VertexColor")
    color, alpha = image.outputs["Color"], image.outputs["Alpha"]
    for second, constant in ((paint, None), (None, (0.9, 0.4, 0.7, 1))):
        mix = scene.node("Mix", data_type="RGBA", blend_type="MULTIPLY")
        math = scene.node("Math", operation="MULTIPLY")
        mix.inputs["Factor"].default_value = 1
        scene.link(color, mix.inputs[6])
        scene.link(alpha, math.inputs[0])
        if second is None:
            mix.inputs[7].default_value, math.inputs[1].default_value = constant, 0.8
        else:
            scene.link(second.outputs["Color"], mix.inputs[7])
            scene.link(second.outputs["Alpha"], math.inputs[1])
        color, alpha = mix.outputs[2], math.outputs[0]
    less, subtract = scene.node("Math", operation="LESS_THAN"), scene.node("Math", operation="SUBTRACT")
    less.inputs[1].default_value, subtract.inputs[0].default_value = 0.21, 1
    scene.link(alpha, less.inputs[0])
    scene.link(less.outputs[0], subtract.inputs[1])
    return color, subtract.outputs[0]


@construction
def scale_and_bias(scene: Scene) -> Sockets:
    """As the USD importer."""
    node, math = scene.image(), scene.node("VectorMath", operation="MULTIPLY_ADD")
    math.inputs[1].default_value, math.inputs[2].default_value = (0.7, 1.4, -0.5), (0.1, -0.1, 0.6)
    scene.link(node.outputs["Color"], math.inputs[0])
    return math.outputs[0], None


@construction
def channel_as_alpha(scene: Scene) -> Sockets:
    node, separate = scene.image(), scene.node("SeparateColor")
    scene.link(node.outputs["Color"], separate.inputs[0])
    return node.outputs["Color"], separate.outputs["Green"]


@construction
def muted_node(scene: Scene) -> Sockets:
    node, gamma = scene.image(), scene.node("Gamma")
    gamma.mute = True
    scene.link(node.outputs["Color"], gamma.inputs["Color"])
    return gamma.outputs["Color"], None


@construction
def nested_groups(scene: Scene) -> Sockets:
    """An image outside, tinted two groups deep by a factor that comes from outside."""
    inner = bpy.data.node_groups.new("inner", "ShaderNodeTree")
    outer = bpy.data.node_groups.new("outer", "ShaderNodeTree")
    for tree in (inner, outer):
        tree.interface.new_socket("Color", in_out="INPUT", socket_type="NodeSocketColor")
        tree.interface.new_socket("Amount", in_out="INPUT", socket_type="NodeSocketFloat")
        tree.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
        tree.nodes.new("NodeGroupInput")
        tree.nodes.new("NodeGroupOutput")
    mix = inner.nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    mix.inputs[7].default_value = (0.1, 0.6, 0.9, 1)
    inner.links.new(inner.nodes["Group Input"].outputs["Color"], mix.inputs[6])
    inner.links.new(inner.nodes["Group Input"].outputs["Amount"], mix.inputs["Factor"])
    inner.links.new(mix.outputs[2], inner.nodes["Group Output"].inputs["Color"])
    nested = outer.nodes.new("ShaderNodeGroup")
    nested.node_tree = inner
    for name in ("Color", "Amount"):
        outer.links.new(outer.nodes["Group Input"].outputs[name], nested.inputs[name])
    outer.links.new(nested.outputs["Color"], outer.nodes["Group Output"].inputs["Color"])
    group = scene.node("Group", node_tree=outer)
    group.inputs["Amount"].default_value = 0.3
    scene.link(scene.image().outputs["Color"], group.inputs["Color"])
    return group.outputs["Color"], None


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return Scene(tmp_path)


def finish(scene: Scene, sockets: Sockets) -> None:
    color, alpha = sockets
    scene.link(color, scene.shader().inputs["Base Color"])
    if alpha is not None:
        scene.link(alpha, scene.shader().inputs["Alpha"])
    check(scene)


@pytest.mark.parametrize("name", CONSTRUCTIONS)
def test_construction(scene: Scene, name: str) -> None:
    finish(scene, CONSTRUCTIONS[name](scene))


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
@pytest.mark.parametrize("interpolation", ["Linear", "Closest", "Cubic", "Smart"])
@pytest.mark.parametrize("channels", [3, 4])
def test_sampling(scene: Scene, extension: str, interpolation: str, channels: int) -> None:
    node = scene.image(noise(channels))
    node.extension, node.interpolation = extension, interpolation
    finish(scene, (node.outputs["Color"], node.outputs["Alpha"] if channels == 4 else None))


@pytest.mark.parametrize("mode", ["STRAIGHT", "CHANNEL_PACKED", "NONE"])
@pytest.mark.parametrize("space", ["sRGB", "Non-Color", "Linear Rec.709"])
@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize("packed", [False, True])
def test_eight_bits_with_alpha(scene: Scene, mode: str, space: str, alpha: bool, packed: bool) -> None:
    """Whether the color is multiplied by alpha depends on all of these."""
    node = scene.image(noise(4), space, mode)
    if packed:
        node.image.pack()
    finish(scene, (node.outputs["Color"], node.outputs["Alpha"] if alpha else None))


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("space", ["sRGB", "Non-Color"])
@pytest.mark.parametrize("packed", [False, True])
def test_grey_and_sixteen_bits(scene: Scene, channels: int, kind: type, space: str, packed: bool) -> None:
    node = scene.image(noise(channels, kind), space, "CHANNEL_PACKED")
    if packed:
        node.image.pack()
    finish(scene, (node.outputs["Color"], node.outputs["Alpha"] if channels in (2, 4) else None))


@pytest.mark.parametrize("alpha", [False, True])
def test_sixteen_bits_with_straight_alpha(scene: Scene, alpha: bool) -> None:
    node = scene.image(noise(4, np.uint16))
    finish(scene, (node.outputs["Color"], node.outputs["Alpha"] if alpha else None))


@pytest.mark.parametrize("mode", ["PREMUL", "CHANNEL_PACKED", "NONE"])
@pytest.mark.parametrize("space", ["Linear Rec.709", "Non-Color"])
@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize("packed", [False, True])
def test_float_with_alpha(scene: Scene, mode: str, space: str, alpha: bool, packed: bool) -> None:
    node = scene.image(noise(4, np.float32), space, mode)
    if packed:
        node.image.pack()
    finish(scene, (node.outputs["Color"], node.outputs["Alpha"] if alpha else None))


@pytest.mark.parametrize(
    ("channels", "kind", "mode", "packed"),
    [
        (4, np.uint8, "PREMUL", False),
        (2, np.uint8, "STRAIGHT", False),
        (4, np.uint16, "STRAIGHT", True),
        (4, np.float32, "STRAIGHT", False),
    ],
)
def test_alpha_that_blenders_treat_differently_is_left_to_the_baker(
    scene: Scene, channels: int, kind: type, mode: str, packed: bool
) -> None:
    node = scene.image(noise(channels, kind), mode=mode)
    if packed:
        node.image.pack()
    scene.link(node.outputs["Color"], scene.shader().inputs["Base Color"])
    look = read_look(scene.material, TextureCache(), Reading())
    assert isinstance(look, Unread) and "alpha" in look.why


@pytest.mark.parametrize("blend", ["MIX", "MULTIPLY"])
@pytest.mark.parametrize("factor", [0.0, 0.37, 1.0, 1.6])
@pytest.mark.parametrize("clamps", [(False, False), (True, True), (False, True)])
def test_mix(scene: Scene, blend: str, factor: float, clamps: tuple[bool, bool]) -> None:
    node, paint = scene.image(noise(3, np.float32) * 3), scene.node("VertexColor")
    mix = scene.node("Mix", data_type="RGBA", blend_type=blend, clamp_factor=clamps[0], clamp_result=clamps[1])
    mix.inputs["Factor"].default_value = factor
    scene.link(node.outputs["Color"], mix.inputs[6])
    scene.link(paint.outputs["Color"], mix.inputs[7])
    finish(scene, (mix.outputs[2], None))
