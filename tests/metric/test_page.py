# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/metric.md names what is in the code, with the values that are there."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

from fmqm_addon.metric.settings import SETTING_NAMES, Settings

PAGE = Path(__file__).parents[2] / "docs" / "metric.md"
NAMED = re.findall(r"`(\w+)\.(\w+)(?: = ([^`]+))?`", PAGE.read_text(encoding="utf-8"))


def test_the_page_names_what_is_there() -> None:
    for place, name, value in NAMED:
        owner = Settings() if place == "Settings" else importlib.import_module(f"fmqm_addon.metric.{place}")
        assert hasattr(owner, name), f"{place}.{name} is gone"
        assert not value or getattr(owner, name) == ast.literal_eval(value), f"{place}.{name} is not {value}"


def test_the_page_names_every_setting_but_the_seed() -> None:
    assert {name for place, name, value in NAMED if place == "Settings" and value} == set(SETTING_NAMES) - {"seed"}
