# SPDX-License-Identifier: GPL-3.0-or-later
"""Find at which size on screen LODs may replace their reference.

fmqm screen-size REFERENCE LOD1 LOD2 --engine unity
python -m fmqm_addon screen-size REFERENCE LOD1 LOD2 --json sizes.json
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

from ..apart import check_apart
from ..batch.interrupt import defer_interrupts
from ..batch.progress_log import Log
from ..batch.scorer import REMEDIES
from ..blender.access import Access
from ..blender.materials.types import Reading
from ..comparison.alignment import align
from ..comparison.pair import PairOptions
from ..metric.errors import FMQMError, SettingsError
from ..metric.stepper import Stepper
from ..report.atomic_files import STDOUT, check_writable, print_parts, write_text
from ..screen_size.definition import VIEW_CHOICES, VIEWS
from ..screen_size.engines import ENGINES, SCREEN_NAMES, Extent, Screen, chain, numbers, pasteable
from ..screen_size.measure import ScreenSize, ScreenSizes
from ..screen_size.records import definition_record, size_record, table
from .arguments import OneLineParser, add_access, add_option, check_access
from .process import FAILED, OK, blender_version, prepare_bpy, run_script

PROGRAM = "screen-size"
_TRANSITIONS = ("strict", "fade")
T = TypeVar("T")

if TYPE_CHECKING:
    from ..comparison.candidates import AssetMesh


def build_parser(program: str) -> OneLineParser:
    parser = OneLineParser(
        prog=program,
        description="The largest size on screen, in pixels of the reference's box diagonal, at which renders of an LOD "
        "look like those of its reference. Base color and smooth shading; docs/screen-size.md says what that does not "
        "tell.",
        epilog="Exit codes: 0 all measured; 1 a file cannot be read, measured or written; 2 wrong arguments.",
        allow_abbrev=False,
    )
    parser.set_defaults(program=program)
    parser.add_argument("reference", metavar="REFERENCE", help="the original, LOD0; a path, or file.glb:Object name")
    parser.add_argument("lods", metavar="LOD", nargs="+", help="its LODs, from fine to coarse")
    parser.add_argument(
        "--views", type=int, choices=VIEW_CHOICES, default=VIEWS, help=f"sides that are rendered (default: {VIEWS})"
    )
    for name in ("space", "match_scale"):
        add_option(parser, PairOptions, name)
    parser.add_argument(
        "--bake", type=int, metavar="N", default=Reading.bake,
        help=f"side of baked images (default: {Reading.bake}); 0: nothing is baked, plain colors are taken",
    )  # fmt: skip
    engine = parser.add_argument_group("engines")
    engine.add_argument("--engine", choices=ENGINES, help="print the numbers that it takes, for all LODs as one chain")
    engine.add_argument(
        "--transition", choices=_TRANSITIONS, default="strict",
        help="strict: LODs replace each other at once; fade: dithered, which allows larger sizes (default: strict)",
    )  # fmt: skip
    for name in SCREEN_NAMES:
        add_option(engine, Screen, name)
    add_access(parser)
    parser.add_argument("--json", metavar="FILE", help="everything as JSON; - is stdout")
    parser.add_argument("--quiet", action="store_true", help="no progress on stderr")
    return parser


def main(argv: Sequence[str], out: TextIO, program: str = PROGRAM) -> int:
    """Measures as the arguments say, and prints to out; returns the exit code.

    Args:
        program: the name that it was called by; usage and messages begin with it.
    """
    parser = build_parser(program)
    parser.out = out
    args = parser.parse_args(argv)
    log = Log(args.program, len(args.lods), 1, args.quiet)
    try:
        check_access(args)
        given = {name: value for name in SCREEN_NAMES if (value := getattr(args, name)) is not None}
        screen = Screen(**given)
        reading = Reading(bake=args.bake, access=Access(args.untrusted, args.asset_root or ""), normals=True)
        if args.json and args.json != STDOUT:
            check_apart([("--json", args.json)], [args.reference, *args.lods])
            check_writable(args.json)
        return _measure(args, screen, reading, log, out)
    except SettingsError as error:
        parser.error(str(error))
    except FMQMError as error:
        log.say(f"{error}{REMEDIES.get(type(error), '')}")
        return FAILED


def _measure(args: argparse.Namespace, screen: Screen, reading: Reading, log: Log, out: TextIO) -> int:
    """Measures, prints, writes; Blender is imported only once the arguments are known to be good."""
    prepare_bpy()
    from ..blender.scene.bvh import BVHQuery

    reference = _load(args.reference, reading)
    sizes = ScreenSizes(reference.world(), args.views, BVHQuery)
    _run(sizes.prepare(), log, 0, args.reference)
    for warning in reference.mesh.warnings:
        log.say(warning, kind="warning: ")
    found: list[ScreenSize | None] = []
    levels: list[dict[str, Any]] = []
    for index, path in enumerate(args.lods):
        triangles, size, error, seconds = None, None, None, 0.0
        notes: tuple[str, ...] = ()
        warnings: tuple[str, ...] = ()
        try:
            asset = _load(path, reading)
            triangles = len(asset.mesh.triangles)
            alignment = align(reference, asset, args.space or PairOptions.space, args.match_scale, sizes.reference)
            notes = (*asset.mesh.notes, *alignment.notes)
            warnings = (*asset.mesh.warnings, *alignment.warnings)
            stepper = sizes.measure(alignment.mesh)
            size = _run(stepper, log, index, path)
            seconds = sum(stepper.seconds.values())
            notes = (*notes, *(f"{path}: {note}" for note in size.notes))
        except FMQMError as reason:
            error = f"{reason}{REMEDIES.get(type(reason), '')}"
            log.say(error if path in error else f"{path}: {error}")
        for note in notes:
            log.say(note, kind="note: ")
        for warning in warnings:
            log.say(warning, kind="warning: ")
        found.append(size)
        record = None if size is None else size_record(size)
        levels.append(
            {
                "file": path,
                "triangles": triangles,
                "screen_size": record,
                "seconds": seconds,
                "warnings": list(warnings),
            }
            | {"notes": list(notes), "error": error}
        )
    log.end()
    switches = [None if size is None else getattr(size, args.transition) for size in found]
    placed = chain(args.lods, switches)
    document: dict[str, Any] = {
        "reference": args.reference,
        "triangles": len(reference.mesh.triangles),
        "warnings": list(reference.mesh.warnings),
        "blender": blender_version(),
        "definition": definition_record(args.views),
        "levels": levels,
        "useless": [{"level": level.number, "file": level.name, "why": level.why} for level in placed if level.why],
    }
    rows = [(each["file"], each["triangles"], size) for each, size in zip(levels, found, strict=True)]
    text = table(rows) + "".join(
        f"LOD {each.number} ({each.name}): no place; {each.why}\n" for each in placed if each.why
    )
    if args.engine:
        values = numbers(args.engine, placed, Extent.of(sizes.reference), screen)
        paste = pasteable(args.engine, values)
        document["engine"] = {
            "name": args.engine,
            "transition": args.transition,
            "screen": asdict(screen),
            "levels": values,
            "text": paste,
        }
        text += f"\n{paste}\n"
    json_text = json.dumps(document, indent=2, allow_nan=False) + "\n"
    if args.json and args.json != STDOUT:
        write_text(args.json, json_text)
    print_parts(out, [json_text if args.json == STDOUT else text])
    return FAILED if any(each["error"] for each in levels) else OK


def _load(path: str, reading: Reading) -> AssetMesh:
    from ..blender.files.load import load_asset

    with defer_interrupts():
        return load_asset(path, reading)


def _run(stepper: Stepper[T], log: Log, done: int, name: str) -> T:
    more = True
    while more:
        with defer_interrupts():
            more = stepper.step()
        log.show(done + stepper.progress.done, f"{stepper.progress.stage} {name}")
    return stepper.result


if __name__ == "__main__":
    run_script(main, __file__)
