# SPDX-License-Identifier: GPL-3.0-or-later
"""Samples, fields and patch scores of one comparison as an NPZ file."""

from __future__ import annotations

import json

import numpy as np

from ..metric.evaluation import Result
from .atomic_files import replaced


def save_fields(path: str, result: Result) -> None:
    """Writes the arrays that the scores were computed from.

    position, ref_nearest, dist_nearest (N, 3) f8, the reference's world frame; ref_sdf, dist_sdf (N,) f8,
    scene units, negative inside; ref_ncf, dist_ncf (N, 3) f4 in [0, 1]; patch (N,) i4, row of the P
    arrays; unit (N,) bool, the drawn color units; patch_center (P, 3), patch_diagonal, patch_area (P,)
    f8; patch_scores (P, 5) f8: geoSSIM, geoGraSSIM, colorSSIM, colorGraSSIM, FMQM; patch_perceived (P, 5)
    f8: shape, facing, color, detail, perceived; settings, a JSON text.

    Both tables follow from the other arrays. Samples are sorted by patch, and in each of them by nothing;
    a patch's L is its patch_diagonal, in the units of position. perceived takes ref_sdf with its sign and
    dist_sdf without, both nearest points, the NCFs as they are saved, and of each unit all samples of its
    patch within 0.125 L.

    Raises:
        FileError: the file cannot be written.
    """
    frame = result.frame
    # An open file: to a path that ends in .NPZ, or in nothing, numpy appends .npz.
    with replaced(path) as temporary, open(temporary, "wb") as file:
        np.savez(
            file,
            position=frame.leave(result.samples.positions),
            patch=result.samples.patch,
            unit=result.samples.unit,
            ref_nearest=frame.leave(result.ref.nearest),
            dist_nearest=frame.leave(result.dist.nearest),
            ref_sdf=result.ref.sdf * frame.scale,
            dist_sdf=result.dist.sdf * frame.scale,
            ref_ncf=result.ref.ncf,
            dist_ncf=result.dist.ncf,
            patch_center=frame.leave(result.patch_centers),
            patch_diagonal=np.array([patch.diagonal for patch in result.patches]) * frame.scale,
            patch_area=np.array([patch.area for patch in result.patches]) * frame.scale**2,
            patch_scores=result.patch_scores,
            patch_perceived=result.patch_perceived,
            settings=np.array(json.dumps(result.settings.as_dict())),
        )
