# SPDX-License-Identifier: GPL-3.0-or-later
"""Score textured meshes against a reference.

fmqm score REFERENCE DISTORTED [DISTORTED ...]
fmqm score --manifest FILE | REFERENCE --glob PATTERN | --lods FILE
python scripts/score.py REFERENCE DISTORTED [DISTORTED ...]
blender -b -q --python scripts/score.py -- REFERENCE DISTORTED [DISTORTED ...]
"""

from __future__ import annotations

import argparse
import functools
import hashlib
import os
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

from ..batch.cluster import WAIT, score_on_cluster
from ..batch.interrupt import stops_wait
from ..batch.journal import Journal, Records, row_key
from ..batch.manifest import glob_files, lod_rows, plain_rows, read_manifest
from ..batch.merge import Merged
from ..batch.progress_log import Log, tell
from ..batch.rows import Options, Row, Task
from ..batch.scorer import score_tasks, units_of, work_off
from ..batch.workers import Limits, adopt, score_with_workers, workers_command
from ..blender.access import Access
from ..blender.materials.types import MAX_BAKE
from ..comparison.alignment import SPACES
from ..folders import TEMPORARY, own_folder, sweep
from ..metric.errors import FileError, FMQMError, SettingsError
from ..metric.settings import CENTERS, COLOR_SPACES, POOLINGS, PRESETS, SETTING_NAMES, Settings
from ..provenance import provenance
from ..report.atomic_files import STDOUT, check_apart, check_writable, print_parts, write_parts
from ..report.explain import explain
from ..report.html.page import PAGE, write_page
from ..report.html.pictures import has_pictures, open_report_folder
from ..report.junit import junit_parts
from ..report.records import below, csv_parts, json_parts, shortfall, table_parts, trust_parts
from .process import (
    FAILED,
    OK,
    WORKER,
    WRONG_ARGUMENTS,
    blender_version,
    machine_memory,
    prepare_bpy,
    run_script,
)

if TYPE_CHECKING:
    from ..comparison.pair import PairResult

PROGRAM = "score.py"
_STRANGERS = 600.0  # seconds that a pair of strangers' files may take
_WORKER_SCRIPT = "cli/worker.py"  # from the package's folder
_LONGEST_NAME = 255  # bytes, where file systems are common


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one line, without the whole usage before it; prints its help to the script's own stdout."""

    out: TextIO | None = None

    def print_help(self, file: Any = None) -> None:
        super().print_help(file or self.out)

    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_ARGUMENTS, f"{self.prog}: error: {message} (--help lists all arguments)\n")


def build_parser() -> OneLineParser:
    parser = OneLineParser(
        prog=PROGRAM,
        description="FMQM: how much textured meshes look like their reference; 1 is the same.",
        epilog="Files: .obj .ply .stl .glb .gltf .fbx .usd .usda .usdc .usdz .abc .blend, and file.glb:Object name. "
        "Exit codes: 0 all scored, and at or above --fail-under; 1 a pair failed or fell below it, or a file cannot be "
        "read or written; 2 wrong arguments.",
        allow_abbrev=False,
    )
    parser.add_argument("reference", metavar="REFERENCE", nargs="?", help="the original")
    parser.add_argument("distorted", metavar="DISTORTED", nargs="*", help="what is scored against it")
    parser.add_argument("--ref-texture", metavar="IMG", help="replaces the base-color image of the whole reference")
    parser.add_argument(
        "--texture", metavar="IMG", action="append", default=[],
        help="replaces that of the distorted: once for all, or once per DISTORTED",
    )  # fmt: skip

    batch = parser.add_argument_group("batches")
    batch.add_argument(
        "--manifest", metavar="FILE",
        help="pairs from a .csv with a header, or a .json list of objects: reference, distorted, and if wanted id, "
        "ref_texture, texture, fail_under and any setting",
    )  # fmt: skip
    batch.add_argument("--glob", metavar="PATTERN", help="score the files that match against REFERENCE")
    batch.add_argument(
        "--lods", metavar="FILE", help="score each level of the file's LOD chains against level 0 and the level before"
    )
    batch.add_argument(
        "--jobs", type=int, metavar="N", help="score in N watched processes (default: 1 for more than one pair)"
    )
    batch.add_argument(
        "--timeout", type=float, metavar="SECONDS", help="a worker may take so long for a pair (default: 3600)"
    )
    batch.add_argument("--memory-limit", type=float, metavar="GB", help="a worker may take so much memory")
    batch.add_argument(
        "--journal", metavar="FILE", help="what is done, line by line (default: the first output with .journal.jsonl)"
    )
    batch.add_argument("--resume", action="store_true", help="score only what the journal has not")
    batch.add_argument("--shard", metavar="I/N", help="score only every Nth pair, from the Ith on")
    batch.add_argument("--merge", metavar="FILE", nargs="+", help="score nothing: join the JSON outputs of shards")
    batch.add_argument("--dask", metavar="ADDRESS", help="score on the Dask cluster of this scheduler")
    batch.add_argument(
        "--wait-workers", type=float, metavar="SECONDS", help=f"for a first worker of the cluster (default: {WAIT:g})"
    )
    batch.add_argument("--worker", metavar="SHARD", help=argparse.SUPPRESS)  # score a shard for the process above

    settings = parser.add_argument_group("settings (the paper's values are the defaults)")
    settings.add_argument("--preset", choices=PRESETS, default="paper", help="explicit flags win over it")
    number = Settings()
    for name, kind, text in (
        ("samples", int, "target number of samples"),
        ("patches", int, "number of patches"),
        ("scored-patches", int, "score only the first K patches (default: all; preset fast: 40)"),
        ("sigma", float, "deviation of the samples from the surface, in patch diagonals"),
        ("radius", float, "radius of the color units, in patch diagonals"),
        ("gradient-radius", float, "radius of the color gradient, in patch diagonals; inf: the whole patch"),
        ("normal-threshold", float, "|cos| above it is along the normal"),
        ("tangent-threshold", float, "|cos| below it is in the tangent plane"),
        ("color-units", int, "color units drawn per patch"),
        ("seed", int, "of all random draws"),
    ):
        default = getattr(number, name.replace("-", "_"))
        suffix = "" if default is None else f" (default: {default})"
        settings.add_argument(f"--{name}", type=kind, metavar="N" if kind is int else "X", help=text + suffix)
    settings.add_argument("--centers", choices=CENTERS, help="choice of patch centers (default: fps)")
    settings.add_argument("--color-space", choices=COLOR_SPACES, help="of the color features (default: rgb)")
    settings.add_argument("--pooling", choices=POOLINGS, help="mean of the four features (default: geometric)")
    settings.add_argument(
        "--repeats", type=int, default=1, metavar="R", help="seeds seed .. seed+R-1; columns become means, with stderr"
    )
    settings.add_argument(
        "--space", choices=SPACES, default="auto",
        help="where the two are compared: as they stand in their worlds, in their local spaces, or (default: auto) "
        "in the world unless another place fits far better",
    )  # fmt: skip
    settings.add_argument(
        "--match-scale", action="store_true", help="undo a difference in size by a factor between units (100, 2.54)"
    )

    settings.add_argument(
        "--both", action="store_true", help="score the other direction too, which sees what only the distorted has"
    )

    reading = parser.add_argument_group("reading")
    reading.add_argument(
        "--bake", type=int, metavar="N",
        help="side of baked images (default: 1024), and a missing base-color image counts as Blender shows it, "
        "magenta; 0: nothing is baked, plain colors are taken",
    )  # fmt: skip
    reading.add_argument("--max-image-side", type=int, metavar="N", help="largest side of an image (default: 32768)")
    reading.add_argument(
        "--max-image-bytes", type=int, metavar="N", help="largest size of a decoded image (default: 1 GiB)"
    )

    add_access(reading)

    output = parser.add_argument_group("output")
    output.add_argument(
        "--json", metavar="FILE", help="everything as JSON; - is stdout, which then carries nothing else"
    )
    output.add_argument("--csv", metavar="FILE", help="one row a pair; - is stdout, as above")
    output.add_argument("--junit", metavar="FILE", help="one test case a pair, for build servers; - as above")
    output.add_argument(
        "--csv-raw",
        action="store_true",
        help="names in the CSV as they are, though a spreadsheet take one for a formula",
    )
    output.add_argument("--report", metavar="DIR", help="a web page with pictures: DIR/index.html")
    output.add_argument("--save-fields", metavar="FILE.npz", help="samples, fields and patch scores of the one pair")
    output.add_argument("--picture", metavar="FILE.png", help="reference, distorted and heat map of the one pair")
    output.add_argument(
        "--attribution", action="store_true", help="in JSON: geometry's and the texture's part of the loss"
    )
    output.add_argument("--explain", action="store_true", help="a paragraph a pair: what got worse, where, how surely")
    output.add_argument("--fail-under", type=float, metavar="X", help="exit code 1 if an FMQM is below X")
    output.add_argument("--verbose", action="store_true", help="how far to trust each score: the facts, in a table")
    output.add_argument("--quiet", action="store_true", help="no progress on stderr")
    return parser


def add_access(parser: argparse._ActionsContainer) -> None:
    """The flags of what files may name."""
    parser.add_argument(
        "--untrusted", action="store_true",
        help="files of strangers: they may name only what lies in their own folder and below; score.py scores each "
        "pair in a watched process, in 600 s and three quarters of the memory unless told otherwise",
    )  # fmt: skip
    parser.add_argument("--asset-root", metavar="DIR", help="a folder that they may name files in, too")


def check_access(args: argparse.Namespace) -> None:
    """Raises SettingsError where the flags of add_access do not fit."""
    if args.asset_root is None:
        return
    if not args.untrusted:
        raise SettingsError("--asset-root is for --untrusted; give both")
    if not os.path.isdir(args.asset_root):
        raise SettingsError(f"--asset-root {args.asset_root}: no such folder")


def _watched(args: argparse.Namespace) -> Limits:
    """What a pair may take; strangers' files are watched where nothing else is said."""
    memory = args.memory_limit and args.memory_limit * 1e9
    if not args.untrusted:
        return Limits(args.timeout or Limits.timeout, memory)
    total = machine_memory()
    return Limits(args.timeout or _STRANGERS, memory or (total and 0.75 * total))


def main(argv: Sequence[str], out: TextIO) -> int:
    """Scores as the arguments say, and prints to out; returns the exit code."""
    parser = build_parser()
    parser.out = out
    args = parser.parse_intermixed_args(argv)
    try:
        chosen = PRESETS[args.preset] | {
            name: getattr(args, name) for name in SETTING_NAMES if getattr(args, name) is not None
        }
        options = Options(
            Settings(**chosen),
            args.repeats,
            args.space,
            args.match_scale,
            args.attribution,
            args.explain,
            args.report or "",
            args.both,
            args.bake,
            args.max_image_side,
            args.max_image_bytes,
            args.untrusted,
            args.asset_root or "",
        )
        limits = _watched(args)
        _check_arguments(args)
        options.settings.with_seed(options.settings.seed + args.repeats - 1)
        if WORKER in os.environ and not args.worker:
            raise FMQMError("a worker without a shard; this is a fault of the program")
        if args.worker:
            prepare_bpy()
            work_off(args.worker, options, provenance(blender_version()), limits.timeout)
            return OK
        rows = _rows(args, options)
        outputs = _outputs(args)
        named = [path for row in rows or () for path in row.files()]
        check_apart(outputs | _page(args), [*named, args.manifest or "", *(args.merge or ())])
        for path in outputs.values():
            if path and path != STDOUT:
                check_writable(path)
        if args.report:
            open_report_folder(args.report)
        if args.merge:
            return _merge(args, rows, out)
        return _score(args, rows or [], options, limits, argv, out)
    except SettingsError as error:
        parser.error(str(error))
    except FMQMError as error:
        tell(f"{PROGRAM}: {error}\n")
        return FAILED


def _check_arguments(args: argparse.Namespace) -> None:
    if args.repeats < 1:
        raise SettingsError(f"repeats is {args.repeats}; it must be at least 1")
    if args.bake is not None and not 0 <= args.bake <= MAX_BAKE:
        raise SettingsError(f"bake is {args.bake}; it must be between 0 and {MAX_BAKE}")
    for flag in ("max_image_side", "max_image_bytes"):
        limit = getattr(args, flag)
        if limit is not None and limit < 1:
            raise SettingsError(f"{flag.replace('_', '-')} is {limit}; it must be at least 1")
    if args.fail_under is not None and not 0 <= args.fail_under <= 1:
        raise SettingsError(f"fail-under is {args.fail_under}; it must be between 0 and 1")
    for flag, ending in (("save_fields", ".npz"), ("picture", ".png")):
        path = getattr(args, flag)
        if path and not path.lower().endswith(ending):
            raise SettingsError(f"{_flag(flag)} {path}: the file must end in {ending}")
    for flag in ("journal", "report"):
        if getattr(args, flag) == STDOUT:
            raise SettingsError(f"{_flag(flag)} -: only --json, --csv and --junit can go to stdout; name a path")
    check_access(args)
    if args.dask and args.asset_root and not os.path.isabs(args.asset_root):
        raise SettingsError(f"--asset-root {args.asset_root}: with --dask name the folder from its root on")
    _check_sources(args)
    for flag, least in (("jobs", 1), ("timeout", 0), ("memory_limit", 0), ("wait_workers", 0)):
        value = getattr(args, flag)
        if value is not None and not (value >= 1 if least else 0 < value < float("inf")):
            raise SettingsError(f"{_flag(flag)} is {value}; it must be {'at least 1' if least else 'above 0'}")
    if args.wait_workers is not None and not args.dask:
        raise SettingsError("--wait-workers is for a cluster; give --dask too")
    if args.csv_raw and not args.csv:
        raise SettingsError("--csv-raw is how --csv writes; give that too")
    if args.dask and args.report and not os.path.isabs(args.report):
        raise SettingsError(f"--report {args.report}: with --dask name a folder that all hosts share, from its root on")
    if args.jobs and args.dask:
        raise SettingsError("--jobs and --dask exclude each other; a cluster has workers of its own")
    if args.resume and not _journal_path(args):
        raise SettingsError("--resume needs --journal, or an output file beside which the journal is")
    if args.shard:
        _shard(args.shard)
    scoring = ("jobs", "dask", "resume", "shard", "save_fields", "picture", "both", "attribution")
    ignored = [flag for flag in scoring if args.merge and getattr(args, flag)]
    if ignored:
        raise SettingsError(f"--merge scores nothing; leave out {_flag(ignored)}")
    for flag in ("save_fields", "picture"):
        if not getattr(args, flag):
            continue
        if len(args.distorted) != 1:
            raise SettingsError(f"{_flag(flag)} takes exactly one DISTORTED; {len(args.distorted)} are given")
        if args.jobs or args.dask or args.resume or args.shard or args.timeout or args.memory_limit or args.untrusted:
            raise SettingsError(f"{_flag(flag)} is of a pair that this process scores; leave out the batch's flags")


def _check_sources(args: argparse.Namespace) -> None:
    """One way of naming pairs."""
    given = [flag for flag in ("manifest", "glob", "lods") if getattr(args, flag)]
    if len(given) > 1 or (given and args.distorted):
        raise SettingsError(f"{_flag(given[0])} names pairs already; leave out {_flag(given[1:]) or 'DISTORTED'}")
    if args.reference and given not in ([], ["glob"]):
        raise SettingsError(f"{_flag(given[0])} names references itself; leave out {args.reference}")
    if given in (["manifest"], ["lods"]) and (args.texture or args.ref_texture):
        raise SettingsError(f"--texture and --ref-texture do not go with {_flag(given[0])}; name them in a manifest")
    if not args.merge and not args.worker and given in ([], ["glob"]):
        missing = "REFERENCE" if not args.reference else "" if given or args.distorted else "DISTORTED"
        if missing:
            raise SettingsError(f"{missing} is missing")


def _flag(name: str | Sequence[str]) -> str:
    name = name if isinstance(name, str) else "".join(name[:1])
    return f"--{name.replace('_', '-')}" if name else ""


def _shard(text: str) -> tuple[int, int]:
    first, _, count = text.partition("/")
    if not (first.isdecimal() and count.isdecimal() and 1 <= int(first) <= int(count)):
        raise SettingsError(f"--shard is {text}; it must be such as 2/5: every 5th pair, from the 2nd on")
    return int(first), int(count)


def _rows(args: argparse.Namespace, options: Options) -> list[Row] | None:
    """The pairs that the arguments name; None for none, which only a merge knows."""
    if args.manifest:
        rows = read_manifest(args.manifest, options.settings)
    elif args.lods:
        prepare_bpy()
        with stops_wait():
            rows = lod_rows(args.lods, Access(options.untrusted, options.asset_root))
    elif args.reference:
        names = glob_files(args.reference, args.glob) if args.glob else args.distorted
        rows = plain_rows(args.reference, names, args.ref_texture or "", args.texture)
    else:
        return None
    if args.shard:
        first, count = _shard(args.shard)
        rows = rows[first - 1 :: count]
    return rows


def _outputs(args: argparse.Namespace) -> dict[str, str | None]:
    """Files that are written, by flag, the report aside."""
    names = ("json", "csv", "junit", "save_fields", "picture")
    journal = None if args.merge else _journal_path(args)
    return {_flag(name): getattr(args, name) for name in names} | {"--journal": journal}


def _page(args: argparse.Namespace) -> dict[str, str | None]:
    return {"--report": args.report and os.path.join(args.report, PAGE)}


def _journal_path(args: argparse.Namespace) -> str | None:
    """Beside the first output file, unless it is named; None where there is neither."""
    if args.journal:
        return str(args.journal)
    first = next((path for path in (args.json, args.csv, args.junit) if path and path != STDOUT), None)
    if first is None:
        return None
    folder, name = os.path.split(first)
    ending = ".journal.jsonl"
    if len(os.fsencode(name + ending)) > _LONGEST_NAME:
        name = f"{name[:40]}-{_digest(name)}"
    return os.path.join(folder, name + ending)


def _digest(name: str) -> str:
    return hashlib.blake2b(os.fsencode(name), digest_size=4).hexdigest()


def _merge(args: argparse.Namespace, rows: list[Row] | None, out: TextIO) -> int:
    merged = Merged(args.merge, rows, Log(PROGRAM, 1, 1), args.fail_under)
    _write(args, merged, merged.settings, merged.versions, None, out)
    return _exit_code(merged)


def _score(
    args: argparse.Namespace, rows: list[Row], options: Options, limits: Limits, argv: Sequence[str], out: TextIO
) -> int:
    """Scores what the journal has not, and writes what it has."""
    versions = provenance(blender_version())
    keys = [row_key(row, options, versions) for row in rows]
    path = _journal_path(args)
    journal = Journal(path, args.resume, options.made_by(versions))
    if journal.damaged:
        tell(f"{PROGRAM}: {journal.damage()}\n")
    folder = os.path.dirname(path) if path else tempfile.gettempdir()
    kind = f"workers-{_digest(os.path.basename(path))}" if path else TEMPORARY
    if path:  # what a run of this journal that was killed has left
        sweep(folder, kind, functools.partial(adopt, journal=journal) if args.resume else None)
    waiting = {
        key: Task(key, row)
        for key, row in zip(keys, rows, strict=True)
        if not journal.has_scores(key) or not has_pictures(args.report, journal.record(key))
    }
    tasks = list(waiting.values())
    # A pair that ends its process, as some files do, shall be an error of its own.
    asked = args.jobs or args.timeout or args.memory_limit or args.untrusted
    use_workers = bool(asked or len(rows) > 1 or any(journal.was_begun(task.key) for task in tasks))
    last = None
    try:
        if args.dask:
            log = Log(PROGRAM, len(tasks), len(tasks), args.quiet)
            score_on_cluster(tasks, args.dask, _WORKER_SCRIPT, argv, limits, journal, log, args.wait_workers or WAIT)
        elif use_workers:
            with own_folder(folder, kind) as place:
                log = Log(PROGRAM, len(tasks), len(tasks), args.quiet)
                command = workers_command(_WORKER_SCRIPT, argv)
                score_with_workers(tasks, command, place, args.jobs or 1, limits, journal, log)
        elif tasks:
            prepare_bpy()
            last = score_tasks(tasks, options, journal, Log(PROGRAM, units_of(tasks), len(tasks), args.quiet))
    except KeyboardInterrupt:
        if path:
            tell(f"{PROGRAM}: interrupted; --resume goes on where {path} ends\n")
        raise
    except OSError as error:
        raise FileError(f"{folder or os.curdir}: workers need a folder here ({error.strerror or error})") from error
    records = Records(rows, keys, journal, args.fail_under)
    _write(args, records, options.as_dict(), versions, last, out)
    code = _exit_code(records)
    batch = args.manifest or args.glob or args.lods or args.jobs or args.dask or args.journal or args.resume
    journal.close() if batch else journal.remove()
    return code


def _write(
    args: argparse.Namespace,
    records: Iterable[Mapping[str, Any]],
    settings: Mapping[str, Any],
    versions: Mapping[str, str],
    last: PairResult | None,
    out: TextIO,
) -> None:
    """What is to be known before the scores are believed, then the files, and in any case what is printed."""
    _say_remarks(records)
    head = dict(versions) | ({"shard": _shard(args.shard)} if args.shard else {})
    texts = [
        (args.json, json_parts(records, settings, head)),
        (args.csv, csv_parts(records, args.csv_raw)),
        (args.junit, junit_parts(records)),
    ]
    try:
        check_apart(_outputs(args) | _page(args), _images(records))
        for path, parts in texts:
            if path and path != STDOUT:
                write_parts(path, parts)
        if args.report:
            write_page(args.report, records, settings, versions)
        if last is not None:
            _write_last(args, last)
    finally:
        alone = next((parts for path, parts in texts if path == STDOUT), None)
        print_parts(out, _table_parts(args, records) if alone is None else alone)


def _write_last(args: argparse.Namespace, last: PairResult) -> None:
    from ..report.npz import save_fields
    from ..report.sheet import write_picture

    result = last.comparison.result
    if args.save_fields:
        save_fields(args.save_fields, result)
    if args.picture:
        write_picture(args.picture, last.reference, last.comparison.distorted, result)


def _table_parts(args: argparse.Namespace, records: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    yield from table_parts(records)
    if args.verbose:
        yield from trust_parts(records)
    if args.explain:
        for record in records:
            # A pair without scores of its own process, such as a lost one, comes without an explanation.
            yield f"\n{record.get('explanation') or explain(record)}\n"


def _images(records: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """Paths of the images that the colors came from."""
    for trust in (record["trust"] for record in records):
        for name in ("reference", "distorted") if trust else ():
            yield from (image["path"] for image in trust[name]["images"]["value"] or ())


def _say_remarks(records: Iterable[Mapping[str, Any]]) -> None:
    """Each warning once, with the pair where it came first; each pair that is below its threshold."""
    pairs = 0
    times: Counter[int] = Counter()
    for record in records:
        pairs += 1
        times.update({hash(warning) for warning in record["warnings"]})
    log = Log(PROGRAM, pairs, pairs)
    for record in records:
        for warning in record["warnings"]:
            if others := times.pop(hash(warning), 0):
                name = record["id"] if others == 1 else f"{record['id']} and {others - 1} more"
                log.say(warning, name, "warning: ")
        if below(record):
            log.say(f"{record['id']}: {shortfall(record)}")


def _exit_code(records: Iterable[Mapping[str, Any]]) -> int:
    return FAILED if any(record["error"] is not None or below(record) for record in records) else OK


if __name__ == "__main__":
    run_script(main, __file__)
