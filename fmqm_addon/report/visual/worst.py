# SPDX-License-Identifier: GPL-3.0-or-later
"""The worst patches of a result, what lowers each, and how to look at one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...comparison.judge import Judge
from ...metric.evaluation import Result
from ...metric.geometry import Floats
from ...metric.surface import triangle_areas, triangle_normals


@dataclass(frozen=True)
class WorstPatch:
    """One of the lowest patches.

    Attributes:
        patch: its row. score: the judge's, of it. blame: which of the judge's features falls furthest below its own
            mean over the patches. value: that feature's.
    """

    patch: int
    score: float
    blame: str
    value: float


def worst_patches(result: Result, count: int, judge: Judge = Judge.FMQM) -> list[WorstPatch]:
    """The patches that the judge scores lowest, worst first."""
    score = result.of_patches(judge.column)
    table = np.stack([result.of_patches(feature) for feature in judge.features], axis=1)
    usual = np.maximum(table.mean(axis=0), 1e-12)
    worst = []
    for patch in np.argsort(score, kind="stable")[:count].tolist():
        features = table[patch]
        # Features have levels of their own; where all are at theirs, the lowest is named.
        feature = int(np.lexsort((features, np.round(features / usual, 6)))[0])
        worst.append(WorstPatch(patch, float(score[patch]), judge.features[feature], float(features[feature])))
    return worst


def patch_view(result: Result, patch: int) -> tuple[Floats, float, Floats]:
    """Center (3,) of a patch's box, its diagonal, and its mean normal (3,), unit or zero; metric's frame."""
    mesh = result.patch_mesh
    triangles = mesh.triangles[result.patches[patch].faces]
    corners = mesh.vertices[triangles.ravel()]
    low, high = corners.min(axis=0), corners.max(axis=0)
    normals = triangle_normals(mesh.vertices, triangles)
    normal = (normals * triangle_areas(mesh.vertices, triangles)[:, None]).sum(axis=0)
    length = float(np.linalg.norm(normal))
    return (low + high) / 2, float(np.linalg.norm(high - low)), normal / length if length > 0 else normal
