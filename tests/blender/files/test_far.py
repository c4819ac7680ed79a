# SPDX-License-Identifier: GPL-3.0-or-later
"""Text files in map coordinates: what single precision would lose is kept."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fmqm_addon.blender.files.far import offset_of
from fmqm_addon.blender.files.load import load_asset
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.comparison.pair import PairOptions, comparing_pair, measurement_of
from fmqm_addon.metric.settings import Settings
from tests.blender.script import noise, write_png

PLACE = np.array([448_000.0, 5_411_000.0, 120.0])
MATERIAL = "newmtl skin\nKd 0.2 0.7 0.4\nmap_Kd made/image.png\n"
# As files hold them: meters with millimeters.
CORNERS = np.array([(x, y, z) for x in (0, 0.123) for y in (0, 0.457) for z in (0, 0.789)]).round(3)
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def obj(folder: Path, place: np.ndarray, name: str) -> str:
    lines = ["mtllib skin.mtl", "o one"]
    lines += ["v " + " ".join(f"{value:.3f}" for value in corner + place) for corner in CORNERS]
    lines += ["vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1", "usemtl skin"]
    for number, face in enumerate(FACES):
        lines += ["o two"] * (number == 3)
        lines.append("f " + " ".join(f"{vertex + 1}/{corner + 1}" for corner, vertex in enumerate(face)))
    path = folder / f"{name}.obj"
    path.write_text("\n".join(lines) + "\n")
    (folder / "skin.mtl").write_text(MATERIAL)
    (folder / "made").mkdir(exist_ok=True)
    write_png(folder / "made" / "image.png", noise(4))
    return str(path)


def ply(folder: Path, place: np.ndarray, name: str, kind: str = "double") -> str:
    header = ["ply", "format ascii 1.0", f"element vertex {len(CORNERS)}", "property uchar red", "property uchar green"]
    header += ["property uchar blue", *(f"property {kind} {axis}" for axis in "xyz")]
    header += [f"element face {len(FACES)}", "property list uchar int vertex_indices", "end_header"]
    lines = ["200 100 50 " + " ".join(f"{value:.3f}" for value in corner + place) for corner in CORNERS]
    lines += ["4 " + " ".join(map(str, face)) for face in FACES]
    path = folder / f"{name}.ply"
    path.write_text("\n".join(header + lines) + "\n")
    return str(path)


@pytest.mark.parametrize("write", [obj, ply])
@pytest.mark.parametrize("place", [PLACE, -PLACE, PLACE * 1000], ids=["map", "negative", "farther"])
def test_what_is_far_away_keeps_its_digits(tmp_path: Path, write: Callable[..., str], place: np.ndarray) -> None:
    """As the same file near the origin, to the sixth of a millimeter that single precision has there."""
    near, far = load_asset(write(tmp_path, np.zeros(3), "near")), load_asset(write(tmp_path, place, "far"))
    turned = np.array([place[0], -place[2], place[1]]) if write is obj else place  # as importers turn them
    positions = far.world().positions
    assert np.abs(positions - near.world().positions - turned).max() < 2e-6
    assert far.mesh.notes == near.mesh.notes == () and far.mesh.warnings == near.mesh.warnings
    assert np.array_equal(far.mesh.triangles, near.mesh.triangles)


def test_materials_and_their_images_are_found_from_the_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = obj(tmp_path, PLACE, "far")
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (image,) = load_asset(path).mesh.materials[0].images
    assert image.path == str(tmp_path / "made" / "image.png") and not image.missing
    Path(path).write_text(Path(path).read_text().replace("mtllib skin.mtl\n", ""))
    (tmp_path / "skin.mtl").rename(tmp_path / "far.mtl")  # which Blender reads without being told
    assert load_asset(path).mesh.materials[0].images[0].path == image.path
    assert not list((tmp_path / "temporary").iterdir())


def test_what_is_near_is_read_as_it_is(tmp_path: Path) -> None:
    for place in (np.zeros(3), np.array([50.0, 0, 0])):
        assert offset_of(obj(tmp_path, place, "near")) is None and offset_of(ply(tmp_path, place, "near")) is None
    broken = tmp_path / "broken.obj"
    broken.write_text("v 1e6 1e6 x\nv 1e6 1e6 1\nf 1 2 1\n")
    assert offset_of(str(broken)) is None


def test_scores_of_the_cases_are_those_near_the_origin(shared_data: Path) -> None:
    options, found = PairOptions(settings=Settings(samples=8000, patches=40)), {}
    for kind in ("local", "utm"):
        reference, lod = (
            load_asset(str(shared_data / "cases" / "far" / f"statue_{kind}_{each}.obj")) for each in ("ref", "lod")
        )
        measurement = measurement_of(reference, BVHQuery, options)
        measurement.prepare().run()
        result = comparing_pair(measurement, reference, lod, options).run()
        assert result.alignment.label == "world" and not result.warnings
        found[kind] = result.comparison.scores
    np.testing.assert_allclose(found["utm"], found["local"], atol=0.002)
