# SPDX-License-Identifier: GPL-3.0-or-later
"""What nodes calculate, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fmqm_addon.blender.materials.expressions import (
    Arithmetic,
    Constant,
    Encoded,
    Grey,
    Light,
    Mix,
    Opacity,
    Operation,
    PlainLight,
    Scaled,
    VertexColor,
    Weighted,
)
from fmqm_addon.metric.colorspace import encode_srgb
from fmqm_addon.metric.texture import Texture, Tiles

VALUES = np.array([[0.2, 0.4, 0.6, 0.5], [1.5, 0.0, 1.0, 0.25]])


@pytest.mark.parametrize(
    ("light", "wanted"),
    [
        (VertexColor(0), VALUES[:, :3]),
        (Mix(VertexColor(0), PlainLight((1, 0, 0)), 0.25), [[0.4, 0.3, 0.45], [1.375, 0, 0.75]]),
        (Mix(VertexColor(0), PlainLight((1, 0, 2)), 1, multiply=True), [[0.2, 0, 1.2], [1.5, 0, 2]]),
        (Mix(VertexColor(0), PlainLight((1, 0, 2)), 0.5, multiply=True), [[0.2, 0.2, 0.9], [1.5, 0, 1.5]]),
        (Mix(VertexColor(0), PlainLight((1, 0, 2)), 1, multiply=True, clamp=True), [[0.2, 0, 1], [1, 0, 1]]),
        (Scaled(VertexColor(0), (2, 1, 0), (0, 0.1, 0.3)), [[0.4, 0.5, 0.3], [3, 0.1, 0.3]]),
        (Grey(Weighted(VertexColor(0), (0, 0.5, 1))), [[0.8] * 3, [1.0] * 3]),
        (Grey(VertexColor(0)), [[0.5] * 3, [0.25] * 3]),
    ],
)
def test_lights_by_hand(light: Light, wanted: list[list[float]]) -> None:
    np.testing.assert_allclose(light.light_at(VALUES), wanted, atol=1e-12)
    np.testing.assert_allclose(Encoded(light).lookup(VALUES), encode_srgb(np.array(wanted)), atol=1e-12)


@pytest.mark.parametrize(
    ("operation", "second", "wanted"),
    [
        ("add", 0.75, [1.25, 1.0]),
        ("subtract", 0.75, [-0.25, -0.5]),
        ("multiply", 2.0, [1.0, 0.5]),
        ("less", 0.5, [0.0, 1.0]),
        ("greater", 0.25, [1.0, 0.0]),
        ("round", 9.0, [1.0, 0.0]),
        ("minimum", 0.3, [0.3, 0.25]),
        ("maximum", 0.3, [0.5, 0.3]),
    ],
)
def test_arithmetic_by_hand(operation: Operation, second: float, wanted: list[float]) -> None:
    value = Arithmetic(operation, VertexColor(0), Constant(second))
    np.testing.assert_allclose(value.value_at(VALUES), wanted)
    clipped = np.clip(wanted, 0, 1)
    np.testing.assert_allclose(replace(value, clamp=True).value_at(VALUES), clipped)
    np.testing.assert_allclose(Opacity(value).opacity(VALUES), clipped)


def test_tiles() -> None:
    """Each place shows its own tile, between -1 and 0 the first; others magenta."""
    tiles = tuple(((column, 0), Texture(np.full((1, 1, 3), 100 + column, np.uint8))) for column in (0, 1))
    uv = np.array([[0.5, 0.5], [1.5, 0.2], [-0.5, 0.5], [2.5, 0.5], [0.5, 1.5]])
    assert np.round(Encoded(Tiles(tiles)).lookup(uv) * 255).tolist() == [
        [100] * 3, [101] * 3, [100] * 3, [255, 0, 255], [255, 0, 255],
    ]  # fmt: skip
    assert Tiles(tiles).alpha_at(uv).tolist() == [1] * 5


def test_what_overflows_is_a_color_all_the_same() -> None:
    """Infinite times nothing is no number."""

    class Endless:
        def light_at(self, values: np.ndarray) -> np.ndarray:
            return np.full((len(values), 3), [np.nan, np.inf, -np.inf])

        def value_at(self, values: np.ndarray) -> np.ndarray:
            return np.full(len(values), np.nan)

    assert Encoded(Endless()).lookup(np.zeros((2, 0))) == pytest.approx(np.array([[0, 1, 0]] * 2))
    assert Opacity(Endless()).opacity(np.zeros((2, 0))).tolist() == [0, 0]
