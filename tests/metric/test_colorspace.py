# SPDX-License-Identifier: GPL-3.0-or-later
"""Color spaces by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fmqm_addon.metric.colorspace import channel_weights, channels, decode_srgb, encode_srgb, srgb_to_lab


@pytest.mark.parametrize(
    ("linear", "encoded"),
    [(0, 0), (1, 1), (0.0031308, 0.04045), (0.214041, 0.5), (0.5, 0.735357), (0.001, 0.01292), (-3, 0), (9, 1)],
)
def test_srgb_encoding_by_hand(linear: float, encoded: float) -> None:
    assert encode_srgb(np.array([linear]))[0] == pytest.approx(encoded, abs=1e-5)
    if 0 <= linear <= 1:
        assert decode_srgb(np.array([encoded]))[0] == pytest.approx(linear, abs=1e-5)


@given(st.floats(0, 1))
def test_srgb_goes_back_and_forth(x: float) -> None:
    assert decode_srgb(encode_srgb(np.array([x])))[0] == pytest.approx(x, abs=2e-7)


@pytest.mark.parametrize(
    ("rgb", "lab"),
    [
        ((1, 1, 1), (100, 0, 0)),
        ((0, 0, 0), (0, 0, 0)),
        ((0.5, 0.5, 0.5), (53.39, 0, 0)),
        ((1, 0, 0), (53.24, 80.09, 67.20)),
        ((0, 1, 0), (87.73, -86.18, 83.18)),
        ((0, 0, 1), (32.30, 79.19, -107.86)),
        ((1, 1, 0), (97.14, -21.55, 94.48)),
        ((0.02, 0.02, 0.02), (1.40, 0, 0)),  # the straight part of f: 903.3 Y
    ],
)
def test_lab_by_hand(rgb: tuple[float, ...], lab: tuple[float, ...]) -> None:
    np.testing.assert_allclose(srgb_to_lab(np.array([rgb], float))[0] * 100, lab, atol=0.02)


def test_channels_are_the_saved_values() -> None:
    """RGB: the float32 NCF, no more digits; Lab: made of it and rounded alike."""
    ncf = np.random.default_rng(0).random((50, 3)).astype(np.float32)
    rgb, lab = channels(ncf, "rgb"), channels(ncf, "lab")
    assert rgb.dtype == lab.dtype == np.float64
    assert np.array_equal(rgb.astype(np.float32), ncf)
    assert np.array_equal(lab, lab.astype(np.float32))
    np.testing.assert_allclose(lab, srgb_to_lab(ncf.astype(np.float64)), atol=1e-6)


def test_channel_weights() -> None:
    assert channel_weights("lab").tolist() == [6, 1, 1]
    assert len(set(channel_weights("rgb").tolist())) == 1
