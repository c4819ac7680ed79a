# SPDX-License-Identifier: GPL-3.0-or-later
"""Score textured meshes against a reference.

python scripts/score.py REFERENCE DISTORTED [DISTORTED ...]
blender -b -q --python scripts/score.py -- REFERENCE DISTORTED [DISTORTED ...]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO, TypeVar

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from fmqm_addon.blender.process import require_bpy, take_stdout
from fmqm_addon.blender.space import SPACES
from fmqm_addon.metric.errors import FMQMError, SettingsError, one_line
from fmqm_addon.metric.settings import CENTERS, COLOR_SPACES, POOLINGS, PRESETS, SETTING_NAMES, Settings

if TYPE_CHECKING:
    from fmqm_addon.blender.material import Reading
    from fmqm_addon.blender.measure import Comparison, Measurement
    from fmqm_addon.blender.space import Placed
    from fmqm_addon.metric.score import Stepper

MAX_BAKE = 16384  # pixels a side
OK, FAILED, WRONG_ARGUMENTS, INTERRUPTED = 0, 1, 2, 130
T = TypeVar("T")


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one line, without the whole usage before it; prints its help to the script's own stdout."""

    out: TextIO | None = None

    def print_help(self, file: Any = None) -> None:
        super().print_help(file or self.out)

    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_ARGUMENTS, f"{self.prog}: error: {message} (--help lists all arguments)\n")


def build_parser() -> OneLineParser:
    parser = OneLineParser(
        prog="score.py",
        description="FMQM: how much textured meshes look like their reference; 1 is the same.",
        epilog="Files: .obj .ply .stl .glb .gltf .fbx .usd .usda .usdc .usdz .abc .blend, and file.blend:Object name. "
        "Exit codes: 0 all scored, and at or above --fail-under; 1 a pair failed or fell below it, or a file cannot be "
        "read or written; 2 wrong arguments.",
        allow_abbrev=False,
    )
    parser.add_argument("reference", metavar="REFERENCE", help="the original")
    parser.add_argument("distorted", metavar="DISTORTED", nargs="+", help="what is scored against it")
    parser.add_argument("--ref-texture", metavar="IMG", help="replaces the base-color image of the whole reference")
    parser.add_argument(
        "--texture", metavar="IMG", action="append", default=[],
        help="replaces that of the distorted: once for all, or once per DISTORTED",
    )  # fmt: skip

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

    output = parser.add_argument_group("output")
    output.add_argument(
        "--json", metavar="FILE", help="everything as JSON; - is stdout, which then carries nothing else"
    )
    output.add_argument("--csv", metavar="FILE", help="one row a pair")
    output.add_argument("--save-fields", metavar="FILE.npz", help="samples, fields and patch scores of the one pair")
    output.add_argument("--picture", metavar="FILE.png", help="reference, distorted and heat map of the one pair")
    output.add_argument("--fail-under", type=float, metavar="X", help="exit code 1 if an FMQM is below X")
    output.add_argument("--verbose", action="store_true", help="how far to trust each score: the facts, in a table")
    output.add_argument("--quiet", action="store_true", help="no progress on stderr")
    return parser


def main(argv: Sequence[str], out: TextIO) -> int:
    """Scores as the arguments say, and prints to out; returns the exit code."""
    parser = build_parser()
    parser.out = out
    args = parser.parse_args(argv)
    try:
        chosen = PRESETS[args.preset] | {
            name: getattr(args, name) for name in SETTING_NAMES if getattr(args, name) is not None
        }
        settings = Settings(**chosen)
        _check_arguments(args)
        settings.with_seed(settings.seed + args.repeats - 1)
    except SettingsError as error:
        parser.error(str(error))
    try:
        return _score(args, settings, out)
    except FMQMError as error:
        print(f"score.py: {error}", file=sys.stderr)
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
    if len(args.texture) not in (0, 1, len(args.distorted)):
        raise SettingsError(
            f"--texture is given {len(args.texture)} times for {len(args.distorted)} files; "
            "give it once, or once per DISTORTED"
        )
    for flag in ("save_fields", "picture"):
        if getattr(args, flag) and len(args.distorted) != 1:
            raise SettingsError(
                f"--{flag.replace('_', '-')} takes exactly one DISTORTED; {len(args.distorted)} are given"
            )
    if args.save_fields and not args.save_fields.endswith(".npz"):
        raise SettingsError(f"--save-fields {args.save_fields}: the file must end in .npz")


def _score(args: argparse.Namespace, settings: Settings, out: TextIO) -> int:
    """Loads, scores and writes; Blender is imported only once the arguments are known to be good."""
    require_bpy()
    import bpy

    from fmqm_addon import VERSION
    from fmqm_addon.report.fields import save_fields
    from fmqm_addon.report.files import check_writable, write_text
    from fmqm_addon.report.pair import csv_text, json_text, table_text, trust_tables
    from fmqm_addon.report.picture import write_picture

    for path in (args.json, args.csv, args.save_fields, args.picture):
        if path and path != "-":
            check_writable(path)
    run = Run(args, settings)
    run.score()
    json_document = json_text(
        run.pairs,
        settings.as_dict() | {"repeats": args.repeats, "space": args.space, "match_scale": args.match_scale},
        {"fmqm_version": VERSION, "blender_version": bpy.app.version_string},
    )
    if args.json == "-":
        out.write(json_document)
    else:
        out.write(table_text(run.pairs))
        if args.verbose:
            out.write(trust_tables(run.pairs))
        if args.json:
            write_text(args.json, json_document)
    if args.csv:
        write_text(args.csv, csv_text(run.pairs))
    if run.last is not None:
        if args.save_fields:
            save_fields(args.save_fields, run.last.result)
        if args.picture:
            write_picture(args.picture, run.measurement.reference, run.last.distorted, run.last.result)
    out.flush()
    return run.exit_code


class Run:
    """The pairs of one command line: one reference, scored pair after pair."""

    def __init__(self, args: argparse.Namespace, settings: Settings) -> None:
        from fmqm_addon.report.pair import PairScore

        self.args = args
        self.settings = settings
        self.pairs: list[PairScore] = []
        self.last: Comparison | None = None  # the newest comparison, for its fields and picture
        self.measurement: Measurement
        self._progress = ProgressLine(len(args.distorted) + 1, args.quiet)

    @property
    def exit_code(self) -> int:
        limit = self.args.fail_under or 0.0
        scores = [pair.fmqm for pair in self.pairs]
        return OK if all(score is not None and score >= limit for score in scores) else FAILED

    def score(self) -> None:
        from fmqm_addon.blender.measure import Measurement
        from fmqm_addon.blender.space import place
        from fmqm_addon.blender.trust import known_facts
        from fmqm_addon.report.pair import PairScore
        from fmqm_addon.report.trust import trust_dict

        args = self.args
        began = time.perf_counter()
        seconds: dict[str, float] = {}
        error: FMQMError | None = None
        try:
            self._progress.show(0, f"loading {args.reference}")
            reference = _timed(seconds, lambda: self._load(args.reference, args.ref_texture))
            self._tell_memory(reference)
            self.measurement = Measurement(reference.world(), self.settings, args.repeats)
            self._work(self.measurement.prepare(), 0, 1, "preparing the reference", seconds)
        except FMQMError as reason:
            error = reason
        textures = args.texture * len(args.distorted) if len(args.texture) == 1 else args.texture
        for index, name in enumerate(args.distorted):
            pair = PairScore(args.reference, name)
            try:
                if error is not None:
                    raise error
                self._progress.show(index + 1, f"loading {name}")
                texture = textures[index] if textures else None
                loaded = _timed(seconds, lambda name=name, texture=texture: self._load(name, texture))  # type: ignore[misc]
                placement = place(reference, loaded, args.space, args.match_scale)
                comparing = self.measurement.compare(placement.mesh, known_facts(placement, self._reading(None)))
                share = 0.5 if args.both else 1
                compared = self._work(comparing, index + 1, share, f"scoring {name}", seconds)
                reverse = None
                if args.both:
                    turned = self.measurement.reverse(placement.mesh)
                    reverse = self._work(turned, index + 1 + share, share, f"scoring {name} as the reference", seconds)
                result = compared.result
                self.last = compared
                pair = replace(
                    pair,
                    scores=compared.scores,
                    stderr=compared.stderr,
                    patches=len(result.patches),
                    samples=len(result.samples.positions),
                    space=placement.label,
                    warnings=(*placement.notes, *placement.warnings, *compared.warnings),
                    reverse=reverse,
                    trust=trust_dict(compared.trust),
                )
            except FMQMError as reason:
                pair = replace(pair, error=str(reason))
                print(f"score.py: {reason}", file=sys.stderr)
            now = time.perf_counter()
            self.pairs.append(replace(pair, seconds={**seconds, "total": now - began}))
            began, seconds = now, {}
        self._progress.end()
        for warning in dict.fromkeys(warning for pair in self.pairs for warning in pair.warnings):
            print(f"score.py: warning: {warning}", file=sys.stderr)

    def _load(self, spec: str, image: str | None) -> Placed:
        from fmqm_addon.blender.files import load_placed

        return load_placed(spec, self._reading(image), self._progress.tell)

    def _reading(self, image: str | None) -> Reading:
        """How an asset is read whose texture, if not None, is the image."""
        from fmqm_addon.blender.headers import DEFAULT_LIMITS, Limits
        from fmqm_addon.blender.images import load_texture
        from fmqm_addon.blender.material import Reading

        args = self.args
        limits = Limits(
            args.max_image_side or DEFAULT_LIMITS.side,
            args.max_image_bytes or DEFAULT_LIMITS.decoded,
        )
        reading = Reading(texture=load_texture(image, limits) if image else None, limits=limits)
        return reading if args.bake is None else replace(reading, bake=args.bake, stand_in=args.bake > 0)

    def _tell_memory(self, reference: Placed) -> None:
        from fmqm_addon.blender.memory import WORTH_SAYING, peak_bytes, peak_text

        if not self.args.quiet and peak_bytes(reference.mesh, self.settings, self.args.repeats) > WORTH_SAYING:
            print(f"score.py: {peak_text(reference.mesh, self.settings, self.args.repeats)}", file=sys.stderr)

    def _work(self, stepper: Stepper[T], first: float, share: float, text: str, seconds: dict[str, float]) -> T:
        """Runs a stepper to its end with its progress shown and its seconds added up by stage."""
        while stepper.step():
            self._progress.show(first + share * stepper.progress.done, text)
        for stage, spent in stepper.seconds.items():
            seconds[stage] = seconds.get(stage, 0.0) + spent
        return stepper.result


def _timed(seconds: dict[str, float], load: Callable[[], Placed]) -> Placed:
    began = time.perf_counter()
    try:
        return load()
    finally:
        seconds["load"] = seconds.get("load", 0.0) + time.perf_counter() - began


class ProgressLine:
    """Progress on stderr: a moving line on a terminal, a line per 10 % otherwise."""

    def __init__(self, total: int, quiet: bool) -> None:
        self._total = total
        self._quiet = quiet
        self._moving = sys.stderr.isatty()
        self._percent = -1

    def show(self, done: float, text: str) -> None:
        percent = int(100 * done / self._total)
        step = 1 if self._moving else 10
        if self._quiet or percent // step <= self._percent // step:
            return
        self._percent = percent
        if self._moving:
            print(f"\r\x1b[K{percent:3d} %  {one_line(text)}", end="", file=sys.stderr, flush=True)
        else:
            print(f"{percent:3d} %  {one_line(text)}", file=sys.stderr, flush=True)

    def tell(self, text: str) -> None:
        """A line of its own, whatever the percentage."""
        if not self._quiet:
            self.end()
            print(f"      {one_line(text)}", file=sys.stderr, flush=True)

    def end(self) -> None:
        if self._moving and not self._quiet:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def run() -> None:
    """Arguments to exit code; under Blender, whose name argv[0] is then, the arguments follow --."""
    argv = sys.argv[1:]
    if Path(sys.argv[0]).name != Path(__file__).name:
        argv = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    try:
        code = main(argv, take_stdout())
    except KeyboardInterrupt:
        code = INTERRUPTED
    sys.exit(code)


if __name__ == "__main__":
    run()
