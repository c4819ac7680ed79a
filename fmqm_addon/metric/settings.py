# SPDX-License-Identifier: GPL-3.0-or-later
"""Every hyperparameter of the metric, with the paper's value as its default."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields, replace
from numbers import Integral
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
        radius: radius r of the color units, in patch diagonals (IV-D).
        gradient_radius: the same for the color gradient (V-E4); inf is the whole patch.
        normal_threshold: norThre, |cos| above it is "along the normal" (IV-D).
        tangent_threshold: tanThre, |cos| below it is "in the tangent plane" (IV-D).
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
        for name in ("samples", "patches", "color_units", "seed", "scored_patches"):
            value = getattr(self, name)
            whole = isinstance(value, Integral) or (value is None and name == "scored_patches")
            _require(whole, name, value, "a whole number")
        for name in ("samples", "patches", "color_units"):
            _require(getattr(self, name) >= 1, name, getattr(self, name), "at least 1")
        _require(self.samples <= MAX_SAMPLES, "samples", self.samples, f"at most {MAX_SAMPLES}")
        if self.scored_patches is not None:
            _require(self.scored_patches >= 1, "scored_patches", self.scored_patches, "at least 1")
        _require(0 <= self.sigma < math.inf, "sigma", self.sigma, "a finite number, at least 0")
        _require(0 < self.radius, "radius", self.radius, "above 0 (inf: the whole patch)")
        _require(0 < self.gradient_radius, "gradient_radius", self.gradient_radius, "above 0 (inf: the whole patch)")
        for name in ("normal_threshold", "tangent_threshold"):
            _require(0 <= getattr(self, name) <= 1, name, getattr(self, name), "between 0 and 1")
        for name, choices in (("centers", CENTERS), ("color_space", COLOR_SPACES), ("pooling", POOLINGS)):
            _require(getattr(self, name) in choices, name, getattr(self, name), " or ".join(choices))
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


def _require(ok: bool, name: str, value: object, wanted: str) -> None:
    if not ok:
        raise SettingsError(f"{name.replace('_', '-')} is {value}; it must be {wanted}")
