# SPDX-License-Identifier: GPL-3.0-or-later
"""How well scores agree with people's.

python scripts/evaluate.py SCORES.csv MOS.csv
python scripts/evaluate.py SCORES.csv --dataset sjtu-tmqa DIR

Needs no Blender; scipy, and matplotlib for --plots (pip install 'fmqm[evidence]').
"""

import argparse
import csv
import io
import json
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fmqm_addon.apart import check_apart
from fmqm_addon.batch.datasets import LAYOUTS, Layout, kind_of, layout_of, model_of, opinion_file
from fmqm_addon.batch.progress_log import print_stderr
from fmqm_addon.cli.arguments import OneLineParser
from fmqm_addon.cli.process import FAILED, OK, run_script
from fmqm_addon.metric.errors import FMQMError, SettingsError
from fmqm_addon.report.atomic_files import STDOUT, check_writable, print_parts, write_text

if TYPE_CHECKING:
    from fmqm_addon.evidence.tables import OpinionTable

_LISTED = 10  # ids without a partner that are printed; all stand in the JSON


def build_parser() -> OneLineParser:
    parser = OneLineParser(
        prog="evaluate.py",
        description="Correlations of every numeric column with people's scores, after the five-parameter logistic of "
        "the Video Quality Experts Group, with 95 % intervals.",
        epilog="Exit codes: 0 done; 1 a file cannot be read or written; 2 wrong arguments or tables.",
        allow_abbrev=False,
    )
    parser.add_argument("scores", metavar="SCORES", help="a CSV or JSON that score.py wrote, or one like it")
    parser.add_argument("mos", metavar="MOS", nargs="?", help="people's scores (CSV, JSON) with the same ids")
    parser.add_argument(
        "--dataset", nargs=2, metavar=("NAME", "DIR"),
        help=f"people's scores of a data set instead of MOS: {', '.join(LAYOUTS)}, and its folder",
    )  # fmt: skip
    parser.add_argument("--layout", metavar="FILE", help="a JSON object that changes how --dataset is laid out")
    parser.add_argument("--id-column", metavar="NAME", default="", help="of MOS (default: id, name, stimulus ...)")
    parser.add_argument("--mos-column", metavar="NAME", default="", help="of MOS (default: mos, dmos, score)")
    parser.add_argument("--metrics", metavar="NAME,NAME", default="", help="only these columns (default: all numbers)")
    parser.add_argument("--compare", nargs=2, metavar=("A", "B"), help="test whether A agrees better than B")
    parser.add_argument("--resamples", type=int, default=1000, metavar="N", help="of the bootstrap; 0: no intervals")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the bootstrap (default: 0)")
    parser.add_argument("--json", metavar="FILE", help="everything; - is stdout, without the table")
    parser.add_argument("--csv", metavar="FILE", help="one row a metric and group; - as above")
    parser.add_argument("--plots", metavar="DIR", help="a scatter plot with the fitted curve for each metric")
    return parser


def main(argv: Sequence[str], out: TextIO) -> int:
    parser = build_parser()
    parser.out = out
    args = parser.parse_args(argv)
    try:
        return _evaluate(args, out)
    except SettingsError as error:
        parser.error(str(error))
    except FMQMError as error:
        print_stderr(f"{parser.prog}: {error}\n")
        return FAILED


def _evaluate(args: argparse.Namespace, out: TextIO) -> int:
    if bool(args.mos) == bool(args.dataset):
        raise SettingsError("people's scores are wanted: MOS, or --dataset NAME DIR" + (", not both" * bool(args.mos)))
    if args.layout and not args.dataset:
        raise SettingsError("--layout is for --dataset; give both")
    if not 0 <= args.resamples <= 100_000:
        raise SettingsError(f"--resamples is {args.resamples}; it must be between 0 and 100000")
    try:
        from fmqm_addon.evidence.evaluate import evaluate
        from fmqm_addon.evidence.evaluation_report import csv_rows, draw_plots, plain, text
        from fmqm_addon.evidence.tables import read_scores
    except ModuleNotFoundError as error:
        raise FMQMError(f"this Python has no {error.name}: pip install 'fmqm[evidence]'") from error
    layout = layout_of(args.dataset[0], args.layout) if args.dataset else None
    table = args.mos if layout is None else opinion_file(args.dataset[1], layout)
    outputs = {flag: path for flag, path in (("--json", args.json), ("--csv", args.csv)) if path}
    check_apart(outputs.items(), [args.scores, table])
    for path in outputs.values():
        if path and path != STDOUT:
            check_writable(path)
    scores = read_scores(args.scores)
    opinions = _opinions(args, table, layout)
    metrics = [name.strip() for name in args.metrics.split(",") if name.strip()]
    compare = tuple(args.compare) if args.compare else None
    found = evaluate(scores, opinions, metrics, compare, args.resamples, args.seed)
    _tell_unmet("without a score", found.unscored)
    _tell_unmet("that people did not score", found.unjudged)
    paper = ({}, {}) if layout is None else (layout.paper, layout.paper_kinds)
    document = json.dumps(plain(found, *paper), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    lines = io.StringIO()
    csv.writer(lines, lineterminator="\n").writerows(csv_rows(found))
    printed = STDOUT in (args.json, args.csv)
    for path, written in ((args.json, document), (args.csv, lines.getvalue())):
        if path == STDOUT:
            print_parts(out, [written])
        elif path:
            write_text(path, written)
    if args.plots:
        draw_plots(args.plots, found)
    if not printed:
        print_parts(out, [text(found, *paper)])
    return OK


def _opinions(args: argparse.Namespace, table: str, layout: Layout | None) -> "OpinionTable":
    from fmqm_addon.evidence.tables import read_opinions

    if layout is None:
        return read_opinions(table, args.id_column, args.mos_column)
    opinions = read_opinions(table, args.id_column or layout.id_column, args.mos_column or layout.opinion_column)
    kinds = tuple(kind_of(layout, name) for name in opinions.ids)
    references = tuple(model_of(layout, name) for name in opinions.ids)
    return replace(opinions, kinds=kinds if any(kinds) else (), references=references if any(references) else ())


def _tell_unmet(what: str, names: Sequence[str]) -> None:
    if names:
        more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        print_stderr(f"{len(names)} {what}: {', '.join(names[:_LISTED])}{more}\n")


if __name__ == "__main__":
    run_script(main, __file__)
