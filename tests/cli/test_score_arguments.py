# SPDX-License-Identifier: GPL-3.0-or-later
"""The way of an option: from its flag to a pair, with the defaults, limits and texts that its dataclass has."""

from __future__ import annotations

from dataclasses import fields

import pytest

from fmqm_addon.batch.rows import BatchOptions, Row
from fmqm_addon.blender.access import Access
from fmqm_addon.blender.materials.image_headers import ImageLimits
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.cli.decimate import build_parser as decimate_parser
from fmqm_addon.cli.score_arguments import build_parser, options_of
from fmqm_addon.comparison.pair import PairOptions
from fmqm_addon.metric.errors import SettingsError
from fmqm_addon.metric.settings import PRESETS, SETTING_NAMES, Settings, info_of

PAIR_NAMES = [each.name for each in fields(PairOptions) if each.name != "settings"]


def options(*flags: str) -> BatchOptions:
    return options_of(build_parser("score.py").parse_intermixed_args(["r", "d", *flags]))


def test_without_flags_all_is_as_the_dataclasses_have_it() -> None:
    assert options() == BatchOptions()
    assert options("--preset", "fast").pair.settings == Settings(**PRESETS["fast"])


def test_each_flag_reaches_the_pair() -> None:
    """Under its own name, whatever the order; a row's settings win over the run's."""
    values = {"samples": 9000, "patches": 20, "scored_patches": 7, "sigma": 0.1, "radius": 0.2, "gradient_radius": 0.3}
    values |= {"normal_threshold": 0.9, "tangent_threshold": 0.1, "color_units": 9, "centers": "random"}
    values |= {"color_space": "lab", "pooling": "arithmetic", "seed": 3}
    assert set(values) == set(SETTING_NAMES)
    pair = {"repeats": 2, "space": "local", "match_scale": True, "both": True, "attribution": True, "align": "icp"}
    assert set(pair) == set(PAIR_NAMES)
    flags = [
        part
        for name, value in {**values, **pair}.items()
        for part in ([f"--{name}".replace("_", "-")] if value is True else [f"--{name}".replace("_", "-"), str(value)])
    ]
    wanted = PairOptions(settings=Settings(**values), **pair)  # type: ignore[arg-type]
    assert options(*flags).pair == wanted
    row = Row("id", "r", "d", settings=(("seed", 9),))
    assert options(*flags).pair_of(row).settings == wanted.settings.with_seed(9)
    for name in ("both", "attribution"):  # they are easily taken for one another
        found = options(f"--{name}").pair
        assert [each for each in PAIR_NAMES if getattr(found, each) is True] == [name]


def test_reading_and_outputs() -> None:
    found = options("--bake", "64", "--max-image-side", "9", "--untrusted", "--explain", "--report", "web")
    reading = Reading(bake=64, stand_in=True, limits=ImageLimits(side=9), access=Access(True), normals=True)
    assert found == BatchOptions(reading=reading, explain=True, report="web")
    assert options("--bake", "0").reading == Reading(bake=0)


def test_what_a_record_says_of_the_options() -> None:
    """What is given, in this order; neither folders nor which files may be named."""
    plain = {**Settings().as_dict(), "repeats": 1, "space": "auto", "match_scale": False}
    assert list(options().as_dict().items()) == list(plain.items())
    assert options("--untrusted", "--report", "web").as_dict() == plain
    more = {"attribution": True, "explain": True, "both": True, "bake": 1024, "max_image_bytes": 5}
    flags = ("--both", "--explain", "--attribution", "--max-image-bytes", "5", "--bake", "1024")
    assert list(options(*flags).as_dict().items()) == [*plain.items(), *more.items()]
    assert options("--bake", "0").as_dict() == plain | {"bake": 0}


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--repeats", "0"), "repeats is 0; it must be at least 1"),
        (("--bake", "20000"), "bake is 20000; it must be between 0 and 16384"),
        (("--seed", str(2**63 - 1), "--repeats", "2"), f"seed is {2**63}; it must be at most {2**63 - 1}"),
        (("--sigma", "inf"), "sigma is inf; it must be a finite number, at least 0"),
        (("--radius", "0"), "radius is 0.0; it must be above 0, or inf for the whole patch"),
        (("--normal-threshold", "2"), "normal-threshold is 2.0; it must be between 0 and 1"),
    ],
)
def test_limits_are_said(flags: tuple[str, ...], words: str) -> None:
    with pytest.raises(SettingsError) as refused:
        options(*flags)
    assert str(refused.value) == words


def test_the_help_has_texts_limits_and_defaults() -> None:
    told = " ".join(build_parser("score.py").format_help().split())
    short = " ".join(decimate_parser("decimate.py").format_help().split())
    for owner, name in [*((Settings, name) for name in SETTING_NAMES), *((PairOptions, name) for name in PAIR_NAMES)]:
        info = info_of(owner, name)
        limits = "" if info.choices or info.kind is bool else f" ({info.wanted}; default: "
        assert info.text + limits in told, name
        if name in ("samples", "patches", "seed"):
            assert info.text + limits in short
