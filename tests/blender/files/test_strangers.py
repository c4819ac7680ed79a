# SPDX-License-Identifier: GPL-3.0-or-later
"""What files may have Blender read: regular ones, of strangers only what lies beside them, images within limits."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import bpy
import pytest

from fmqm_addon.blender.access import ANYWHERE, Access
from fmqm_addon.blender.files.libraries import library_names
from fmqm_addon.blender.files.load import load_asset
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.metric.errors import FMQMError, ImageSizeError, MeshError
from tests.blender import scenes
from tests.blender.script import SCORE, noise, score, write_png

STRANGE = Reading(access=Access(confined=True))
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl M\nf 1/1 2/1 3/1\n"
USD_TRIANGLE = (
    'def Mesh "m" {\nint[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]\n'
    "point3f[] points = [(0,0,0), (1,0,0), (0,1,0)]\n}\n"
)


def refusal(path: Path, reading: Reading = Reading()) -> str:  # noqa: B008 - frozen
    """The line with which a file is refused; "" where it is measured."""
    try:
        load_asset(str(path), reading)
    except FMQMError as error:
        assert len(str(error).splitlines()) == 1 and str(path) in str(error)
        return str(error)
    return ""


def png_header(width: int, height: int) -> bytes:
    """A PNG that promises a size and holds next to nothing."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(b"\0")) + chunk(b"IEND", b"")


def save(path: Path, **options: bool) -> Path:
    bpy.ops.wm.save_as_mainfile(filepath=str(path), **options)
    scenes.clear()
    return path


def write_obj(path: Path, name: str, _: str) -> None:
    path.write_text(f"mtllib m.mtl\n{TRIANGLE}")
    (path.parent / "m.mtl").write_text(f"newmtl M\nmap_Kd -s 1 1 1 {name}\n")


def write_obj_library(path: Path, name: str, _: str) -> None:
    path.write_text(f"mtllib \\\n {name}\n{TRIANGLE}")


def gltf(**parts: object) -> str:
    primitive = {"attributes": {"POSITION": 0}}
    plain = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}], "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                       "min": [0, 0, 0], "max": [1, 1, 1]}],
    }  # fmt: skip
    return json.dumps(plain | parts)


def write_gltf_buffer(path: Path, name: str, _: str) -> None:
    path.write_text(gltf(buffers=[{"uri": name, "byteLength": 36}]))


def write_gltf_image(path: Path, name: str, _: str) -> None:
    data = "data:application/octet-stream;base64," + "A" * 48
    path.write_text(gltf(buffers=[{"uri": data, "byteLength": 36}], images=[{"uri": name}]))


def write_usd(path: Path, name: str, kind: str) -> None:
    shader = f'def Shader "I" {{\nuniform token info:id = "UsdUVTexture"\nasset inputs:file = @{name}@\n}}\n'
    texts = {
        "layer": f"(subLayers = [@{name}@])\n{USD_TRIANGLE}",
        "reference": f'def "A" (references = @{name}@</m>) {{}}\n{USD_TRIANGLE}',
        "payload": f'def "A" (payload = @{name}@</m>) {{}}\n{USD_TRIANGLE}',
        "variant": f'def "A" (\nvariants = {{ string v = "a" }}\nprepend variantSets = "v"\n) {{\n'
        f'variantSet "v" = {{ "a" (references = @{name}@</m>) {{}} }}\n}}\n{USD_TRIANGLE}',
        "texture": f'def Material "M" {{\n{shader}}}\n{USD_TRIANGLE}',
    }
    path.write_text(f"#usda 1.0\n{texts[kind]}")


def write_fbx(path: Path, name: str, _: str) -> None:
    """With the path exchanged in what Blender's own exporter writes."""
    scenes.clear()
    image = path.parent / "placeholder_of_a_name.png"
    write_png(image, noise())
    material = bpy.data.materials.new("M")
    material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = bpy.data.images.load(str(image))
    shader = next(each for each in material.node_tree.nodes if each.type == "BSDF_PRINCIPLED")
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    scenes.cube().data.materials.append(material)
    bpy.ops.export_scene.fbx(filepath=str(path), path_mode="STRIP")
    image.unlink()
    data = path.read_bytes()
    old = image.name.encode()
    assert struct.pack("<I", len(old)) + old in data
    spare = len(old) - len(name)
    new = "./" * (spare // 2) + name.replace("/", "//", spare % 2)
    if name.startswith("/"):
        new = "/" * spare + name
    path.write_bytes(data.replace(old, new.encode()))
    scenes.clear()


WRITERS: dict[str, tuple[str, Callable[[Path, str, str], None], str]] = {
    "obj": (".obj", write_obj, ""),
    "mtllib": (".obj", write_obj_library, ""),
    "buffer": (".gltf", write_gltf_buffer, ""),
    "image": (".gltf", write_gltf_image, ""),
    **{kind: (".usda", write_usd, kind) for kind in ("layer", "reference", "payload", "variant", "texture")},
}


def written(folder: Path, kind: str, name: str) -> Path:
    suffix, write, detail = WRITERS[kind]
    folder.mkdir(exist_ok=True)
    path = folder / f"asset{suffix}"
    write(path, name, detail)
    return path


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize(
    "place", ["../../../../../../../../dev/zero", "/dev/zero", "pipe", "link", "/proc/self/status"]
)
def test_only_regular_files_are_opened(tmp_path: Path, kind: str, place: str) -> None:
    """However far away they lie, and wherever links lead; whatever /proc says that it is."""
    folder = tmp_path / "in"
    folder.mkdir()
    os.mkfifo(tmp_path / "pipe")
    (folder / "pipe").symlink_to(tmp_path / "pipe")
    (folder / "link").symlink_to("/dev/zero")
    path = written(folder, kind, place)
    said = refusal(path)
    assert "it names " in said and "a file is wanted" in said


@pytest.mark.parametrize("kind", WRITERS)
@pytest.mark.parametrize(
    "name",
    ["../secret.png", "/etc/hostname", "file:///etc/hostname", "..%2Fsecret.png", "..\\secret.png", "C:\\etc\\hostname",
     "\\\\server\\share\\x.png", "link/secret.png", "linked.png", "../missing.png"],
)  # fmt: skip
def test_strangers_files_name_only_what_lies_beside_them(tmp_path: Path, kind: str, name: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(b"secret")
    (folder / "link").symlink_to("..")
    (folder / "linked.png").symlink_to("../secret.png")
    path = written(folder, kind, name.replace("\\", "\\\\") if kind in {"no"} else name)
    said = refusal(path, STRANGE)
    assert "outside of" in said and "copy the file" in said, said
    assert "outside of" not in refusal(path)


@pytest.mark.parametrize("kind", WRITERS)
def test_what_lies_below_or_in_the_root_is_allowed(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "in"
    (folder / "below").mkdir(parents=True)
    for name, reading in (
        ("below/x.png", STRANGE),
        ("below/../x.png", STRANGE),
        ("../x.png", Reading(access=Access(True, str(tmp_path)))),
    ):
        assert "outside" not in refusal(written(folder, kind, name), reading)


def test_a_link_to_elsewhere_is_no_asset_of_strangers(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "other.obj").write_text(TRIANGLE)
    (tmp_path / "in" / "asset.obj").symlink_to("../other.obj")
    assert "it is a link to" in refusal(tmp_path / "in" / "asset.obj", STRANGE)
    assert refusal(tmp_path / "in" / "asset.obj") == ""


def test_fbx(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "secret.png").write_bytes(b"secret")
    path = tmp_path / "in" / "asset.fbx"
    for name, words in (
        ("../secret.png", "outside of"),
        ("../missing.png", "outside of"),
        ("/etc/hostname", "outside of"),
    ):
        write_fbx(path, name, "")
        assert words in refusal(path, STRANGE), name
        assert words not in refusal(path)
    write_fbx(path, "/dev/zero", "")
    assert "a file is wanted" in refusal(path)


def test_shared_case(shared_data: Path) -> None:
    path = shared_data / "cases" / "security" / "buf_zero.gltf"
    assert "/dev/zero; a file is wanted, not a pipe or a device" in refusal(path)
    done = score(path, path, "--quiet")
    assert done.returncode == 1 and done.stderr.count("\n") == 1 and "Traceback" not in done.stderr


@pytest.mark.parametrize("compress", [False, True])
def test_libraries(tmp_path: Path, compress: bool) -> None:
    """They are opened while Blender loads, compressed or not; and so are those that they link themselves."""
    folder = tmp_path / "in"
    folder.mkdir()
    scenes.cube("Linked")
    bpy.data.libraries.write(str(tmp_path / "lib.blend"), set(bpy.data.objects))
    scenes.clear()
    with bpy.data.libraries.load(str(tmp_path / "lib.blend"), link=True) as (_, wanted):
        wanted.objects = ["Linked"]
    bpy.context.scene.collection.objects.link(wanted.objects[0])
    path = save(folder / "asset.blend", compress=compress)
    assert [name.removeprefix("//") for name in library_names(str(path))] in (
        [str(tmp_path / "lib.blend")],
        ["../lib.blend"],
    )
    assert "outside of" in refusal(path, STRANGE)
    assert refusal(path) == ""
    assert refusal(path, Reading(access=Access(True, str(tmp_path)))) == ""
    (tmp_path / "lib.blend").unlink()
    os.mkfifo(tmp_path / "lib.blend")
    assert "not a pipe" in refusal(path)


def tree_of(kind: str) -> tuple[bpy.types.NodeTree, bpy.types.Node, bpy.types.Node]:
    """A node tree as a cube's modifier, a node in it, and its output."""
    tree = bpy.data.node_groups.new("G", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    scenes.cube().modifiers.new("N", "NODES").node_group = tree
    return tree, tree.nodes.new(kind), tree.nodes.new("NodeGroupOutput")


IMPORTS = sorted(name for name in dir(bpy.types) if name.startswith("GeometryNodeImport"))


def test_import_nodes_are_known() -> None:
    assert [name.removeprefix("GeometryNodeImport") for name in IMPORTS] == ["CSV", "OBJ", "PLY", "STL", "Text", "VDB"]


@pytest.mark.parametrize("kind", IMPORTS)
@pytest.mark.parametrize("linked", [False, True])
def test_import_nodes_read_nothing(tmp_path: Path, kind: str, linked: bool) -> None:
    """They would at a pipe for ever, already while the file is loaded."""
    tree, node, output = tree_of(kind)
    join = tree.nodes.new("GeometryNodeJoinGeometry")
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], join.inputs[0])
    tree.links.new(join.outputs[0], output.inputs[0])
    made = node.outputs[0]
    if kind.endswith("Text"):
        curves = tree.nodes.new("GeometryNodeStringToCurves")
        tree.links.new(made, curves.inputs["String"])
        made = curves.outputs[0]
    tree.links.new(made, join.inputs[0])
    far = tmp_path / "far" / "off"
    far.mkdir(parents=True)
    node.inputs[0].default_value = str(far / "none")
    path = tmp_path / "asset.blend"
    if linked:
        bpy.data.libraries.write(str(tmp_path / "lib.blend"), {tree})
        object_ = bpy.data.objects[0]
        object_.modifiers.clear()
        bpy.data.node_groups.remove(tree)
        with bpy.data.libraries.load(str(tmp_path / "lib.blend"), link=True) as (_, wanted):
            wanted.node_groups = ["G"]
        object_.modifiers.new("N", "NODES").node_group = wanted.node_groups[0]
    save(path)
    os.mkfifo(far / "none")
    found = load_asset(str(path))
    assert len(found.mesh.triangles) == 12
    told = [warning for warning in found.mesh.warnings if "are not evaluated" in warning]
    assert len(told) == 1 and "Import" in told[0]


HUGE = (40000, 40000)


def huge_image(folder: Path, packed: bool = False) -> bpy.types.Image:
    (folder / "huge.png").write_bytes(png_header(*HUGE))
    image = bpy.data.images.load(str(folder / "huge.png"))
    if packed:
        image.pack()
    return image


def shows(kind: str) -> Callable[[bpy.types.Image], None]:
    """A material whose base color is a node's."""

    def build(image: bpy.types.Image) -> None:
        material = bpy.data.materials.new("M")
        material.use_nodes = True
        node = material.node_tree.nodes.new(kind)
        node.image = image
        shader = next(each for each in material.node_tree.nodes if each.type == "BSDF_PRINCIPLED")
        material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        scenes.cube().data.materials.append(material)

    return build


def textured(image: bpy.types.Image) -> bpy.types.Texture:
    texture = bpy.data.textures.new("T", "IMAGE")
    texture.image = image
    return texture


def displaced(image: bpy.types.Image) -> None:
    scenes.cube().modifiers.new("D", "DISPLACE").texture = textured(image)


def warped(image: bpy.types.Image) -> None:
    modifier = scenes.cube().modifiers.new("W", "WARP")
    modifier.texture = textured(image)


def by_nodes(image: bpy.types.Image) -> None:
    tree, node, output = tree_of("GeometryNodeImageTexture")
    node.inputs["Image"].default_value = image
    move = tree.nodes.new("GeometryNodeSetPosition")
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], move.inputs[0])
    tree.links.new(node.outputs["Color"], move.inputs["Offset"])
    tree.links.new(move.outputs[0], output.inputs[0])


WAYS: dict[str, Callable[[bpy.types.Image], None]] = {
    "image": shows("ShaderNodeTexImage"),
    "environment": shows("ShaderNodeTexEnvironment"),
    "nodes": by_nodes,
    "displace": displaced,
    "warp": warped,
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("packed", [False, True])
def test_images_are_within_limits_whatever_shows_them(tmp_path: Path, way: str, packed: bool) -> None:
    scenes.clear()
    WAYS[way](huge_image(tmp_path, packed))
    path = save(tmp_path / "asset.blend")
    with pytest.raises(ImageSizeError, match="promises 40000 x 40000"):
        load_asset(str(path))
    assert not [block for block in bpy.data.images if block.has_data]


def test_what_only_lights_the_scene_is_not_decoded(tmp_path: Path) -> None:
    scenes.clear()
    world = bpy.data.worlds.new("W")
    world.use_nodes = True
    world.node_tree.nodes.new("ShaderNodeTexEnvironment").image = huge_image(tmp_path)
    bpy.context.scene.world = world
    scenes.cube()
    assert refusal(save(tmp_path / "asset.blend")) == ""


@pytest.mark.parametrize("way", WAYS)
def test_images_without_pixels_are_errors(tmp_path: Path, way: str) -> None:
    """Of a size that is allowed, and broken."""
    scenes.clear()
    (tmp_path / "broken.png").write_bytes(png_header(64, 64)[:40])
    WAYS[way](bpy.data.images.load(str(write_png(tmp_path / "good.png", noise()))))
    bpy.data.images[0].filepath = str(tmp_path / "broken.png")
    path = save(tmp_path / "asset.blend")
    with pytest.raises(MeshError, match="broken"):
        load_asset(str(path))


def test_one_tile_or_frame_is_enough(tmp_path: Path) -> None:
    scenes.clear()
    write_png(tmp_path / "x.1001.png", noise())
    (tmp_path / "x.1002.png").write_bytes(png_header(*HUGE))
    image = bpy.data.images.load(str(tmp_path / "x.1001.png"))
    WAYS["displace"](image)
    image.source = "SEQUENCE"
    with pytest.raises(ImageSizeError):
        load_asset(str(save(tmp_path / "asset.blend")))


def test_fonts_and_caches_of_blend_files(tmp_path: Path) -> None:
    """Whatever else a .blend names, before it is evaluated: text objects would open their fonts."""
    scenes.clear()
    folder = tmp_path / "in"
    folder.mkdir()
    source = Path(bpy.utils.system_resource("DATAFILES")) / "fonts"
    found = next(source.glob("*.woff2"))
    (tmp_path / "font.woff2").write_bytes(found.read_bytes())
    curve = bpy.data.curves.new("C", "FONT")
    curve.body, curve.font = "A", bpy.data.fonts.load(str(tmp_path / "font.woff2"))
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("C", curve))
    path = save(folder / "asset.blend")
    assert "outside of" in refusal(path, STRANGE)
    (tmp_path / "font.woff2").unlink()
    os.mkfifo(tmp_path / "font.woff2")
    assert "not a pipe" in refusal(path)


def test_bakes_on_disk(tmp_path: Path) -> None:
    scenes.clear()
    tree_of("GeometryNodeBake")
    bpy.context.view_layer.update()
    bpy.data.objects[0].modifiers[0].bake_directory = "/etc"
    path = save(tmp_path / "asset.blend")
    assert "outside of" in refusal(path, STRANGE)


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory as Linux has them")
@pytest.mark.parametrize("way", WAYS)
def test_no_number_where_there_is_no_memory(tmp_path: Path, way: str) -> None:
    """An image of 8192 x 8192 that decodes to 268 MB, in a process that has less than that left."""
    scenes.clear()
    image = bpy.data.images.new("I", 8192, 8192)
    image.generated_color = (1, 0.5, 0.2, 1)
    image.filepath_raw, image.file_format = str(tmp_path / "large.png"), "PNG"
    image.save()
    bpy.data.images.remove(image)
    WAYS[way](bpy.data.images.load(str(tmp_path / "large.png")))
    path = save(tmp_path / "asset.blend")
    code = (
        "import resource, sys; import bpy; from pathlib import Path\n"
        f"sys.path.insert(0, {str(SCORE.parents[1])!r})\n"
        "from fmqm_addon.blender.files.load import load_asset\nfrom fmqm_addon.metric.errors import FMQMError\n"
        "bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)\n"
        "pages = int(Path('/proc/self/statm').read_text().split()[0]) * 4096\n"
        "resource.setrlimit(resource.RLIMIT_AS, (pages + 200_000_000,) * 2)\n"
        "try:\n    load_asset(sys.argv[1])\nexcept FMQMError as error:\n    print('REFUSED', error)\n"
        "except MemoryError:\n    print('REFUSED')\nelse:\n    print('NUMBER')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)], capture_output=True, text=True, timeout=600, check=False
    )
    assert "REFUSED" in done.stdout, done.stdout + done.stderr[-500:]


def test_the_script_watches_strangers_files(tmp_path: Path) -> None:
    """In a worker, which gets the flags; a root of their own allows what lies above."""
    folder = tmp_path / "in"
    folder.mkdir()
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"
    (folder / "plain.obj").write_text(corners)
    (folder / "naming.obj").write_text(f"mtllib ../m.mtl\n{corners}")
    pair = (folder / "plain.obj", folder / "naming.obj", "--quiet", "--samples", 2000, "--patches", 10, "--untrusted")
    refused = score(*pair)
    assert refused.returncode == 1
    assert "it names ../m.mtl, which is outside of" in refused.stderr and "--asset-root" in refused.stderr
    assert score(*pair, "--asset-root", tmp_path).returncode == 0
    assert score(*pair[:-1], "--asset-root", tmp_path).returncode == 2


def test_access_by_default() -> None:
    assert ANYWHERE == Access(False, "")
