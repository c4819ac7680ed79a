# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a comparison: right colors at right places, and never half a file."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.comparison.judge import Judge
from fmqm_addon.comparison.normals import corner_normals
from fmqm_addon.metric.colorspace import srgb_to_lab
from fmqm_addon.metric.errors import FileError, FMQMError
from fmqm_addon.metric.evaluation import COLUMNS, Evaluation, Result
from fmqm_addon.metric.settings import Settings
from fmqm_addon.metric.stepper import Stepper, finish
from fmqm_addon.metric.surface import Frame, MeshArrays, Surface, prepare_surface
from fmqm_addon.metric.texture import Material, PlainColor, Texture
from fmqm_addon.report import render as rendering
from fmqm_addon.report import sheet
from fmqm_addon.report.heat import FRONT as FRONT_SIDE
from fmqm_addon.report.heat import heat_of, side_of_loss
from fmqm_addon.report.labels import shorten
from fmqm_addon.report.render import Camera, render
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


def test_steps_shared_rays_and_given_normals_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    ball = surface(sphere(), (texture(),))
    camera, size = Camera.close_up(np.zeros(3), Camera.framing(ball).axes, 1.5), (40, 30)
    whole = render(ball, camera, size)
    assert np.array_equal(render(ball, camera, size, None, corner_normals(ball)), whole)
    own, same = rendering.render_all(ball, camera, size, (None, None))
    assert np.array_equal(own, whole) and np.array_equal(same, whole)
    monkeypatch.setattr(rendering, "BATCH", 97)
    stepper = Stepper(rendering.rendering(ball, camera, size, (None,)))
    done = [stepper.progress.done for _ in iter(stepper.step, False)]
    assert len(done) > 5 and done == sorted(done) and done[-1] == 1
    assert np.array_equal(stepper.result[0], whole)


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


@pytest.mark.parametrize("near", [None, 1.2, 0.0])
def test_pixels_show_what_rays_hit(near: float | None) -> None:
    """Triangles that cross each other, from outside, cut in the middle, and with the eye among them; some pixels alone
    as all of them."""
    random, size = np.random.default_rng(3), (90, 70)
    mixed = surface((random.normal(size=(120, 3)), np.arange(120).reshape(-1, 3)), (PlainColor((1, 1, 1)),))
    camera = Camera.framing(mixed)
    if near is not None:
        back = 1.3 if near else 0.0
        camera = Camera(-back * camera.axes[2], camera.axes, (0.4, 0.3), near)
    columns, rows = (grid.ravel() + 0.5 for grid in np.meshgrid(np.arange(size[0]), np.arange(size[1])))
    directions = camera.directions(2 * columns / size[0] - 1, 1 - 2 * rows / size[1])
    begin = max(camera.near, rendering.NEAREST) / (directions @ camera.axes[2])
    hit, _ = mixed.query.first_hit(camera.eye + begin[:, None] * directions, directions)
    screen = finish(rendering._projecting(mixed, camera, size))
    shown = finish(screen.showing())
    assert np.mean(shown != hit) < 0.002 and 0.05 < np.mean(shown >= 0) and len(np.unique(shown)) >= 5
    some = np.flatnonzero(random.random(shown.size) < 0.3)
    assert np.array_equal(finish(screen.showing(some)), shown[some])


def test_places_have_the_color_of_the_nearest_patch_between_fitted_ends() -> None:
    reference, _, result = compared(12, FEW)
    heat = heat_of(reference, result, Judge.FMQM)
    assert heat.high == 1 and 0 <= heat.low <= np.percentile(heat.values, 5) and not heat.has_gaps
    image = render(reference, Camera.framing(reference, **FRONT), (60, 60), heat.paint)
    camera = Camera.framing(reference, **FRONT)
    for patch, center in enumerate(result.patch_centers):
        x, y = camera.place_of(center)
        wanted = score_colors((heat.values[patch : patch + 1] - heat.low) / (1 - heat.low))[0]
        seen = image[min(int(60 * y), 59), min(int(60 * x), 59)]
        if (seen != rendering.BACKGROUND).any() and 0.1 < x < 0.9 and 0.1 < y < 0.9:
            assert hue(seen) == pytest.approx(hue(wanted), abs=0.2)


def test_places_without_a_patch_are_their_own_color_dimmed() -> None:
    reference, _, result = compared(12, Settings(samples=2000, patches=20, scored_patches=2))
    heat = heat_of(reference, result, Judge.FMQM)
    assert heat.has_gaps
    camera = Camera.framing(reference, **FRONT)
    own, image = (render(reference, camera, (60, 60), paint).astype(float) for paint in (None, heat.paint))
    bare = image[30, 15:45]  # centers are far outside
    assert (
        np.abs(bare - rendering.BACKGROUND).max(axis=1) < np.abs(own[30, 15:45] - rendering.BACKGROUND).max(axis=1)
    ).all()
    assert np.ptp(bare, axis=1).max() < 0.5 * np.ptp(own[30, 15:45], axis=1).max()


@pytest.mark.parametrize(("x", "azimuth"), [(1.0, 90.0), (-1.0, 270.0)])
def test_the_camera_goes_to_the_side_of_the_loss(x: float, azimuth: float) -> None:
    """Of a ball whose patches are bad on one side only."""
    ball = surface(sphere(), (texture(),))
    evaluation = Evaluation(ball, Settings(samples=2000, patches=60))
    evaluation.prepare().run()
    result = evaluation.compare(ball).run()
    assert side_of_loss(ball, result, Judge.FMQM) == FRONT_SIDE  # nothing is lost
    scores = result.patch_scores.copy()
    scores[:, COLUMNS.index("FMQM")] = np.where(x * result.patch_centers[:, 0] > 0.2, 0.3, 1.0)
    found, _ = side_of_loss(ball, replace(result, patch_scores=scores), Judge.FMQM)
    assert np.cos(np.radians(found - azimuth)) > 0.6


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
