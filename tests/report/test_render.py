# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a comparison: right colors at right places, and never half a file."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.comparison.normals import corner_normals
from fmqm_addon.metric.colorspace import srgb_to_lab
from fmqm_addon.metric.errors import FileError, FMQMError
from fmqm_addon.metric.evaluation import COLUMNS, Evaluation, Result
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.stepper import Stepper
from fmqm_addon.metric.surface import Frame, MeshArrays, Surface, prepare_surface
from fmqm_addon.metric.texture import Material, PlainColor, Texture
from fmqm_addon.report import render as rendering
from fmqm_addon.report import sheet
from fmqm_addon.report.labels import shorten
from fmqm_addon.report.render import Camera, render, score_by_face
from fmqm_addon.report.sheet import write_picture
from fmqm_addon.report.visual.colormap import NO_PATCH, score_colors
from tests.metric.meshes import cube, sphere, surface, texture

RED, GREEN, BLUE, YELLOW = (200, 20, 20), (20, 200, 20), (20, 20, 200), (200, 200, 20)
FRONT = {"azimuth": 0.0, "elevation": 0.0}
FEW = Settings(samples=2000, patches=20)

FOUR = np.array([[RED, GREEN], [BLUE, YELLOW]], np.uint8)


def wall(cells: int, frame: Frame | None = None, width: float = 2.0) -> Surface:
    """An upright plane that faces the front, cells x cells quads, with a texture of four colors."""
    line = np.linspace(0, 1, cells + 1)
    u, v = (grid.ravel() for grid in np.meshgrid(line, line))
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, up = corner + 1, corner + cells + 1
    triangles = np.concatenate([np.stack([corner, right, up + 1], 1), np.stack([corner, up + 1, up], 1)])
    mesh = MeshArrays(
        name="wall",
        positions=np.stack([width * u, 0 * u, 2 * v], axis=1),
        triangles=triangles,
        corners=np.stack([u, v], axis=1)[triangles],
        material=np.zeros(len(triangles), np.int64),
        materials=(Material("four", Texture(FOUR, interpolation="closest")),),
    )
    return prepare_surface(mesh, BVHQuery, frame)


def compared(cells: int, settings: Settings) -> tuple[Surface, Surface, Result]:
    reference = wall(cells)
    distorted = wall(1, reference.frame, width=1.9)
    evaluation = Evaluation(reference, settings)
    evaluation.prepare().run()
    return reference, distorted, evaluation.compare(distorted).run()


def hue(color: np.ndarray) -> np.ndarray:
    """Shade takes all channels down alike."""
    return color / color.max()


def test_colors_stand_where_the_texture_says() -> None:
    surface = wall(4)
    image = render(surface, Camera.framing(surface, **FRONT), (60, 60))
    assert image.shape == (60, 60, 3) and image.dtype == np.uint8
    for row, column, color in ((15, 15, RED), (15, 45, GREEN), (45, 15, BLUE), (45, 45, YELLOW)):
        assert hue(image[row, column]) == pytest.approx(hue(np.array(color)), abs=0.03)
    assert (image[0] == rendering.BACKGROUND).all() and (image[:, -1] == rendering.BACKGROUND).all()
    middle = image[30, 31]  # between yellow and green: the same red in both, or a mixture
    assert middle[1] > 100


def test_steps_and_shared_hits_and_normals_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    ball = surface(sphere(), (texture(),))
    camera, size = Camera.close_up(np.zeros(3), Camera.framing(ball).axes, 1.5), (40, 30)
    whole = render(ball, camera, size)
    hits, normals = rendering.pixel_hits(ball, camera, size), corner_normals(ball)
    assert np.array_equal(render(ball, camera, size, None, hits, normals), whole)
    monkeypatch.setattr(rendering, "BATCH", 97)
    stepper = Stepper(rendering.rendering(ball, camera, size))
    done = [stepper.progress.done for _ in iter(stepper.step, False)]
    assert len(done) > 1200 // 97 and done == sorted(done) and done[-1] == 1
    assert np.array_equal(stepper.result, whole)


def test_both_sides_of_a_face_are_drawn() -> None:
    surface = wall(2)
    image = render(surface, Camera.framing(surface, azimuth=180.0, elevation=0.0), (40, 40))
    assert hue(image[10, 30]) == pytest.approx(hue(np.array(RED)), abs=0.03)  # left and right change places


def test_curved_surfaces_are_shaded_smoothly_and_edges_stay_sharp() -> None:
    ball, box = (surface(shape, (PlainColor((1, 1, 1)),)) for shape in (sphere(), cube()))
    for each, low, high in ((ball, 1, 8), (box, 50, 255)):
        image = render(each, Camera.framing(each), (120, 120)).astype(int)
        assert low <= np.abs(np.diff(image[30:90, 30:90].max(axis=2), axis=1)).max() < high


def test_camera_holds_every_vertex_and_wastes_nothing() -> None:
    reference = wall(3)
    camera = Camera.framing(reference, wall(1, reference.frame, width=3.0), aspect=0.8)
    points = np.concatenate([reference.vertices, wall(1, reference.frame, width=3.0).vertices])
    local = (points - camera.eye) @ camera.axes.T
    seen = np.abs(local[:, :2] / local[:, 2:] / camera.half)
    assert seen.max() == pytest.approx(1 / rendering.MARGIN)
    assert camera.axes @ camera.axes.T == pytest.approx(np.eye(3))
    assert camera.axes[1, 2] > 0.9  # Z is up


def test_faces_have_the_mean_of_their_patches_and_grey_without() -> None:
    settings = Settings(samples=2000, patches=20, scored_patches=2)
    reference, _, result = compared(12, settings)
    scores = score_by_face(result, reference)
    column = COLUMNS.index("FMQM")
    for face in range(len(reference.triangles)):
        covering = [result.patch_scores[k, column] for k, patch in enumerate(result.patches) if face in patch.faces]
        assert scores[face] == pytest.approx(np.mean(covering) if covering else np.nan, nan_ok=True)
    assert 0 < np.isnan(scores).sum() < len(scores)

    image = render(reference, Camera.framing(reference, **FRONT), (60, 60), score_colors(scores))
    assert hue(image[30, 30]) == pytest.approx(hue(np.array(NO_PATCH)), abs=0.03)  # centers are far outside
    corner = reference.vertices[result.patches[0].center]
    row, column_ = (4 if corner[2] > 0 else 55), (55 if corner[0] > 0 else 4)
    wanted = score_colors(result.patch_scores[:1, column])[0]
    assert hue(image[row, column_]) == pytest.approx(hue(wanted), abs=0.03)


def test_cut_triangles_have_the_mean_of_their_pieces() -> None:
    reference, _, result = compared(1, FEW)
    mesh = result.patch_mesh
    assert mesh.was_split and len(reference.triangles) == 2
    assert np.bincount(mesh.parent, mesh.areas) == pytest.approx([mesh.area / 2] * 2)
    corners = mesh.vertices[mesh.triangles].mean(axis=1)  # each piece lies on the side of its parent's centroid
    parents = reference.vertices[reference.triangles].mean(axis=1)
    nearest = np.linalg.norm(corners[:, None] - parents, axis=2).argmin(axis=1)
    assert (nearest == mesh.parent).all()
    scores = score_by_face(result, reference)
    pieces = np.zeros(len(mesh.triangles))
    for face in range(len(pieces)):
        pieces[face] = np.mean(
            [s for p, s in zip(result.patches, result.patch_scores[:, 4], strict=True) if face in p.faces]
        )
    for parent in (0, 1):
        here = mesh.parent == parent
        assert scores[parent] == pytest.approx(np.average(pieces[here], weights=mesh.areas[here]))


def test_score_colors_are_even_and_bad_is_bright() -> None:
    lab = srgb_to_lab(score_colors(np.linspace(0, 1, 21)))
    assert (np.diff(lab[:, 0]) < 0).all()
    steps = np.linalg.norm(np.diff(lab, axis=0), axis=1)
    assert steps.max() < 1.35 * steps.min()
    assert score_colors(np.array([np.nan, 0.5]))[0] == pytest.approx(NO_PATCH)


def test_png_decodes(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    path = tmp_path / "pair.png"
    path.write_text("an older picture")
    write_picture(path, *compared(6, FEW), width=450)
    with image.open(path) as decoded:
        assert decoded.format == "PNG" and decoded.mode == "RGB" and decoded.width == 450
        pixels = np.asarray(decoded)
    assert (pixels[[0, -1]] == rendering.BACKGROUND).all()
    assert (pixels != rendering.BACKGROUND).any(axis=2).mean() > 0.3
    assert list(tmp_path.iterdir()) == [path]


def test_unwritable_path_is_named(tmp_path: Path) -> None:
    pytest.importorskip("PIL.Image")
    pair = compared(6, FEW)
    (tmp_path / "folder").mkdir()
    for path, words in ((tmp_path / "missing" / "pair.png", "does not exist"), (tmp_path / "folder", "is a folder")):
        with pytest.raises(FileError, match=words) as caught:
            write_picture(path, *pair, width=300)
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == [tmp_path / "folder"]


def test_failure_leaves_the_old_file_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("PIL.Image")
    pair = compared(6, FEW)
    path = tmp_path / "pair.png"
    path.write_text("an older picture")

    def fail(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(sheet, "compose", fail)
    with pytest.raises(MemoryError):
        write_picture(path, *pair)
    assert list(tmp_path.iterdir()) == [path] and path.read_text() == "an older picture"


def test_missing_pillow_costs_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pair = compared(6, FEW)
    for name in ("PIL", "PIL.Image"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(FMQMError, match="pictures need Pillow, which this Python lacks") as caught:
        write_picture(tmp_path / "pair.png", *pair)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_long_names_lose_their_middle() -> None:
    def fits(text: str) -> bool:
        return len(text) <= 12

    assert shorten("short.glb", fits) == "short.glb"
    assert shorten("a_very_long_name_of_a_file.glb", fits) == "a_ver....glb"
