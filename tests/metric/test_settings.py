# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings: the paper's defaults, and values that are refused by the name of their flag."""

from __future__ import annotations

import json
import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from fmqm_addon.metric.errors import FMQMError, SettingsError
from fmqm_addon.metric.settings import PRESETS, SETTING_NAMES, Settings

NAN = math.nan


def test_the_papers_defaults() -> None:
    assert Settings().as_dict() == {
        "samples": 200_000,
        "patches": 250,
        "scored_patches": None,
        "sigma": 0.05,
        "radius": 0.125,
        "gradient_radius": 0.125,
        "normal_threshold": 0.95,
        "tangent_threshold": 0.05,
        "color_units": 100,
        "centers": "fps",
        "color_space": "rgb",
        "pooling": "geometric",
        "seed": 0,
    }


BAD: list[tuple[str, Any]] = [
    *[("samples", x) for x in (0, -1, NAN)],
    *[("patches", x) for x in (0, -5, NAN)],
    *[("scored_patches", x) for x in (0, -1, NAN)],
    *[("color_units", x) for x in (0, -1, NAN)],
    *[("sigma", x) for x in (-0.01, NAN, math.inf, -math.inf)],
    *[("radius", x) for x in (0, -1, NAN, -math.inf)],
    *[("gradient_radius", x) for x in (0, -1, NAN, -math.inf)],
    *[("normal_threshold", x) for x in (-0.1, 1.1, NAN, math.inf)],
    *[("tangent_threshold", x) for x in (-0.1, 1.1, NAN, -math.inf)],
    *[("seed", x) for x in (-1, 2**63, NAN)],
    *[("centers", x) for x in ("FPS", "", "rs", None)],
    *[("color_space", x) for x in ("LAB", "", "yuv", None)],
    *[("pooling", x) for x in ("mean", "", "Geometric", None)],
]


@pytest.mark.parametrize(("name", "value"), BAD)
def test_a_bad_value_is_refused_by_name(name: str, value: object) -> None:
    """The message begins with the flag, and says what was given and what is wanted."""
    with pytest.raises(SettingsError, match=f"^{name.replace('_', '-')} is {value}; it must be .+") as caught:
        Settings(**{name: value})  # type: ignore[arg-type]
    assert isinstance(caught.value, FMQMError)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("samples", math.inf),
        ("samples", 9000.5),
        ("patches", 2.5),
        ("scored_patches", 1.5),
        ("scored_patches", math.inf),
        ("color_units", 1.5),
        ("color_units", math.inf),
        ("seed", 0.5),
    ],
)
def test_counts_and_the_seed_are_whole_numbers(name: str, value: float) -> None:
    with pytest.raises(SettingsError, match=name.replace("_", "-")):
        Settings(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [name for name in SETTING_NAMES if name not in {"centers", "color_space", "pooling"}])
@pytest.mark.parametrize("value", [True, False, np.True_, "1", [1], np.ones(1), 1j], ids=repr)
def test_what_is_no_number_is_refused(name: str, value: object) -> None:
    with pytest.raises(SettingsError, match=f"^{name.replace('_', '-')} is .*; it must be ."):
        Settings(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["centers", "color_space", "pooling"])
@pytest.mark.parametrize("value", [1, ["fps"], np.array(["rgb", "lab"])], ids=repr)
def test_what_is_no_text_is_refused(name: str, value: object) -> None:
    with pytest.raises(SettingsError, match=f"^{name.replace('_', '-')} is .*; it must be .* or "):
        Settings(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("name", ["sigma", "radius", "gradient_radius", "normal_threshold", "tangent_threshold"])
def test_a_number_beyond_double_precision_is_refused(name: str) -> None:
    with pytest.raises(SettingsError, match=f"^{name.replace('_', '-')} is "):
        Settings(**{name: 10**400})


def test_every_setting_has_a_bad_value_here() -> None:
    assert {name for name, _ in BAD} == set(SETTING_NAMES)


@pytest.mark.parametrize(("samples", "patches"), [(31, 1), (319, 10), (7999, 250)])
def test_too_few_samples_a_patch_are_refused_with_a_way_out(samples: int, patches: int) -> None:
    with pytest.raises(SettingsError, match=f"^samples is {samples}; .*{32 * patches}.*fewer patches"):
        Settings(samples=samples, patches=patches)
    Settings(samples=32 * patches, patches=patches)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("sigma", 0),
        ("radius", math.inf),
        ("gradient_radius", math.inf),
        ("normal_threshold", 0),
        ("normal_threshold", 1),
        ("tangent_threshold", 0),
        ("tangent_threshold", 1),
        ("scored_patches", 10**6),
        ("seed", 2**63 - 1),
        ("centers", "random"),
        ("color_space", "lab"),
        ("pooling", "arithmetic"),
    ],
)
def test_a_limit_is_accepted(name: str, value: object) -> None:
    assert getattr(Settings(**{name: value}), name) == value  # type: ignore[arg-type]


def test_settings_survive_json() -> None:
    settings = Settings(gradient_radius=math.inf, seed=7)
    assert json.loads(json.dumps(settings.as_dict(), allow_nan=False))["gradient_radius"] == "inf"
    assert settings.with_seed(8) == Settings(gradient_radius=math.inf, seed=8)


def test_numbers_of_numpy_are_taken_and_saved_as_pythons() -> None:
    """Every type of numpy's: what is kept is a plain int, float or text, so that JSON takes it."""
    whole = [np.int64(40), np.int32(40), np.uint16(40), np.uint64(40)]
    real = [np.float64(0.25), np.float32(0.25), np.float16(0.25), np.int8(1), 1, Fraction(1, 4)]
    given: list[dict[str, Any]] = [{"patches": n, "scored_patches": n, "color_units": n, "seed": n} for n in whole]
    given += [{name: x for name in SETTING_NAMES if type(getattr(Settings(), name)) is float} for x in real]
    given += [{"samples": np.int64(9000)}, {"centers": np.str_("random"), "color_space": np.str_("lab")}]
    for values in given:
        settings = Settings(**values)
        for name, value in values.items():
            kept = getattr(settings, name)
            assert kept == value and type(kept) in (int, float, str), (name, value)
            assert name not in {"sigma", "radius"} or type(kept) is float
        assert Settings(**json.loads(json.dumps(settings.as_dict()))) == settings


def test_presets_are_settings() -> None:
    assert Settings(**PRESETS["paper"]) == Settings()
    assert Settings(**PRESETS["fast"]) == Settings(scored_patches=40)
