# SPDX-License-Identifier: GPL-3.0-or-later
"""The study of how the numbers behave: what is measured, and measuring it into a journal that can be gone on with.

A reference is prepared once for each settings, and compared with all its distorted versions, which are loaded once.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..batch.interrupt import defer_interrupts
from ..batch.journal import Journal, row_key
from ..batch.rows import BatchOptions, Row
from ..comparison.pair import PairOptions
from ..metric.errors import FMQMError
from ..metric.settings import FAST_SCORED_PATCHES, SETTING_NAMES, Settings
from ..report.records import PairScore, pair_record
from .degrade import MANIFEST
from .distortions import DISTORTIONS, GTC, Distortion

if TYPE_CHECKING:
    from ..metric.surface import MeshArrays
    from ..screen_size.measure import ScreenSizes

SEEDS = 5
FAST = Settings(scored_patches=FAST_SCORED_PATCHES)
BASE, RENDERED = "preset fast", "rendered"  # what sweeps are compared with; the same once more, with pictures
# One setting at a time.
SWEEPS: tuple[tuple[str, Any], ...] = (
    ("seed", 1),
    *(("samples", value) for value in (10_000, 50_000, 100_000)),
    *(("patches", value) for value in (100, 500)),
    *(("sigma", value) for value in (0.025, 0.1)),
    ("normal_threshold", 0.9),
    ("tangent_threshold", 0.1),
    *(("radius", value) for value in (0.0625, 0.25)),
    ("gradient_radius", 0.25),
    *(("color_units", value) for value in (25, 200)),
    ("centers", "random"),
    ("color_space", "lab"),
    ("pooling", "arithmetic"),
)
LADDER_RANKS = (0, 2, 5, 5, 5)  # of the seeds; the rest is ranked between


@dataclass(frozen=True)
class Variant:
    """Settings under a name, and what is measured with them.

    Attributes:
        rank: what is measured first of all models, should there not be time for everything.
        ladder: of the paper's settings, for the order of levels and the spread over seeds.
        whole: all distortions; else every third level. sized: each kind is rendered too, from its mildest level to the
            first that shows.
    """

    name: str
    settings: Settings
    rank: int
    ladder: bool = False
    whole: bool = False
    sized: bool = False

    def takes(self, distortion: Distortion) -> bool:
        return self.whole or distortion.level % 3 == 1


@dataclass(frozen=True)
class Study:
    """What is measured; SMOKE is a small one, which only shows that all of it runs.

    Attributes:
        variants: the ladder's first. cells: of the generated models. kinds: of distortion; empty for all.
    """

    variants: tuple[Variant, ...]
    cells: int = 24
    kinds: tuple[str, ...] = ()

    @property
    def swept(self) -> list[Variant]:
        """Those that differ from BASE in one setting."""
        return [each for each in self.variants if not each.ladder and each.name not in (BASE, RENDERED)]

    @property
    def distortions(self) -> tuple[Distortion, ...]:
        return tuple(each for each in DISTORTIONS if not self.kinds or each.kind in self.kinds)


def ladder_name(seed: int) -> str:
    return f"ladder, seed {seed}"


def _variants(paper: Settings, fast: Settings, seeds: int, sweeps: Sequence[tuple[str, Any]]) -> Iterator[Variant]:
    for seed in range(seeds):
        yield Variant(ladder_name(seed), paper.with_seed(seed), LADDER_RANKS[seed], ladder=True, whole=True)
    yield Variant(BASE, fast, 1, whole=True)
    for name, value in sweeps:
        yield Variant(f"{name.replace('_', '-')} {value}", replace(fast, **{name: value}), 3)
    yield Variant(RENDERED, fast, 4, whole=True, sized=True)


FULL = Study(tuple(_variants(Settings(), FAST, SEEDS, SWEEPS)))
_SMALL = Settings(samples=4000, patches=20, color_units=20)
_SMALL_SWEEPS = (("seed", 1), ("samples", 2000), ("pooling", "arithmetic"))
SMOKE = Study(tuple(_variants(_SMALL, _SMALL, 2, _SMALL_SWEEPS)), cells=8, kinds=("GN", "GTC"))


@dataclass(frozen=True)
class Measured:
    """One number of the study, with what it is of."""

    model: str
    variant: str
    distortion: Distortion
    record: Mapping[str, Any]


def measure(study: Study, folders: Sequence[Path], journal: Journal, part: int, parts: int, versions: Any) -> None:
    """Measures a part of the study into a journal, what is missing in it; needs bpy.

    Args:
        folders: of the models, as degrade has written them. part: from 0, of so many parts.
        versions: as provenance.provenance has them.
    """
    turn = 0
    for rank in sorted({each.rank for each in study.variants}):
        loaded = [_Loaded(folder) for folder in folders]
        for variant in study.variants:
            for each in loaded:
                turn += variant.rank == rank
                if variant.rank == rank and turn % parts == part:
                    _measure_variant(study, each, variant, journal, versions)


def read_study(study: Study, folders: Sequence[Path], journals: Sequence[Journal], versions: Any) -> list[Measured]:
    """What the journals hold of the study, less what failed; an error is in its record."""
    found = []
    for folder in folders:
        for variant in study.variants:
            for distortion, _, key in _pairs(study, folder, variant, versions):
                record = next((journal.record(key) for journal in journals if key in journal), None)
                if record is not None:
                    found.append(Measured(folder.name, variant.name, distortion, record))
    return found


def planned(study: Study, folders: Sequence[Path], versions: Any) -> dict[str, int]:
    """How many pairs the study has, by variant."""
    return {
        each.name: sum(1 for folder in folders for _ in _pairs(study, folder, each, versions))
        for each in study.variants
    }


def _pairs(study: Study, folder: Path, variant: Variant, versions: Any) -> Iterator[tuple[Distortion, Row, str]]:
    """A model's pairs in the order of DISTORTIONS, with their keys in the journal."""
    names = {each.name: each for each in study.distortions if variant.takes(each)}
    plain = {each.name: getattr(Settings(), each.name) for each in fields(Settings)}
    settings = tuple((n, v) for n in SETTING_NAMES if (v := getattr(variant.settings, n)) != plain[n])
    options = BatchOptions(pair=PairOptions(), screen_size=variant.sized)
    with open(folder / MANIFEST, encoding="utf-8", newline="") as file:
        for line in csv.DictReader(file):
            distortion = names.get(line["id"].removeprefix(f"{Path(line['reference']).stem}_"))
            if distortion is not None:
                row = Row(line["id"], line["reference"], line["distorted"], settings=settings, folder=str(folder))
                row = replace(row, kind=distortion.kind, level=distortion.level)
                yield distortion, row, row_key(row, options, versions)


class _Loaded:
    """A model's meshes, each loaded when it is first asked for."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._meshes: dict[str, MeshArrays] = {}

    def mesh(self, row: Row, name: str) -> MeshArrays:
        from ..blender.files.load import load_mesh

        if name not in self._meshes:
            with defer_interrupts():  # in an importer they would be an error of the file
                self._meshes[name] = load_mesh(row.path(name))
        return self._meshes[name]


def _measure_variant(study: Study, loaded: _Loaded, variant: Variant, journal: Journal, versions: Any) -> None:
    from ..blender.scene.node_queries import surface_query
    from ..comparison.measurement import Measurement
    from ..screen_size.measure import ScreenSizes

    pairs = list(_pairs(study, loaded.folder, variant, versions))
    if all(journal.has_scores(key) for _, _, key in pairs):
        return
    reference = loaded.mesh(pairs[0][1], pairs[0][1].reference)
    measurement = Measurement(reference, surface_query, variant.settings)
    measurement.prepare().run()
    sizes, shown = None, set[str]()
    if variant.sized:
        sizes = ScreenSizes(reference)
        sizes.prepare().run()
    for distortion, row, key in pairs:
        if not journal.has_scores(key):
            journal.start(key)
            patches = variant.settings.scored_patches or variant.settings.patches
            pair = PairScore(row.reference, row.distorted, patches=patches)
            try:
                mesh = loaded.mesh(row, row.distorted)
                readings = measurement.score(mesh).run()
                wanted = sizes is not None and distortion.kind != GTC and distortion.kind not in shown
                findings = {"screen_size": _size(sizes, mesh)} if wanted else {}
                pair = replace(pair, readings=readings, findings=findings)
            except FMQMError as error:
                pair = replace(pair, error=str(error))
            journal.done(key, pair_record(pair) | row.record_fields())
        if is_visible(journal.record(key)):
            shown.add(distortion.kind)


def _size(sizes: ScreenSizes | None, mesh: MeshArrays) -> dict[str, Any]:
    from ..screen_size.records import size_record

    assert sizes is not None
    return size_record(sizes.measure(mesh).run())


def is_visible(record: Mapping[str, Any]) -> bool | None:
    """Whether renderings of at most 512 pixels differ by more than a hard switch may; None: they were not made."""
    found = record.get("screen_size")
    return None if found is None else found["strict"]["bound"] != "at least"
