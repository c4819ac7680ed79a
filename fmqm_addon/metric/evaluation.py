# SPDX-License-Identifier: GPL-3.0-or-later
"""The score of a distorted surface against its reference, computed in small steps.

    evaluation = Evaluation(reference, settings)
    evaluation.prepare().run()
    result = evaluation.compare(distorted).run()

fmqm() does this at once. One preparation serves any number of comparisons, all on the same samples.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from .colorspace import channel_weights, channels
from .errors import MeshError
from .features import FieldValues, colors_around, features_of_patches, pairs_of_patches, pool_features
from .fields import Fields, evaluate_fields
from .geometry import Floats, Ints, morton_order
from .patches import Patch, PatchMesh, build_patch_mesh, choose_centers, grow_patches
from .perceived import (
    PERCEIVED_COLUMNS,
    RADIUS,
    Perceived,
    low_percentile,
    perceived_of_pair,
    perceived_of_patches,
)
from .sampling import PatchSamples, Samples, draw_samples, join_samples
from .settings import Settings
from .stepper import Progress, Stepper, Work, as_part
from .surface import Frame, MeshArrays, QueryBuilder, Surface, prepare_surface

_DRAWN_AT_ONCE = 8  # patches
_SAMPLES_AT_ONCE = 5000  # of patches that are compared together: few enough for their pairs to stay in a core's cache


class Scores(NamedTuple):
    """The four features and their mean, each in [0, 1]; 1 is a mesh against itself."""

    geoSSIM: float  # noqa: N815  (the paper's names)
    geoGraSSIM: float  # noqa: N815
    colorSSIM: float  # noqa: N815
    colorGraSSIM: float  # noqa: N815
    FMQM: float


COLUMNS = Scores._fields


@dataclass(frozen=True)
class Result:
    """A comparison.

    Attributes:
        scores: means over the patches.
        patch_scores: (P, 5) float64, in the order of COLUMNS.
        fmqm_p10: 10th percentile of FMQM over the patches.
        perceived: the second reading of the same samples, means over the patches.
        patch_perceived: (P, 5) float64, in the order of perceived.PERCEIVED_COLUMNS.
        patch_mesh: the reference as the patches see it; their faces are its triangles.
        patches: the P patches, on patch_mesh. patch_centers: (P, 3) metric's frame.
        samples: N sample points. ref, dist: the fields of both surfaces there; metric's frame.
        frame: from the metric's frame to the reference's world.
        warnings: what should be known before the scores are believed. notes: what was done that misleads nobody.
    """

    settings: Settings
    scores: Scores
    patch_scores: Floats
    fmqm_p10: float
    perceived: Perceived
    patch_perceived: Floats
    patch_mesh: PatchMesh
    patches: tuple[Patch, ...]
    patch_centers: Floats
    samples: Samples
    ref: Fields
    dist: Fields
    frame: Frame
    warnings: tuple[str, ...]
    notes: tuple[str, ...]

    def of_patches(self, column: str) -> Floats:
        """(P,) one of COLUMNS or of perceived.PERCEIVED_COLUMNS."""
        if column in COLUMNS:
            return self.patch_scores[:, COLUMNS.index(column)]
        return self.patch_perceived[:, PERCEIVED_COLUMNS.index(column)]


@dataclass(frozen=True)
class _Prepared:
    patch_mesh: PatchMesh
    patches: tuple[Patch, ...]
    patch_centers: Floats
    samples: Samples
    order: Ints
    ref: Fields
    notes: tuple[str, ...]


class Evaluation:
    """A reference with its patches, samples and field values."""

    def __init__(self, reference: Surface, settings: Settings) -> None:
        self.reference = reference
        self.settings = settings
        self._prepared: _Prepared | None = None

    def prepare(self) -> Stepper[None]:
        """Patches, samples and the reference's fields; once, before comparing."""
        return Stepper(self._prepare())

    def compare(self, distorted: Surface) -> Stepper[Result]:
        """Scores of a surface that was prepared in the reference's frame."""
        if self._prepared is None:
            raise RuntimeError("prepare() must have run to its end before compare()")
        if distorted.frame is not self.reference.frame:
            raise ValueError("the distorted surface must be prepared in the reference's frame")
        return Stepper(self._compare(self._prepared, distorted))

    def _prepare(self) -> Work[None]:
        settings = self.settings
        mesh = yield from as_part(build_patch_mesh(self.reference, settings.patches), 0.0, 0.05, "prepare")
        yield Progress("prepare", 0.05)
        chosen = []
        for center in choose_centers(mesh.vertices, settings):
            chosen.append(center)
            yield Progress("prepare", 0.05 + 0.05 * len(chosen) / settings.patches)
        centers = np.array(chosen)
        patches: list[Patch] = []
        parts: list[PatchSamples] = []
        total_area = mesh.area
        for patch in grow_patches(mesh, centers, settings.patches):
            patches.append(patch)
            if len(patches) % _DRAWN_AT_ONCE == 0 or len(patches) == len(centers):
                parts += draw_samples(mesh, patches[len(parts) :], total_area, settings)
            yield Progress("prepare", 0.1 + 0.3 * len(patches) / len(centers))
        samples = join_samples(parts)
        if not len(samples.positions):
            raise MeshError(f"{self.reference.name}: no samples fall on its patches")
        order = morton_order(samples.positions)
        yield Progress("prepare", 0.4)

        notes = list(self.reference.notes)
        if mesh.was_split:
            before, after = len(self.reference.triangles), len(mesh.triangles)
            notes.append(
                f"{self.reference.name}: {len(self.reference.vertices)} vertices are too few for {settings.patches} "
                f"patches; edges were split for them ({before} to {after} triangles, same surface)"
            )
        reach = np.abs(samples.offset)  # a sample is this near to the face it was drawn on
        fields = evaluate_fields(self.reference, samples.positions, order, reach)
        ref = yield from as_part(fields, 0.4, 0.6, "fields")
        self._prepared = _Prepared(mesh, tuple(patches), mesh.vertices[centers], samples, order, ref, tuple(notes))

    def _compare(self, prepared: _Prepared, distorted: Surface) -> Work[Result]:
        settings, samples = self.settings, prepared.samples
        fields = evaluate_fields(distorted, samples.positions, prepared.order)
        dist = yield from as_part(fields, 0.0, 0.8, "fields")
        weights = channel_weights(settings.color_space)
        diagonals = np.array([patch.diagonal for patch in prepared.patches])
        features = np.empty((len(prepared.patches), 4))
        perceived = np.empty((len(prepared.patches), len(PERCEIVED_COLUMNS)))
        together = max(1, _SAMPLES_AT_ONCE * len(features) // len(samples.positions))
        for first in range(0, len(features), together):
            group = slice(first, first + together)
            start = samples.start[first : first + together + 1]
            here = slice(start[0], start[-1])
            start = start - start[0]
            diagonal = np.repeat(diagonals[group], np.diff(start))  # lengths are in patch diagonals from here on
            positions, units = _shrunk(samples.positions[here], diagonal), np.flatnonzero(samples.unit[here])
            ref, other = _in_diagonals(prepared.ref, here, diagonal), _in_diagonals(dist, here, diagonal)
            near = pairs_of_patches(positions, start, units, RADIUS, itself=True)
            around = colors_around(near, units, ref.channels, other.channels)
            perceived[group] = perceived_of_patches(positions, start, ref, other, units, near, around)
            pairs = near
            if settings.radius != RADIUS:
                pairs = pairs_of_patches(positions, start, units, settings.radius)
            if settings.color_space != "rgb":
                ref, other = (
                    replace(
                        _in_diagonals(fields, here, diagonal), channels=channels(fields.ncf[here], settings.color_space)
                    )
                    for fields in (prepared.ref, dist)
                )
            if pairs is not near or settings.color_space != "rgb":
                around = colors_around(pairs, units, ref.channels, other.channels)
            features[group] = features_of_patches(positions, start, ref, other, units, pairs, around, weights, settings)
            yield Progress("features", 0.8 + 0.2 * min(first + together, len(features)) / len(features))
        patch_scores = np.column_stack([features, pool_features(features, settings.pooling)])
        return Result(
            settings=settings,
            scores=Scores(*patch_scores.mean(axis=0).tolist()),
            patch_scores=patch_scores,
            fmqm_p10=low_percentile(patch_scores[:, -1]),
            perceived=perceived_of_pair(perceived),
            patch_perceived=perceived,
            patch_mesh=prepared.patch_mesh,
            patches=prepared.patches,
            patch_centers=prepared.patch_centers,
            samples=samples,
            ref=prepared.ref,
            dist=dist,
            frame=self.reference.frame,
            warnings=tuple(dict.fromkeys((*self.reference.warnings, *distorted.warnings))),
            notes=tuple(dict.fromkeys((*prepared.notes, *distorted.notes))),
        )


def fmqm(reference: MeshArrays, distorted: MeshArrays, settings: Settings, build_query: QueryBuilder) -> Scores:
    """Scores of a distorted mesh against its reference: the paper's method, from arrays to five numbers.

    1. Both meshes are moved to one frame, in which the reference's box has the diagonal 1.
    2. Vertices of the reference that lie far apart are the centers of patches (V-B).
    3. Each patch grows ring by ring until it has its share 1 / N_patch of the surface (V-B).
    4. Samples are drawn on the patch's faces, and moved along their normals (V-C, equations 12 and 13).
    5. At each sample p both meshes are asked for the nearest point p_n: the SDF is its distance, negative
       inside (III-B, 3 and 4), the NCF the color there (IV-A, 5 to 7).
    6. Of each patch the SDFs are compared by their moments (15 to 18) and their gradients (20 and 21);
    7. the NCFs by their moments around some samples, along the normal and in the tangent plane (10, 11, 22 to 27),
    8. and by their steepest slopes in the tangent plane (28 to 32).
    9. The geometric mean of these four is the patch's FMQM (33).
    10. Scores are the means over the patches.

    docs/metric.md says what the paper leaves open. Evaluation does the same in steps, and for several distorted
    meshes at the cost of one preparation.

    Args:
        build_query: makes what finds nearest triangles and hits of rays, from vertices (V, 3) and triangles (T, 3).

    Raises:
        MeshError: one of the meshes has no surface that could be measured.
    """
    surface = prepare_surface(reference, build_query)
    evaluation = Evaluation(surface, settings)
    evaluation.prepare().run()
    return evaluation.compare(prepare_surface(distorted, build_query, surface.frame)).run().scores


def _in_diagonals(fields: Fields, here: slice, diagonal: Floats) -> FieldValues:
    ncf = fields.ncf[here].astype(np.float64)
    return FieldValues(_shrunk(fields.nearest[here], diagonal), fields.sdf[here] / diagonal, ncf)


def _shrunk(positions: Floats, by: Floats) -> Floats:
    """(n, 3) positions by (n,) lengths; each axis in one piece of memory, where what follows is faster."""
    return np.divide(positions.T, by, order="C").T
