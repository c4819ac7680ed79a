# SPDX-License-Identifier: GPL-3.0-or-later
"""The screen sizes of several assets that have been read already, in steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..comparison.alignment import align
from ..comparison.candidates import AssetMesh
from ..metric.errors import FMQMError
from ..metric.stepper import Stepper, Work, as_part
from ..metric.surface import QueryBuilder
from .definition import VIEWS
from .engines import Extent
from .measure import ScreenSize, ScreenSizes


@dataclass(frozen=True)
class SizedLOD:
    """One LOD of a chain.

    Attributes:
        name: as of its mesh. triangles: after triangulation; 0 where it could not be read.
        size: None where there is an error. warnings: what should be known before it is believed.
        error: why there is no size.
    """

    name: str
    triangles: int = 0
    size: ScreenSize | None = None
    warnings: tuple[str, ...] = ()
    error: str | None = None


@dataclass(frozen=True)
class SizedChain:
    """LODs in the order in which they were given, and how large their reference is."""

    lods: tuple[SizedLOD, ...]
    extent: Extent


def sizing_chain(
    reference: AssetMesh,
    lods: Sequence[tuple[str, AssetMesh | str]],
    build_query: QueryBuilder,
    views: int = VIEWS,
    space: str = "auto",
    match_scale: bool = False,
) -> Stepper[SizedChain]:
    """A stepper over measuring LODs against their reference; one that fails does not stop the others.

    Args:
        reference, lods: read with their normals. Each LOD has a name, and instead of a mesh the reason why it has none.
        build_query: makes the spatial query of the reference, by which LODs are aligned.
        space, match_scale: as in comparison.alignment.align.

    Raises:
        SettingsError: no such number of views.
        MeshError, while stepping: the reference cannot be rendered.
    """
    return Stepper(_work(ScreenSizes(reference.world(), views, build_query), reference, lods, space, match_scale))


def _work(
    sizes: ScreenSizes,
    reference: AssetMesh,
    lods: Sequence[tuple[str, AssetMesh | str]],
    space: str,
    match_scale: bool,
) -> Work[SizedChain]:
    share = 1 / (len(lods) + 1)
    yield from as_part(sizes.prepare(), 0.0, share, f"Preparing {reference.mesh.name}")
    found = []
    for index, (name, asset) in enumerate(lods, 1):
        if isinstance(asset, str):
            found.append(SizedLOD(name, error=asset))
            continue
        triangles = len(asset.mesh.triangles)
        try:
            placed = align(reference, asset, space, match_scale, sizes.reference)
            size = yield from as_part(sizes.measure(placed.mesh), share * index, share, f"Rendering {name}")
            found.append(SizedLOD(name, triangles, size, (*asset.mesh.warnings, *placed.warnings)))
        except FMQMError as reason:
            found.append(SizedLOD(name, triangles, error=str(reason)))
    return SizedChain(tuple(found), Extent.of(sizes.reference))
