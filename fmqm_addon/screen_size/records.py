# SPDX-License-Identifier: GPL-3.0-or-later
"""Screen sizes as plain values, as JSON has them, and as a table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..metric.errors import one_line
from . import definition
from .measure import AtSize, ScreenSize, Switch
from .views import fibonacci_directions


def definition_record(views: int) -> dict[str, Any]:
    """The constants that sizes depend on."""
    return {
        "sizes": list(definition.SIZES),
        "conditions": list(definition.CONDITIONS),
        "views": fibonacci_directions(views).tolist(),
        "pixels_per_degree": definition.PIXELS_PER_DEGREE,
        "strict": {"flip": definition.STRICT.flip, "ssim": definition.STRICT.ssim},
        "fade": {"flip": definition.FADE.flip, "ssim": definition.FADE.ssim},
    }


def size_record(found: ScreenSize) -> dict[str, Any]:
    """One LOD: its two switch sizes, the curve that they are from, and what should be known of the renders."""
    return {
        "strict": _switch_record(found.strict),
        "fade": _switch_record(found.fade),
        "curve": [_at_size_record(each) for each in found.curve],
        "notes": list(found.notes),
    }


def table(rows: Sequence[tuple[str, int | None, ScreenSize | None]]) -> str:
    """Names, triangles and sizes of LODs; - where one could not be measured."""
    cells = [("triangles", "strict", "fade", "worst view", "")]
    for name, triangles, found in rows:
        sizes = ("-", "-", "-") if found is None else (found.strict.label, found.fade.label, str(found.strict.worst))
        cells.append(("-" if triangles is None else str(triangles), *sizes, one_line(name)))
    widths = [max(len(row[column]) for row in cells) for column in range(4)]
    return "".join(
        "  ".join(cell.rjust(width) for cell, width in zip(row[:4], widths, strict=True))
        + f"  {row[4]}".rstrip()
        + "\n"
        for row in cells
    )


def _switch_record(switch: Switch) -> dict[str, Any]:
    return {"pixels": switch.pixels, "bound": switch.bound, "worst_view": switch.worst}


def _at_size_record(each: AtSize) -> dict[str, Any]:
    view, worst = each.worst_view(definition.STRICT)
    return {
        "size": each.size,
        "D_strict": each.difference(definition.STRICT),
        "D_fade": each.difference(definition.FADE),
        "worst_view": view,
        "worst_D_strict": worst,
        "flip": each.flip.tolist(),
        "dissimilarity": each.dissimilarity.tolist(),
    }
