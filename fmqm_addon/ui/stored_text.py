# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the texts that results keep in a .blend file, which may come from strangers: None where one is broken.

Panels ask at each redraw: what was read is remembered.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from ..metric.evaluation import COLUMNS
from ..metric.settings import SETTING_NAMES
from ..report.record_check import checked_json, is_attribution, is_settings, is_trust
from ..report.trust_table import Report


@functools.lru_cache(1024)
def read_columns(text: str) -> dict[str, float] | None:
    """Five numbers by the names of metric.evaluation.COLUMNS."""
    values = _read(text)
    if not isinstance(values, list) or [type(value) for value in values] != [float] * len(COLUMNS):
        return None
    return dict(zip(COLUMNS, values, strict=True))


@functools.lru_cache(64)
def read_attribution(text: str) -> dict[str, Any] | None:
    """As comparison.attribution.Attribution.as_dict has it."""
    found = _read(text)
    return found if isinstance(found, dict) and is_attribution(found) else None


@functools.lru_cache(64)
def read_trust(text: str) -> Report | None:
    """As report.trust_table.trust_dict has it."""
    found = _read(text)
    return found if is_trust(found) else None


@functools.lru_cache(64)
def read_settings(text: str) -> dict[str, Any] | None:
    """As metric.settings.Settings.as_dict has them, and what else the row was measured with."""
    found = _read(text)
    return found if isinstance(found, dict) and is_settings(found) and found.keys() >= set(SETTING_NAMES) else None


@functools.lru_cache(64)
def read_stages(text: str) -> dict[str, float] | None:
    """Seconds by stage."""
    found = _read(text)
    is_right = isinstance(found, dict) and all(isinstance(value, (int, float)) for value in found.values())
    return found if is_right else None


@functools.lru_cache(64)
def read_legend(text: str) -> dict[str, Any] | None:
    """As report.visual.layers.Legend.as_dict has it."""
    found = _read(text)
    if not isinstance(found, dict):
        return None
    texts = [found.get(name) for name in ("title", "subtitle", "note")]
    lists: list[Any] = [found.get(name) for name in ("bar", "ticks", "swatches")]
    if not all(isinstance(each, str) for each in texts) or not all(isinstance(each, list) for each in lists):
        return None
    bar, ticks, swatches = lists
    marks = [found["mark"]] if found.get("mark") else []
    is_right = (
        all(map(_is_color, bar))
        and all(_is_named(each, _is_number) for each in [*ticks, *marks])
        and all(_is_named(each, _is_color) for each in swatches)
    )
    return found | {"mark": marks[0] if marks else None} if is_right else None


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float))


def _is_color(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))


def _is_named(value: object, is_right: Callable[[object], bool]) -> bool:
    """Whether it is something and the text that stands beside it."""
    return isinstance(value, list) and len(value) == 2 and is_right(value[0]) and isinstance(value[1], str)


def _read(text: str) -> Any:
    try:
        return checked_json(text)
    except ValueError:
        return None
