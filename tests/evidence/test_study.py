# SPDX-License-Identifier: GPL-3.0-or-later
"""What the page of evidence says, of numbers that were made up; and the journal that a study goes on with."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fmqm_addon.batch.journal import Journal, parse_line
from fmqm_addon.evidence.consistency import (
    Results,
    kept_ranking,
    ladder_steps,
    rank_correlation,
    share_in_order,
    smallest_visible,
    spread,
)
from fmqm_addon.evidence.degrade import COLUMNS, MANIFEST
from fmqm_addon.evidence.distortions import DISTORTIONS, Distortion
from fmqm_addon.evidence.models import find_models, make_models
from fmqm_addon.evidence.study import (
    BASE,
    FULL,
    SEEDS,
    Measured,
    Study,
    is_visible,
    ladder_name,
    planned,
    read_study,
)
from fmqm_addon.evidence.study_page import TEMPLATE, write_page
from fmqm_addon.metric.errors import FMQMError
from fmqm_addon.report.records import PairScore, pair_record
from tests.readings import all_alike

VERSIONS = {"fmqm_version": "1", "fmqm_code": "0", "blender_version": "4.5.0"}


def good_score(each: Distortion, seed: int = 0) -> float:
    """The lower the harsher, all of GTC's nine among them; a little higher with each seed."""
    return 0.99 - 0.02 * DISTORTIONS.index(each) * 0.4 + 0.0001 * seed


def measured(score: float, each: Distortion, variant: str, model: str = "rock", **findings: Any) -> Measured:
    pair = PairScore("rock.glb", each.name, all_alike(score), patches=40, findings=findings)
    return Measured(model, variant, each, pair_record(pair))


def whole_study(study: Study = FULL) -> list[Measured]:
    """All of a study, every number in order; of BASE the third level of each kind is the first that shows."""
    found = []
    for variant in study.variants:
        for each in filter(variant.takes, study.distortions):
            shown = {"screen_size": size("" if each.level >= 3 else "at least")} if variant.sized else {}
            found.append(measured(good_score(each, variant.settings.seed), each, variant.name, **shown))
    return found


def size(bound: str) -> dict[str, Any]:
    return {"strict": {"bound": bound, "pixels": 512.0}}


def of_kind(kind: str) -> list[Distortion]:
    return [each for each in DISTORTIONS if each.kind == kind]


def test_steps_are_counted_for_each_seed() -> None:
    found = whole_study()
    assert share_in_order(ladder_steps(Results(FULL, found), "perceived")) == 1
    mild, middle, harsh = of_kind("GN")[:3]
    worse = [each for each in found if (each.variant, each.distortion) != (ladder_name(1), middle)]
    worse.append(measured(good_score(mild, 1), middle, ladder_name(1)))  # as high as the milder one: not in order
    steps = ladder_steps(Results(FULL, worse), "FMQM", "GN")
    assert len(steps) == 4 * SEEDS and [each for each in steps if not each.in_order] == [
        step for step in steps if (step.seed, step.milder, step.harsher) == (1, mild, middle)
    ]
    assert share_in_order(ladder_steps(Results(FULL, worse), "perceived", "DS")) == 1
    assert share_in_order(ladder_steps(Results(FULL, found[:1]), "perceived")) is None


def test_steps_without_harm_have_no_order() -> None:
    mild, middle = of_kind("SOT")[:2]
    found = [measured(score, each, ladder_name(0)) for score, each in ((0.99995, mild), (1.0, middle))]
    (step,) = ladder_steps(Results(FULL, found), "perceived")
    assert step.is_harmless and not step.in_order and share_in_order([step]) is None
    first, _, third, _, _ = of_kind("SWT")  # as far as GTC takes triangles in its first two rows
    one, two = of_kind("GTC")[0], of_kind("GTC")[3]
    both = [measured(0.9, each, ladder_name(0)) for each in (one, two)]
    (step,) = ladder_steps(Results(FULL, both), "FMQM")
    assert not step.is_harmless and not step.in_order, "a tie is no order"
    flat = [*both, *(measured(1.0, each, ladder_name(0)) for each in (first, third))]
    assert [each.is_harmless for each in ladder_steps(Results(FULL, flat), "FMQM", "GTC")] == [True]


def test_spread_is_of_the_seeds_that_were_measured() -> None:
    one = spread(Results(FULL, whole_study()), "perceived", "QP")
    assert one is not None and one.pairs == 5 and one.small == 1
    assert one.mean == pytest.approx(np.std([0, 0.0001, 0.0002, 0.0003, 0.0004], ddof=1))
    single = [each for each in whole_study() if each.variant == ladder_name(0)]
    assert spread(Results(FULL, single), "perceived") is None


def test_the_mildest_visible_level_counts() -> None:
    found = smallest_visible(Results(FULL, whole_study()), "perceived", "DS")
    assert found is not None and found.pair == "rock, 1/8" and found.models == 1
    mild, shown = of_kind("DS")[1:3]
    assert found.loss == pytest.approx(1 - good_score(shown, 2)) and found.hidden == pytest.approx(
        1 - good_score(mild, 2)
    )
    assert smallest_visible(Results(FULL, whole_study()[:50]), "perceived", "DS") is None
    assert is_visible({}) is None and is_visible({"screen_size": size("below")}) is True


def test_rank_correlations() -> None:
    assert rank_correlation([1, 2, 3, 4], [1, 4, 9, 16]) == 1 and rank_correlation([1, 2, 3, 4], [4, 3, 2, 1]) == -1
    assert rank_correlation([1, 2, 3, 4], [1, 1, 1, 1]) is None and rank_correlation([1, 2], [1, 2]) is None
    results = Results(FULL, whole_study())
    swept = next(each for each in FULL.variants if each.name == "sigma 0.1")
    assert kept_ranking(results, swept, "FMQM") == (1, sum(map(swept.takes, DISTORTIONS)))


def test_the_page_is_text_with_tables_between_marks(tmp_path: Path) -> None:
    models = [*find_models(None), *make_models(tmp_path, cells=2)]
    plan = {each.name: sum(map(each.takes, DISTORTIONS)) for each in FULL.variants}
    write_page(tmp_path / "page.md", FULL, models, whole_study(), plan, VERSIONS)
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    marks = re.compile(r"(<!-- study: \w+ -->\n).*?(?=<!-- end -->)", re.DOTALL)
    template = TEMPLATE.read_text(encoding="utf-8")
    assert marks.sub(r"\1", text) == marks.sub(r"\1", template), "what people wrote stays"
    assert "Skipped: spot (no folder of models was given)." in text and "Not all was run" not in text
    assert "| all | all of them | 220 | 100.0 % | 100.0 % |" in text and "met." in text and "missed" not in text
    pictures = {path.name: path.read_bytes() for path in tmp_path.glob("evidence_*.png")}
    assert set(re.findall(r"evidence_\w+\.png", text)) == set(pictures)
    write_page(tmp_path / "page.md", FULL, models, whole_study()[:-9], plan, VERSIONS)
    assert "In part: rendered (41 of 50).\n" in (tmp_path / "page.md").read_text()
    write_page(tmp_path / "page.md", FULL, models, whole_study()[:1], plan, VERSIONS)
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert text.count("Not measured.") >= 4 and "evidence_settings.png" not in text
    assert not (tmp_path / "evidence_settings.png").exists(), "that of another study is gone"
    write_page(tmp_path / "page.md", FULL, models, whole_study(), plan, VERSIONS)
    assert {path.name: path.read_bytes() for path in tmp_path.glob("evidence_*.png")} == pictures, "the same bytes"
    with pytest.raises(FMQMError, match="nothing is measured"):
        write_page(tmp_path / "page.md", FULL, models, [], plan, VERSIONS)


def test_the_page_in_docs_has_all_marks_filled() -> None:
    blocks = re.findall(r"<!-- study: (\w+) -->\n(.*?)<!-- end -->", TEMPLATE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 7 and all(body.strip() for _, body in blocks)


def test_what_is_measured_is_read_again(tmp_path: Path) -> None:
    """From the journal, whose lines are checked: what a study writes must be a record that counts."""
    from fmqm_addon.evidence import study as module

    folder = tmp_path / "rock"
    folder.mkdir()
    for name in ("rock.glb", "rock_GN_1.glb"):
        (folder / name).write_bytes(b"")
    with open(folder / MANIFEST, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerows([COLUMNS, ("rock_GN_1", "rock.glb", "rock_GN_1.glb", "GN", 1)])
    assert planned(FULL, [folder], VERSIONS)[BASE] == 1
    ((each, row, key),) = module._pairs(FULL, folder, FULL.variants[0], VERSIONS)
    path = str(tmp_path / "journal.jsonl")
    journal = Journal(path, made_by=VERSIONS)
    journal.done(key, dict(measured(0.9, each, "").record) | row.record_fields())
    journal.close()
    assert all(map(parse_line, Path(path).read_bytes().splitlines(keepends=True)))
    (found,) = read_study(FULL, [folder], [Journal(path, True, VERSIONS)], VERSIONS)
    assert (found.model, found.variant, found.distortion) == ("rock", ladder_name(0), each)


def test_models_are_looked_for(tmp_path: Path) -> None:
    (tmp_path / "bob").mkdir()
    for path in (tmp_path / "spot.obj", tmp_path / "bob" / "bob.glb"):
        path.write_bytes(b"")
    found = {each.name: each for each in find_models(tmp_path)}
    assert found["spot"].path == tmp_path / "spot.obj" and found["bob"].path == tmp_path / "bob" / "bob.glb"
    assert found["egyptian_cat"].path is None and "egyptian_cat.obj" in found["egyptian_cat"].why
