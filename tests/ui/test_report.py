# SPDX-License-Identifier: GPL-3.0-or-later
"""The Report button: the page, its pictures with and without Pillow, and what is left in the file."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest
from PIL import Image

from fmqm_addon import ui
from fmqm_addon.blender.display.picture_bytes import png_bytes
from fmqm_addon.metric.errors import FMQMError
from fmqm_addon.report.html import pictures
from fmqm_addon.report.picture_files import EncodedPicture, encode, encoded_by, shrunk
from fmqm_addon.ui import session
from fmqm_addon.ui.operators import inputs, report
from tests.blender import scenes


@pytest.fixture
def measured(empty_session: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """An original with two LODs."""
    for name, size in (("VIEW_AREA", 48**2), ("LONG_SIDE", 48), ("CLOSE_UP", 24), ("THUMBNAIL", 16)):
        monkeypatch.setattr(pictures, name, size, raising=False)
    ui.register()
    skin = scenes.textured(scenes.write_png(tmp_path / "skin.png", scenes.noise(8)))
    rocks = [scenes.monkey(f"Rock_LOD{level}", [skin]) for level in range(3)]
    for rock, ratio in zip(rocks[1:], (0.5, 0.2), strict=True):
        rock.modifiers.new("Decimate", "DECIMATE").ratio = ratio
    fmqm = bpy.context.scene.fmqm
    fmqm.settings.samples, fmqm.settings.patches = 3200, 40
    inputs.set_reference(fmqm, rocks[0])
    inputs.set_compared(fmqm, rocks[1:])
    assert bpy.ops.fmqm.measure() == {"FINISHED"}
    yield
    ui.unregister()


@pytest.mark.usefixtures("measured")
@pytest.mark.parametrize("pillow", [True, False])
def test_the_page_is_there_with_its_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pillow: bool) -> None:
    if not pillow:
        for name in [name for name in sys.modules if name.partition(".")[0] == "PIL"]:
            monkeypatch.setitem(sys.modules, name, None)
    before, folder = scenes.blocks(), tmp_path / "page"
    assert bpy.ops.fmqm.write_report(folder=str(folder)) == {"FINISHED"}
    assert scenes.blocks() == before
    page = (folder / "index.html").read_text(encoding="utf-8")
    assert "Rock_LOD1" in page and "Rock_LOD2" in page
    files = list((folder / "pictures").iterdir())
    assert {path.suffix for path in files} == {".jpg" if pillow else ".png"}
    assert files and all(path.name in page for path in files), "none too few and none too many"


@pytest.mark.usefixtures("measured")
def test_what_is_not_in_memory_any_more_has_its_numbers(tmp_path: Path) -> None:
    session.clear()
    assert bpy.ops.fmqm.write_report(folder=str(tmp_path / "page")) == {"FINISHED"}
    assert not list((tmp_path / "page" / "pictures").iterdir())
    assert "Rock_LOD2" in (tmp_path / "page" / "index.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("measured")
def test_a_folder_that_cannot_be_is_told_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RuntimeError, match="cannot be made") as caught:
        bpy.ops.fmqm.write_report(folder=str(tmp_path / "file" / "page"))
    assert len(str(caught.value).strip().splitlines()) == 1


@pytest.mark.usefixtures("measured")
def test_it_is_proposed_beside_the_blend(tmp_path: Path) -> None:
    assert Path(report.default_folder()).is_relative_to(bpy.app.tempdir)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "rock.blend"))
    assert report.default_folder() == str(tmp_path / "rock_fmqm_report")
    assert bpy.ops.fmqm.report(filepath=str(tmp_path / "chosen")) == {"FINISHED"}
    assert (tmp_path / "chosen" / "index.html").is_file()


def test_blenders_pictures_have_the_same_colors(empty_session: None) -> None:
    pixels = np.arange(256 * 9 * 3).reshape(9, 256, 3).astype(np.uint8)
    before = scenes.blocks()
    png = png_bytes(pixels)
    assert scenes.blocks() == before
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(png)).convert("RGB")), pixels), "every value, and upright"
    with encoded_by(lambda seen: EncodedPicture(png_bytes(seen), "png")):
        assert encode(pixels) == (png, "png")
    assert encode(pixels).kind == "jpeg" and encode(pixels, lossless=True).kind == "png"


def test_without_anything_to_encode_pictures_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    monkeypatch.setitem(sys.modules, "PIL.Image", None)
    with pytest.raises(FMQMError, match="pictures need Pillow"):
        encode(np.zeros((1, 1, 3), np.uint8))


def test_noise_can_be_encoded() -> None:
    """It takes more than a byte a pixel."""
    noise = np.random.default_rng(0).integers(0, 256, (300, 300, 3), dtype=np.uint8)
    assert len(encode(noise).data) > 300 * 300


def test_shrunk_pictures_are_means() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (12, 9, 3), dtype=np.uint8)
    quarters = pixels.reshape(3, 4, 3, 3, 3).mean(axis=(1, 3))
    assert np.abs(shrunk(pixels, (3, 3)) - quarters).max() <= 0.51
    # Ends within pixels: each counts by the share of it that is covered.
    row = np.array([[[10] * 3, [20] * 3, [60] * 3]], np.uint8)
    assert shrunk(row, (2, 1))[0, :, 0].tolist() == [13, 47]
    assert np.array_equal(shrunk(pixels, (9, 12)), pixels)
