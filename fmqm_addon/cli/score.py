# SPDX-License-Identifier: GPL-3.0-or-later
"""Score textured meshes against a reference.

fmqm score REFERENCE DISTORTED [DISTORTED ...]
fmqm score --manifest FILE | REFERENCE --glob PATTERN | --lods FILE | --dataset NAME DIR
python scripts/score.py REFERENCE DISTORTED [DISTORTED ...]
blender -b -q --python scripts/score.py -- REFERENCE DISTORTED [DISTORTED ...]
"""

from __future__ import annotations

import argparse
import functools
import os
import tempfile
from collections.abc import Mapping, Sequence
from typing import Any, TextIO

from ..apart import check_apart
from ..batch.datasets import layout_of, read_dataset
from ..batch.interrupt import defer_interrupts
from ..batch.journal import Journal, Records, row_key
from ..batch.manifest import glob_files, lod_rows, plain_rows, read_manifest
from ..batch.merge import Merged
from ..batch.progress_log import Log, print_stderr
from ..batch.rows import BatchOptions, Row, Task
from ..batch.scorer import score_shard, score_tasks, units_of
from ..batch.workers import WORKER, Limits, recover_scores, score_with_workers, workers_command
from ..comparison.judge import Judge
from ..folders import TEMPORARY, own_folder, sweep
from ..metric.errors import FileError, FMQMError, SettingsError, one_line
from ..provenance import provenance
from ..report.atomic_files import STDOUT, check_writable
from .process import (
    FAILED,
    OK,
    blender_version,
    machine_memory,
    prepare_bpy,
    run_script,
)
from .score_arguments import (
    WAIT,
    build_parser,
    check_arguments,
    criteria_of,
    digest_of,
    journal_path,
    options_of,
    output_files,
    page_file,
    shard_of,
)
from .score_outputs import exit_code, write_outputs

PROGRAM = "score.py"
_STRANGERS = 600.0  # seconds that a pair of strangers' files may take
_WORKER_SCRIPT = "cli/worker.py"  # from the package's folder


def main(argv: Sequence[str], out: TextIO, program: str = PROGRAM) -> int:
    """Scores as the arguments say, and prints to out; returns the exit code.

    Args:
        program: the name that it was called by; usage and messages begin with it.
    """
    parser = build_parser(program)
    parser.out = out
    args = parser.parse_intermixed_args(argv)
    try:
        options = options_of(args)
        limits = _limits(args)
        check_arguments(args)
        if WORKER in os.environ and not args.worker:
            raise FMQMError("a worker without a shard; this is a fault of the program")
        if args.worker:
            prepare_bpy()
            score_shard(args.worker, options, provenance(blender_version()), limits.timeout)
            return OK
        rows = _rows(args, options)
        outputs = output_files(args)
        named = [path for row in rows or () for path in row.files()]
        check_apart((outputs | page_file(args)).items(), [*named, args.manifest or "", *(args.merge or ())])
        for path in outputs.values():
            if path != STDOUT:
                check_writable(path)
        if args.report:
            from ..report.html.pictures import open_report_folder

            open_report_folder(args.report)
        if args.merge:
            return _merge(args, rows, out)
        return _score(args, rows or [], options, limits, argv, out)
    except SettingsError as error:
        parser.error(str(error))
    except FMQMError as error:
        print_stderr(f"{args.program}: {error}\n")
        return FAILED


def _limits(args: argparse.Namespace) -> Limits:
    """What a pair may take; strangers' files are watched where nothing else is said."""
    memory = args.memory_limit and args.memory_limit * 1e9
    if not args.untrusted:
        return Limits(args.timeout or Limits.timeout, memory)
    total = machine_memory()
    return Limits(args.timeout or _STRANGERS, memory or (total and 0.75 * total))


def _rows(args: argparse.Namespace, options: BatchOptions) -> list[Row] | None:
    """The pairs that the arguments name; None for none, which only a merge knows."""
    if args.manifest:
        rows = read_manifest(args.manifest, options.pair.settings)
    elif args.dataset:
        rows = _dataset_rows(args)
    elif args.lods:
        prepare_bpy()
        with defer_interrupts():
            rows = lod_rows(args.lods, options.reading.access, args.fail_under or ())
    elif args.reference:
        names = glob_files(args.reference, args.glob) if args.glob else args.distorted
        rows = plain_rows(args.reference, names, args.ref_texture or "", args.texture)
    else:
        return None
    if args.shard:
        first, count = shard_of(args.shard)
        rows = rows[first - 1 :: count]
    return rows


def _score(
    args: argparse.Namespace, rows: list[Row], options: BatchOptions, limits: Limits, argv: Sequence[str], out: TextIO
) -> int:
    """Scores what the journal has not, and writes what it has."""
    versions = provenance(blender_version())
    keys = [row_key(row, options, versions) for row in rows]
    path = journal_path(args)
    journal = Journal(path, args.resume, options.made_by(versions))
    if journal.damaged:
        print_stderr(f"{args.program}: {journal.damage()}\n")
    folder = os.path.dirname(path) if path else tempfile.gettempdir()
    kind = f"workers-{digest_of(os.path.basename(path))}" if path else TEMPORARY
    if path:  # what a run of this journal that was killed has left
        sweep(folder, kind, functools.partial(recover_scores, journal=journal) if args.resume else None)
    waiting = {
        key: Task(key, row)
        for key, row in zip(keys, rows, strict=True)
        if not journal.has_scores(key)
        or (args.report and not _has_pictures(args.report, journal.record(key), options.judge))
    }
    tasks = list(waiting.values())
    # A pair that ends its process, as some files do, shall be an error of its own.
    watched = args.jobs or args.timeout or args.memory_limit or args.untrusted
    use_workers = bool(watched or len(rows) > 1 or any(journal.was_begun(task.key) for task in tasks))
    last = None
    try:
        if args.dask:
            from ..batch.cluster import score_on_cluster

            log = Log(args.program, len(tasks), len(tasks), args.quiet)
            wait = args.wait_workers or WAIT
            score_on_cluster(tasks, args.dask, _WORKER_SCRIPT, argv, limits, journal, log, wait)
        elif use_workers:
            with own_folder(folder, kind) as place:
                log = Log(args.program, len(tasks), len(tasks), args.quiet)
                command = workers_command(_WORKER_SCRIPT, argv)
                score_with_workers(tasks, command, place, args.jobs or 1, limits, journal, log)
        elif tasks:
            prepare_bpy()
            last = score_tasks(tasks, options, journal, Log(args.program, units_of(tasks), len(tasks), args.quiet))
    except KeyboardInterrupt:
        if path:
            print_stderr(f"{args.program}: interrupted; --resume goes on where {path} ends\n")
        raise
    except OSError as error:
        raise FileError(f"{folder or os.curdir}: workers need a folder here ({error.strerror or error})") from error
    records = Records(rows, keys, journal, criteria_of(args))
    write_outputs(args, records, options.as_dict(), versions, last, out)
    code = exit_code(records)
    named = args.manifest or args.dataset or args.glob or args.lods
    batch = named or args.jobs or args.dask or args.journal or args.resume
    journal.close() if batch else journal.remove()
    return code


def _dataset_rows(args: argparse.Namespace) -> list[Row]:
    """The pairs of a data set; tells the names in its table that have no files."""
    name, folder = args.dataset
    found = read_dataset(folder, layout_of(name, args.layout))
    if found.missing:
        print_stderr(f"{len(found.missing)} of {len(found.rows) + len(found.missing)} names have no files here:\n")
        print_stderr("".join(f"  {one_line(each)}\n" for each in found.missing))
    return list(found.rows)


def _has_pictures(folder: str, record: Mapping[str, Any], judge: Judge) -> bool:
    from ..report.html.pictures import has_pictures

    return has_pictures(folder, record, judge)


def _merge(args: argparse.Namespace, rows: list[Row] | None, out: TextIO) -> int:
    merged = Merged(args.merge, rows, Log(args.program, 1, 1), criteria_of(args))
    write_outputs(args, merged, merged.settings, merged.versions, None, out)
    return exit_code(merged)


if __name__ == "__main__":
    run_script(main, __file__)
