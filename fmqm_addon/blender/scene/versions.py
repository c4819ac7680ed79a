# SPDX-License-Identifier: GPL-3.0-or-later
"""Versions of an asset of the open scene that reach their targets, found and scored as LODs, in steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...comparison.candidates import AssetMesh
from ...comparison.decimation import DecimationGoal, DecimationResult, Search, TargetResult, Version, searching
from ...comparison.pair import PairOptions, comparing_pair
from ...metric.errors import FMQMError, MeshError
from ...metric.stepper import Progress, Stepper, Work, as_part
from ...metric.surface import MeshArrays
from ..materials.types import Reading
from .decimate import read_version
from .measure import Outcome
from .node_queries import surface_query
from .parts import parts_of
from .target import OBJECT, Target, take

_SEARCHING = 0.85  # share of the whole


@dataclass(frozen=True)
class FoundVersion:
    """What was found for one target of a goal.

    Attributes:
        suffix: of its name, and of the names of what hangs from it.
        searched: how. version: what reaches it; with the textures as they are, where smaller ones miss their own.
        outcome: its scores as Measure Quality would find them; its fingerprint is to be filled in.
    """

    suffix: str
    searched: TargetResult
    version: Version
    outcome: Outcome


@dataclass(frozen=True)
class FoundVersions:
    """What was found for a goal.

    Attributes:
        members: by name_full what was decimated: the object, if it shows a surface, and what hangs from it.
        versions: for each target that is reached, in their order. result: of the searches.
    """

    members: tuple[str, ...]
    versions: tuple[FoundVersion, ...]
    result: DecimationResult


def finding_versions(
    original: Target,
    base: str,
    suffixes: Sequence[str],
    goal: DecimationGoal,
    options: PairOptions,
    reading: Reading,
    called: str | None = None,
) -> Stepper[FoundVersions]:
    """A stepper over finding and scoring versions of an object: all are scored on the same samples of one reference.

    Nothing is left in the scene; scene.decimate.add_version puts a version there.

    Args:
        base, suffixes: what the versions will be called: base + suffix, for each of the goal's targets.
        options, reading: as of measure.measuring.
        called: what texts call the original: the name that it is to get; None: its label.

    Raises, while stepping:
        FMQMError: the object is gone, or cannot be measured.
    """
    return Stepper(_finding(original, base, suffixes, goal, options, reading, called or original.label))


def _finding(
    original: Target,
    base: str,
    suffixes: Sequence[str],
    goal: DecimationGoal,
    options: PairOptions,
    reading: Reading,
    called: str,
) -> Work[FoundVersions]:
    yield Progress(f"Reading {called}", 0.0)
    root = original.find()
    if root is None:
        raise MeshError(f"{called}: it is no longer in the file; choose another")
    members = tuple(object_.name_full for object_ in parts_of(root, reading).objects)
    frame = original.name if original.name in members else None
    asset = _called(take(original, reading), original.label, called)
    whole = asset.world()

    def read(version: Version) -> MeshArrays:
        if version == Version():
            return whole
        return read_version(members, called, version, reading, frame).world()

    search = Search(read, surface_query, options.settings, repeats=options.repeats)
    result = yield from as_part(searching(search, goal), 0.0, _SEARCHING)
    found: list[FoundVersion] = []
    share = (1 - _SEARCHING) / max(1, len(suffixes))
    for number, (suffix, searched) in enumerate(zip(suffixes, result.results, strict=True)):
        name = base + suffix
        best = searched.geometry or searched.last
        if not best.reached:
            continue
        version = (searched.last if searched.last.reached else best).best.version
        began, stage = _SEARCHING + share * number, f"Measuring {name}"
        yield Progress(stage, began)
        compared = read_version(members, name, version, reading, frame, suffix)
        comparing = comparing_pair(search.measurement, asset, compared, options, reading.facts)
        pair = yield from as_part(comparing, began, share, stage)
        outcome = Outcome(
            original,
            Target(OBJECT, name),
            pair,
            triangles=len(compared.mesh.triangles),
            reference_triangles=len(asset.mesh.triangles),
            seconds={**comparing.seconds, "total": sum(comparing.seconds.values())},
        )
        found.append(FoundVersion(suffix, searched, version, outcome))
    return FoundVersions(members, tuple(found), result)


def _called(asset: AssetMesh, old: str, new: str) -> AssetMesh:
    """The asset with texts that name it as it will be called."""
    if old == new:
        return asset
    mesh = asset.mesh
    warnings, notes, objects = (
        tuple(text.replace(old, new, 1) for text in texts) for texts in (mesh.warnings, mesh.notes, mesh.objects)
    )
    return replace(asset, mesh=replace(mesh, name=new, warnings=warnings, notes=notes, objects=objects))


def attempting(work: Stepper[FoundVersions]) -> Work[FoundVersions | FMQMError]:
    """The versions, or why they could not be found."""
    try:
        return (yield from work.steps())
    except FMQMError as error:
        return error
