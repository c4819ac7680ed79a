# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the colors of places have shifted as a whole, which a likeness of their patterns hardly weighs."""

from __future__ import annotations

import numpy as np

from ..metric.colorspace import LAB_SCALE, srgb_to_lab
from ..metric.evaluation import Result
from ..metric.geometry import Floats

JUST_NOTICEABLE = 2.3  # a CIE 1976 difference that people begin to see side by side


def color_shifts(result: Result) -> Floats:
    """(P,) CIE 1976 differences between the mean colors of each patch's samples on the two meshes."""
    start = result.samples.start
    count = np.maximum(np.diff(start), 1)[:, None]
    lab = []
    for fields in (result.ref, result.dist):
        colors = fields.ncf.astype(np.float64)
        if start[-2] == len(colors):  # a row of zeros lets patches without samples, at the end, sum nothing
            colors = np.concatenate([colors, np.zeros((1, 3))])
        sums = np.add.reduceat(colors, start[:-1], axis=0)
        sums[np.diff(start) == 0] = 0
        lab.append(srgb_to_lab(np.clip(sums / count, 0, 1)) * LAB_SCALE)
    return np.asarray(np.linalg.norm(lab[0] - lab[1], axis=1))
