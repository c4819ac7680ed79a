# SPDX-License-Identifier: GPL-3.0-or-later
"""What color a surface has: textures, plain colors, and the color spaces they are compared in."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Extension = Literal["repeat", "extend", "clip", "mirror"]
Interpolation = Literal["linear", "closest"]

LAB_SCALE = 100.0  # L* of white becomes 1, as RGB's
LAB_WEIGHTS = (6.0, 1.0, 1.0)  # supplement, "Ablations": L, a, b
RGB_WEIGHTS = (1.0, 1.0, 1.0)  # V-E3: plain mean over r, g, b
EDGE = 1e-9  # texture coordinates this far outside [0, 1] are on its edge, up to rounding
_D65 = np.array([0.95047, 1.0, 1.08883])  # CIE 1931 2 degree white, Y = 1
_RGB_TO_XYZ = np.array(  # IEC 61966-2-1
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


class Color(Protocol):
    """What color a material has at a place, from the corner values there (MeshArrays.corners)."""

    def lookup(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 3) float64 colors in [0, 1], encoded for display (sRGB), for (N, K) interpolated values."""


class Alpha(Protocol):
    """How opaque a material is at a place."""

    def opacity(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N,) float64 in [0, 1] for (N, K) interpolated values."""


How = Literal["read", "baked", "plain", "given", "none"]


@dataclass(frozen=True)
class ImageFacts:
    """An image that a material uses, whether the metric sees it or not.

    Attributes:
        role: "base color", "alpha", or the shader's input that it feeds ("Normal", "Roughness").
        name, path: as Blender has them; the path is "" for images that were made in Blender.
        width, height: pixels; 0 where unknown.
        color_space: Blender's name of it.
        missing: neither its file nor its data are there.
        digest: the same for the same content; "" where missing.
    """

    role: str
    name: str
    path: str
    width: int
    height: int
    color_space: str
    missing: bool
    digest: str


@dataclass(frozen=True)
class Material:
    """What triangles look like.

    Attributes:
        name: for messages and reports.
        color, alpha: at a place; None is opaque everywhere.
        how: where the color is from: its nodes were read or baked, only a plain color was taken, a texture was
            given for the whole asset, or there is no material.
        images: what it uses.
        uv: the first of the two channels of corners that hold texture coordinates; None: it has none. For reports.
    """

    name: str
    color: Color
    alpha: Alpha | None = None
    how: How = "read"
    images: tuple[ImageFacts, ...] = ()
    uv: int | None = None


@dataclass(frozen=True)
class PlainColor:
    """One color everywhere: rgb as encoded for display (sRGB), in [0, 1]."""

    rgb: tuple[float, float, float]

    def lookup(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.broadcast_to(np.asarray(self.rgb, np.float64), (len(values), 3))


@dataclass(frozen=True)
class Texture:
    """An image on a surface (IV-A).

    Attributes:
        pixels: (H, W, 3) uint8, or float32 in [0, 1]; encoded for display (sRGB); row 0 is the top.
        extension: what lies outside [0, 1]; "clip" is black.
        interpolation: "linear" is bilinear over four pixels, "closest" the pixel that holds the point.
    """

    pixels: NDArray[np.uint8] | NDArray[np.float32]
    extension: Extension = "repeat"
    interpolation: Interpolation = "linear"

    def lookup(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """Equation (7): (N, 3) float64 colors in [0, 1] for (N, 2) texture coordinates.

        Pixel i = u W - 0.5, j = (1 - v) H - 0.5, bilinear in float64.
        """
        height, width = self.pixels.shape[:2]
        u, v = uv[:, 0], uv[:, 1]
        if self.extension == "repeat":  # keep the float arithmetic below small for any u
            u, v = u - np.floor(u), v - np.floor(v)
        elif self.extension == "mirror":
            u, v = u - 2 * np.floor(u / 2), v - 2 * np.floor(v / 2)
        else:
            u, v = np.clip(u, -1, 2), np.clip(v, -1, 2)
        i, j = u * width - 0.5, (1 - v) * height - 0.5
        pixels = self.pixels.reshape(-1, 3)
        if self.interpolation == "closest":
            # Rows are counted from the top here, but a place between two belongs to the lower v as in Blender.
            row, column = self._wrap(np.ceil(j + 0.5) - 1, height), self._wrap(np.floor(i + 0.5), width)
            color = _at(pixels, row * width + column).astype(np.float64)
        else:
            i0, j0 = np.floor(i), np.floor(j)
            fi, fj = (i - i0)[:, None], (j - j0)[:, None]
            left, right = self._wrap(i0, width), self._wrap(i0 + 1, width)
            top, bottom = self._wrap(j0, height) * width, self._wrap(j0 + 1, height) * width
            color = (_at(pixels, top + left) * (1 - fi) + _at(pixels, top + right) * fi) * (1 - fj)
            color += (_at(pixels, bottom + left) * (1 - fi) + _at(pixels, bottom + right) * fi) * fj
        if self.pixels.dtype == np.uint8:
            color /= 255
        if self.extension == "clip":
            color[(uv < -EDGE).any(axis=1) | (uv > 1 + EDGE).any(axis=1)] = 0
        return color

    def _wrap(self, index: NDArray[np.float64], size: int) -> NDArray[np.int64]:
        """Whole pixel indices, anywhere, to [0, size)."""
        whole = index.astype(np.int64)
        if self.extension == "repeat":
            return whole % size
        if self.extension == "mirror":
            whole %= 2 * size
            return np.minimum(whole, 2 * size - 1 - whole)
        return np.clip(whole, 0, size - 1)


def _at(pixels: NDArray[Any], index: NDArray[np.int64]) -> NDArray[Any]:
    return pixels.take(index, axis=0)


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
