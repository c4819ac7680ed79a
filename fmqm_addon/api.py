# SPDX-License-Identifier: GPL-3.0-or-later
"""Measuring from Python, in double precision, without touching the panel's results.

from bl_ext.user_default.fmqm.fmqm_addon import api   # installed; or: from fmqm_addon import api

for outcome in api.measure(bpy.data.objects["Rock_LOD0"], [bpy.data.objects["Rock_LOD1"]]):
    print(outcome.target.name, outcome.error or outcome.scores.FMQM)
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

import bpy

from .blender.materials.types import Reading
from .blender.scene.bvh import BVHQuery
from .blender.scene.measure import Outcome, measuring
from .blender.scene.target import take, target_of
from .comparison.candidates import AssetMesh
from .comparison.pair import PairOptions
from .metric.errors import FMQMError
from .metric.evaluation import COLUMNS, Result, Scores
from .metric.perceived import Perceived
from .metric.settings import PRESETS, Settings
from .screen_size.chain import SizedChain, sizing_chain
from .screen_size.definition import VIEWS

__all__ = ["COLUMNS", "PRESETS", "Outcome", "Perceived", "Result", "Scores", "Settings", "measure", "screen_sizes"]

Asset: TypeAlias = bpy.types.Object | bpy.types.Collection
_ASSETS = (bpy.types.Object, bpy.types.Collection)


def measure(
    reference: Asset,
    distorted: Asset | Iterable[Asset],
    settings: Settings | None = None,
    space: str = "auto",
    match_scale: bool = False,
    repeats: int = 1,
    reference_without_modifiers: bool = False,
    both: bool = False,
    attribution: bool = False,
    bake: int = Reading.bake,
    include: Iterable[str] = (),
    exclude: Iterable[str] = (),
    align: str = PairOptions.align,
) -> list[Outcome]:
    """Scores of objects or collections against a reference.

    Args:
        reference, distorted: objects, which stand for what hangs from them, with their instances; collections.
            Hidden or not. Of levels of detail in one the finest counts, and hulls for collisions do not.
        settings: the paper's if None; `Settings(**PRESETS["fast"])` for a quick look.
        space: "auto", "world" or "local". match_scale: undo a difference in size.
        repeats: measure with so many seeds; scores become means.
        reference_without_modifiers: the reference is its mesh without modifiers, so that an object can be
            measured against itself.
        both: score the other direction too: `outcome.reverse` and `outcome.reverse_perceived`.
        attribution: score geometry and texture apart too: `outcome.attribution`, whose loss it is.
        align: "icp" refines each placement, rigidly: for scans that stand a little askew.
        bake: side in pixels of the images onto which materials are baked that cannot be read; 0 forbids it.
        include, exclude: patterns of names (`*_body`): of the objects that count, of what they hang from or of their
            collections. No include takes all.

    Returns:
        One outcome per distorted asset, in their order; `outcome.scores` are Scores, a named tuple in the order
        of COLUMNS, or None with the reason in `outcome.error`; `outcome.perceived` is Perceived, a named tuple of
        the second reading: score, shape, facing, color, detail, p10. `outcome.comparison.result` is a Result of
        metric.evaluation with patches, samples and fields, `outcome.trust` a comparison.trust.Trust: how far to
        believe the scores.

    Raises:
        TypeError: an asset is no object and no collection.
        SettingsError: a setting has a value that it cannot have.
    """
    assets = _checked(reference, distorted)
    options = PairOptions(
        settings=settings or Settings(),
        repeats=repeats,
        space=space,
        match_scale=match_scale,
        both=both,
        attribution=attribution,
        align=align,
    )
    reading = Reading(bake=bake, include=tuple(include), exclude=tuple(exclude))
    reference_target = target_of(reference, bare=reference_without_modifiers)
    targets = [target_of(asset) for asset in assets]
    return measuring(reference_target, targets, options, reading).run()


def screen_sizes(
    reference: Asset,
    lods: Asset | Iterable[Asset],
    views: int = VIEWS,
    space: str = "auto",
    match_scale: bool = False,
    bake: int = Reading.bake,
) -> SizedChain:
    """At which size on screen LODs may be shown in place of their reference (docs/screen-size.md).

    Args:
        reference, lods, space, match_scale, bake: as for measure. views: 6, or 12.

    Returns:
        `chain.lods` has an item per LOD, in their order: `lod.size.strict.pixels` for a hard switch,
        `lod.size.fade.pixels` for a dithered one, or `lod.error`. screen_size.engines makes of them what engines take.

    Raises:
        TypeError: an asset is no object and no collection.
        SettingsError: a setting has a value that it cannot have.
        MeshError: the reference cannot be measured.
    """
    assets = _checked(reference, lods)
    reading = Reading(bake=bake, normals=True)
    PairOptions(space=space)  # it raises what is wrong
    original = take(target_of(reference), reading)
    read: list[tuple[str, AssetMesh | str]] = []
    for asset in assets:
        try:
            read.append((asset.name, take(target_of(asset), reading)))
        except FMQMError as error:
            read.append((asset.name, str(error)))
    return sizing_chain(original, read, BVHQuery, views, space, match_scale).run()


def _checked(reference: Asset, others: Asset | Iterable[Asset]) -> list[Asset]:
    assets = list(others) if isinstance(others, Iterable) else [others]
    for asset in (reference, *assets):
        if not isinstance(asset, _ASSETS) or asset.is_embedded_data:
            raise TypeError(f"{asset!r} is given; an object or a collection, not the scene's own, is wanted")
    return assets
