# SPDX-License-Identifier: GPL-3.0-or-later
"""Every hyperparameter of the metric, with the paper's value as its default.

Defaults, limits and texts stand here and nowhere else: the command line's --help and the sidebar ask info_of for them.
"""

from __future__ import annotations

import math
from dataclasses import Field, asdict, dataclass, field, fields, replace
from numbers import Integral, Real
from typing import Any

from .errors import SettingsError

CENTERS = ("fps", "random")
COLOR_SPACES = ("rgb", "lab")
POOLINGS = ("geometric", "arithmetic")

MIN_SAMPLES_PER_PATCH = 32  # below it the moments of a patch say nothing
MAX_SAMPLES = 100_000_000  # 500 times the paper's; they take 30 GB of memory
FAST_SCORED_PATCHES = 40  # preset "fast": the first FPS centres still cover the surface evenly


@dataclass(frozen=True)
class Info:
    """What is known of a setting besides its name and its default.

    Attributes:
        kind: int, float, str or bool.
        text: what it is: the help of its flag and, with a capital, of its button.
        minimum, maximum: of its values; None where there is none. above: the minimum itself is too small.
        infinity: what an infinite value means; "" where it may have none.
        choices: of a text.
    """

    kind: type
    text: str
    minimum: float | None = None
    maximum: float | None = None
    above: bool = False
    infinity: str = ""
    choices: tuple[str, ...] = ()

    @property
    def wanted(self) -> str:
        """Its limits in words, as they follow "it must be"."""
        if self.choices:
            return " or ".join(self.choices)
        if self.infinity:
            return f"above {self.minimum}, or inf for {self.infinity}"
        if self.maximum is not None:
            return f"between {self.minimum} and {self.maximum}"
        return f"{'' if self.kind is int else 'a finite number, '}at least {self.minimum}"

    def fault(self, value: Any) -> str:
        """What a value of this kind must be instead; "" if it is within the limits, which nan never is."""
        if self.choices:
            return "" if value in self.choices else self.wanted
        if self.kind is int and self.maximum is not None and value > self.maximum:
            return f"at most {self.maximum}"
        low = self.minimum is None or (value > self.minimum if self.above else value >= self.minimum)
        high = value <= self.maximum if self.maximum is not None else value < math.inf or bool(self.infinity)
        return "" if low and high else self.wanted


def setting(default: Any, text: str, kind: type | None = None, **limits: Any) -> Any:
    """A field of a dataclass with its default and its Info; its kind is the default's unless it is given."""
    return field(default=default, metadata={"info": Info(kind or type(default), text, **limits)})


def info_of(owner: type, name: str) -> Info:
    """The Info of a field that setting has made."""
    found: Field[Any] = owner.__dataclass_fields__[name]  # type: ignore[attr-defined]
    info: Info = found.metadata["info"]
    return info


@dataclass(frozen=True)
class Settings:
    """Hyperparameters (VI-C "Experimental Setup", unless said otherwise).

    Attributes:
        samples: target number of samples over the whole surface, N_target; at most MAX_SAMPLES.
        patches: number of local surface patches, N_patch.
        scored_patches: only the first so many patches are scored, at full density; None scores all.
        sigma: standard deviation of the normal offset, in patch diagonals, sigma_base (V-C).
        radius: radius r of the color units, in patch diagonals (IV-C).
        gradient_radius: the same for the color gradient (V-E4); inf is the whole patch.
        normal_threshold: norThre, |cos| above it is "along the normal" (IV-C).
        tangent_threshold: tanThre, |cos| below it is "in the tangent plane" (IV-C).
        color_units: color units drawn per patch, N_color_patch (V-E3).
        centers: "fps" or "random" choice of patch centres (V-B).
        color_space: "rgb" or "lab" (supplement, "Ablations").
        pooling: "geometric" or "arithmetic" mean of the four features (V-E5, supplement).
        seed: of all random draws, at least 0.

    Raises:
        SettingsError: a value is out of its range; the text names the setting.
    """

    samples: int = setting(
        200_000,
        "target number of points near the surface at which both meshes are compared",
        minimum=1,
        maximum=MAX_SAMPLES,
    )
    patches: int = setting(250, "number of patches that the original is divided into", minimum=1)
    scored_patches: int | None = setting(
        None,
        "how many patches are scored, the first ones, which are spread evenly, at full density",
        kind=int,
        minimum=1,
    )
    sigma: float = setting(
        0.05, "standard deviation of the samples' distance from the surface, in patch diagonals", minimum=0
    )
    radius: float = setting(
        0.125,
        "radius of the surroundings in which colors are compared, in patch diagonals",
        minimum=0,
        above=True,
        infinity="the whole patch",
    )
    gradient_radius: float = setting(
        0.125,
        "radius within which the steepest color change is looked for, in patch diagonals",
        minimum=0,
        above=True,
        infinity="the whole patch",
    )
    normal_threshold: float = setting(
        0.95, "absolute cosine above which a direction counts as along the normal", minimum=0, maximum=1
    )
    tangent_threshold: float = setting(
        0.05, "absolute cosine below which a direction counts as in the tangent plane", minimum=0, maximum=1
    )
    color_units: int = setting(100, "samples of a patch whose surroundings the color features look at", minimum=1)
    centers: str = setting("fps", "how the patch centers are chosen", choices=CENTERS)
    color_space: str = setting("rgb", "color space of the two color features", choices=COLOR_SPACES)
    pooling: str = setting("geometric", "mean of a patch's four features", choices=POOLINGS)
    seed: int = setting(0, "of all random draws: the same seed gives the same numbers", minimum=0, maximum=2**63 - 1)

    def __post_init__(self) -> None:
        """Numbers and texts of numpy's become Python's own, which JSON takes; True and False are no numbers."""
        for name in SETTING_NAMES:
            value, info = getattr(self, name), info_of(Settings, name)
            if value is None and name == "scored_patches":
                continue
            if info.kind is int:
                _require(isinstance(value, Integral) and not isinstance(value, bool), name, value, "a whole number")
            elif info.kind is str:
                _require(isinstance(value, str), name, value, info.wanted)
            kept = _double(value) if info.kind is float else info.kind(value)
            fault = info.fault(kept)
            _require(not fault, name, value, fault)
            object.__setattr__(self, name, kept)
        _require(
            self.samples >= MIN_SAMPLES_PER_PATCH * self.patches,
            "samples",
            self.samples,
            f"at least {MIN_SAMPLES_PER_PATCH} for each of the {self.patches} patches "
            f"({MIN_SAMPLES_PER_PATCH * self.patches}); ask for more samples or fewer patches",
        )

    def with_seed(self, seed: int) -> Settings:
        return replace(self, seed=seed)

    def as_dict(self) -> dict[str, Any]:
        """Plain values under the names of the command line's flags; an infinite radius is the text "inf"."""
        return {k: "inf" if v == math.inf else v for k, v in asdict(self).items()}


SETTING_NAMES = tuple(each.name for each in fields(Settings))
PRESETS: dict[str, dict[str, Any]] = {"paper": {}, "fast": {"scored_patches": FAST_SCORED_PATCHES}}


def _double(value: Any) -> float:
    """The value in double precision; nan, which no range holds, where it is no number or beyond that precision."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return math.nan
    try:
        return float(value)
    except OverflowError:
        return math.nan


def _require(ok: bool, name: str, value: object, wanted: str) -> None:
    if not ok:
        raise SettingsError(f"{name.replace('_', '-')} is {value}; it must be {wanted}")
