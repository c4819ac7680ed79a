# SPDX-License-Identifier: GPL-3.0-or-later
"""What color a surface has: its materials, plain colors and textures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from .colorspace import decode_srgb, encode_srgb
from .geometry import Floats

Extension = Literal["repeat", "extend", "clip", "mirror"]
Interpolation = Literal["linear", "closest", "cubic"]
Fold = Literal["none", "wrap", "pingpong"]

FAR = 4.0  # image sides; no interpolation reaches farther, were the image a single pixel
MISSING = (1.0, 0.0, 1.0)  # linear light: magenta, what Blender shows for an image that is not there


class Color(Protocol):
    """What color a material has at a place, from the corner values there (MeshArrays.corners)."""

    def lookup(self, values: Floats) -> Floats:
        """(N, 3) float64 colors in [0, 1], encoded for display (sRGB), for (N, K) interpolated values."""


class Alpha(Protocol):
    """How opaque a material is at a place."""

    def opacity(self, values: Floats) -> Floats:
        """(N,) float64 in [0, 1] for (N, K) interpolated values."""


How = Literal["read", "baked", "plain", "given", "none"]


@dataclass(frozen=True)
class ImageFacts:
    """An image that a material uses, whether the metric sees it or not.

    Attributes:
        role: "base color", "alpha", or the shader's input that it feeds ("Normal", "Roughness"). roles: all that it
            feeds; empty: only that one.
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
    roles: tuple[str, ...] = ()


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
        return color.T

    def _taps(self, first: Floats, size: int, weights: Sequence[Any]) -> list[tuple[NDArray[np.int64], Any]]:
        """Pixel indices in [0, size), from the first, anywhere, on; each with its weight."""
        taps = []
        for step, weight in enumerate(weights):
            index = (first + step).astype(np.int64)
            if self.extension == "clip":
                weight = weight * ((index >= 0) & (index < size))
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


def image_arrays(part: object) -> Iterator[NDArray[Any]]:
    """The pixels of every texture in a material, or in one of its samplers, whatever it is mixed from."""
    if isinstance(part, Texture):
        yield part.pixels
    elif isinstance(part, tuple):
        for item in part:
            yield from image_arrays(item)
    elif is_dataclass(part):
        for field in fields(part):
            yield from image_arrays(getattr(part, field.name))


def _weighted_row(flat: NDArray[Any], start: NDArray[np.int64], columns: list[tuple[NDArray[np.int64], Any]]) -> Floats:
    """(channels, N) the weighted sum over the columns of the rows that begin at start."""

    def weighted(column: NDArray[np.int64], weight: Any) -> Floats:
        values: Floats = flat.take(start + column, axis=0).T.astype(np.float64, order="C")
        values *= weight
        return values

    total = weighted(*columns[0])
    for column, weight in columns[1:]:
        total += weighted(column, weight)
    return total


def _fold(x: Floats, fold: Fold) -> Floats:
    if fold == "wrap":
        return x - np.floor(x)
    if fold == "pingpong":
        return np.abs(x - 2 * np.floor(x / 2 + 0.5))
    return x


def _linear_weights(t: Floats) -> list[Floats]:
    return [1 - t, t]


def _cubic_weights(t: Floats) -> list[Floats]:
    """The uniform cubic B-spline of the pixels at -1, 0, 1, 2 for places t in [0, 1)."""
    s = 1 - t
    return [w / 6 for w in (s**3, 3 * t**3 - 6 * t**2 + 4, 3 * s**3 - 6 * s**2 + 4, t**3)]
