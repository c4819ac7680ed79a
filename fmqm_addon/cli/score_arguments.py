# SPDX-License-Identifier: GPL-3.0-or-later
"""The arguments of `fmqm score`: their parser, what they may be, and the files that they name."""

from __future__ import annotations

import argparse
import hashlib
import os
from dataclasses import fields

from ..batch.datasets import LAYOUTS
from ..batch.rows import BatchOptions
from ..batch.workers import Limits
from ..blender.access import Access
from ..blender.materials.image_headers import DEFAULT_LIMITS, ImageLimits
from ..blender.materials.types import Reading
from ..comparison.judge import Judge
from ..comparison.pair import PairOptions
from ..metric.errors import SettingsError
from ..metric.settings import PRESETS, SETTING_NAMES, Settings
from ..report.atomic_files import STDOUT
from ..report.criteria import Criteria
from .arguments import OneLineParser, add_access, add_judge, add_option, check_access, flag_of, settings_of

PAIR_NAMES = tuple(each.name for each in fields(PairOptions) if each.name != "settings")
WAIT = 30.0  # seconds for a first worker of a cluster
_LONGEST_NAME = 255  # bytes, where file systems are common


def build_parser(program: str) -> OneLineParser:
    parser = OneLineParser(
        prog=program,
        description="FMQM: how much textured meshes look like their reference; 1 is the same.",
        epilog="Files: .obj .ply .stl .glb .gltf .fbx .usd .usda .usdc .usdz .abc .blend, and file.glb:Object name. "
        "Exit codes: 0 all scored, and at or above --fail-under; 1 a pair failed or fell below it, or a file cannot be "
        "read or written; 2 wrong arguments.",
        allow_abbrev=False,
    )
    parser.set_defaults(program=program)
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
    batch.add_argument(
        "--dataset", nargs=2, metavar=("NAME", "DIR"),
        help=f"score a data set of the paper that lies in DIR: {', '.join(LAYOUTS)}; evaluate.py judges the scores",
    )  # fmt: skip
    batch.add_argument("--layout", metavar="FILE", help="a JSON object that changes how --dataset is laid out")
    batch.add_argument("--glob", metavar="PATTERN", help="score the files that match against REFERENCE")
    batch.add_argument(
        "--lods", metavar="FILE", help="score each level of the file's LOD chains against level 0 and the level before"
    )
    batch.add_argument(
        "--jobs", type=int, metavar="N", help="score in N watched processes (default: 1 for more than one pair)"
    )
    batch.add_argument(
        "--timeout",
        type=float,
        metavar="SECONDS",
        help=f"a worker may take so long for a pair (default: {Limits.timeout:g})",
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
    for name in SETTING_NAMES:
        add_option(settings, Settings, name)
    for name in PAIR_NAMES:
        add_option(settings, PairOptions, name)

    reading = parser.add_argument_group("reading")
    reading.add_argument(
        "--bake", type=int, metavar="N",
        help=f"side of baked images (default: {Reading.bake}), and a missing base-color image counts as Blender shows "
        "it, magenta; 0: nothing is baked, plain colors are taken",
    )  # fmt: skip
    reading.add_argument(
        "--max-image-side", type=int, metavar="N", help=f"largest side of an image (default: {DEFAULT_LIMITS.side})"
    )
    reading.add_argument(
        "--max-image-bytes",
        type=int,
        metavar="N",
        help=f"largest size of a decoded image (default: {DEFAULT_LIMITS.decoded})",
    )

    reading.add_argument(
        "--frame", type=int, metavar="N",
        help="measure each file at frame N of its first clip (default: .blend files as saved, others without a clip)",
    )  # fmt: skip
    for flag, what in (("include", "measure only"), ("exclude", "leave out")):
        reading.add_argument(
            f"--{flag}", metavar="PATTERN", action="append", default=[],
            help=f"{what} objects with such names (*_body), or in empties or collections with them; may be repeated",
        )  # fmt: skip
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
    output.add_argument("--explain", action="store_true", help="a paragraph a pair: what got worse, where, how surely")
    output.add_argument(
        "--screen-size", action="store_true",
        help="at which size on screen, in pixels of the box's diagonal, each may be shown in place of its reference",
    )  # fmt: skip
    add_judge(output, "about --fail-under, a manifest's fail_under, heat maps and worst places")
    output.add_argument(
        "--fail-under", type=_thresholds, metavar="X", help="exit code 1 if a score is below X; for --lods also "
        "X1,X2,...: of the first level below the finest, of the next; the last of all that follow",
    )  # fmt: skip
    output.add_argument(
        "--fail-under-p10", type=float, metavar="X",
        help="exit code 1 if the 10th percentile over a pair's patches is below X: its worst places",
    )  # fmt: skip
    output.add_argument(
        "--parts", action="store_true", help="each object, material and connected part: its scores, and which are gone"
    )
    output.add_argument(
        "--verbose", action="store_true", help="how far to trust each score: the facts, in a table; and notes"
    )
    output.add_argument("--quiet", action="store_true", help="no progress on stderr")
    return parser


def options_of(args: argparse.Namespace) -> BatchOptions:
    """How the pairs are scored, as the arguments have it.

    Raises:
        SettingsError: a value is out of its range.
    """
    given = {name: value for name in PAIR_NAMES if (value := getattr(args, name)) is not None}
    reading = Reading(
        bake=Reading.bake if args.bake is None else args.bake,
        stand_in=bool(args.bake),
        limits=ImageLimits(args.max_image_side or DEFAULT_LIMITS.side, args.max_image_bytes or DEFAULT_LIMITS.decoded),
        access=Access(args.untrusted, args.asset_root or ""),
        normals=args.screen_size or bool(args.report),
        include=tuple(args.include),
        exclude=tuple(args.exclude),
        frame=args.frame,
    )
    pair = PairOptions(settings=settings_of(args), **given)
    judge = args.judge or Judge.FMQM
    extra = {"explain": args.explain, "screen_size": args.screen_size, "report": args.report or ""}
    return BatchOptions(pair=pair, reading=reading, judge=judge, **extra)


def _thresholds(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text} is no number, nor numbers with commas between") from error


def check_arguments(args: argparse.Namespace) -> None:
    for flag in ("max_image_side", "max_image_bytes"):
        limit = getattr(args, flag)
        if limit is not None and limit < 1:
            raise SettingsError(f"{flag.replace('_', '-')} is {limit}; it must be at least 1")
    limits = [("fail-under", limit) for limit in args.fail_under or ()]
    for flag, least in (*limits, ("fail-under-p10", args.fail_under_p10)):
        if least is not None and not 0 <= least <= 1:
            raise SettingsError(f"{flag} is {least}; it must be between 0 and 1")
    if len(limits) > 1 and not args.lods:
        raise SettingsError("--fail-under takes several numbers for the levels of --lods; give one")
    for flag, ending in (("save_fields", ".npz"), ("picture", ".png")):
        path = getattr(args, flag)
        if path and not path.lower().endswith(ending):
            raise SettingsError(f"{flag_of(flag)} {path}: the file must end in {ending}")
    for flag in ("journal", "report"):
        if getattr(args, flag) == STDOUT:
            raise SettingsError(f"{flag_of(flag)} -: only --json, --csv and --junit can go to stdout; name a path")
    check_access(args)
    if args.dask and args.asset_root and not os.path.isabs(args.asset_root):
        raise SettingsError(f"--asset-root {args.asset_root}: with --dask name the folder from its root on")
    _check_sources(args)
    for flag, least in (("jobs", 1), ("timeout", 0), ("memory_limit", 0), ("wait_workers", 0)):
        value = getattr(args, flag)
        if value is not None and not (value >= 1 if least else 0 < value < float("inf")):
            raise SettingsError(f"{flag_of(flag)} is {value}; it must be {'at least 1' if least else 'above 0'}")
    if args.wait_workers is not None and not args.dask:
        raise SettingsError("--wait-workers is for a cluster; give --dask too")
    if args.csv_raw and not args.csv:
        raise SettingsError("--csv-raw is how --csv writes; give that too")
    if args.dask and args.report and not os.path.isabs(args.report):
        raise SettingsError(f"--report {args.report}: with --dask name a folder that all hosts share, from its root on")
    if args.jobs and args.dask:
        raise SettingsError("--jobs and --dask exclude each other; a cluster has workers of its own")
    if args.resume and not journal_path(args):
        raise SettingsError("--resume needs --journal, or an output file beside which the journal is")
    if args.shard:
        shard_of(args.shard)
    scoring = ("jobs", "dask", "resume", "shard", "save_fields", "picture", "both", "attribution", "screen_size")
    ignored = [flag for flag in scoring if args.merge and getattr(args, flag)]
    if ignored:
        raise SettingsError(f"--merge scores nothing; leave out {flag_of(ignored)}")
    for flag in ("save_fields", "picture"):
        if not getattr(args, flag):
            continue
        if len(args.distorted) != 1:
            raise SettingsError(f"{flag_of(flag)} takes exactly one DISTORTED; {len(args.distorted)} are given")
        if args.jobs or args.dask or args.resume or args.shard or args.timeout or args.memory_limit or args.untrusted:
            raise SettingsError(f"{flag_of(flag)} is of a pair that this process scores; leave out the batch's flags")


def criteria_of(args: argparse.Namespace) -> Criteria:
    """What all pairs must reach that have no threshold of their own."""
    return Criteria(args.judge, args.fail_under[-1] if args.fail_under else None, args.fail_under_p10)


def _check_sources(args: argparse.Namespace) -> None:
    """One way of naming pairs."""
    given = [flag for flag in ("manifest", "glob", "lods", "dataset") if getattr(args, flag)]
    if args.layout and not args.dataset:
        raise SettingsError("--layout is for --dataset; give both")
    if len(given) > 1 or (given and args.distorted):
        raise SettingsError(f"{flag_of(given[0])} names pairs already; leave out {flag_of(given[1:]) or 'DISTORTED'}")
    if args.reference and given not in ([], ["glob"]):
        raise SettingsError(f"{flag_of(given[0])} names references itself; leave out {args.reference}")
    if given in (["manifest"], ["lods"], ["dataset"]) and (args.texture or args.ref_texture):
        raise SettingsError(f"--texture and --ref-texture do not go with {flag_of(given[0])}; name them in a manifest")
    if not args.merge and not args.worker and given in ([], ["glob"]):
        missing = "REFERENCE" if not args.reference else "" if given or args.distorted else "DISTORTED"
        if missing:
            raise SettingsError(f"{missing} is missing")


def shard_of(text: str) -> tuple[int, int]:
    first, _, count = text.partition("/")
    if not (first.isdecimal() and count.isdecimal() and 1 <= int(first) <= int(count)):
        raise SettingsError(f"--shard is {text}; it must be such as 2/5: every 5th pair, from the 2nd on")
    return int(first), int(count)


def output_files(args: argparse.Namespace) -> dict[str, str]:
    """Files that are written, by flag, the report aside."""
    named = {flag_of(name): getattr(args, name) for name in ("json", "csv", "junit", "save_fields", "picture")}
    journal = None if args.merge else journal_path(args)
    return {flag: path for flag, path in (named | {"--journal": journal}).items() if path}


def page_file(args: argparse.Namespace) -> dict[str, str]:
    if not args.report:
        return {}
    from ..report.html.page import PAGE

    return {"--report": os.path.join(args.report, PAGE)}


def journal_path(args: argparse.Namespace) -> str | None:
    """Beside the first output file, unless it is named; None where there is neither."""
    if args.journal:
        return str(args.journal)
    first = next((path for path in (args.json, args.csv, args.junit) if path and path != STDOUT), None)
    if first is None:
        return None
    folder, name = os.path.split(first)
    ending = ".journal.jsonl"
    if len(os.fsencode(name + ending)) > _LONGEST_NAME:
        name = f"{name[:40]}-{digest_of(name)}"
    return os.path.join(folder, name + ending)


def digest_of(name: str) -> str:
    return hashlib.blake2b(os.fsencode(name), digest_size=4).hexdigest()
