# SPDX-License-Identifier: GPL-3.0-or-later
"""Screen sizes as the numbers that engines switch levels of detail at."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ..metric.errors import SettingsError, one_line
from ..metric.settings import info_of, setting
from ..metric.surface import Surface
from .measure import Switch

ENGINES = ("unity", "unreal", "godot", "threejs", "gltf")
MARGIN = 0.05  # of a distance: so much nearer the finer level comes back, that the two do not take turns


@dataclass(frozen=True, kw_only=True)
class Screen:
    """The screen that sizes in pixels are of.

    Attributes:
        fov: vertical, in degrees. lod_bias: of Unity's quality settings. height_ratio: of MSFT_screencoverage.

    Raises:
        SettingsError: one of these has a value that it cannot have.
    """

    height: int = setting(1080, "pixels that the screen is high", minimum=1)
    width: int = setting(1920, "pixels that the screen is wide", minimum=1)
    fov: float = setting(60.0, "vertical field of view in degrees", minimum=1, maximum=179)
    lod_bias: float = setting(1.0, "of Unity's quality settings", minimum=0, above=True)
    height_ratio: bool = setting(False, "glTF: coverages as ratios of heights, as some loaders take them")

    def __post_init__(self) -> None:
        for name in SCREEN_NAMES:
            value, info = getattr(self, name), info_of(Screen, name)
            if info.kind is not bool and (fault := info.fault(value)):
                raise SettingsError(f"{name.replace('_', '-')} is {value}; it must be {fault}")


SCREEN_NAMES = tuple(each.name for each in fields(Screen))


@dataclass(frozen=True)
class Extent:
    """How large the reference is, in units of its scene: its box's diagonal and longest side, and the radius of the
    sphere around the box's center that holds it."""

    diagonal: float
    side: float
    radius: float

    @classmethod
    def of(cls, surface: Surface) -> Extent:
        scale = surface.frame.scale
        radius = float(np.linalg.norm(surface.vertices, axis=1).max())
        return cls(scale, float(np.ptp(surface.vertices, axis=0).max()) * scale, radius * scale)


@dataclass(frozen=True)
class Level:
    """An LOD in a chain.

    Attributes:
        number: 1 is the first after the reference. name: for comments.
        pixels: from this size of the reference's box diagonal on downward it may be shown; None: at no size that was
            looked at, or a coarser one may be shown from there on already.
        why: what it is useless for, or "".
    """

    number: int
    name: str
    pixels: float | None
    why: str = ""


def chain(names: Sequence[str], switches: Sequence[Switch | None]) -> tuple[Level, ...]:
    """LODs from fine to coarse, with sizes that only get smaller; what has no place of its own in the chain says why.

    Args:
        switches: None where an LOD could not be measured.
    """
    levels: list[Level] = []
    largest, coarser = 0.0, ""
    for number, (name, switch) in reversed(list(enumerate(zip(names, switches, strict=True), 1))):
        if switch is None:
            levels.append(Level(number, name, None, "it could not be measured"))
        elif switch.bound == "below":
            levels.append(Level(number, name, None, f"it differs too much even at {switch.pixels:.0f} px"))
        elif switch.pixels <= largest:
            levels.append(Level(number, name, None, f"{coarser}, which comes after it, may be shown as early"))
        else:
            largest, coarser = switch.pixels, name
            levels.append(Level(number, name, switch.pixels))
    return tuple(reversed(levels))


def distance(pixels: float, extent: Extent, screen: Screen) -> float:
    """How far away, in the scene's units, the reference's box diagonal spans so many pixels."""
    return extent.diagonal * screen.height / (2 * pixels * math.tan(math.radians(screen.fov) / 2))


def numbers(engine: str, levels: Sequence[Level], extent: Extent, screen: Screen) -> list[dict[str, Any]]:
    """What an engine takes, for the reference and each level that has its place: its number, its name, its values."""
    shown = [Level(0, "reference", None), *(level for level in levels if level.pixels is not None)]
    sizes = [level.pixels for level in shown[1:]]
    return [
        {
            "level": level.number,
            "name": level.name,
            **_VALUES[engine](
                sizes[index - 1] if index else None, sizes[index] if index < len(sizes) else None, extent, screen
            ),
        }
        for index, level in enumerate(shown)
    ]


def pasteable(engine: str, values: Sequence[dict[str, Any]]) -> str:
    """The numbers of an engine as lines to paste into it, or to type into its editor."""
    return _TEXTS[engine](values)


def _unity(size: float | None, next_size: float | None, extent: Extent, screen: Screen) -> dict[str, Any]:
    ratio = screen.lod_bias * extent.side / extent.diagonal
    return {"screenRelativeTransitionHeight": 0.0 if next_size is None else ratio * next_size / screen.height}


def _unreal(size: float | None, next_size: float | None, extent: Extent, screen: Screen) -> dict[str, Any]:
    ratio = 2 * extent.radius / extent.diagonal / min(screen.height, screen.width)
    return {"ScreenSize": 1.0 if size is None else ratio * size}


def _godot(size: float | None, next_size: float | None, extent: Extent, screen: Screen) -> dict[str, Any]:
    begin = 0.0 if size is None else distance(size, extent, screen)
    end = 0.0 if next_size is None else distance(next_size, extent, screen)
    return {
        "visibility_range_begin": begin,
        "visibility_range_begin_margin": MARGIN * begin,
        "visibility_range_end": end,
        "visibility_range_end_margin": MARGIN * end,
    }


def _threejs(size: float | None, next_size: float | None, extent: Extent, screen: Screen) -> dict[str, Any]:
    return {"distance": 0.0 if size is None else distance(size, extent, screen), "hysteresis": MARGIN}


def _gltf(size: float | None, next_size: float | None, extent: Extent, screen: Screen) -> dict[str, Any]:
    if next_size is None:
        return {"screencoverage": 0.0}
    across = 2 * extent.radius * next_size / extent.diagonal
    disk = math.pi / 4 * across**2 / (screen.width * screen.height)
    return {"screencoverage": across / screen.height if screen.height_ratio else disk}


_VALUES: dict[str, Callable[[float | None, float | None, Extent, Screen], dict[str, Any]]] = {
    "unity": _unity,
    "unreal": _unreal,
    "godot": _godot,
    "threejs": _threejs,
    "gltf": _gltf,
}


def _comment(mark: str, values: dict[str, Any]) -> str:
    return f"  {mark} {one_line(values['name'])}"


def _unity_text(values: Sequence[dict[str, Any]]) -> str:
    lines = ["LOD[] lods = lodGroup.GetLODs();"]
    for index, each in enumerate(values):
        height = f"{each['screenRelativeTransitionHeight']:.6f}f"
        lines.append(f"lods[{index}].screenRelativeTransitionHeight = {height};{_comment('//', each)}")
    return "\n".join([*lines, "lodGroup.SetLODs(lods);"])


def _unreal_text(values: Sequence[dict[str, Any]]) -> str:
    return "\n".join(
        f"LOD {index}: Screen Size {each['ScreenSize']:.6f}{_comment('#', each)}" for index, each in enumerate(values)
    )


def _godot_text(values: Sequence[dict[str, Any]]) -> str:
    names = [name for name in values[0] if name.startswith("visibility")]
    return "\n".join(
        f"$LOD{index}.{name} = {each[name]:.6g}{_comment('#', each) if name == names[0] else ''}"
        for index, each in enumerate(values)
        for name in names
    )


def _threejs_text(values: Sequence[dict[str, Any]]) -> str:
    return "\n".join(
        f"lod.addLevel(level{index}, {each['distance']:.6g}, {each['hysteresis']:g});{_comment('//', each)}"
        for index, each in enumerate(values)
    )


def _gltf_text(values: Sequence[dict[str, Any]]) -> str:
    coverages = [float(f"{each['screencoverage']:.6g}") for each in values]
    return f'"extras": {{ "MSFT_screencoverage": {json.dumps(coverages)} }}'


_TEXTS: dict[str, Callable[[Sequence[dict[str, Any]]], str]] = {
    "unity": _unity_text,
    "unreal": _unreal_text,
    "godot": _godot_text,
    "threejs": _threejs_text,
    "gltf": _gltf_text,
}
