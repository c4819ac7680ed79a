# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done to models: levels as promised, which is harsher, and the arrays and pixels that come of it."""

from __future__ import annotations

from collections import Counter
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fmqm_addon.evidence.distortions import DISTORTIONS, GTC, KINDS, Distortion, steps
from fmqm_addon.evidence.meshes import diagonal, rounded, shaken
from fmqm_addon.evidence.textures import png_bytes, worse_texture
from tests.blender.script import noise


def test_as_many_levels_as_promised() -> None:
    counts = Counter(each.kind for each in DISTORTIONS)
    assert counts == dict(zip(KINDS, (5, 5, 4, 5, 5, 6, 6, 9, 5), strict=True))
    assert len({each.name for each in DISTORTIONS}) == len(DISTORTIONS)
    assert "simpL5_qp9_qt8_decompJPEG_1024x1024_Q10" in {each.name for each in DISTORTIONS}


def test_each_step_is_harsher() -> None:
    """In one thing at least, and milder in none."""

    def harshness(each: Distortion) -> tuple[float, ...]:
        texture = (each.divisor, -(each.side or 9999), -(each.quality or 100))
        return (1 - each.kept, each.noise, -(each.position_bits or 32), -(each.uv_bits or 32), *texture)

    for milder, harsher in steps():
        assert milder.kind == harsher.kind and milder.codec == harsher.codec
        pairs = list(zip(harshness(milder), harshness(harsher), strict=True))
        assert all(a <= b for a, b in pairs) and any(a < b for a, b in pairs), (milder.name, harsher.name)
    counts = Counter(milder.kind for milder, _ in steps())
    assert counts == dict(zip(KINDS, (4, 4, 3, 4, 4, 4, 5, 12, 4), strict=True))


def test_gtc_joins_swt_and_tmc() -> None:
    parts = {(each.kept, each.codec, each.quality) for each in DISTORTIONS if each.kind == GTC}
    for kept, codec, quality in parts:
        assert any((each.kind, each.kept) == ("SWT", kept) for each in DISTORTIONS)
        assert any((each.kind, each.codec, each.quality) == ("TMC", codec, quality) for each in DISTORTIONS)
    assert len(parts) == 9


def test_noise_has_its_size_and_leaves_seams_closed() -> None:
    rng = np.random.default_rng(0)
    positions = rng.random((20_000, 3))
    positions[10_000:] = positions[:10_000]  # as importers split them
    moved = shaken(positions, 0.01, np.random.default_rng(1))
    assert np.array_equal(moved[:10_000], moved[10_000:])
    assert (moved - positions).std() == pytest.approx(0.01, rel=0.02)
    assert np.array_equal(moved, shaken(positions, 0.01, np.random.default_rng(1)))
    assert not np.array_equal(moved, shaken(positions, 0.01, np.random.default_rng(2)))


def test_bits_make_a_grid_of_their_number() -> None:
    values = np.stack([np.linspace(-3, 5, 1000), np.linspace(0, 2, 1000)], axis=1)
    grid = rounded(values, 3)
    assert len(np.unique(grid[:, 0])) == 8 and np.abs(grid - values).max() <= 8 / 7 / 2 + 1e-12
    assert np.array_equal(grid[[0, -1], 0], [-3, 5])
    assert np.array_equal(rounded(values[:1], 3), values[:1]), "a single point stays"
    assert diagonal(np.array([[0.0, 0, 0], [1, 2, 2]])) == 3


def test_a_texture_is_what_the_decoder_gives_back() -> None:
    pixels = noise(64)
    file = BytesIO()
    Image.fromarray(pixels).save(file, "JPEG", quality=10)
    file.seek(0)
    expected = np.asarray(Image.open(file))
    assert np.array_equal(worse_texture(pixels, _on_texture(codec="JPEG", quality=10)), expected)
    assert np.array_equal(np.asarray(Image.open(BytesIO(png_bytes(pixels)))), pixels)


def test_sizes_of_textures() -> None:
    wide = np.concatenate([noise(64), noise(64)], axis=1)
    assert worse_texture(wide, _on_texture(divisor=32)).shape == (2, 4, 3)
    assert worse_texture(wide, _on_texture(side=32)).shape == (16, 32, 3)
    assert np.array_equal(worse_texture(wide, _on_texture(side=1024)), wide), "never larger"
    assert worse_texture(noise(2), _on_texture(divisor=32)).shape == (1, 1, 3)


def test_alpha_is_not_compressed() -> None:
    pixels = np.dstack([noise(32), noise(32, seed=1)[..., 0]])
    worse = worse_texture(pixels, _on_texture(codec="WEBP", quality=10))
    assert np.array_equal(worse[..., 3], pixels[..., 3]) and not np.array_equal(worse[..., :3], pixels[..., :3])


@pytest.mark.parametrize("model", ["spot", "egyptian_cat"])
@pytest.mark.parametrize("name", ["DS_3", "TMC_3"])
def test_as_others_have_made_it(shared_data: Path, model: str, name: str) -> None:
    """Textures of the same kinds and levels, to the bit."""
    (level,) = (each for each in DISTORTIONS if each.name == name)
    original = np.asarray(Image.open(shared_data / "objpng" / model / f"{model}.png").convert("RGB"))
    expected = np.asarray(Image.open(shared_data / "pairs" / model / name.lower() / "tex.png").convert("RGB"))
    assert np.array_equal(worse_texture(original, level), expected)


def _on_texture(**does: object) -> Distortion:
    return Distortion("TMC", 1, "", "", **does)  # type: ignore[arg-type]
