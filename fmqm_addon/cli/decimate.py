# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the fewest triangles, or the smallest textures, with which an asset still looks like itself.

fmqm decimate REFERENCE --target-fmqm 0.9 -o out.glb
python scripts/decimate.py REFERENCE --judge perceived --target 0.95 -o out.glb
blender -b -q --python scripts/decimate.py -- REFERENCE --chain 0.95,0.9,0.8 -o lods.glb
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from ..apart import check_apart
from ..batch.interrupt import defer_interrupts
from ..batch.progress_log import Log
from ..batch.scorer import REMEDIES
from ..blender.access import Access
from ..blender.materials.types import Reading
from ..comparison.judge import Judge
from ..metric.errors import FMQMError, OutsideError, SettingsError, one_line
from ..metric.settings import PRESETS, Settings
from ..report.numbers import score_text
from .arguments import OneLineParser, add_access, add_judge, add_option, check_access, settings_of
from .process import FAILED, OK, prepare_bpy, run_script

PROGRAM = "decimate.py"

if TYPE_CHECKING:
    from ..comparison.decimation import DecimationResult, SearchResult, Step, TargetResult


def build_parser(program: str) -> OneLineParser:
    parser = OneLineParser(
        prog=program,
        description="The fewest triangles (Decimate, collapse) or the smallest textures whose score is at or above a "
        "target, found by bisection.",
        epilog="With -o the versions that decide are scored as they are read back from such a file. Exit codes: 0 "
        "found and written; 1 the target is missed even by the dearest version allowed, or a file cannot be read or "
        "written; 2 wrong arguments.",
        allow_abbrev=False,
    )
    parser.set_defaults(program=program)
    parser.add_argument("reference", metavar="REFERENCE", help="the original, as for score.py")
    parser.add_argument("--target", type=float, metavar="X", help="fewest triangles with at least the judge's score X")
    parser.add_argument("--target-fmqm", type=float, metavar="X", help="the same, with FMQM as the judge")
    parser.add_argument("--chain", type=_numbers, metavar="X,Y,...", help="the same for several targets, a file each")
    add_judge(parser, "whose scores --target, --chain and --target-texture are")
    parser.add_argument("--max-triangles", type=int, metavar="N", help="never more triangles than this")
    parser.add_argument(
        "--target-texture", type=float, metavar="X",
        help="smallest textures (powers of two) with which the result still has at least this score; after "
        "--target, of the decimated asset",
    )  # fmt: skip
    parser.add_argument("--preset", choices=PRESETS, default="paper", help="what decides; searching is always fast")
    for name in ("samples", "patches", "seed"):
        add_option(parser, Settings, name)
    parser.add_argument(
        "-o", "--output", metavar="FILE",
        help=".glb .obj .ply .stl .fbx .usd, plain meshes as they are measured, without skeletons, shape keys and "
        "animation; or .blend, which keeps these and the modifier live; of a chain NAME_LOD1 and so on",
    )  # fmt: skip
    add_access(parser)
    parser.add_argument("--json", metavar="FILE", help="targets, versions and paths; - is stdout")
    parser.add_argument("--quiet", action="store_true", help="no progress on stderr")
    return parser


def _numbers(text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text} is no list of numbers such as 0.95,0.9,0.8") from error


def main(argv: Sequence[str], out: TextIO, program: str = PROGRAM) -> int:
    """Searches as the arguments say, and prints to out; returns the exit code.

    Args:
        program: the name that it was called by; usage and messages begin with it.
    """
    parser = build_parser(program)
    parser.out = out
    args = parser.parse_args(argv)
    try:
        check_access(args)
        settings = settings_of(args)
        targets = _targets(args)
        log = Log(args.program, 1, 1, args.quiet)
        return _search(args, targets, settings, log, out)
    except SettingsError as error:
        parser.error(str(error))
    except FMQMError as error:
        log.say(f"{error}{REMEDIES.get(type(error), '') if isinstance(error, OutsideError) else ''}")
        return FAILED


def _targets(args: argparse.Namespace) -> list[float]:
    """Of the geometry; none where only the textures are to get smaller."""
    asked = {"--target": args.target, "--target-fmqm": args.target_fmqm, "--chain": args.chain or None}
    given = [flag for flag, value in asked.items() if value is not None]
    if len(given) > 1:
        raise SettingsError(f"{given[0]} and {given[1]} are both given; give one of them")
    if args.target_fmqm is not None and args.judge not in (None, Judge.FMQM):
        raise SettingsError(f"--target-fmqm is judged by FMQM; give --target for --judge {args.judge}")
    single = args.target if args.target_fmqm is None else args.target_fmqm
    targets = args.chain or ([] if single is None else [single])
    wanted = [*targets, *([] if args.target_texture is None else [args.target_texture])]
    if not wanted:
        raise SettingsError("nothing is asked for; give --target, --chain or --target-texture")
    for target in wanted:
        if not (math.isfinite(target) and 0 < target <= 1):
            raise SettingsError(f"the target is {target}; it must be above 0 and at most 1")
    if args.max_triangles is not None and not targets:
        raise SettingsError("--max-triangles needs --target or --chain")
    return targets


def _search(args: argparse.Namespace, targets: list[float], settings: Settings, log: Log, out: TextIO) -> int:
    """Searches, prints, writes; Blender is imported only once the arguments are known to be good."""
    prepare_bpy()
    from ..blender.files.export import (
        check_ending,
        file_reader,
        files_read,
        save_version,
        texture_sizes,
        written_reader,
    )
    from ..blender.scene.node_queries import surface_query
    from ..comparison.decimation import DecimationGoal, decimating
    from ..report.atomic_files import STDOUT, check_writable, print_parts, write_text

    judge = args.judge or Judge.FMQM
    outputs = _output_names(args.output, targets if args.chain else [])
    for path in outputs:
        check_ending(path)
    files = [*(("-o", path) for path in outputs), *([("--json", args.json)] if args.json else [])]
    for _, path in files:
        if path != STDOUT:
            check_writable(path)
    reading = Reading(access=Access(args.untrusted, args.asset_root or ""))
    if files:
        named = [Path(path).with_suffix(".mtl") for path in outputs if path.lower().endswith(".obj")]
        beside = [("-o (its materials)", str(path)) for path in named]
        check_apart([*files, *beside], files_read(args.reference, reading))
    with defer_interrupts():
        sizes = () if args.target_texture is None else tuple(texture_sizes(args.reference, reading))
    goal = DecimationGoal(tuple(targets), args.max_triangles, args.target_texture, sizes, judge)
    written = written_reader(args.reference, outputs[0], reading) if outputs else None
    stepper = decimating(file_reader(args.reference, reading), surface_query, goal, settings, written)
    more = True
    while more:
        with defer_interrupts():
            more = stepper.step()
        log.show(stepper.progress.done, stepper.progress.stage)
    log.end()

    result = stepper.result
    errors, warnings = [], list(result.warnings)
    saved: list[str | None] = [None] * len(result.results)
    for number, outcome in enumerate(result.results):
        if not outcome.last.reached:
            errors.append(f"{args.reference}: {_missed(outcome, judge, args.max_triangles, args.output)}")
        elif outputs:
            try:
                with defer_interrupts():
                    warnings += save_version(args.reference, outcome.last.best.version, outputs[number], reading)
                saved[number] = outputs[number]
            except FMQMError as error:
                errors.append(str(error))
    document = _json_text(args.reference, judge, settings, result, saved)
    if args.json and args.json != STDOUT:
        write_text(args.json, document)
    print_parts(out, [document if args.json == STDOUT else _table(result, saved)])
    for line in (*(f"warning: {warning}" for warning in warnings), *errors):
        log.say(line)
    return FAILED if errors else OK


def _output_names(output: str | None, chain: list[float]) -> list[str]:
    """One, or for a chain NAME_LOD1 and so on."""
    if output is None or not chain:
        return [] if output is None else [output]
    path = Path(output)
    return [str(path.with_name(f"{path.stem}_LOD{number + 1}{path.suffix}")) for number in range(len(chain))]


def _missed(outcome: TargetResult, judge: Judge, max_triangles: int | None, output: str | None) -> str:
    best, target = outcome.last.best, outcome.last.target
    score = best.score(judge)
    reached = "nothing that could be measured" if score is None else f"{judge.column} {score_text(score)}"
    kind, remedy = "", "ask for less"
    if max_triangles is not None and outcome.texture is None:
        remedy += ", or allow more"
    if output is not None:
        kind = f" as {Path(output).suffix.lower()}"
        remedy += ", or choose another kind of file, if this one does not hold its materials"
    allowed = "all triangles" if max_triangles is None else f"the {max_triangles} triangles that are allowed"
    if outcome.texture is not None:
        allowed = "the textures as they are"
    return f"the target {target:g} is missed even with {allowed}{kind} ({reached}); {remedy}"


def _table(result: DecimationResult, saved: Sequence[str | None]) -> str:
    """The path of every search, then what was found and where it was written."""
    rows = []
    for outcome, path in zip(result.results, saved, strict=True):
        for found in (outcome.geometry, outcome.texture):
            if found is None:
                continue
            rows += [(f"{found.target:g}", *_cells(step), "fast" if step.quick else "") for step in found.path]
            verdict = "found" if found.reached else "missed"
            if path is not None and found is outcome.last:
                verdict += f", written to {path}"
            rows.append((f"{found.target:g}", *_cells(found.best), verdict))
    rows.insert(0, ("target", "ratio", "triangles", "texture", "FMQM", "perceived", ""))
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return "".join(
        "  ".join(cell.rjust(width) for cell, width in zip(row[:-1], widths, strict=False))
        + f"  {one_line(row[-1])}".rstrip()
        + "\n"
        for row in rows
    )


def _cells(step: Step) -> tuple[str, ...]:
    texture = "-" if step.version.texture is None else str(step.version.texture)
    scores = (score_text(score) for score in (step.fmqm, step.perceived))
    return f"{step.version.ratio:.4f}", str(step.triangles), texture, *scores


def _json_text(
    reference: str, judge: Judge, settings: Settings, result: DecimationResult, saved: Sequence[str | None]
) -> str:
    document = {
        "reference": reference,
        "triangles": result.triangles,
        "judge": judge,
        "settings": settings.as_dict(),
        "warnings": list(result.warnings),
        "notes": list(result.notes),
        "found": [
            {"geometry": _found_dict(outcome.geometry), "texture": _found_dict(outcome.texture), "file": path}
            for outcome, path in zip(result.results, saved, strict=True)
        ],
    }
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def _found_dict(found: SearchResult | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "target": found.target,
        "reached": found.reached,
        "best": _step_dict(found.best),
        "below": None if found.below is None else _step_dict(found.below),
        "path": [_step_dict(step) for step in found.path],
    }


def _step_dict(step: Step) -> dict[str, Any]:
    scores = {"FMQM": step.fmqm, "perceived": step.perceived}
    return {**asdict(step.version), "triangles": step.triangles, **scores, "fast": step.quick}


if __name__ == "__main__":
    run_script(main, __file__)
