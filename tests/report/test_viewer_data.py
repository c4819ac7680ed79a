# SPDX-License-Identifier: GPL-3.0-or-later
"""What the report's viewer is given: the mesh and the colors that were measured, small, shared, and text always."""

from __future__ import annotations

import base64
import io
import json
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fmqm_addon.comparison.judge import Judge
from fmqm_addon.comparison.normals import corner_normals
from fmqm_addon.metric.errors import OutputError
from fmqm_addon.metric.evaluation import Evaluation, Result
from fmqm_addon.metric.geometry import Floats
from fmqm_addon.metric.surface import MeshArrays, Surface, prepare_surface
from fmqm_addon.metric.texture import Material, Placement, PlainColor, Texture
from fmqm_addon.report.html.kept import is_viewer
from fmqm_addon.report.html.viewer import images, skins
from fmqm_addon.report.html.viewer.files import has_viewer_data, write_pair_data, write_reference_data
from fmqm_addon.report.html.viewer.heat import heat_data
from fmqm_addon.report.html.viewer.markup import viewer_markup
from fmqm_addon.report.html.viewer.mesh import mesh_data
from fmqm_addon.report.html.viewer.packing import ends, packed, quantized, restored, script_text, unpacked
from fmqm_addon.report.visual.layers import field_values
from tests.metric.meshes import SMALL, cube, grid, materials, mesh_arrays, shaken, sphere, surface, texture
from tests.metric.oracles import NaiveQuery

ROOT = Path(__file__).resolve().parents[2]
HOSTILE = "</script><script>alert(1)</script>\u2028\u2029<!--"
MOST = 25_000_000  # bytes of a pair of 200,000 triangles


@dataclass(frozen=True)
class Mixed:
    """A color that needs texture coordinates and a color attribute: no image alone shows it."""

    image: Texture

    def lookup(self, values: Floats) -> Floats:
        return self.image.lookup(values) * values[:, 2:3]


@dataclass(frozen=True)
class Halved:
    """What a material calculates from an image alone."""

    image: Texture

    def lookup(self, values: Floats) -> Floats:
        return self.image.lookup(values) / 2


@pytest.fixture(scope="module")
def pair() -> tuple[Surface, Surface, Result]:
    arrays = mesh_arrays(sphere(), (texture(size=16),))
    reference = prepare_surface(arrays, NaiveQuery)
    evaluation = Evaluation(reference, SMALL)
    evaluation.prepare().run()
    distorted = prepare_surface(shaken(arrays, 0.02), NaiveQuery, reference.frame)
    return reference, distorted, evaluation.compare(distorted).run()


def corners(data: dict[str, Any]) -> tuple[Floats, Floats, Floats, Floats]:
    """What the viewer makes of it, corner after corner: positions, texture coordinates, normals, colors in [0, 1]."""
    index = unpacked(data["index"], 1, np.uint32)[:, 0]
    place = data["positions"]
    positions = restored(unpacked(place["data"], 3, np.uint16), np.array(place["low"]), np.array(place["span"]))
    steps = unpacked(data["uv"], 2, np.uint16)[index]
    uv = np.zeros((len(index), 2))
    for skin in data["skins"]:
        here = slice(3 * skin["first"], 3 * (skin["first"] + skin["count"]))
        uv[here] = restored(steps[here], np.array(skin["low"]), np.array(skin["span"]))
    square = restored(unpacked(data["normals"], 2, np.uint16), np.full(2, -1.0), np.full(2, 2.0))
    z = 1 - np.abs(square).sum(axis=1)
    folded = (1 - np.abs(square[:, ::-1])) * np.where(square < 0, -1, 1)
    normals = np.column_stack([np.where(z[:, None] < 0, folded, square), z])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colors = np.ones((len(index), 3))
    if data["colors"]:
        colors = unpacked(data["colors"], 3, np.uint8)[index] / 255
    return positions[index], uv, normals[index], colors


def pixels_of(uri: str) -> np.ndarray:
    image = pytest.importorskip("PIL.Image")
    return np.asarray(image.open(io.BytesIO(base64.b64decode(uri.split(",", 1)[1]))))


# Numbers


def test_quantized_numbers_come_back_within_half_a_step() -> None:
    values = np.random.default_rng(0).normal(0, [1, 100, 0], (1000, 3)) + [0, 5, 7]
    low, span = ends(values)
    back = restored(quantized(values, low, span), low, span)
    assert (np.abs(back - values) <= span / 65535 / 2 + 1e-12).all()
    assert np.array_equal(back.min(axis=0), low) and np.allclose(back.max(axis=0), low + span)


@pytest.mark.parametrize(("dtype", "columns"), [(np.uint8, 3), (np.uint16, 2), (np.uint32, 1)])
def test_packed_rows_come_back(dtype: Any, columns: int) -> None:
    rows = np.random.default_rng(0).integers(0, np.iinfo(dtype).max, (100, columns), dtype, endpoint=True)
    assert np.array_equal(unpacked(packed(rows), columns, dtype), rows)
    assert unpacked(packed(rows[:0]), columns, dtype).shape == (0, columns)


# Meshes


def test_a_mesh_comes_back_as_it_is() -> None:
    shown = surface(sphere(), (texture(), PlainColor((0.8, 0.4, 0.2)), texture(1)))
    data = mesh_data(shown)
    positions, _, normals, _ = corners(data)
    order = np.argsort(np.array([0, 1, 2])[shown.material], kind="stable")
    span = np.array(data["positions"]["span"])
    assert (np.abs(positions - shown.vertices[shown.triangles[order]].reshape(-1, 3)) <= span / 65535).all()
    own = corner_normals(shown)[order].reshape(-1, 3)
    assert np.einsum("nc,nc->n", normals, own).min() > 1 - 1e-7
    assert data["triangles"] == len(shown.triangles) == sum(skin["count"] for skin in data["skins"])


def test_a_smooth_mesh_has_about_as_many_vertices_as_it_has_places() -> None:
    shown = surface(grid(20, 20), (texture(),))
    assert len(unpacked(mesh_data(shown)["uv"], 2, np.uint16)) == len(shown.vertices)


def test_an_image_is_taken_as_it_is() -> None:
    image = texture(size=16)
    shown = surface(cube(2), (image,))
    data = mesh_data(shown)
    (skin,) = data["skins"]
    assert skin["wrap"] == "repeat" and skin["smooth"]
    assert np.array_equal(pixels_of(data["images"][skin["image"]]), image.pixels)
    check_colors(shown, 1e-3)


@pytest.mark.parametrize(
    "image",
    [
        replace(texture(), extension="mirror", placement=Placement(affine=((3.0, 0.5, -7.0), (0.0, 2.0, 0.2)))),
        replace(texture(), extension="extend", interpolation="linear"),
        replace(texture(), placement=Placement(affine=((0.0, 1.5, 40.0), (1.0, 0.0, -0.3)))),
        Halved(texture(size=64)),
        replace(texture(size=64), placement=Placement(fold=("pingpong", "none"))),
        Texture(np.linspace(0, 255, 64 * 64 * 3).astype(np.uint8).reshape(64, 64, 3), linear=True),
        PlainColor((0.2, 0.5, 0.9)),
    ],
    ids=["mirrored", "extended", "placed", "calculated", "folded", "linear", "plain"],
)
def test_colors_are_those_that_were_measured(image: Any) -> None:
    arrays = mesh_arrays(cube(3), (image,))
    shown = prepare_surface(replace(arrays, materials=(Material("m", image, uv=0),)), NaiveQuery)
    check_colors(shown, 0.02)


def test_what_no_image_shows_is_painted_triangle_by_triangle() -> None:
    arrays = mesh_arrays(cube(2))
    shade = np.random.default_rng(0).uniform(0.2, 1, (*arrays.triangles.shape, 1))
    image = Texture(np.broadcast_to(np.linspace(0, 255, 64).astype(np.uint8)[:, None, None], (64, 64, 3)).copy())
    arrays = replace(
        arrays,
        corners=np.concatenate([arrays.corners * 0.9 + 0.05, shade], axis=2),
        materials=(Material("m", Mixed(image), uv=0),),
    )
    check_colors(prepare_surface(arrays, NaiveQuery), 0.02)


def test_more_triangles_than_can_be_painted_have_colors_at_corners(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(skins, "LARGEST_SIDE", 8)
    arrays = mesh_arrays(cube(2))
    corner = np.concatenate([arrays.corners, np.ones((*arrays.triangles.shape, 1))], axis=2)
    corner[:, :, 2] = np.random.default_rng(0).uniform(0, 1, arrays.triangles.shape)
    arrays = replace(arrays, corners=corner, materials=(Material("m", Mixed(texture()), uv=0),))
    shown = prepare_surface(arrays, NaiveQuery)
    (skin,) = skins.coloring(shown).skins
    assert skin.pixels is None
    own = shown.color_at(np.repeat(np.arange(len(shown.triangles)), 3), np.tile(np.eye(3), (len(shown.triangles), 1)))
    assert np.abs(corners(mesh_data(shown))[3] - own).max() < 0.005


def check_colors(shown: Surface, tolerance: float) -> None:
    """At places inside of all triangles: colors as drawn, and as the metric looks them up."""
    colored = skins.coloring(shown)
    triangle = np.repeat(np.arange(len(shown.triangles)), 8)
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], len(triangle))
    uv = np.einsum("nk,nkc->nc", weights, colored.uv[triangle])
    seen = np.einsum("nk,nkc->nc", weights, colored.colors[triangle] / 255)
    for number, skin in enumerate(colored.skins):
        here = colored.skin[triangle] == number
        if skin.pixels is not None:
            wrap: Any = "extend" if skin.wrap == "clamp" else skin.wrap
            seen[here] = Texture(skin.pixels, wrap).lookup(uv[here])
    wrong = np.abs(seen - shown.color_at(triangle, weights)).max(axis=1)
    assert np.quantile(wrong, 0.95) <= tolerance and wrong.mean() <= tolerance


# Images


def test_images_are_small_enough_together(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("PIL")
    large = np.random.default_rng(0).integers(0, 256, (4096, 1024, 3), np.uint8)
    ((_, uri),) = images.encoded([large])
    assert max(pixels_of(uri).shape) <= skins.LARGEST_SIDE and len(uri) <= images.MOST_BYTES
    assert uri.startswith("data:image/jpeg;base64,")
    monkeypatch.setattr(images, "MOST_BYTES", 100_000)
    assert sum(len(uri) for _, uri in images.encoded([large, large])) <= 100_000


def test_small_images_stay_as_they_are() -> None:
    pytest.importorskip("PIL")
    small = np.random.default_rng(0).integers(0, 256, (300, 512, 3), np.uint8)
    (first, uri), (second, _) = images.encoded([small, small])
    assert np.array_equal(pixels_of(uri), small) and first == second


@pytest.mark.once
def test_a_pair_of_200_000_triangles_is_small_enough() -> None:
    """The worst there is: each corner has a normal and texture coordinates of its own, and images are noise."""
    pytest.importorskip("PIL")
    chance = np.random.default_rng(0)
    positions, triangles = grid(317, 316)
    positions += chance.normal(0, 0.3, positions.shape)
    image = Texture(chance.integers(0, 256, (2048, 2048, 3), np.uint8))
    mesh = MeshArrays(
        "m", positions, triangles, chance.uniform(0, 1, (len(triangles), 3, 2)), np.zeros(len(triangles), int),
        materials(image), normals=chance.normal(size=(len(triangles), 3, 3)),
    )  # fmt: skip
    shown = prepare_surface(mesh, lambda *_: None)  # type: ignore[arg-type, return-value]
    assert len(shown.triangles) > 200_000
    heat = 2 * 96**3 // 4  # what cells take, at most: a quarter is not empty
    assert 2 * len(script_text("x", {"mesh": mesh_data(shown)})) + heat < MOST


# Heat


def test_heat_has_the_values_of_patches_and_samples(pair: tuple[Surface, Surface, Result]) -> None:
    _, _, result = pair
    heat = heat_data(result, Judge.PERCEIVED)
    layers = {layer["name"]: layer for layer in heat["layers"]}
    assert layers["FMQM"]["values"] == pytest.approx(result.of_patches("FMQM"), abs=1e-5)
    assert np.array(heat["centers"]).reshape(-1, 3) == pytest.approx(result.patch_centers, abs=1e-6)
    lowest = np.sort(result.of_patches("perceived"))[:5]
    assert [place["score"] for place in heat["worst"]] == pytest.approx(lowest, abs=1e-5) and not heat["partial"]
    assert all(place["words"].startswith(f"{score:.3f}; ") for place, score in zip(heat["worst"], lowest, strict=True))
    cells = heat["cells"][0]
    color, distance, known = unpacked(cells["data"], 3, np.uint8).T / 255
    place = ((result.ref.nearest - cells["low"]) / cells["size"]).astype(int)
    row = (place[:, 2] * cells["shape"][1] + place[:, 1]) * cells["shape"][0] + place[:, 0]
    assert known[row].min() == 1 and known.sum() == len(np.unique(row)) and len(known) == np.prod(cells["shape"])
    for column, name in ((color, "NCF_DIFFERENCE"), (distance, "SDF_DIFFERENCE")):
        values = field_values(name, result.ref, result.dist, result.frame.scale)
        one = row[np.argmax(np.bincount(row)[row])]
        mean = np.clip(values[row == one].mean() / layers[name]["high"], 0, 1)
        assert column[one] == pytest.approx(mean, abs=0.003)


def test_rounding_is_not_painted_as_a_difference(pair: tuple[Surface, Surface, Result]) -> None:
    """A mesh against itself: nothing is worst, and the ranges do not end at noise."""
    reference, _, _ = pair
    evaluation = Evaluation(reference, SMALL)
    evaluation.prepare().run()
    heat = heat_data(evaluation.compare(reference).run(), Judge.FMQM)
    ranges = {layer["name"]: layer["high"] for layer in heat["layers"] if layer["values"] is None}
    assert heat["worst"] == [] and ranges["NCF_DIFFERENCE"] == 0.01
    assert ranges["SDF_DIFFERENCE"] == pytest.approx(1e-4 * reference.frame.scale)


# Files


def test_files_are_shared_and_the_same_each_time(pair: tuple[Surface, Surface, Result], tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    reference, distorted, result = pair
    records, contents = [], []
    for name in ("one", "two"):
        folder = str(tmp_path / name)
        shared = write_reference_data(folder, "ref-1", reference)
        record = write_pair_data(folder, "lod-1", shared, distorted, result, Judge.FMQM)
        write_pair_data(folder, "lod-2", shared, reference, result, Judge.FMQM)
        records.append(record)
        contents.append({path.name: path.read_bytes() for path in (tmp_path / name / "viewer").iterdir()})
    assert records[0] == records[1] == {"reference": "viewer/ref-1.js", "level": "viewer/lod-1.js"}
    assert contents[0] == contents[1] and contents[0].keys() == {"ref-1.js", "lod-1.js", "lod-2.js"}
    assert is_viewer(records[0]) and has_viewer_data(str(tmp_path / "one"), records[0])
    level = data_of(tmp_path / "one" / records[0]["level"])
    assert level["mesh"]["images"] == {} and level["mesh"]["skins"][0]["image"] in shared.images
    (tmp_path / "one" / records[0]["level"]).unlink()
    assert not has_viewer_data(str(tmp_path / "one"), records[0]) and not has_viewer_data(str(tmp_path), None)


def test_a_folder_that_cannot_be_made_is_an_output_error(pair: tuple[Surface, Surface, Result], tmp_path: Path) -> None:
    (tmp_path / "viewer").write_text("")
    with pytest.raises(OutputError, match="cannot be made"):
        write_reference_data(str(tmp_path), "ref", pair[0])


def test_names_from_strangers_stay_text(pair: tuple[Surface, Surface, Result], tmp_path: Path) -> None:
    pytest.importorskip("PIL")
    shared = write_reference_data(str(tmp_path), "ref", replace(pair[0], name=HOSTILE))
    text = (tmp_path / shared.path).read_text(encoding="utf-8")
    assert text.isascii() and "<" not in text and ">" not in text
    assert data_of(tmp_path / shared.path)["mesh"]["name"] == HOSTILE
    assert "<script" not in viewer_markup({"reference": "viewer/a.js", "level": "viewer/b.js"}, HOSTILE)


@pytest.mark.parametrize(
    "path", ["../x.js", "viewer/../x.js", "viewer/x.js?", "http://x/viewer/x.js", "viewer/x.html", 3]
)
def test_a_record_names_files_of_the_report_alone(path: object) -> None:
    assert not is_viewer({"reference": path, "level": "viewer/a.js"})
    assert not is_viewer({"level": "viewer/a.js"}) and is_viewer(dict.fromkeys(("reference", "level"), "viewer/a.js"))


def data_of(path: Path) -> dict[str, Any]:
    call = re.fullmatch(r'fmqmViewer\.take\("[^"]*", (.*)\);\n', path.read_text(encoding="utf-8"))
    assert call is not None
    return json.loads(call[1])


def test_three_js_is_the_version_that_is_locked() -> None:
    """Its license and version lie beside it; nothing in the lock names where packages come from."""
    wanted = json.loads((ROOT / "scripts" / "three" / "package.json").read_text(encoding="utf-8"))["devDependencies"]
    lock = (ROOT / "scripts" / "three" / "package-lock.json").read_text(encoding="utf-8")
    packages = json.loads(lock)["packages"]
    assert packages["node_modules/three"]["version"] == wanted["three"] and "resolved" not in lock
    beside = ROOT / "fmqm_addon" / "report" / "html" / "viewer"
    told = (beside / "three.LICENSE.txt").read_text(encoding="utf-8")
    assert told.startswith(f"three.js {wanted['three']}\n") and "MIT License" in told
    script = (beside / "three.js").read_text(encoding="utf-8")
    assert f'REVISION = "{wanted["three"].split(".")[1]}"' in script and "SPDX-License-Identifier: MIT" in script
    assert len(script.splitlines()) > 20_000  # not minified
