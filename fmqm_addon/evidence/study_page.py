# SPDX-License-Identifier: GPL-3.0-or-later
"""docs/evidence.md: people write its text, the study its tables, between marks."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..metric.errors import FMQMError
from ..report.atomic_files import write_text
from .consistency import (
    ALL,
    HARMLESS,
    ORDER_GOAL,
    READINGS,
    SMALL_SPREAD,
    Results,
    Step,
    beside,
    kept_ranking,
    ladder_steps,
    rank_correlation,
    share_in_order,
    smallest_visible,
    spread,
)
from .distortions import MEANING
from .models import Model
from .study import Measured, Study
from .study_plots import write_plots

TEMPLATE = Path(__file__).resolve().parents[2] / "docs" / "evidence.md"
_BLOCK = re.compile(r"(<!-- study: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
_LISTED = 12  # steps out of order that are named
# Whatever these settings say, it is fixed for perceived.
_ONLY_FMQM = ("normal-threshold", "tangent-threshold", "radius", "gradient-radius", "color-space", "pooling")


def write_page(
    page: Path,
    study: Study,
    models: Sequence[Model],
    found: Sequence[Measured],
    planned: Mapping[str, int],
    versions: Mapping[str, str],
) -> None:
    """Puts the tables of what was found into the text of docs/evidence.md, and the plots beside the page.

    Args:
        models: all that were looked for. planned: pairs by variant, whether measured or not.

    Raises:
        FMQMError: nothing was found, or the text has marks of other names.
    """
    if not found:
        raise FMQMError(f"{page}: nothing is measured; there is nothing to write")
    results = Results(study, found)
    blocks = {
        "made": _made(results, models, found, planned, versions),
        "order": _order(results),
        "disorder": _disorder(results),
        "spread": _spread(results),
        "visible": _visible(results),
        "settings": _settings(results),
        "beside": _beside(results),
    }
    text = TEMPLATE.read_text(encoding="utf-8")
    names = [name for _, name, _ in _BLOCK.findall(text)]
    if sorted(names) != sorted(blocks):
        raise FMQMError(f"{TEMPLATE}: its marks are {', '.join(names)}; wanted are {', '.join(blocks)}")
    for name, line in write_plots(page.parent, results).items():
        blocks[name] += f"\n\n{line}"
    write_text(str(page), _BLOCK.sub(lambda mark: f"{mark[1]}{blocks[mark[2]]}\n{mark[3]}", text))


def _table(*rows: Sequence[str]) -> str:
    """The first row is the header; without another there is no table."""
    if len(rows) == 1:
        return "Not measured."
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _number(value: float | None, digits: int = 4) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _made(
    results: Results,
    models: Sequence[Model],
    found: Sequence[Measured],
    planned: Mapping[str, int],
    versions: Mapping[str, str],
) -> str:
    there = [model.name for model in models if model.path]
    lines = [f"Models: {', '.join(there)}."]
    lines += [f"Skipped: {model.name} ({model.why})." for model in models if not model.path]
    lines.append(
        f"Measured: {len(found)} of {sum(planned.values())} planned pairs, {len(results.errors)} of them an error; "
        f"FMQM {versions['fmqm_version']} (code {versions['fmqm_code']}), Blender {versions['blender_version']}."
    )
    counts = Counter(each.variant for each in found)
    none = [name for name, wanted in planned.items() if wanted and not counts[name]]
    some = [f"{name} ({counts[name]} of {wanted})" for name, wanted in planned.items() if 0 < counts[name] < wanted]
    told = [f"{what} {'; '.join(names)}." for what, names in (("In part:", some), ("Not at all:", none)) if names]
    if told:
        lines.append(f"**Not all was run**, and everything below is only of what was. {' '.join(told)}")
    return "\n".join(lines)


def _order(results: Results) -> str:
    rows: list[Sequence[str]] = [("kind", "what", "steps", *(f"{reading} in order" for reading in READINGS))]
    for kind in (*results.kinds, ALL):
        found = [ladder_steps(results, reading, kind) for reading in READINGS]
        if not found[0]:
            continue
        shares = [_percent(share_in_order(each)) for each in found]
        rows.append((kind, MEANING.get(kind, "all of them"), str(len(found[0])), *shares))
    counted = ladder_steps(results, READINGS[0])
    total = share_in_order(counted)
    if total is None:
        return _table(*rows)
    harmless = [sum(step.is_harmless for step in ladder_steps(results, reading)) for reading in READINGS]
    seeds = _plural(len({step.seed for step in counted}), "seed")
    goal = f"Goal: {_percent(ORDER_GOAL)} of perceived's; {_met(total >= ORDER_GOAL)}."
    left = f"Left out are {harmless[0]} steps of {READINGS[0]} and {harmless[1]} of {READINGS[1]} that do no harm:"
    told = (
        f"A step counts once for each model and each of {seeds}. {left} both of their levels score at least {HARMLESS}."
    )
    return f"{_table(*rows)}\n\n{goal} {told}"


def _plural(count: int, word: str) -> str:
    return f"{count} {word}{'' if count == 1 else 's'}"


def _met(is_met: bool) -> str:
    return "met" if is_met else "**missed**"


def _disorder(results: Results) -> str:
    parts = []
    for reading in READINGS:
        wrong = [each for each in ladder_steps(results, reading) if not (each.in_order or each.is_harmless)]
        by_step: dict[tuple[str, str, str], list[Step]] = {}
        for each in wrong:
            by_step.setdefault((each.model, each.milder.name, each.harsher.name), []).append(each)
        ordered = sorted(by_step.items(), key=lambda item: min(step.fall for step in item[1]))
        if not ordered:
            parts.append(f"{reading}: none.")
            continue
        rows = [("model", "step", "seeds", "rises by at most")]
        for (model, milder, harsher), own in ordered[:_LISTED]:
            first = own[0]
            step = f"{milder} ({first.milder.label}) to {harsher} ({first.harsher.label})"
            rows.append((model, step, str(len(own)), _number(-min(each.fall for each in own))))
        more = len(ordered) - _LISTED
        tail = f"\n\nand {more} more of {reading}'s." if more > 0 else ""
        parts.append(
            f"{reading}, {_plural(len(ordered), 'step')} of a model, the worst first:\n\n" + _table(*rows) + tail
        )
    return "\n\n".join(parts)


def _spread(results: Results) -> str:
    rows: list[Sequence[str]] = [
        ("kind", "pairs", *(f"{reading}, {what}" for reading in READINGS for what in ("mean", "worst")))
    ]
    for kind in (*results.kinds, ALL):
        found = [spread(results, reading, kind) for reading in READINGS]
        if found[0] is None:
            continue
        cells = [_number(value) for each in found if each for value in (each.mean, each.worst)]
        rows.append((kind, str(found[0].pairs), *cells))
    parts = [_table(*rows)]
    for reading in READINGS:
        each = spread(results, reading)
        if each is not None:
            parts.append(
                f"{reading}: {_percent(each.small)} of the pairs below {SMALL_SPREAD}, the worst is {each.worst_pair}."
            )
    perceived = spread(results, READINGS[0])
    if perceived is not None:
        mean, worst = perceived.mean < SMALL_SPREAD, perceived.worst < SMALL_SPREAD
        parts.append(
            f"Goal: below {SMALL_SPREAD} for perceived; of the mean {_met(mean)}, of every pair {_met(worst)}."
        )
    return "\n\n".join(parts)


def _visible(results: Results) -> str:
    what = [f"{reading}: {each}" for reading in READINGS for each in ("smallest loss", "of")]
    rows: list[Sequence[str]] = [("kind", "models", *what, *(f"{reading}: unseen" for reading in READINGS))]
    for kind in results.kinds:
        found = [smallest_visible(results, reading, kind) for reading in READINGS]
        if found[0] is None:
            continue
        cells = [cell for each in found if each for cell in (_number(each.loss), each.pair)]
        rows.append((kind, str(found[0].models), *cells, *(_number(each.hidden) for each in found if each)))
    return _table(*rows)


def _settings(results: Results) -> str:
    rows: list[Sequence[str]] = [("setting", *READINGS, "pairs")]
    paper = next(each for each in results.study.variants if each.ladder)
    named = [("preset paper", paper), *((each.name, each) for each in results.study.swept)]
    for name, variant in named:
        found = [kept_ranking(results, variant, reading) for reading in READINGS]
        cells = [_number(value) for value, _ in found]
        if variant.name.rpartition(" ")[0] in _ONLY_FMQM:
            cells[0] = "fixed"
        if found[1][0] is not None:
            rows.append((name, *cells, str(found[0][1])))
    return _table(*rows)


def _beside(results: Results) -> str:
    rows: list[Sequence[str]] = [("kind", "pairs", "rank correlation", "perceived, mean", "FMQM, mean")]
    for kind in (*results.kinds, ALL):
        fmqm, perceived = beside(results, kind)
        if not fmqm:
            continue
        means = [_number(sum(values) / len(values)) for values in (perceived, fmqm)]
        rows.append((kind, str(len(fmqm)), _number(rank_correlation(fmqm, perceived), 3), *means))
    return _table(*rows)
