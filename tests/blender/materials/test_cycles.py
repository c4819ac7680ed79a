# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read of a material is what Cycles shows: its baker is the oracle, construction by construction."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.materials.images import TextureCache
from fmqm_addon.blender.materials.read_material import read_look
from fmqm_addon.blender.materials.types import Look, Reading, Unread
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.mesh_arrays import mesh_arrays
from fmqm_addon.metric.colorspace import encode_srgb
from fmqm_addon.metric.surface import Surface, prepare_surface
from tests.blender import scenes

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
    other output, of a shader or not, which may change what an image's color is, stays in use."""
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
    kept = diffuse.outputs[0]
    if alive is not None and alive.type == "SHADER":
        kept = alive
    elif alive is not None and alive.is_output:
        scene.link(alive, diffuse.inputs["Color"])
    scene.link(emission.outputs[0], both.inputs[0])
    scene.link(kept, both.inputs[1])
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


def emitted(scene: Scene) -> np.ndarray:
    """(SIDE, SIDE, 3) linear light that the material emits as it is."""
    target = bpy.data.images.new("target", SIDE, SIDE, float_buffer=True, is_data=True)
    scene.tree.nodes.active = scene.node("TexImage", image=target)
    with cycles(scene.object):
        bpy.ops.object.bake(type="EMIT", margin=0)
    return np.array(target.pixels).reshape(SIDE, SIDE, 4)[:, :, :3]


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


@construction
def vector_as_alpha(scene: Scene) -> Sockets:
    """As the USD importer scales an opacity."""
    node, math = scene.image(), scene.node("VectorMath", operation="MULTIPLY")
    math.inputs[1].default_value = (0.2, 0.9, 0.6)
    scene.link(node.outputs["Color"], math.inputs[0])
    return node.outputs["Color"], math.outputs[0]


@construction
def arithmetic_in_alpha(scene: Scene) -> Sockets:
    node = scene.image(noise(4))
    alpha = node.outputs["Alpha"]
    for operation, second, clamp in (
        ("MULTIPLY", 2.5, False),
        ("SUBTRACT", 0.4, False),
        ("MINIMUM", 1.3, False),
        ("MAXIMUM", -0.2, True),
        ("ADD", 0.1, False),
        ("MULTIPLY_ADD", 0.9, False),
    ):
        math = scene.node("Math", operation=operation, use_clamp=clamp)
        math.inputs[1].default_value, math.inputs[2].default_value = second, 0.05
        scene.link(alpha, math.inputs[0])
        alpha = math.outputs[0]
    return node.outputs["Color"], alpha


@construction
def rounded_alpha(scene: Scene) -> Sockets:
    node, math = scene.image(noise(4)), scene.node("Math", operation="ROUND")
    scene.link(node.outputs["Alpha"], math.inputs[0])
    return node.outputs["Color"], math.outputs[0]


@construction
def alpha_greater_than(scene: Scene) -> Sockets:
    node, math = scene.image(noise(4)), scene.node("Math", operation="GREATER_THAN")
    math.inputs[1].default_value = 0.3
    scene.link(node.outputs["Alpha"], math.inputs[0])
    return node.outputs["Color"], math.outputs[0]


@construction
def clamped_legacy_mix(scene: Scene) -> Sockets:
    mix = scene.node("MixRGB", blend_type="MIX", use_clamp=True)
    mix.inputs["Fac"].default_value = 0.6
    mix.inputs["Color2"].default_value = (3.0, 0.2, 0.5, 1)
    scene.link(scene.image().outputs["Color"], mix.inputs["Color1"])
    return mix.outputs["Color"], None


def udim(scene: Scene, *numbers: int) -> bpy.types.Node:
    """An image node with tiles of 7 x 5 pixels with alpha."""
    for number in numbers:
        scenes.write_png(scene.folder / f"t.{number}.png", np.random.default_rng(number).permutation(noise(4)))
    image = bpy.data.images.load(str(scene.folder / f"t.{numbers[0]}.png"))
    image.source = "TILED"
    image.filepath = str(scene.folder / "t.<UDIM>.png")
    for number in numbers[1:]:
        image.tiles.new(number)
    return scene.node("TexImage", image=image)


@construction
def tiles_with_gaps(scene: Scene) -> Sockets:
    """Places that no tile covers are magenta."""
    node = udim(scene, 1001, 1002, 1012)
    node.image.pack()  # of files, Cycles loads only the tiles that it takes the mesh to reach, and misses some
    return node.outputs["Color"], node.outputs["Alpha"]


@construction
def packed_tiles(scene: Scene) -> Sockets:
    """What lies between -1 and 0 belongs to the first tile of its row or column."""
    node = udim(scene, 1001, 1002, 1011, 1012)
    node.image.pack()
    node.extension, node.interpolation = "EXTEND", "Closest"
    return node.outputs["Color"], None


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
        (2, np.uint16, "STRAIGHT", False),
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
    assert isinstance(look, Unread) and "unusual" in look.why


@pytest.mark.parametrize(
    ("kind", "space"), [(np.uint16, "ACEScg"), (np.uint16, "Linear Rec.2020"), (np.float32, "sRGB")]
)
@pytest.mark.parametrize("packed", [False, True])
def test_files_that_cycles_decodes_by_itself(scene: Scene, kind: type, space: str, packed: bool) -> None:
    """It does so after the interpolation, and not as Blender does; what is packed it has from Blender."""
    node = scene.image(noise(3, kind), space)
    scene.link(node.outputs["Color"], scene.shader().inputs["Base Color"])
    assert isinstance(read_look(scene.material, TextureCache(), Reading()), Unread)
    if packed:
        node.image.pack()
        check(scene)


@pytest.mark.parametrize("channels", [1, 2, 3, 4])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("mode", ["STRAIGHT", "CHANNEL_PACKED"])
@pytest.mark.parametrize("packed", [False, True])
def test_decal(scene: Scene, channels: int, kind: type, mode: str, packed: bool) -> None:
    """Outside, what has no alpha of its own is transparent too, unless it is a file with a single channel."""
    pixels = noise(channels, kind)
    if channels in (2, 4):
        pixels[:, :, -1] = np.iinfo(kind).max
    node = scene.image(pixels, mode=mode)
    if packed:
        node.image.pack()
    node.extension = "CLIP"
    finish(scene, (node.outputs["Color"], node.outputs["Alpha"]))


@pytest.mark.parametrize("alpha", [False, True])
@pytest.mark.parametrize(
    ("kind", "channels"),
    [(kind, 4) for kind in ("png", "tif", "tga", "webp", "bmp", "jp2", "sgi")] + [("tif", 2), ("tga", 2), ("png", 2)],
)
def test_kinds_of_files_with_alpha(scene: Scene, kind: str, channels: int, alpha: bool) -> None:
    """Read as Cycles reads them, or left to it."""
    pillow = pytest.importorskip("PIL.Image")
    path = scene.folder / f"image.{kind}"
    pixels = pillow.fromarray(noise(channels), "LA" if channels == 2 else "RGBA")
    pixels.save(path, **({"lossless": True, "exact": True} if kind == "webp" else {}))
    node = scene.node("TexImage", image=bpy.data.images.load(str(path)))
    scene.link(node.outputs["Color"], scene.shader().inputs["Base Color"])
    if alpha:
        scene.link(node.outputs["Alpha"], scene.shader().inputs["Alpha"])
    read = isinstance(read_look(scene.material, TextureCache(), Reading()), Look)
    if read:
        check(scene)
    assert read == (channels == 4 and (kind in {"png", "tif", "tga"} or bpy.app.version >= (5, 2)))


# Whether a color is divided by alpha depends on whether Cycles uses the alpha for anything, and it makes one node of
# equal ones: what is not plain is baked. Each of these changes two nodes of one image, whose color and alpha are used.


def check_baked(surface: Surface, wanted: np.ndarray, how: str = "baked") -> None:
    """Alike but for where a pixel of the image ends, and for what is lost on the way through another image."""
    assert [each.how for each in surface.materials] == [how]
    assert (np.abs(seen(surface)[0] - wanted) <= TOLERANCE).all(axis=2).mean() > 0.9


Two = Callable[[Scene, bpy.types.Node, bpy.types.Node], object]


def mapped(scene: Scene, node: bpy.types.Node, scale: float, uv: str = "") -> None:
    mapping, start = scene.node("Mapping"), scene.node("UVMap", uv_map=uv) if uv else scene.node("TexCoord")
    mapping.inputs["Scale"].default_value = (scale,) * 3
    scene.link(start.outputs["UV"], mapping.inputs["Vector"])
    scene.link(mapping.outputs[0], node.inputs["Vector"])


def on_map(scene: Scene, node: bpy.types.Node, kind: str, **settings: str) -> None:
    scene.link(scene.node(kind, **settings).outputs["Vector" if kind == "Attribute" else "UV"], node.inputs["Vector"])


def of_its_own(scene: Scene, node: bpy.types.Node, **settings: str) -> None:
    """Another image of the same file."""
    node.image = bpy.data.images.load(node.image.filepath, check_existing=False)
    node.image.colorspace_settings.name = settings.get("space", "sRGB")
    node.image.alpha_mode = settings.get("mode", "STRAIGHT")


TWO: dict[str, Two] = {
    "equal": lambda scene, one, other: None,
    "extension": lambda scene, one, other: setattr(other, "extension", "CLIP"),
    "interpolation": lambda scene, one, other: setattr(other, "interpolation", "Closest"),
    "projection": lambda scene, one, other: setattr(other, "projection", "BOX"),
    "own mapping": lambda scene, one, other: other.texture_mapping.translation.__setitem__(0, 1.0),
    "equal mappings": lambda scene, one, other: [mapped(scene, each, 2) for each in (one, other)],
    "unlike mappings": lambda scene, one, other: [mapped(scene, one, 2), mapped(scene, other, 3)],
    "mappings of unlike UV maps": lambda scene, *both: [
        mapped(scene, each, 2, name) for each, name in zip(both, ("UVMap", "Second"), strict=True)
    ],
    "two images": lambda scene, one, other: of_its_own(scene, other),
    "two modes": lambda scene, one, other: of_its_own(scene, other, mode="CHANNEL_PACKED"),
    "one packed image": lambda scene, one, other: one.image.pack(),
    "two packed images": lambda scene, one, other: [
        of_its_own(scene, other),
        *(each.image.pack() for each in (one, other)),
    ],
}


@pytest.mark.parametrize("name", TWO)
def test_two_nodes_of_an_image(scene: Scene, name: str) -> None:
    one = scene.image(noise(4))
    other = scene.node("TexImage", image=one.image)
    TWO[name](scene, one, other)
    scene.link(one.outputs["Color"], scene.shader().inputs["Base Color"])
    scene.link(other.outputs["Alpha"], scene.shader().inputs["Roughness"])
    wanted = encode_srgb(bake(scene, one.outputs["Color"], other.outputs["Alpha"]))
    apart = {"two modes", "two packed images"}  # to Cycles they have nothing in common
    check_baked(scene.surface(), wanted, "read" if name in apart else "baked")


def test_alpha_as_color_is_baked(scene: Scene) -> None:
    alpha = scene.image(noise(4)).outputs["Alpha"]
    scene.link(alpha, scene.shader().inputs["Base Color"])
    check_baked(scene.surface(), encode_srgb(bake(scene, alpha, None)))


def in_mix_shader(scene: Scene, alpha: bpy.types.NodeSocket, factor: float) -> None:
    mix, other, output = scene.node("MixShader"), scene.node("BsdfGlossy"), scene.tree.get_output_node("ALL")
    mix.inputs[0].default_value = factor
    scene.link(alpha, other.inputs["Roughness"])
    scene.link(scene.shader().outputs[0], mix.inputs[1 if factor == 0 else 2])
    scene.link(other.outputs[0], mix.inputs[2 if factor == 0 else 1])
    scene.link(mix.outputs[0], output.inputs["Surface"])


def in_math(scene: Scene, alpha: bpy.types.NodeSocket, second: float) -> None:
    math = scene.node("Math", operation="MULTIPLY")
    math.inputs[1].default_value = second
    scene.link(alpha, math.inputs[0])
    scene.link(math.outputs[0], scene.shader().inputs["Metallic"])


def in_emission(scene: Scene, alpha: bpy.types.NodeSocket, strength: float) -> None:
    scene.shader().inputs["Emission Strength"].default_value = strength
    scene.link(alpha, scene.shader().inputs["Emission Color"])


def in_mix(scene: Scene, alpha: bpy.types.NodeSocket, factor: float, number: int, blend: str = "MIX") -> None:
    mix = scene.node("Mix", data_type="RGBA", blend_type=blend)
    mix.inputs["Factor"].default_value = factor
    scene.link(alpha, mix.inputs[number])
    scene.link(mix.outputs[2], scene.shader().inputs["Specular Tint"])


def in_volume(scene: Scene, alpha: bpy.types.NodeSocket) -> None:
    volume = scene.node("VolumePrincipled")
    scene.link(alpha, volume.inputs["Density"])
    scene.link(volume.outputs[0], scene.tree.get_output_node("ALL").inputs["Volume"])


USES: dict[str, Callable[[Scene, bpy.types.NodeSocket], None]] = {
    "times one": lambda scene, alpha: in_math(scene, alpha, 1),
    "times zero": lambda scene, alpha: in_math(scene, alpha, 0),
    "emission off": lambda scene, alpha: in_emission(scene, alpha, 0),
    "first shader": lambda scene, alpha: in_mix_shader(scene, alpha, 0),
    "second shader": lambda scene, alpha: in_mix_shader(scene, alpha, 1),
    "hidden color": lambda scene, alpha: in_mix(scene, alpha, 0, 7),
    "covered color": lambda scene, alpha: in_mix(scene, alpha, 1, 6),
    "multiplied color": lambda scene, alpha: in_mix(scene, alpha, 1, 6, "MULTIPLY"),
    "volume": in_volume,
}


@pytest.mark.parametrize("name", USES)
def test_alpha_that_is_used_elsewhere(scene: Scene, name: str) -> None:
    """Or that Cycles takes for unused, since nothing comes of it."""
    node, output = scene.image(noise(4)), scene.tree.get_output_node("ALL")
    scene.link(node.outputs["Color"], scene.shader().inputs["Base Color"])
    USES[name](scene, node.outputs["Alpha"])
    wanted = encode_srgb(bake(scene, node.outputs["Color"], source(output.inputs["Surface"])))
    check_baked(scene.surface(), wanted)


def on_tube(scene: Scene, node: bpy.types.Node) -> bpy.types.Node:
    node.projection = "TUBE"
    scene.link(scene.node("TexCoord").outputs["Object"], node.inputs["Vector"])
    return node


def on_constant(scene: Scene, node: bpy.types.Node) -> bpy.types.Node:
    vector = scene.node("CombineXYZ")
    vector.inputs["X"].default_value = vector.inputs["Y"].default_value = 0.4
    scene.link(vector.outputs[0], node.inputs["Vector"])
    return node


def enclosed(scene: Scene, node: bpy.types.Node) -> bpy.types.Node:
    """The node in a group that has its outputs."""
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    end, inner = group.nodes.new("NodeGroupOutput"), group.nodes.new("ShaderNodeTexImage")
    inner.image, inner.projection = node.image, "SPHERE"
    for output in inner.outputs:
        group.interface.new_socket(output.name, in_out="OUTPUT", socket_type=output.bl_idname)
    for output, socket in zip(inner.outputs, end.inputs, strict=False):
        group.links.new(output, socket)
    return scene.node("Group", node_tree=group)


@pytest.mark.parametrize("prepare", [on_tube, on_constant, enclosed])
@pytest.mark.parametrize("name", ["times one", "times zero", "volume"])
def test_alpha_that_is_used_beside_what_is_baked(
    scene: Scene, prepare: Callable[[Scene, bpy.types.Node], bpy.types.Node], name: str
) -> None:
    """Only the color is baked; what the alpha is used for is not."""
    node = scene.image(noise(4))
    node.interpolation = "Closest"
    node = prepare(scene, node)
    output = scene.tree.get_output_node("ALL")
    scene.link(node.outputs["Color"], scene.shader().inputs["Base Color"])
    USES[name](scene, node.outputs["Alpha"])
    check_baked(scene.surface(), encode_srgb(bake(scene, node.outputs["Color"], source(output.inputs["Surface"]))))


@pytest.mark.parametrize("constant", [False, True])
def test_alpha_that_is_a_color_on_its_way(scene: Scene, constant: bool) -> None:
    node = scene.image(noise(4))
    if constant:
        node = on_constant(scene, node)
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Color", in_out=way, socket_type="NodeSocketColor")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    group.links.new(start.outputs[0], end.inputs[0])
    passed = scene.node("Group", node_tree=group)
    scene.link(node.outputs["Alpha"], passed.inputs[0])
    scene.link(passed.outputs[0], scene.shader().inputs["Alpha" if constant else "Roughness"])
    scene.link(node.outputs["Color"], scene.shader().inputs["Base Color"])
    check_baked(scene.surface(), encode_srgb(bake(scene, node.outputs["Color"], node.outputs["Alpha"])))


LOBES = ("Subsurface Weight", "Coat Weight", "Sheen Weight", "Anisotropic", "Thin Film Thickness", "Emission Strength")
FED = ("Roughness", "Normal", "Coat Tint", "Sheen Roughness", "Thin Film IOR", *LOBES)


@pytest.mark.parametrize("weight", [0.0, 0.3])
@pytest.mark.parametrize("name", FED)
def test_alpha_in_an_input_of_the_shader(scene: Scene, name: str, weight: float) -> None:
    """Cycles takes it for unused where its lobe has no weight, which is left to it."""
    node, shader, output = scene.image(noise(4)), scene.shader(), scene.tree.get_output_node("ALL")
    for lobe in LOBES:
        shader.inputs[lobe].default_value = weight
    shader.inputs["Emission Color"].default_value = (0, 0, 0, 1)
    scene.link(node.outputs["Color"], shader.inputs["Base Color"])
    scene.link(node.outputs["Alpha"], shader.inputs[name])
    check_baked(scene.surface(), encode_srgb(bake(scene, node.outputs["Color"], source(output.inputs["Surface"]))))


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


def as_unlit(scene: Scene, see_through: bool) -> None:
    """As the glTF importer builds unlit materials."""
    node, emission = scene.image(noise(4), mode="CHANNEL_PACKED"), scene.node("Emission")
    transparent, mix = scene.node("BsdfTransparent"), scene.node("MixShader")
    scene.link(node.outputs["Color"], emission.inputs["Color"])
    scene.link(scene.node("LightPath").outputs["Is Camera Ray"], mix.inputs[0])
    scene.link(transparent.outputs[0], mix.inputs[1])
    scene.link(emission.outputs[0], mix.inputs[2])
    if see_through:
        inner, mix = mix, scene.node("MixShader")
        scene.link(node.outputs["Alpha"], mix.inputs[0])
        scene.link(transparent.outputs[0], mix.inputs[1])
        scene.link(inner.outputs[0], mix.inputs[2])
    scene.tree.nodes.remove(scene.shader())
    scene.link(mix.outputs[0], scene.tree.get_output_node("ALL").inputs["Surface"])


@pytest.mark.parametrize("see_through", [False, True])
def test_unlit(scene: Scene, see_through: bool) -> None:
    as_unlit(scene, see_through)
    node = next(node for node in scene.tree.nodes if node.type == "TEX_IMAGE")
    shown, opacity = seen(scene.surface())
    alpha = node.outputs["Alpha"]
    np.testing.assert_allclose(shown, encode_srgb(bake(scene, node.outputs["Color"], alpha)), rtol=0, atol=TOLERANCE)
    wanted = bake(scene, alpha, None, as_number=True)[:, :, 0] if see_through else np.ones_like(opacity)
    np.testing.assert_allclose(opacity, wanted, rtol=0, atol=TOLERANCE)


def grouped(scene: Scene, kind: str, links: bool = True) -> bpy.types.Node:
    """A group that hands on one value of a kind of socket; or that has a reroute before its output, fed by nothing."""
    tree = bpy.data.node_groups.new("group", "ShaderNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Value", in_out=way, socket_type=kind)
    start = tree.nodes.new("NodeGroupInput" if links else "NodeReroute")
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(start.outputs[0], output.inputs[0])
    if not links:
        output.inputs[0].default_value = (0.5, 0.1, 0.4, 1)
    return scene.node("Group", node_tree=tree)


def empty_reroute(scene: Scene) -> bpy.types.NodeSocket:
    return scene.tree.nodes.new("NodeReroute").outputs[0]


def muted(scene: Scene, start: bpy.types.NodeSocket | None = None) -> bpy.types.NodeSocket:
    gamma = scene.node("Gamma", mute=True)
    gamma.inputs["Color"].default_value = (0.2, 0.4, 0.6, 1)
    if start is not None:
        scene.link(start, gamma.inputs["Color"])
    return gamma.outputs[0]


def rerouted(scene: Scene, start: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    reroute = scene.tree.nodes.new("NodeReroute")
    scene.link(start, reroute.inputs[0])
    return reroute.outputs[0]


def into_group(scene: Scene, start: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    group = grouped(scene, "NodeSocketColor")
    group.inputs[0].default_value = (0.7, 0.2, 0.3, 1)
    scene.link(start, group.inputs[0])
    return group.outputs[0]


ENDS: dict[str, Callable[[Scene], bpy.types.NodeSocket]] = {
    "reroute": empty_reroute,
    "muted node": muted,
    "muted node after a reroute": lambda scene: muted(scene, empty_reroute(scene)),
    "reroute after a muted node": lambda scene: rerouted(scene, muted(scene)),
    "muted node without a way through": lambda scene: scene.node("RGB", mute=True).outputs[0],
    "reroute in a group": lambda scene: grouped(scene, "NodeSocketColor", links=False).outputs[0],
    "reroute before a group": lambda scene: into_group(scene, empty_reroute(scene)),
    "muted node before a group": lambda scene: into_group(scene, muted(scene)),
}


@pytest.mark.parametrize("name", ENDS)
def test_link_that_ends_in_nothing(scene: Scene, name: str) -> None:
    """Blenders do not agree on whose own value counts then."""
    emission = scene.node("Emission")
    emission.inputs["Color"].default_value = (0.1, 0.9, 0.3, 1)
    scene.link(ENDS[name](scene), emission.inputs["Color"])
    scene.link(emission.outputs[0], scene.tree.get_output_node("ALL").inputs["Surface"])
    shown, _ = seen(scene.surface())
    np.testing.assert_allclose(shown, encode_srgb(emitted(scene)), rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("kind", ["NodeSocketInt", "NodeSocketBool", "NodeSocketFloat"])
def test_alpha_through_a_group_of_whole_numbers(scene: Scene, kind: str) -> None:
    """Which round what they are given before Blender 5.2."""
    group, shader = grouped(scene, kind), scene.shader()
    scene.link(scene.image(noise(4)).outputs["Alpha"], group.inputs[0])
    scene.link(group.outputs[0], shader.inputs["Alpha"])
    _, opacity = seen(prepare_surface(mesh_arrays([scene.object], "asset", Reading(bake=4096)), BVHQuery))
    wanted = bake(scene, group.outputs[0], None, as_number=True)[:, :, 0]
    np.testing.assert_allclose(opacity, wanted, rtol=0, atol=2 * TOLERANCE)


@pytest.mark.parametrize("strength", [1.0, 0.4, 3.0])
def test_emission(scene: Scene, strength: float) -> None:
    """Baked as it is, strength and all."""
    emission, output = scene.node("Emission"), scene.tree.get_output_node("ALL")
    emission.inputs["Strength"].default_value = strength
    scene.link(scene.image().outputs["Color"], emission.inputs["Color"])
    scene.link(emission.outputs[0], output.inputs["Surface"])
    shown, _ = seen(scene.surface())
    np.testing.assert_allclose(shown, encode_srgb(emitted(scene)), rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("muted", [False, True])
@pytest.mark.parametrize("strength", [1.0, 0.4])
def test_principled_that_only_shines(scene: Scene, strength: float, muted: bool) -> None:
    """Its base color is plain black, as a muted link leaves it: its emission is what the artist sees."""
    shader = scene.shader()
    shader.inputs["Base Color"].default_value = (0, 0, 0, 1)
    shader.inputs["Emission Strength"].default_value = strength
    scene.link(scene.image().outputs["Color"], shader.inputs["Emission Color"])
    if muted:
        scene.tree.links.new(scene.node("VertexColor").outputs["Color"], shader.inputs["Base Color"]).is_muted = True
    surface = scene.surface()
    shown, _ = seen(surface)
    np.testing.assert_allclose(shown, encode_srgb(emitted(scene)), rtol=0, atol=TOLERANCE)
    assert [image.role for image in surface.materials[0].images] == ["base color"]


@pytest.mark.parametrize(("base", "emission", "strength"), [(0.2, 1.0, 1.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_emission_beside_a_base_color_does_not_count(
    scene: Scene, base: float, emission: float, strength: float
) -> None:
    """Nor does one that is black or off."""
    shader = scene.shader()
    shader.inputs["Base Color"].default_value = (base, base, base, 1)
    shader.inputs["Emission Color"].default_value = (emission, emission, emission, 1)
    shader.inputs["Emission Strength"].default_value = strength
    shown, _ = seen(scene.surface())
    np.testing.assert_allclose(shown, encode_srgb(np.full((SIDE, SIDE, 3), base)), rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("first", ["transparent", "principled"])
@pytest.mark.parametrize("varies", [False, True])
def test_mixed_with_transparent(scene: Scene, first: str, varies: bool) -> None:
    """Alpha is how much of the other shader there is, on either side of the mix."""
    node, mix, shader = scene.image(noise(4)), scene.node("MixShader"), scene.shader()
    scene.link(node.outputs["Color"], shader.inputs["Base Color"])
    sides = [scene.node("BsdfTransparent").outputs[0], shader.outputs[0]]
    for number, side in enumerate(sides if first == "transparent" else sides[::-1], 1):
        scene.link(side, mix.inputs[number])
    if varies:
        scene.link(node.outputs["Alpha"], mix.inputs[0])
    else:
        mix.inputs[0].default_value = 0.3
    scene.link(mix.outputs[0], scene.tree.get_output_node("ALL").inputs["Surface"])
    shown, opacity = seen(scene.surface())
    alpha = node.outputs["Alpha"]
    wanted = encode_srgb(bake(scene, node.outputs["Color"], alpha if varies else None))
    np.testing.assert_allclose(shown, wanted, rtol=0, atol=TOLERANCE)
    factor = bake(scene, alpha, None, as_number=True)[:, :, 0] if varies else np.full_like(opacity, 0.3)
    np.testing.assert_allclose(opacity, factor if first == "transparent" else 1 - factor, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("first", ["transparent", "principled"])
def test_what_a_transparent_shader_covers_has_a_color(scene: Scene, first: str) -> None:
    """As where it is baked; the factor is a node's."""
    mix, shader, factor = scene.node("MixShader"), scene.shader(), scene.node("Value")
    shader.inputs["Base Color"].default_value = (0.1, 0.6, 0.2, 1)
    sides = [scene.node("BsdfTransparent").outputs[0], shader.outputs[0]]
    for number, side in enumerate(sides if first == "transparent" else sides[::-1], 1):
        scene.link(side, mix.inputs[number])
    factor.outputs[0].default_value = 0 if first == "transparent" else 1
    scene.link(factor.outputs[0], mix.inputs[0])
    scene.link(mix.outputs[0], scene.tree.get_output_node("ALL").inputs["Surface"])
    shown, opacity = seen(scene.surface())
    np.testing.assert_allclose(shown[0, 0], encode_srgb(np.array([0.1, 0.6, 0.2])), rtol=0, atol=TOLERANCE)
    assert (opacity == 0).all()


def test_alpha_above_one_in_a_mix(scene: Scene) -> None:
    """Counts as one, as a render shows: the mix has the factor's share of what is opaque."""
    mix, shader, double = scene.node("MixShader"), scene.shader(), scene.node("Math", operation="MULTIPLY")
    double.inputs[1].default_value = 2
    scene.link(scene.image(noise(4)).outputs["Alpha"], double.inputs[0])
    scene.link(double.outputs[0], shader.inputs["Alpha"])
    mix.inputs[0].default_value = 0.4
    scene.link(scene.node("BsdfTransparent").outputs[0], mix.inputs[1])
    scene.link(shader.outputs[0], mix.inputs[2])
    scene.link(mix.outputs[0], scene.tree.get_output_node("ALL").inputs["Surface"])
    _, opacity = seen(scene.surface())
    wanted = np.clip(bake(scene, double.outputs[0], None, as_number=True)[:, :, 0], 0, 1) * 0.4
    np.testing.assert_allclose(opacity, wanted, rtol=0, atol=TOLERANCE)
    assert opacity.max() == pytest.approx(0.4)


USD = """#usda 1.0
(
  defaultPrim = "root"
  upAxis = "Z"
  metersPerUnit = 1
)
def Xform "root" {{
  def Mesh "square" (prepend apiSchemas = ["MaterialBindingAPI"]) {{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    texCoord2f[] primvars:Bake = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
    rel material:binding = </root/M>
  }}
  def Material "M" {{
    token outputs:surface.connect = </root/M/S.outputs:surface>
    def Shader "S" {{
      uniform token info:id = "UsdPreviewSurface"
      color3f inputs:diffuseColor.connect = </root/M/T.outputs:rgb>
      float inputs:opacity.connect = </root/M/T.outputs:a>
      {surface}
      token outputs:surface
    }}
    def Shader "T" {{
      uniform token info:id = "UsdUVTexture"
      asset inputs:file = @./image.png@
      float2 inputs:st.connect = </root/M/X.outputs:result>
      token inputs:wrapS = "mirror"
      token inputs:wrapT = "mirror"
      {texture}
      float3 outputs:rgb
      float outputs:a
    }}
    def Shader "X" {{
      uniform token info:id = "UsdTransform2d"
      float2 inputs:in.connect = </root/M/P.outputs:result>
      float inputs:rotation = 30
      float2 inputs:scale = (2, 3)
      float2 inputs:translation = (0.1, 0.2)
      float2 outputs:result
    }}
    def Shader "P" {{
      uniform token info:id = "UsdPrimvarReader_float2"
      string inputs:varname = "Bake"
      float2 outputs:result
    }}
  }}
}}
"""
SCALE_AND_BIAS = "float4 inputs:scale = (0.5, 0.6, 0.7, 0.9)\n      float4 inputs:bias = (0.1, 0, 0, 0.05)"
OBJ = """mtllib square.mtl
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl M
f 1/1 2/2 3/3 4/4
"""
MTL = """newmtl M
Kd 0.5 0.2 0.1
map_Kd -s 2 3 1 -o 0.1 0.2 0 image.png
"""


def imported(scene: Scene, name: str) -> None:
    """The scene becomes what an importer makes of a file in its folder; the one UV map is the square as it lies."""
    scenes.clear()
    path = str(scene.folder / name)
    if name.endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=path, forward_axis="Y", up_axis="Z")
    else:
        bpy.ops.wm.usd_import(filepath=path)
    scene.object = next(object_ for object_ in bpy.data.objects if object_.type == "MESH")
    scene.material = scene.object.data.materials[0]
    scene.tree = scene.material.node_tree
    bpy.context.view_layer.update()


@pytest.mark.parametrize(
    ("surface", "texture"), [("", ""), ("float inputs:opacityThreshold = 0.4", ""), ("", SCALE_AND_BIAS)]
)
def test_usd(scene: Scene, surface: str, texture: str) -> None:
    scenes.write_png(scene.folder / "image.png", noise(4))
    (scene.folder / "square.usda").write_text(USD.format(surface=surface, texture=texture), encoding="utf-8")
    imported(scene, "square.usda")
    check(scene)


@pytest.mark.parametrize("opacity", ["map_d -s 2 2 1 image.png", "map_d -s 2 3 1 -o 0.1 0.2 0 image.png"])
def test_obj(scene: Scene, opacity: str) -> None:
    """One image of color and opacity, which only the second places alike."""
    scenes.write_png(scene.folder / "image.png", noise(4))
    (scene.folder / "square.obj").write_text(OBJ, encoding="utf-8")
    (scene.folder / "square.mtl").write_text(f"{MTL}{opacity}\n", encoding="utf-8")
    imported(scene, "square.obj")
    shader = scene.shader()
    color, alpha = source(shader.inputs["Base Color"]), source(shader.inputs["Alpha"])
    check_baked(scene.surface(), encode_srgb(bake(scene, color, alpha)))
