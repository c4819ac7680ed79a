# SPDX-License-Identifier: GPL-3.0-or-later
"""The worst patches of a result, what lowers each, and how to look at one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...comparison.judge import Judge
from ...metric.evaluation import Result
from ...metric.geometry import Floats, triangle_areas, triangle_normals
from ...metric.perceived import PERCEIVED_COLUMNS


@dataclass(frozen=True)
class WorstPatch:
    """One of the lowest patches.

    Attributes:
        patch: its row. score: the judge's, of it. blame: which of the four features of perceived is lowest. value: that
            feature's.
    """

    patch: int
    score: float
    blame: str
    value: float


def worst_patches(result: Result, count: int, judge: Judge = Judge.FMQM) -> list[WorstPatch]:
    """The patches that the judge scores lowest, worst first."""
    score = result.of_patches(judge.column)
    table = result.patch_perceived[:, :4]
    worst = []
    for patch in np.argsort(score, kind="stable")[:count].tolist():
        lowest = int(table[patch].argmin())
        worst.append(WorstPatch(patch, float(score[patch]), PERCEIVED_COLUMNS[lowest], float(table[patch, lowest])))
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
