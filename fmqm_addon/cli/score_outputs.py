# SPDX-License-Identifier: GPL-3.0-or-later
"""The outputs of `fmqm score`: the files that were asked for, the table, the warnings, the exit code."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, TextIO

from ..apart import check_apart
from ..batch.progress_log import Log
from ..comparison.judge import Judge
from ..report.atomic_files import STDOUT, print_parts, write_parts
from ..report.criteria import below, shortfall
from ..report.explain import explain, footnote
from ..report.parts_table import parts_parts
from ..report.records import csv_parts, json_parts, note_parts, table_parts, trust_parts
from .process import FAILED, OK
from .score_arguments import output_files, page_file, shard_of

if TYPE_CHECKING:
    from ..comparison.pair import PairResult


def write_outputs(
    args: argparse.Namespace,
    records: Iterable[Mapping[str, Any]],
    settings: Mapping[str, Any],
    versions: Mapping[str, str],
    last: PairResult | None,
    out: TextIO,
) -> None:
    """What is to be known before the scores are believed, then the files, and in any case what is printed."""
    _say_warnings(args, records)
    head = dict(versions) | ({"shard": shard_of(args.shard)} if args.shard else {})
    texts = [
        (args.json, json_parts(records, settings, head)),
        (args.csv, csv_parts(records, args.csv_raw)),
    ]
    if args.junit:
        from ..report.junit import junit_parts

        texts.append((args.junit, junit_parts(records)))
    try:
        check_apart((output_files(args) | page_file(args)).items(), _images(records))
        for path, parts in texts:
            if path and path != STDOUT:
                write_parts(path, parts)
        if args.report:
            from ..report.html.page import write_page

            write_page(args.report, records, settings, versions)
        if last is not None:
            _write_last(args, last)
    finally:
        alone = next((parts for path, parts in texts if path == STDOUT), None)
        print_parts(out, _table_parts(args, records) if alone is None else alone)


def _write_last(args: argparse.Namespace, last: PairResult) -> None:
    result = last.comparison.result
    if args.save_fields:
        from ..report.npz import save_fields

        save_fields(args.save_fields, result)
    if args.picture:
        from ..report.sheet import write_picture

        write_picture(args.picture, last.reference, last.comparison.distorted, result, judge=args.judge or Judge.FMQM)


def _table_parts(args: argparse.Namespace, records: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    yield from table_parts(records)
    if args.verbose:
        yield from trust_parts(records)
        yield from note_parts(records)
    if args.parts:
        yield from parts_parts(records)
    if args.explain:
        for record in records:
            # A pair without scores of its own process, such as a lost one, comes without an explanation.
            yield f"\n{record.get('explanation') or explain(record)}\n"
        yield f"\n{footnote(records)}\n"


def _images(records: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """Paths of the images that the colors came from."""
    for trust in (record["trust"] for record in records):
        for name in ("reference", "distorted") if trust else ():
            yield from (image["path"] for image in trust[name]["images"]["value"] or ())


def _say_warnings(args: argparse.Namespace, records: Iterable[Mapping[str, Any]]) -> None:
    """Each warning once, with the pair where it came first; each pair that is below its threshold."""
    pairs = 0
    times: Counter[int] = Counter()
    for record in records:
        pairs += 1
        times.update({hash(warning) for warning in record["warnings"]})
    log = Log(args.program, pairs, pairs)
    for record in records:
        for warning in record["warnings"]:
            if others := times.pop(hash(warning), 0):
                name = record["id"] if others == 1 else f"{record['id']} and {others - 1} more"
                log.say(warning, name, "warning: ")
        if below(record):
            log.say(f"{record['id']}: {shortfall(record)}")


def exit_code(records: Iterable[Mapping[str, Any]]) -> int:
    return FAILED if any(record["error"] is not None or below(record) for record in records) else OK
