# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture lookup pixel by pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.metric.texture import Extension, Interpolation, Placement, PlainColor, Texture

from .oracles import texture_color

EXTENSIONS: tuple[Extension, ...] = ("repeat", "extend", "clip", "mirror")
INTERPOLATIONS: tuple[Interpolation, ...] = ("linear", "closest", "cubic")

coordinate = st.one_of(
    st.floats(-3, 3, allow_subnormal=False),
    st.sampled_from([0.0, -0.0, 0.25, 0.5, 1.0, -1.0, 2.0, 0.125, 1e6 + 0.375, -1e6 - 0.375, -1e-17, 1 + 2**-52]),
)


@given(
    st.tuples(st.integers(1, 7), st.integers(1, 7)),
    st.booleans(),
    st.sampled_from(EXTENSIONS),
    st.sampled_from(("linear", "cubic")),
    st.lists(st.tuples(coordinate, coordinate), min_size=1, max_size=8),
)
def test_smooth_lookup(
    size: tuple[int, int],
    as_bytes: bool,
    extension: Extension,
    interpolation: Interpolation,
    uv: list[tuple[float, float]],
) -> None:
    """Equation (6) and bilinear or cubic interpolation, to 1e-7 also at u = 1e6."""
    rng = np.random.default_rng(size)
    pixels = rng.integers(0, 256, (*size, 3), np.uint8) if as_bytes else rng.random((*size, 3), np.float32)
    image = Texture(pixels, extension, interpolation)
    expected = [texture_color(image, u, v) for u, v in uv]
    found = image.lookup(np.array(uv))
    assert found.dtype == np.float64
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)


@given(
    st.tuples(st.integers(1, 5), st.integers(1, 5)),
    st.booleans(),
    st.sampled_from(EXTENSIONS),
    st.lists(st.tuples(st.integers(-30, 29), st.integers(-30, 29), st.floats(0.01, 0.99), st.floats(0.01, 0.99))),
    st.sampled_from([0, 1e6, -1e6]),
)
def test_closest_lookup(
    size: tuple[int, int],
    as_bytes: bool,
    extension: Extension,
    places: list[tuple[int, int, float, float]],
    away: float,
) -> None:
    """The pixel that holds the point, for points inside pixels."""
    rng = np.random.default_rng(size)
    pixels = rng.integers(0, 256, (*size, 3), np.uint8) if as_bytes else rng.random((*size, 3), np.float32)
    image = Texture(pixels, extension, "closest")
    uv = np.array([(away + (i + x) / size[1], away + (j + y) / size[0]) for i, j, x, y in places]).reshape(-1, 2)
    expected = np.array([texture_color(image, u, v) for u, v in uv.tolist()]).reshape(-1, 3)
    assert image.lookup(uv).tolist() == expected.tolist()


ROWS = np.array([[[0, 0, 0], [100, 0, 0]], [[200, 0, 0], [40, 0, 0]]], np.uint8)  # top row: 0 100, bottom: 200 40


@pytest.mark.parametrize(
    ("extension", "u", "v", "red"),
    [
        ("repeat", 0.25, 0.75, 0),  # centers of the four pixels; v goes up, rows go down
        ("repeat", 0.75, 0.75, 100),
        ("repeat", 0.25, 0.25, 200),
        ("repeat", 0.75, 0.25, 40),
        ("repeat", 0.5, 0.75, 50),
        ("repeat", 0.5, 0.5, 85),
        ("repeat", 0.0, 0.75, 50),  # half way to the neighbor around the border
        ("extend", 0.0, 0.75, 0),
        ("extend", 1.0, 0.75, 100),
        ("extend", 7.0, -7.0, 40),
        ("clip", 0.0, 0.25, 100),  # half way to the black outside
        ("clip", 1.0, 0.25, 20),
        ("clip", 1.25, 0.25, 0),
        ("clip", 7.0, -7.0, 0),
        ("mirror", 1.25, 0.75, 100),
        ("mirror", 1.75, 0.25, 200),
        ("mirror", -0.25, 0.75, 0),
        ("mirror", 0.75, -0.25, 40),
        ("mirror", 1.0, 0.75, 100),
        ("repeat", 1.25, -0.75, 200),
    ],
)
def test_lookup_by_hand(extension: Extension, u: float, v: float, red: float) -> None:
    for scale, image in ((255, ROWS), (255, (ROWS / 255).astype(np.float32))):
        found = Texture(image, extension).lookup(np.array([[u, v]]))
        np.testing.assert_allclose(found * scale, [[red, 0, 0]], atol=1e-5)


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_one_pixel_is_one_color(extension: Extension, interpolation: Interpolation) -> None:
    image = Texture(np.array([[[51, 102, 255]]], np.uint8), extension, interpolation)
    uv = np.random.default_rng(0).random((20, 2))
    if extension == "clip":  # it blends with what lies around it, but for its center
        assert (image.lookup(uv) <= np.array([0.2, 0.4, 1.0]) + 1e-15).all()
        uv = np.full((20, 2), 0.5)
        if interpolation == "cubic":
            np.testing.assert_allclose(image.lookup(uv)[0], np.array([0.2, 0.4, 1.0]) * 4 / 9, atol=1e-15)
            return
    np.testing.assert_allclose(image.lookup(uv), np.tile([0.2, 0.4, 1.0], (20, 1)), atol=1e-15)


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_colors_stay_in_range(interpolation: Interpolation) -> None:
    image = Texture(np.full((3, 3, 3), 255, np.uint8), "repeat", interpolation)
    uv = np.random.default_rng(0).normal(0, 1e3, (500, 2))
    assert (image.lookup(uv).astype(np.float32) == 1).all()


def test_closest_pixel_at_the_lower_border_is_in_the_bottom_row() -> None:
    """As Blender has it: row floor(v H) from below."""
    assert Texture(ROWS, "repeat", "closest").lookup(np.zeros((1, 2)))[0, 0] == pytest.approx(200 / 255)


def test_clip_is_transparent_outside() -> None:
    uv = np.array([[0.5, 0.5], [1.0, 0.5], [3.0, 0.5]])
    for pixels in (np.full((1, 1, 3), 255, np.uint8), np.full((1, 1, 4), 255, np.uint8)):
        assert Texture(pixels, "clip").alpha_at(uv).tolist() == [1, 0.5, 0]
    assert Texture(pixels, "extend").alpha_at(uv).tolist() == [1, 1, 1]
    assert Texture(pixels, "clip", solid=True).alpha_at(uv).tolist() == [1, 1, 1]


def test_color_is_divided_by_alpha_after_the_interpolation() -> None:
    """Half way between red at alpha 1 and nothing there is red at alpha 0.5, not dark red; 0 stays 0."""
    pixels = np.array([[[200, 0, 0, 255], [0, 0, 0, 0]]], np.uint8)
    uv = np.array([[0.5, 0.5], [0.75, 0.5]])
    red = Texture(pixels, "extend", unassociate=True)
    np.testing.assert_allclose(red.lookup(uv) * 255, [[200, 0, 0], [0, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(red.alpha_at(uv), [0.5, 0])
    np.testing.assert_allclose(replace(red, unassociate=False).lookup(uv)[0] * 255, [100, 0, 0], atol=1e-9)


def test_linear_pixels_are_interpolated_as_light_and_then_encoded() -> None:
    pixels = np.array([[[0.0, 0.0, 0.0], [1.0, 1.0, 9.0]]], np.float32)
    texture, uv = Texture(pixels, "extend", linear=True), np.array([[0.5, 0.5]])
    np.testing.assert_allclose(texture.lookup(uv), [[0.735357, 0.735357, 1.0]], atol=1e-5)
    np.testing.assert_allclose(texture.light_at(uv), [[0.5, 0.5, 4.5]])
    np.testing.assert_allclose(replace(texture, linear=False).light_at(uv)[0, 0], 0.214041, atol=1e-5)


def test_placement_by_hand() -> None:
    """Channels 1 and 2, moved and scaled, then folded."""
    values = np.array([[9.0, 0.5, 0.25], [9.0, 2.25, -0.5]])
    place = Placement(1, ((2.0, 0.0, 0.25), (0.0, 1.0, 1.0)), ("wrap", "pingpong"))
    u, v = place.at(values)
    assert u.tolist() == [0.25, 0.75] and v.tolist() == [0.75, 0.5]


@given(st.floats(-50, 50))
def test_folded_coordinates_show_what_the_extension_shows(x: float) -> None:
    image = Texture(np.arange(12, dtype=np.uint8).reshape(1, 4, 3), "extend", "closest")
    for fold, extension in (("wrap", "repeat"), ("pingpong", "mirror")):
        if abs(x * 4 - round(x * 4)) < 1e-6:
            continue  # between two pixels
        folded = replace(image, placement=Placement(0, None, (fold, "none")))
        uv = np.array([[x, 0.5]])
        assert folded.lookup(uv).tolist() == replace(image, extension=extension).lookup(uv).tolist()


def test_plain_color() -> None:
    assert PlainColor((0.1, 0.2, 0.3)).lookup(np.zeros((4, 2))).tolist() == [[0.1, 0.2, 0.3]] * 4
