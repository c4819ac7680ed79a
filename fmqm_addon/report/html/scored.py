# SPDX-License-Identifier: GPL-3.0-or-later
"""The report of pairs that have been scored and are still in memory, in steps: what the sidebar writes."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...comparison.judge import Judge
from ...comparison.measurement import Comparison
from ...metric.stepper import Progress, Work
from ...metric.surface import Surface
from ..criteria import Criteria
from ..explain import explain, where
from ..heat import side_of_loss
from ..picture_files import Encoder, encoded_by
from ..records import Costs, PairScore, pair_record
from ..texture_memory import texture_bytes
from .page import PAGE, write_page
from .pictures import open_report_folder, picture_stem, write_pair_pictures
from .viewer.files import ReferenceFile, write_pair_data, write_reference_data


@dataclass(frozen=True)
class ScoredPair:
    """A pair for the page.

    Attributes:
        reference, comparison: what pictures are drawn from; None: they are not in memory any more, there are none.
    """

    score: PairScore
    reference: Surface | None = None
    comparison: Comparison | None = None


def writing_report(
    folder: str,
    pairs: Sequence[ScoredPair],
    judge: Judge,
    settings: Mapping[str, Any],
    versions: Mapping[str, str],
    encoder: Encoder | None = None,
) -> Work[str]:
    """Writes the pictures, a pair a step, then the page; ends in its path.

    Args:
        encoder: of the pictures; None: Pillow.

    Raises, while stepping:
        FMQMError: a file cannot be written, or nothing encodes pictures.
    """
    yield Progress("Making the folder", 0.0)
    with encoded_by(encoder):
        open_report_folder(folder)
    files: dict[int, ReferenceFile] = {}  # by the surface
    records = []
    for number, pair in enumerate(pairs):
        yield Progress(f"Drawing {pair.score.distorted}", number / (len(pairs) + 1))
        with encoded_by(encoder):
            records.append(_record(folder, pair, judge, files))
    yield Progress("Writing the page", len(pairs) / (len(pairs) + 1))
    write_page(folder, records, settings, versions)
    return os.path.join(folder, PAGE)


def _record(folder: str, pair: ScoredPair, judge: Judge, files: dict[int, ReferenceFile]) -> dict[str, Any]:
    reference, comparison, score = pair.reference, pair.comparison, pair.score
    if reference is not None and comparison is not None:
        distorted, result = comparison.distorted, comparison.result
        given, whole = (surface.preparation.given for surface in (distorted, reference))
        stem = picture_stem(score.reference, score.distorted)
        if id(reference) not in files:
            own = picture_stem(str(len(files)), score.reference)  # it may have changed between two measurements
            files[id(reference)] = write_reference_data(folder, own, reference)
        side = side_of_loss(reference, result, judge)
        findings = {
            "pictures": write_pair_pictures(folder, stem, reference, distorted, result, judge, side),
            "viewer": write_pair_data(folder, stem, files[id(reference)], distorted, result, judge, side),
            "where": where(reference, result),
        }
        costs = Costs(given, given / whole, texture_bytes(distorted))
        score = replace(score, costs=costs, findings=score.findings | findings)
    record = pair_record(score) | Criteria(judge).record_fields()
    return record | {"explanation": explain(record)}
