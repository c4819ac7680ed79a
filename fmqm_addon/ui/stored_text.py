# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads the texts that results keep in a .blend file, which may come from strangers: None where one is broken.

Panels ask at each redraw: what was read is remembered.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from typing import Any, TypeVar

from ..comparison.measurement import Readings
from ..metric.evaluation import Scores
from ..metric.perceived import Perceived
from ..metric.settings import SETTING_NAMES
from ..report.record_check import checked_json, is_attribution, is_part, is_screen_size, is_settings, is_trust
from ..report.trust_table import Report

T = TypeVar("T")


def readings_text(readings: Readings) -> str:
    """Both readings as the text that read_readings reads back bit by bit."""
    return json.dumps({name: getattr(readings, name) for name in _READINGS}, allow_nan=False)


@functools.lru_cache(1024)
def read_readings(text: str) -> Readings | None:
    """Both readings of a pair."""
    found = _read(text)
    if not isinstance(found, dict) or found.keys() != _READINGS.keys():
        return None
    values = {name: make(found[name]) for name, make in _READINGS.items()}
    if None in (values["scores"], values["perceived"], values["fmqm_p10"]):
        return None
    if any(values[name] is None for name in _ERRORS if found[name] is not None):
        return None
    return Readings(**values)


def _doubles(value: object, kind: type[T]) -> T | None:
    """A named tuple from a list of as many doubles."""
    names: tuple[str, ...] = kind._fields  # type: ignore[attr-defined]
    is_right = isinstance(value, list) and [type(each) for each in value] == [float] * len(names)
    return kind(*value) if is_right else None  # type: ignore[misc]


_ERRORS = ("stderr", "perceived_stderr")
_READINGS: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(("scores", "stderr"), functools.partial(_doubles, kind=Scores)),
    "fmqm_p10": lambda value: value if type(value) is float else None,
    **dict.fromkeys(("perceived", "perceived_stderr"), functools.partial(_doubles, kind=Perceived)),
}


@functools.lru_cache(64)
def read_attribution(text: str) -> dict[str, Any] | None:
    """As comparison.attribution.Attribution.as_dict has it."""
    found = _read(text)
    return found if isinstance(found, dict) and is_attribution(found) else None


@functools.lru_cache(64)
def read_screen_size(text: str) -> dict[str, Any] | None:
    """As screen_size.records.size_record has it."""
    found = _read(text)
    return found if isinstance(found, dict) and is_screen_size(found) else None


@functools.lru_cache(64)
def read_extent(text: str) -> tuple[float, float, float] | None:
    """As screen_size.engines.Extent."""
    found = _read(text)
    is_right = isinstance(found, list) and len(found) == 3 and all(isinstance(n, float) and n > 0 for n in found)
    return (found[0], found[1], found[2]) if is_right else None


@functools.lru_cache(64)
def read_trust(text: str) -> Report | None:
    """As report.trust_table.trust_dict has it."""
    found = _read(text)
    return found if is_trust(found) else None


@functools.lru_cache(64)
def read_parts(text: str) -> list[dict[str, Any]] | None:
    """As comparison.parts.Part.as_dict has each."""
    found = _read(text)
    return found if isinstance(found, list) and all(map(is_part, found)) else None


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


def _read(text: str) -> Any:
    try:
        return checked_json(text)
    except ValueError:
        return None
