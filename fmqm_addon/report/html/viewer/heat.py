# SPDX-License-Identifier: GPL-3.0-or-later
"""A result as the viewer paints it: patches by their centers, what was sampled in the cells of a grid, worst places."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....comparison.judge import Judge
from ....metric.evaluation import Result
from ....metric.fields import Fields
from ....metric.geometry import Floats
from ...numbers import score_text
from ...visual.heat_map import fitted_range
from ...visual.layers import LAYERS, LENGTH, SCORE, field_values, value_range
from ...visual.worst import patch_view, worst_patches
from .packing import packed

WORST = 5  # places that are marked
FIELDS = ("NCF_DIFFERENCE", "SDF_DIFFERENCE")  # layers that are shown by cells
# Upper ends of their colors at least: what differs less is rounding. A color, and a share of the reference's diagonal.
LEAST = {"NCF_DIFFERENCE": 0.01, "SDF_DIFFERENCE": 1e-4}
_SPACINGS = 2.5  # of samples; a cell is so wide
_MOST_CELLS = 96  # along the longest side
_FULL = 255
_DIGITS = 7  # after the point, in diagonals of the reference


def heat_data(result: Result, judge: Judge) -> dict[str, Any]:
    """Plain values for the viewer, in the metric's frame.

    Args:
        judge: by whose score places are worst.

    Returns:
        "centers" of the patches; "layers": name, label, ends of the colors, and one value a patch, or None for those
        that "cells" hold; "cells" of both surfaces; "partial": only some patches were scored; "worst" places.
    """
    layers = []
    ends = {}
    for name, layer in LAYERS.items():
        values = None
        if layer.kind == SCORE:
            values = result.of_patches(name)
            low, high = fitted_range(values)
        elif name in FIELDS:
            sampled = field_values(name, result.ref, result.dist, result.frame.scale)
            low, high = value_range(name, sampled, True, result.frame.scale)
            high = max(high, LEAST[name] * (result.frame.scale if LAYERS[name].kind == LENGTH else 1.0))
            ends[name] = high
        else:
            continue
        plain = None if values is None else [round(value, 5) for value in values.tolist()]
        layers.append({"name": name, "label": layer.label, "low": low, "high": high, "values": plain})
    return {
        "centers": _rounded(result.patch_centers.ravel()),
        "layers": layers,
        "cells": [_cells(result, fields, [ends[name] for name in FIELDS]) for fields in (result.ref, result.dist)],
        "partial": len(result.patches) < result.settings.patches,
        "worst": _worst(result, judge),
    }


def _cells(result: Result, fields: Fields, highs: list[float]) -> dict[str, Any]:
    """Means of the sampled layers where a surface's points are nearest to samples, in cubes of a regular grid.

    Args:
        fields: of the surface. highs: upper ends of the layers of FIELDS.

    Returns:
        "low" corner, "size" of a cell, "shape" (x, y, z), and "data", packed with x running fastest: a column for
        each of FIELDS, in 255ths of its upper end, and whether there is any sample (255) or none (0).
    """
    points = fields.nearest
    area = sum(patch.area for patch in result.patches)
    low, high = points.min(axis=0), points.max(axis=0)
    size = max(_SPACINGS * float(np.sqrt(area / len(points))), float((high - low).max()) / (_MOST_CELLS - 3), 1e-6)
    size, low = round(size, _DIGITS), np.round(low - size, _DIGITS)  # an empty cell all around
    shape = ((high - low) / size).astype(int) + 2
    cell = ((points - low) / size).astype(np.int64)
    key = (cell[:, 2] * shape[1] + cell[:, 1]) * shape[0] + cell[:, 0]
    total = int(shape.prod())
    counts = np.bincount(key, minlength=total)
    columns = []
    for name, end in zip(FIELDS, highs, strict=True):
        values = field_values(name, result.ref, result.dist, result.frame.scale)
        means = np.bincount(key, values, total) / np.maximum(counts, 1)
        columns.append(np.rint(np.clip(means / end, 0, 1) * _FULL))
    columns.append(np.where(counts > 0, _FULL, 0))
    return {
        "low": _rounded(low),
        "size": size,
        "shape": shape.tolist(),
        "data": packed(np.stack(columns, axis=1).astype(np.uint8)),
    }


def _worst(result: Result, judge: Judge) -> list[dict[str, Any]]:
    found = []
    for worst in worst_patches(result, WORST, judge):
        if worst.score == 1:
            break
        center, diagonal, normal = patch_view(result, worst.patch)
        found.append(
            {
                "at": _rounded(result.patch_centers[worst.patch]),
                "center": _rounded(center),
                "normal": _rounded(normal),
                "diagonal": round(diagonal, _DIGITS),
                "score": round(worst.score, 5),
                "words": f"{score_text(worst.score, places=3)}; {LAYERS[worst.blame].label} "
                f"{score_text(worst.value, places=3)}",
            }
        )
    return found


def _rounded(numbers: Floats) -> list[float]:
    return [round(number, _DIGITS) for number in np.asarray(numbers, np.float64).tolist()]
