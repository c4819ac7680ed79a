# SPDX-License-Identifier: GPL-3.0-or-later
"""What a material's nodes calculate, as colors and numbers that numpy evaluates; knows nothing of Blender."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Literal, Protocol

import numpy as np

from ...metric.colorspace import encode_srgb
from ...metric.geometry import Floats
from ...metric.texture import PlainColor, Texture, Tiles

BRIGHTEST = 1e6  # linear light is kept within this, so that nothing made of it overflows
LUMINANCE = (0.2126729, 0.7151522, 0.0721750)  # a color where a number is wanted
AVERAGE = (1 / 3, 1 / 3, 1 / 3)  # a vector where a number is wanted
CHANNELS = {"Red": (1.0, 0.0, 0.0), "Green": (0.0, 1.0, 0.0), "Blue": (0.0, 0.0, 1.0)} | {
    "X": (1.0, 0.0, 0.0),
    "Y": (0.0, 1.0, 0.0),
    "Z": (0.0, 0.0, 1.0),
}


class Light(Protocol):
    """A color while it is still calculated with: what colors are made of."""

    def light_at(self, values: Floats) -> Floats:
        """(N, 3) float64 linear light, finite, not clipped, for (N, K) interpolated values."""


class Value(Protocol):
    """A number while it is still calculated with: what opacities are made of."""

    def value_at(self, values: Floats) -> Floats:
        """(N,) float64, finite, not clipped, for (N, K) interpolated values."""


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
OPERATIONS: dict[str, Operation] = {  # of Math nodes
    "ADD": "add",
    "SUBTRACT": "subtract",
    "MULTIPLY": "multiply",
    "LESS_THAN": "less",
    "GREATER_THAN": "greater",
    "ROUND": "round",
    "MINIMUM": "minimum",
    "MAXIMUM": "maximum",
}


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


def plain_color(linear: tuple[float, ...]) -> PlainColor:
    """A linear color as a material has it, encoded."""
    red, green, blue = encode_srgb(np.array([finite(x) for x in linear])).tolist()
    return PlainColor((red, green, blue))


def finite(number: float) -> float:
    """Sockets take any float; what is made of them must stay finite."""
    return min(max(number, -BRIGHTEST), BRIGHTEST) if isfinite(number) else 0.0


_NOWHERE: Floats = np.zeros((1, 0))


def evaluated(light: Light) -> PlainLight:
    """The color of a constant light."""
    red, green, blue = light.light_at(_NOWHERE)[0].tolist()
    return PlainLight((finite(red), finite(green), finite(blue)))


def scaled(light: Light, scale: tuple[float, ...], bias: tuple[float, ...]) -> Light:
    """A light times a scale plus a bias, channel by channel."""
    if scale == (1.0, 1.0, 1.0) and bias == (0.0, 0.0, 0.0):
        return light
    scaled = Scaled(light, (scale[0], scale[1], scale[2]), (bias[0], bias[1], bias[2]))
    return evaluated(scaled) if isinstance(light, PlainLight) else scaled


def weighted(light: Light, weights: tuple[float, float, float]) -> Value:
    """The weighted sum of a light's channels."""
    weighted = Weighted(light, weights)
    return Constant(float(weighted.value_at(_NOWHERE)[0])) if isinstance(light, PlainLight) else weighted


def arithmetic(operation: Operation, first: Value, second: Value, clamp: bool = False) -> Value:
    """What a Math node makes of two numbers."""
    value = Arithmetic(operation, first, second, clamp)
    constant = isinstance(first, Constant) and isinstance(second, Constant)
    return Constant(finite(float(value.value_at(_NOWHERE)[0]))) if constant else value


def clamped(value: Value) -> Value:
    """To [0, 1]."""
    return arithmetic("add", value, Constant(0.0), clamp=True)


def product(first: Value, second: Value) -> Value:
    """The product of two numbers."""
    return first if isinstance(second, Constant) and second.number == 1 else arithmetic("multiply", first, second)
