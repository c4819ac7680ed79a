# SPDX-License-Identifier: GPL-3.0-or-later
"""Every hyperparameter of the metric, with the paper's value as its default."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
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

    samples: int = 200_000
    patches: int = 250
    scored_patches: int | None = None
    sigma: float = 0.05
    radius: float = 0.125
    gradient_radius: float = 0.125
    normal_threshold: float = 0.95
    tangent_threshold: float = 0.05
    color_units: int = 100
    centers: str = "fps"
    color_space: str = "rgb"
    pooling: str = "geometric"
    seed: int = 0

    def __post_init__(self) -> None:
        """Numbers and texts of numpy's become Python's own, which JSON takes; True and False are no numbers."""
        for name in ("samples", "patches", "color_units", "seed", "scored_patches"):
            value = getattr(self, name)
            if value is not None or name != "scored_patches":
                whole = isinstance(value, Integral) and not isinstance(value, bool)
                _require(whole, name, value, "a whole number")
                object.__setattr__(self, name, int(value))
        for name, (fits, wanted) in _RANGES.items():
            value = getattr(self, name)
            _require(fits(_double(value)), name, value, wanted)
            object.__setattr__(self, name, _double(value))
        for name, choices in (("centers", CENTERS), ("color_space", COLOR_SPACES), ("pooling", POOLINGS)):
            value = getattr(self, name)
            _require(isinstance(value, str) and value in choices, name, value, " or ".join(choices))
            object.__setattr__(self, name, str(value))
        for name in ("samples", "patches", "color_units"):
            _require(getattr(self, name) >= 1, name, getattr(self, name), "at least 1")
        _require(self.samples <= MAX_SAMPLES, "samples", self.samples, f"at most {MAX_SAMPLES}")
        if self.scored_patches is not None:
            _require(self.scored_patches >= 1, "scored_patches", self.scored_patches, "at least 1")
        _require(0 <= self.seed < 2**63, "seed", self.seed, "a whole number from 0 to 2^63 - 1")
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


SETTING_NAMES = tuple(field.name for field in fields(Settings))
PRESETS: dict[str, dict[str, Any]] = {"paper": {}, "fast": {"scored_patches": FAST_SCORED_PATCHES}}

_RANGES: dict[str, tuple[Callable[[float], bool], str]] = {
    "sigma": (lambda x: 0 <= x < math.inf, "a finite number, at least 0"),
    "radius": (lambda x: x > 0, "above 0 (inf: the whole patch)"),
    "gradient_radius": (lambda x: x > 0, "above 0 (inf: the whole patch)"),
    "normal_threshold": (lambda x: 0 <= x <= 1, "between 0 and 1"),
    "tangent_threshold": (lambda x: 0 <= x <= 1, "between 0 and 1"),
}


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
