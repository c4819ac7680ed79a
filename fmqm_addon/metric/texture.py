# SPDX-License-Identifier: GPL-3.0-or-later
"""What color a surface has: textures, plain colors, and the color spaces they are compared in."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

Extension = Literal["repeat", "extend", "clip", "mirror"]
Interpolation = Literal["linear", "closest", "cubic"]
Fold = Literal["none", "wrap", "pingpong"]

LAB_SCALE = 100.0  # L* of white becomes 1, as RGB's
LAB_WEIGHTS = (6.0, 1.0, 1.0)  # supplement, "Ablations": L, a, b
RGB_WEIGHTS = (1.0, 1.0, 1.0)  # V-E3: plain mean over r, g, b
FAR = 4.0  # image sides; no interpolation reaches farther, were the image a single pixel
MISSING = (1.0, 0.0, 1.0)  # linear light: magenta, what Blender shows for an image that is not there
_D65 = np.array([0.95047, 1.0, 1.08883])  # CIE 1931 2 degree white, Y = 1
_RGB_TO_XYZ = np.array(  # IEC 61966-2-1
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)


class Color(Protocol):
    """What color a material has at a place, from the corner values there (MeshArrays.corners)."""

    def lookup(self, values: Floats) -> Floats:
        """(N, 3) float64 colors in [0, 1], encoded for display (sRGB), for (N, K) interpolated values."""


class Alpha(Protocol):
    """How opaque a material is at a place."""

    def opacity(self, values: Floats) -> Floats:
        """(N,) float64 in [0, 1] for (N, K) interpolated values."""


class Light(Protocol):
    """A color while it is still calculated with: what colors are made of."""

    def light_at(self, values: Floats) -> Floats:
        """(N, 3) float64 linear light, finite, not clipped, for (N, K) interpolated values."""


class Value(Protocol):
    """A number while it is still calculated with: what opacities are made of."""

    def value_at(self, values: Floats) -> Floats:
        """(N,) float64, finite, not clipped, for (N, K) interpolated values."""


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

    def lookup(self, values: Floats) -> Floats:
        return np.broadcast_to(np.asarray(self.rgb, np.float64), (len(values), 3))


@dataclass(frozen=True)
class Encoded:
    """Light as it is displayed: clipped to [0, 1] and encoded (the Standard view transform)."""

    light: Light

    def lookup(self, values: Floats) -> Floats:
        return encode_srgb(_known(self.light.light_at(values)))


def _known(numbers: Floats) -> Floats:
    """Long chains of huge factors may overflow to what is no number; that is 0."""
    return numbers if np.isfinite(numbers).all() else np.nan_to_num(numbers)


@dataclass(frozen=True)
class Opacity:
    """A value as an opacity, clipped to [0, 1]."""

    value: Value

    def opacity(self, values: Floats) -> Floats:
        return np.clip(_known(self.value.value_at(values)), 0, 1)


@dataclass(frozen=True)
class PlainLight:
    """One color everywhere: rgb in linear light, any finite numbers."""

    rgb: tuple[float, float, float]

    def light_at(self, values: Floats) -> Floats:
        return np.broadcast_to(np.asarray(self.rgb, np.float64), (len(values), 3))


@dataclass(frozen=True)
class VertexColor:
    """A color attribute, which holds linear light: four channels of the corner values, from the given one on."""

    channel: int

    def light_at(self, values: Floats) -> Floats:
        return values[:, self.channel : self.channel + 3]

    def value_at(self, values: Floats) -> Floats:
        """Its alpha."""
        return values[:, self.channel + 3]


@dataclass(frozen=True)
class Mix:
    """Two colors in linear light: first (1 - factor) + factor second, or, multiplied, + factor first second.

    Attributes:
        factor: any finite number.
        clamp: of the result, to [0, 1].
    """

    first: Light
    second: Light
    factor: float
    multiply: bool = False
    clamp: bool = False

    def light_at(self, values: Floats) -> Floats:
        first, second = self.first.light_at(values), self.second.light_at(values)
        mixed = first * (1 - self.factor) + (first * second if self.multiply else second) * self.factor
        return np.clip(mixed, 0, 1) if self.clamp else mixed


@dataclass(frozen=True)
class Scaled:
    """A color times a scale plus a bias, for each of r, g, b, in linear light."""

    light: Light
    scale: tuple[float, float, float]
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def light_at(self, values: Floats) -> Floats:
        return self.light.light_at(values) * np.asarray(self.scale) + np.asarray(self.bias)


@dataclass(frozen=True)
class Grey:
    """A value as a color."""

    value: Value

    def light_at(self, values: Floats) -> Floats:
        return np.repeat(self.value.value_at(values)[:, None], 3, axis=1)


@dataclass(frozen=True)
class Constant:
    """One number everywhere."""

    number: float

    def value_at(self, values: Floats) -> Floats:
        return np.full(len(values), self.number)


@dataclass(frozen=True)
class Weighted:
    """The sum of weights times r, g, b in linear light: a channel of a color, or its luminance."""

    light: Light
    weights: tuple[float, float, float]

    def value_at(self, values: Floats) -> Floats:
        return self.light.light_at(values) @ np.asarray(self.weights)


@dataclass(frozen=True)
class ImageAlpha:
    """The alpha of a texture."""

    texture: Texture | Tiles

    def value_at(self, values: Floats) -> Floats:
        return self.texture.alpha_at(values)


Operation = Literal["add", "subtract", "multiply", "less", "greater", "round", "minimum", "maximum"]


@dataclass(frozen=True)
class Arithmetic:
    """Two values made one; "round" takes the first. "less" and "greater" are 0 or 1.

    Attributes:
        clamp: of the result, to [0, 1].
    """

    operation: Operation
    first: Value
    second: Value
    clamp: bool = False

    def value_at(self, values: Floats) -> Floats:
        found = _OPERATIONS[self.operation](self.first.value_at(values), self.second.value_at(values))
        return np.clip(found, 0, 1) if self.clamp else found


_OPERATIONS: dict[Operation, Callable[[Floats, Floats], Floats]] = {
    "add": np.add,
    "subtract": np.subtract,
    "multiply": np.multiply,
    "less": lambda a, b: (a < b).astype(np.float64),
    "greater": lambda a, b: (a > b).astype(np.float64),
    "round": lambda a, b: np.floor(a + 0.5),
    "minimum": np.minimum,
    "maximum": np.maximum,
}


@dataclass(frozen=True)
class Placement:
    """Where on an image a place of the surface lies.

    Attributes:
        channel: the first of the two channels of the corner values that hold the texture coordinates.
        affine: ((a, b, c), (d, e, f)): u' = a u + b v + c, v' = d u + e v + f; None leaves them as they are.
        fold: what is done to u' and v' after that: "wrap" to [0, 1), "pingpong" there and back again.
    """

    channel: int = 0
    affine: tuple[tuple[float, float, float], tuple[float, float, float]] | None = None
    fold: tuple[Fold, Fold] = ("none", "none")

    def at(self, values: Floats) -> tuple[Floats, Floats]:
        """(N,) u and (N,) v for (N, K) corner values."""
        u, v = values[:, self.channel], values[:, self.channel + 1]
        if self.affine is not None:
            (a, b, c), (d, e, f) = self.affine
            u, v = a * u + b * v + c, d * u + e * v + f
        return _fold(u, self.fold[0]), _fold(v, self.fold[1])


@dataclass(frozen=True)
class Texture:
    """An image on a surface (IV-A).

    Attributes:
        pixels: (H, W, 3 or 4) uint8, or float32; row 0 is the top. Without a fourth channel it is opaque.
        extension: what lies outside [0, 1]; "clip" is black and transparent.
        interpolation: "linear" is bilinear over four pixels, "closest" the pixel that holds the point, "cubic" the
            uniform B-spline over sixteen, which blurs a little.
        linear: the pixels hold linear light, any finite numbers; otherwise they are encoded for display (sRGB), in
            [0, 1] or bytes.
        unassociate: the pixels' color is multiplied by their alpha, and is divided by it after the interpolation.
        placement: where on the image a place lies.
        solid: opaque everywhere, outside [0, 1] too.
    """

    pixels: NDArray[np.uint8] | NDArray[np.float32]
    extension: Extension = "repeat"
    interpolation: Interpolation = "linear"
    linear: bool = False
    unassociate: bool = False
    placement: Placement = Placement()
    solid: bool = False

    def lookup(self, values: Floats) -> Floats:
        """Equations (6) and (7): (N, 3) float64 colors in [0, 1] for (N, K) corner values.

        Pixel i = u W - 0.5, j = (1 - v) H - 0.5, bilinear in float64.
        """
        color = self._color(*self.placement.at(values))
        return encode_srgb(color) if self.linear else color

    def light_at(self, values: Floats) -> Floats:
        color = self._color(*self.placement.at(values))
        return color if self.linear else decode_srgb(color)

    def alpha_at(self, values: Floats) -> Floats:
        """(N,) float64 in [0, 1] for bytes."""
        return self._alpha(*self.placement.at(values))

    def _color(self, u: Floats, v: Floats) -> Floats:
        """(N, 3) as the pixels have it: encoded or linear."""
        color = self._interpolated(self.pixels, u, v)
        if self.unassociate:
            alpha = color[:, 3] if color.shape[1] == 4 else self._alpha(u, v)
            color = color[:, :3] / np.where(alpha == 0, 1, alpha)[:, None]
        return color[:, :3]

    def _alpha(self, u: Floats, v: Floats) -> Floats:
        if self.solid:
            return np.ones(len(u))
        if self.pixels.shape[2] == 4:
            return self._interpolated(self.pixels[:, :, 3:], u, v)[:, 0]
        if self.extension == "clip":
            return self._interpolated(np.full((*self.pixels.shape[:2], 1), 255, np.uint8), u, v)[:, 0]
        return np.ones(len(u))

    def _interpolated(self, pixels: NDArray[Any], u: Floats, v: Floats) -> Floats:
        """(N, channels) float64, bytes as [0, 1]."""
        height, width, depth = pixels.shape
        if self.extension == "repeat":  # keep the float arithmetic below small for any u
            u, v = u - np.floor(u), v - np.floor(v)
        elif self.extension == "mirror":
            u, v = u - 2 * np.floor(u / 2), v - 2 * np.floor(v / 2)
        else:  # farther out than any interpolation reaches from the image
            u, v = np.clip(u, -FAR, 1 + FAR), np.clip(v, -FAR, 1 + FAR)
        i, j = u * width - 0.5, (1 - v) * height - 0.5
        if self.interpolation == "closest":
            # Rows are counted from the top here, but a place between two belongs to the lower v as in Blender.
            columns, rows = self._taps(np.floor(i + 0.5), width, [1.0]), self._taps(np.ceil(j + 0.5) - 1, height, [1.0])
        elif self.interpolation == "linear":
            i0, j0 = np.floor(i), np.floor(j)
            columns = self._taps(i0, width, _linear_weights(i - i0))
            rows = self._taps(j0, height, _linear_weights(j - j0))
        else:
            i0, j0 = np.floor(i), np.floor(j)
            columns = self._taps(i0 - 1, width, _cubic_weights(i - i0))
            rows = self._taps(j0 - 1, height, _cubic_weights(j - j0))
        flat = pixels.reshape(-1, depth)
        color = _weighted_row(flat, rows[0][0] * width, columns)
        color *= rows[0][1]
        for row, weight in rows[1:]:
            line = _weighted_row(flat, row * width, columns)
            line *= weight
            color += line
        if pixels.dtype == np.uint8:
            color /= 255
        return color

    def _taps(self, first: Floats, size: int, weights: Sequence[Any]) -> list[tuple[NDArray[np.int64], Any]]:
        """Pixel indices in [0, size), from the first, anywhere, on; each with its weight."""
        taps = []
        for step, weight in enumerate(weights):
            index = (first + step).astype(np.int64)
            if self.extension == "clip":
                weight = weight * ((index >= 0) & (index < size))[:, None]
            taps.append((self._wrap(index, size), weight))
        return taps

    def _wrap(self, index: NDArray[np.int64], size: int) -> NDArray[np.int64]:
        if self.extension == "repeat":
            return index % size
        if self.extension == "mirror":
            index = index % (2 * size)
            return np.minimum(index, 2 * size - 1 - index)
        return np.clip(index, 0, size - 1)


@dataclass(frozen=True)
class Tiles:
    """A UDIM set: tile (column, row) is seen where u and v have these whole parts; other places are magenta.

    Attributes:
        tiles: with textures as they are placed on [0, 1]; ((column, row), texture).
        placement: where a place lies.
    """

    tiles: tuple[tuple[tuple[int, int], Texture], ...]
    placement: Placement = Placement()

    def light_at(self, values: Floats) -> Floats:
        uv = np.stack(self.placement.at(values), axis=1)
        light = np.tile(np.asarray(MISSING), (len(uv), 1))
        for texture, here, inside in self._parts(uv):
            light[here] = texture.light_at(inside)
        return light

    def alpha_at(self, values: Floats) -> Floats:
        uv = np.stack(self.placement.at(values), axis=1)
        alpha = np.ones(len(uv))
        for texture, here, inside in self._parts(uv):
            alpha[here] = texture.alpha_at(inside)
        return alpha

    def _parts(self, uv: Floats) -> Iterator[tuple[Texture, NDArray[np.int64], Floats]]:
        """Each tile that is seen, where, and at which of its own coordinates."""
        whole = np.trunc(uv)  # as Cycles: what lies between -1 and 0 belongs to the first tile
        for place, texture in self.tiles:
            here = np.flatnonzero((whole == place).all(axis=1))
            if here.size:
                yield texture, here, uv[here] - place


def _weighted_row(flat: NDArray[Any], start: NDArray[np.int64], columns: list[tuple[NDArray[np.int64], Any]]) -> Floats:
    """(N, channels) the weighted sum over the columns of the rows that begin at start."""
    total = flat.take(start + columns[0][0], axis=0) * columns[0][1]
    for column, weight in columns[1:]:
        total += flat.take(start + column, axis=0) * weight
    return total


def _fold(x: Floats, fold: Fold) -> Floats:
    if fold == "wrap":
        return x - np.floor(x)
    if fold == "pingpong":
        return np.abs(x - 2 * np.floor(x / 2 + 0.5))
    return x


def _linear_weights(t: Floats) -> list[Floats]:
    return [(1 - t)[:, None], t[:, None]]


def _cubic_weights(t: Floats) -> list[Floats]:
    """The uniform cubic B-spline of the pixels at -1, 0, 1, 2 for places t in [0, 1)."""
    s = 1 - t
    return [w[:, None] / 6 for w in (s**3, 3 * t**3 - 6 * t**2 + 4, 3 * s**3 - 6 * s**2 + 4, t**3)]


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
