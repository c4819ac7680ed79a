# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be shown of a result: a number or a color at every place, its color, and the legend that explains it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from ...metric.evaluation import Result
from ...metric.fields import Fields
from ...metric.geometry import Floats, dot
from ..numbers import score_text
from .colormap import GREY_DARK, GREY_LIGHT, SKY, VERMILION, number_colors, score_colors, signed_colors
from .heat_map import fitted_range, round_ticks

# How values become colors.
SCORE = "score"  # 0 to 1, low is hot
AMOUNT = "amount"  # 0 up, high is hot
LENGTH = "length"  # the same in scene units
SIGNED = "signed"  # scene units, either side of 0
COLOR = "color"  # itself
SIDES = "sides"  # inside or outside of either surface
NUMBER = "number"  # only told apart

FIXED_LENGTH = {LENGTH: 0.01, SIGNED: 0.02}  # upper end of the fixed range, in diagonals of the reference
FIT_PERCENTILE = 99.0  # a fitted range of samples ends here: a few wild ones would flatten all others
SIDE_NAMES = ("Outside both", "Inside both", "Inside original only", "Inside LOD only")
_SIDE_COLORS = np.array([GREY_LIGHT, GREY_DARK, VERMILION, SKY])
_TICKS = 5


@dataclass(frozen=True)
class Layer:
    """Something to show.

    Attributes:
        name: identifier. label: for the menu and the legend. kind: how its values become colors.
        description: for an artist.
    """

    name: str
    label: str
    kind: str
    description: str

    @property
    def per_patch(self) -> bool:
        """Whether it has one value for all of a patch."""
        return self.kind in (SCORE, NUMBER)


LAYERS: dict[str, Layer] = {
    layer.name: layer
    for layer in (
        Layer("FMQM", "FMQM", SCORE, "Quality of each patch: what the score is the mean of"),
        Layer("geoSSIM", "geoSSIM", SCORE, "Shape: low where the surface moved away or lost relief"),
        Layer("geoGraSSIM", "geoGraSSIM", SCORE, "Facing: low where the surface faces another way"),
        Layer("colorSSIM", "colorSSIM", SCORE, "Color: low where colors changed or detail was lost"),
        Layer("colorGraSSIM", "colorGraSSIM", SCORE, "Detail: low where edges in the texture moved or blurred"),
        Layer("perceived", "Perceived", SCORE, "Perceived quality of each patch: what the score is the mean of"),
        Layer("shape", "Shape", SCORE, "Low where the surface moved away or lost relief"),
        Layer("facing", "Facing", SCORE, "Low where the surface faces another way, and shades so"),
        Layer("color", "Color", SCORE, "Low where colors or their contrast changed visibly"),
        Layer("detail", "Detail", SCORE, "Low where the texture is blurred, moved or broken up"),
        Layer("NCF_REFERENCE", "Color of Original", COLOR, "NCF: the original's color nearest to each sample"),
        Layer("NCF_COMPARED", "Color of LOD", COLOR, "NCF: the LOD's color nearest to each sample"),
        Layer(
            "NCF_DIFFERENCE",
            "Color Difference",
            AMOUNT,
            "Distance between the two colors in RGB",
        ),
        Layer(
            "SDF_REFERENCE",
            "Distance to Original",
            SIGNED,
            "SDF: distance to the original, negative inside",
        ),
        Layer(
            "SDF_COMPARED",
            "Distance to LOD",
            SIGNED,
            "SDF: distance to the LOD, negative inside",
        ),
        Layer(
            "SDF_DIFFERENCE",
            "Distance Difference",
            LENGTH,
            "How much the two differ: where the surface moved",
        ),
        Layer("SIDES", "Inside or Outside", SIDES, "On which side of the two surfaces each sample lies"),
        Layer("PATCH", "Patch Number", NUMBER, "Which samples belong to one patch"),
    )
}


@dataclass(frozen=True)
class Legend:
    """What the colors mean.

    Attributes:
        title: what is shown. subtitle: of which object.
        bar: encoded colors from the lower to the upper end, or empty. ticks: place in [0, 1] and text.
        mark: place in [0, 1] and text of the whole score, or None.
        swatches: encoded color and text of each kind of thing. note: one line below.
    """

    title: str
    subtitle: str
    bar: tuple[tuple[float, float, float], ...] = ()
    ticks: tuple[tuple[float, str], ...] = ()
    mark: tuple[float, str] | None = None
    swatches: tuple[tuple[tuple[float, float, float], str], ...] = ()
    note: str = ""

    def as_dict(self) -> dict[str, object]:
        """Plain values for JSON."""
        return asdict(self)


def layer_values(result: Result, name: str, length: float | None = None) -> NDArray[np.float64]:
    """A layer at the N samples.

    Args:
        name: of LAYERS. length: scene units of the metric's unit; the frame's, if None.

    Returns:
        (N,) float64: scores in [0, 1], differences, lengths in scene units, or whole numbers; (N, 3)
        encoded colors for the kind COLOR.
    """
    if LAYERS[name].per_patch:
        return patch_values(result, name)[result.samples.patch]
    return field_values(name, result.ref, result.dist, result.frame.scale if length is None else length)


def field_values(name: str, ref: Fields, dist: Fields, length: float) -> NDArray[np.float64]:
    """A layer that is not per patch, from the fields of both surfaces at the same places; as in layer_values."""
    if name in ("NCF_REFERENCE", "NCF_COMPARED"):
        return (ref if name == "NCF_REFERENCE" else dist).ncf.astype(np.float64)
    values: Floats
    if name == "NCF_DIFFERENCE":
        gap = ref.ncf.astype(np.float64) - dist.ncf
        values = np.sqrt(dot(gap, gap) / 3)
        return values
    if name == "SDF_DIFFERENCE":
        values = np.abs(ref.sdf - dist.sdf) * length
        return values
    if name == "SIDES":
        inside_r, inside_d = ref.sdf < 0, dist.sdf < 0
        return np.where(inside_r == inside_d, inside_r * 1.0, np.where(inside_r, 2.0, 3.0))
    return (ref if name == "SDF_REFERENCE" else dist).sdf * length


def patch_values(result: Result, name: str) -> NDArray[np.float64]:
    """(P,) a layer of the kinds SCORE and NUMBER."""
    if name == "PATCH":
        return np.arange(len(result.patches), dtype=np.float64)
    return result.of_patches(name)


def value_range(name: str, values: Floats, fitted: bool, diagonal: float) -> tuple[float, float]:
    """The lower and upper end of the color map; (0, 1) where there is none.

    Args:
        values: (N,) what is shown. fitted: to these values, not fixed.
        diagonal: of the reference's bounding box, in scene units.
    """
    kind = LAYERS[name].kind
    if kind not in (SCORE, AMOUNT, LENGTH, SIGNED):
        return 0.0, 1.0
    if not fitted or not len(values):
        high = diagonal * FIXED_LENGTH.get(kind, 1.0 / diagonal)
        return (-high if kind == SIGNED else 0.0), high
    if kind == SCORE:
        return fitted_range(values)
    high = float(np.percentile(np.abs(values), FIT_PERCENTILE)) or diagonal * 1e-6
    return (-high if kind == SIGNED else 0.0), high


def layer_colors(name: str, values: NDArray[np.float64], low: float, high: float) -> Floats:
    """(N, 3) encoded colors in [0, 1] of a layer's values between the ends of value_range."""
    kind = LAYERS[name].kind
    if kind == COLOR:
        return values
    if kind == SIDES:
        return _SIDE_COLORS[values.astype(np.int64)]
    if kind == NUMBER:
        return number_colors(values.astype(np.int64))
    if kind == SIGNED:
        return signed_colors(values / high)
    place = (values - low) / (high - low)
    return score_colors(place if kind == SCORE else 1 - place)


def legend(
    name: str,
    ends: tuple[float, float],
    subtitle: str,
    result: Result,
    length_text: Callable[[float], str] = lambda value: f"{value:.3g}",
) -> Legend:
    """The legend of a layer that is shown between two ends.

    Args:
        length_text: a length in scene units as the user wants to read it.
    """
    layer = LAYERS[name]
    if layer.kind == COLOR:
        return Legend(layer.label, subtitle, note="as in the textures")
    if layer.kind == NUMBER:
        return Legend(layer.label, subtitle, note=f"{len(result.patches)} patches")
    if layer.kind == SIDES:
        swatches = tuple((tuple(c), text) for c, text in zip(_SIDE_COLORS.tolist(), SIDE_NAMES, strict=True))
        return Legend(layer.label, subtitle, swatches=swatches)
    low, high = ends
    shown = np.linspace(low, high, 33)
    bar = tuple(tuple(color) for color in layer_colors(name, shown, low, high).tolist())
    if layer.kind == SCORE:
        numbers = round_ticks(low, high)
        text = number_text(numbers[1] - numbers[0] if len(numbers) > 1 else high - low)
    else:
        numbers = np.linspace(low, high, _TICKS).tolist()
        text = length_text if layer.kind in (LENGTH, SIGNED) else number_text((high - low) / (_TICKS - 1))
    ticks = tuple(((number - low) / (high - low), text(number)) for number in numbers)
    if layer.kind != SCORE:
        return Legend(layer.label, subtitle, bar, ticks)
    score = float(result.of_patches(name).mean())
    place = min(max((score - low) / (high - low), 0.0), 1.0)
    heading = layer.label if layer.label.lower() == name.lower() else f"{layer.label} ({name})"
    return Legend(heading, subtitle, bar, ticks, (place, score_text(score)))


def number_text(step: float) -> Callable[[float], str]:
    """Numbers with as many decimals as tell ticks that are a step apart."""
    decimals = int(np.clip(np.ceil(-np.log10(max(step, 1e-12)) - 1e-9), 1, 6))
    return lambda value: f"{value:.{decimals}f}"
