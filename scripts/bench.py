# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the time goes: every stage of whole pairs, beside what the tree queries alone cost in the same run.

    python scripts/bench.py [--growth] [--case REFERENCE DISTORTED] [--decimated REFERENCE] [--batch] ...

Without cases it measures generated surfaces. Each pair is scored in a process of its own, as a user would; "whole" is
that process from its start to its end, in floors, "1 core" how many times as long its fields take on one core, and
"step" the longest step of the stepper, building trees apart: between steps the window is drawn, and Esc heard.
The floor is the time of plain Python loops of nearest-point and ray-parity queries on both surfaces, along
the same curve, with the tightest bounds there can be: nothing that asks the trees less can be faster.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

if TYPE_CHECKING:
    from fmqm_addon.metric.fields import Fields
    from fmqm_addon.metric.surface import Surface

DECIMATED_TO = 0.25  # share of the triangles in a decimated copy
GENERATED = (10_000, 100_000, 1_000_000)  # triangles of the growth table
STAGES = ("load", "prepare", "fields", "features", "total")


def main() -> int:
    parser = argparse.ArgumentParser(description="Times of whole pairs by stage, and the floor of the tree queries.")
    parser.add_argument("--case", nargs=2, action="append", default=[], metavar=("REFERENCE", "DISTORTED"))
    parser.add_argument(
        "--decimated", action="append", default=[], metavar="REFERENCE", help="against a decimated copy"
    )
    parser.add_argument(
        "--growth", action="store_true", help="generated surfaces of 10 thousand to 1 million triangles"
    )
    parser.add_argument(
        "--samples", action="store_true", help="a generated surface at 50, 100 and 200 thousand samples"
    )
    parser.add_argument(
        "--decimate",
        action="append",
        default=[],
        metavar="FILE",
        help="processor time of decimate.py --target-fmqm 0.9",
    )
    parser.add_argument("--batch", action="store_true", help="40 pairs with 1 and 2 jobs, and the parent's memory")
    parser.add_argument("--part", nargs="+", help=argparse.SUPPRESS)  # one of PARTS, in a process of its own
    args = parser.parse_args()
    if args.part:
        PARTS[args.part[0]](*args.part[1:])
        return 0
    everything = not (args.case or args.decimated or args.growth or args.samples or args.batch or args.decimate)
    print(
        f"{'pair':34}{'triangles':>10}"
        + "".join(f"{stage:>9}" for stage in STAGES)
        + "    floor  ratio  whole 1 core  step    peak"
    )
    with tempfile.TemporaryDirectory() as folder:
        small = str(Path(folder) / "small.blend")
        small_lod = str(Path(folder) / "small_lod.blend")
        for reference, distorted in args.case:
            measure(Path(reference).name, reference, distorted)
        for reference in args.decimated:
            part("decimate", reference, small_lod)
            measure(f"{Path(reference).name} decimated", reference, small_lod)
        if args.growth or everything:
            for triangles in GENERATED:
                part("generate", str(triangles), small)
                part("decimate", small, small_lod)
                measure(f"generated {triangles:,}", small, small_lod)
        if args.samples or everything:
            part("generate", str(GENERATED[0]), small)
            part("decimate", small, small_lod)
            for samples in (50_000, 100_000, 200_000):
                measure(f"generated, {samples:,} samples", small, small_lod, samples)
        for path in args.decimate:
            measure_decimation(path)
        if args.batch or everything:
            part("generate", str(GENERATED[0]), small)
            part("decimate", small, small_lod)
            measure_batches(small, small_lod)
    return 0


def part(name: str, *args: str) -> str:
    """Runs one of PARTS in a process of its own, so that this one stays small: a child's peak counts its parent's."""
    command = [sys.executable, str(Path(__file__).resolve()), "--part", name, *args]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1]


def measure(name: str, reference: str, distorted: str, samples: int = 200_000) -> None:
    """Scores a pair in processes of their own and prints a row: seconds by stage, floor, ratios, peak memory."""
    flags = ["--quiet", "--samples", str(samples), "--json", "-"]
    command = [sys.executable, str(ROOT / "scripts" / "score.py"), reference, distorted, *flags]
    pair, whole, peak = run_score(command)
    if pair["error"]:
        print(f"{name:34}{pair['error']}")
        return
    floor, triangles = map(float, part("floor", reference, distorted, str(samples)).split())
    longest = float(part("steps", reference, distorted, str(samples)))
    seconds = pair["seconds"]
    alone = float("nan")
    if hasattr(os, "sched_setaffinity"):
        cores = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {min(cores)})
        try:
            alone = run_score(command)[0]["seconds"]["fields"] / seconds["fields"]
        finally:
            os.sched_setaffinity(0, cores)
    numbers = "".join(f"{seconds[stage]:9.2f}" for stage in STAGES)
    ratios = f"{seconds['total'] / floor:7.2f}{whole / floor:7.2f}{alone:7.2f}{longest:6.2f}"
    print(f"{name:34}{triangles:10.0f}{numbers}{floor:9.2f}{ratios}{peak:6.2f} GB", flush=True)


def run_score(command: list[str]) -> tuple[dict[str, Any], float, float]:
    """The record of the only pair, seconds from start to end, and the peak memory in GB."""
    with tempfile.TemporaryFile() as out:
        began = time.perf_counter()
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.DEVNULL)
        _, status, usage = os.wait4(process.pid, 0)
        whole = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        return json.load(out)["pairs"][0], whole, usage.ru_maxrss / 2**20  # kilobytes on Linux


def measure_decimation(path: str) -> None:
    """Prints the processor time of a whole search for the fewest triangles."""
    command = [sys.executable, str(ROOT / "scripts" / "decimate.py"), path, "--target-fmqm", "0.9", "--quiet"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    seconds, code = usage.ru_utime + usage.ru_stime, process.returncode
    print(f"{Path(path).name} decimated to 0.9: {seconds:.1f} s of processors, exit code {code}", flush=True)


def measure_batches(reference: str, distorted: str) -> None:
    """Prints what a second job gains, and what more pairs cost the parent of the jobs."""
    middling = ["--samples", "20000", "--patches", "100"]
    tiny = ["--samples", "640", "--patches", "20", "--color-units", "5"]
    times = [run_batch(reference, distorted, 40, jobs, middling)[0] for jobs in (1, 2)]
    print(f"40 pairs: {times[0]:.1f} s with 1 job, {times[1]:.1f} s with 2: {times[0] / times[1]:.2f} times faster")
    few, many = (run_batch(reference, distorted, pairs, 2, tiny)[1] for pairs in (40, 200))
    print(f"peak memory of the parent: {few:.1f} MB for 40 pairs, {many:.1f} MB for 200", flush=True)


def run_batch(reference: str, distorted: str, pairs: int, jobs: int, flags: list[str]) -> tuple[float, float]:
    """Wall seconds of a batch, and the peak of its parent's own memory in MB, as Linux tells it."""
    with tempfile.TemporaryDirectory() as folder:
        manifest = Path(folder) / "pairs.json"
        rows = [{"reference": reference, "distorted": distorted, "seed": seed} for seed in range(pairs)]
        manifest.write_text(json.dumps(rows), encoding="utf-8")
        command = [sys.executable, str(ROOT / "scripts" / "score.py"), "--manifest", str(manifest), *flags]
        outputs = ["--jobs", str(jobs), "--json", str(Path(folder) / "all.json"), "--quiet"]
        began = time.perf_counter()
        process = subprocess.Popen([*command, *outputs], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        peak = 0.0
        while process.poll() is None:
            found = re.search(r"VmHWM:\s+(\d+) kB", Path(f"/proc/{process.pid}/status").read_text(encoding="ascii"))
            peak = int(found[1]) / 1000 if found else peak
            time.sleep(0.05)
        if process.returncode:
            raise RuntimeError(f"the batch of {pairs} pairs ended with {process.returncode}")
        return time.perf_counter() - began, peak


def query_floor(reference: str, distorted: str, samples: str) -> None:
    """Prints the seconds of the plain loops on both surfaces, and the reference's triangles."""
    from fmqm_addon.blender.files.load import load_mesh
    from fmqm_addon.blender.scene.bvh import BVHQuery
    from fmqm_addon.metric.evaluation import Evaluation
    from fmqm_addon.metric.geometry import morton_order
    from fmqm_addon.metric.settings import Settings
    from fmqm_addon.metric.surface import prepare_surface

    ref = prepare_surface(load_mesh(reference), BVHQuery)
    dist = prepare_surface(load_mesh(distorted), BVHQuery, ref.frame)
    evaluation = Evaluation(ref, Settings(samples=int(samples)))
    evaluation.prepare().run()
    result = evaluation.compare(dist).run()
    order = morton_order(result.samples.positions)
    points = result.samples.positions[order]
    seconds = plain_loops(ref, points, result.ref, order) + plain_loops(dist, points, result.dist, order)
    print(seconds, len(ref.triangles))


def longest_step(reference: str, distorted: str, samples: str) -> None:
    """Prints the processor seconds of the longest step of a pair, building trees apart."""
    from fmqm_addon.blender.files.load import load_asset
    from fmqm_addon.blender.scene import bvh, node_queries
    from fmqm_addon.comparison.pair import PairOptions, comparing_pair, measurement_of
    from fmqm_addon.metric.settings import Settings

    in_trees = 0.0

    class Timed(bvh.BVHQuery):
        def __init__(self, *args: Any, **flags: Any) -> None:
            nonlocal in_trees
            began = time.thread_time()
            super().__init__(*args, **flags)
            in_trees += time.thread_time() - began

    node_queries.BVHQuery = Timed  # type: ignore[misc]
    loaded, options = (
        [load_asset(path) for path in (reference, distorted)],
        PairOptions(settings=Settings(samples=int(samples))),
    )
    measurement, longest = measurement_of(loaded[0], node_queries.surface_query, options), 0.0
    for stepper in (measurement.prepare(), comparing_pair(measurement, *loaded, options)):
        more = True
        while more:
            began, trees = time.thread_time(), in_trees
            more = stepper.step()
            longest = max(longest, time.thread_time() - began - (in_trees - trees))
    print(longest)


def plain_loops(surface: Surface, points: np.ndarray, fields: Fields, order: np.ndarray) -> float:
    """Seconds for nearest points and crossings of sorted points, one plain call after the other."""
    tree = surface.query._tree  # type: ignore[attr-defined]
    find, cast = tree.find_nearest, tree.ray_cast
    away = points - fields.nearest[order]
    length = np.linalg.norm(away, axis=1)
    bounds = (length * 1.0001 + 1e-6).tolist()
    directions = away / np.maximum(length, 1e-12)[:, None]
    rays, points_list = directions.tolist(), points.tolist()
    began = time.perf_counter()
    for point, bound in zip(points_list, bounds, strict=True):
        find(point, bound)
    for point, ray in zip(points_list, rays, strict=True):
        hit = cast(point, ray)
        while hit[0] is not None:
            x, y, z = hit[0]
            hit = cast((x + 1e-6 * ray[0], y + 1e-6 * ray[1], z + 1e-6 * ray[2]), ray)
    return time.perf_counter() - began


def generate(wanted: str, path: str) -> None:
    """A bumpy torus with a generated texture, as .blend: about so many triangles."""
    import bpy

    from fmqm_addon.blender import arrays

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    around = round((int(wanted) / 4) ** 0.5 * 2)
    rows = around // 2
    u, v = np.meshgrid(np.arange(around) / around, np.arange(rows) / rows, indexing="ij")
    a, b = 2 * np.pi * u, 2 * np.pi * v
    radius = 0.4 + 0.03 * np.sin(9 * a) * np.cos(7 * b) + 0.004 * np.sin(80 * a) * np.sin(60 * b)
    ring = 1 + radius * np.cos(b)
    positions = np.stack([ring * np.cos(a), ring * np.sin(a), radius * np.sin(b)], axis=-1).reshape(-1, 3)
    index = np.arange(around * rows).reshape(around, rows)
    right, up = np.roll(index, -1, 0), np.roll(index, -1, 1)
    quads = np.stack([index, right, np.roll(right, -1, 1), up], axis=-1).reshape(-1, 4)
    corner = np.stack([np.stack([u + i / around, v + j / rows], -1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))], 2)
    mesh = bpy.data.meshes.new("torus")
    arrays.fill(mesh, positions, quads)
    arrays.write(mesh.uv_layers.new(name="UVMap").uv, "vector", corner.astype(np.float32))
    mesh.update(calc_edges=True)
    object_ = bpy.data.objects.new("torus", mesh)
    bpy.context.scene.collection.objects.link(object_)
    image = bpy.data.images.new("noise", 1024, 1024)
    pixels = np.random.default_rng(0).random((64, 64, 4), np.float32).repeat(16, 0).repeat(16, 1)
    arrays.write_pixels(image, pixels)
    image.pack()
    material = bpy.data.materials.new("noise")
    if material.node_tree is None:  # 5.0 and later always have one
        material.use_nodes = True
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    mesh.materials.append(material)
    bpy.ops.wm.save_as_mainfile(filepath=path)


def decimate(reference: str, path: str) -> None:
    """A decimated copy of each mesh, as .blend."""
    import bpy

    from fmqm_addon.blender.files.load import open_file

    open_file(reference)
    meshes = [object_ for object_ in bpy.context.scene.objects if object_.type == "MESH"]
    for object_ in meshes:
        object_.modifiers.new("LOD", "DECIMATE").ratio = DECIMATED_TO
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for object_ in meshes:  # keep the outcome, not the modifier: its own time is not what is measured
        object_.data = bpy.data.meshes.new_from_object(object_.evaluated_get(depsgraph), depsgraph=depsgraph)
        object_.modifiers.clear()
    bpy.ops.wm.save_as_mainfile(filepath=path)


PARTS: dict[str, Callable[..., None]] = {
    "floor": query_floor,
    "steps": longest_step,
    "generate": generate,
    "decimate": decimate,
}


if __name__ == "__main__":
    sys.exit(main())
