# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds a textured asset and a damaged LOD of it, scores the pair and draws what was compared.

    python scripts/demo.py [--out out/demo] [--only-build]

Everything is made here, from formulas and a fixed seed: a lidded porcelain urn of 36,000 triangles with a
1024 x 1024 texture, and its LOD with 6 % of the triangles (Decimate, collapse) and a JPEG of quality 10.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from fmqm_addon.cli.process import require_bpy, reserve_stdout
from fmqm_addon.metric.errors import FMQMError
from scripts.urn import Outline, build_urn, outline, paint_texture

try:
    require_bpy()
except FMQMError as reason:
    sys.exit(f"demo.py: {reason}")
import bpy

from fmqm_addon.blender import arrays

LOD_RATIO = 0.06
LOD_JPEG_QUALITY = 10


def save_picture(pixels: NDArray[np.float32], path: Path, file_format: str, quality: int) -> bpy.types.Image:
    """Saves (H, W, 3) pixels, row 0 at the bottom, and loads what the file holds."""
    height, width = pixels.shape[:2]
    canvas = bpy.data.images.new(path.stem, width, height)
    rgba = np.ones((height, width, 4), np.float32)
    rgba[..., :3] = pixels
    arrays.write_pixels(canvas, rgba)
    canvas.file_format = file_format
    canvas.save(filepath=str(path), quality=quality)
    bpy.data.images.remove(canvas)
    return bpy.data.images.load(str(path))


def build_object(line: Outline) -> bpy.types.Object:
    """The urn in the scene, without a material."""
    vertices, faces, uv = build_urn(line)
    mesh = bpy.data.meshes.new("urn")
    mesh.from_pydata(vertices.tolist(), [], faces)
    arrays.write(mesh.uv_layers.new(name="UVMap").uv, "vector", uv.astype(np.float32))
    mesh.shade_smooth()
    urn = bpy.data.objects.new("urn", mesh)
    bpy.context.scene.collection.objects.link(urn)
    return urn


def set_texture(urn: bpy.types.Object, image: bpy.types.Image) -> None:
    material = bpy.data.materials.new(image.name)
    if material.node_tree is None:  # 5.0 and later always have one
        material.use_nodes = True
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    urn.data.materials.clear()
    urn.data.materials.append(material)


def export(path: Path) -> None:
    """The scene as .glb, modifiers applied."""
    bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB", export_apply=True)


def build_pair(folder: Path) -> tuple[Path, Path]:
    """Writes the reference and its LOD, and returns their paths."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    line = outline()
    pixels = paint_texture(line)
    reference, lod = folder / "urn.glb", folder / "urn_lod.glb"
    urn = build_object(line)
    set_texture(urn, save_picture(pixels, folder / "urn.png", "PNG", 100))
    export(reference)
    decimate = urn.modifiers.new("LOD", "DECIMATE")
    decimate.ratio = LOD_RATIO
    set_texture(urn, save_picture(pixels, folder / "urn_lod.jpg", "JPEG", LOD_JPEG_QUALITY))
    export(lod)
    return reference, lod


def main() -> int:
    parser = argparse.ArgumentParser(description="Build a demo asset and its LOD, score them, draw what was compared.")
    parser.add_argument(
        "--out", type=Path, default=Path("out/demo"), help="folder for the files (default: %(default)s)"
    )
    parser.add_argument("--only-build", action="store_true", help="build the two assets, do not score them")
    args = parser.parse_args()
    folder = args.out.resolve()
    out = reserve_stdout()  # exporters print
    try:
        folder.mkdir(parents=True, exist_ok=True)
        reference, lod = build_pair(folder)
    except (OSError, RuntimeError) as error:
        print(f"demo.py: {error}", file=sys.stderr)
        return 1
    print(f"built {reference}\n      {lod}", file=out, flush=True)
    if args.only_build:
        return 0
    outputs = ["--json", str(folder / "score.json"), "--picture", str(folder / "demo.png")]
    scored = subprocess.run(
        [sys.executable, str(ROOT / "scripts" / "score.py"), str(reference), str(lod), *outputs], stdout=out
    )
    return 0 if scored.returncode == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
