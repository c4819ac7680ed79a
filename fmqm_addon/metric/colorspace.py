# SPDX-License-Identifier: GPL-3.0-or-later
"""The color spaces that colors are looked up, calculated with and compared in."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

LAB_SCALE = 100.0  # L* of white becomes 1, as RGB's
LAB_WEIGHTS = (6.0, 1.0, 1.0)  # supplement, "Ablations": L, a, b
RGB_WEIGHTS = (1.0, 1.0, 1.0)  # V-E3: plain mean over r, g, b
_D65 = np.array([0.95047, 1.0, 1.08883])  # CIE 1931 2 degree white, Y = 1
_RGB_TO_XYZ = np.array(  # IEC 61966-2-1
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


def encode_srgb(linear: NDArray[Any]) -> NDArray[np.float64]:
    """Linear light to the sRGB encoding, clipped to [0, 1] (IEC 61966-2-1)."""
    x = np.clip(np.asarray(linear, np.float64), 0, 1)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)


def decode_srgb(encoded: NDArray[Any]) -> NDArray[np.float64]:
    """The sRGB encoding, in [0, 1], to linear light (IEC 61966-2-1)."""
    x = np.asarray(encoded, np.float64)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def srgb_to_lab(rgb: NDArray[Any]) -> NDArray[np.float64]:
    """(N, 3) encoded sRGB in [0, 1] to CIE L*a*b* under D65, divided by 100."""
    xyz = decode_srgb(rgb) @ (_RGB_TO_XYZ / _D65[:, None]).T
    f = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    x, y, z = f.T
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=1) / LAB_SCALE


def channels(ncf: NDArray[np.float32], color_space: str) -> NDArray[np.float64]:
    """The (N, 3) channels that features compare: exactly the saved float32 NCF, or its Lab rounded alike."""
    if color_space == "lab":
        return srgb_to_lab(ncf).astype(np.float32).astype(np.float64)
    return ncf.astype(np.float64)


def channel_weights(color_space: str) -> NDArray[np.float64]:
    """Weights over the channels, summing to 1 when divided by their sum."""
    return np.array(LAB_WEIGHTS if color_space == "lab" else RGB_WEIGHTS)
