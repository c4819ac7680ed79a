# SPDX-License-Identifier: GPL-3.0-or-later
"""How the numbers behave: distorts models, measures them, writes docs/evidence.md and its plots.

python scripts/evidence.py [--models DIR] [--work DIR] [--page FILE]
python scripts/evidence.py --smoke
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from fmqm_addon.batch.journal import Journal
from fmqm_addon.batch.progress_log import print_stderr
from fmqm_addon.batch.workers import end_with_parent
from fmqm_addon.cli.arguments import OneLineParser
from fmqm_addon.cli.process import FAILED, OK, blender_version, prepare_bpy, run_script
from fmqm_addon.evidence.degrade import MANIFEST
from fmqm_addon.evidence.models import GENERATED, REAL, Model, find_models, make_models
from fmqm_addon.evidence.study import FULL, SMOKE, measure, planned, read_study
from fmqm_addon.evidence.study_page import write_page
from fmqm_addon.metric.errors import FMQMError
from fmqm_addon.provenance import provenance

VARIABLE = "FMQM_MODELS"


def main(argv: Sequence[str], out: TextIO) -> int:
    parser = OneLineParser(prog="evidence.py", description=__doc__.partition("\n")[0], allow_abbrev=False)
    parser.out = out
    given = os.environ.get(VARIABLE)
    parser.add_argument(
        "--models", metavar="DIR", type=Path, default=Path(given) if given else None,
        help=f"where spot, egyptian_cat and bob are (default: what {VARIABLE} says); absent ones are told on the page",
    )  # fmt: skip
    parser.add_argument("--work", metavar="DIR", type=Path, help="for models and journals (default: out/evidence)")
    parser.add_argument("--page", metavar="FILE", type=Path, help="the page to bring up to date (docs/evidence.md)")
    parser.add_argument("--smoke", action="store_true", help="a small study of the generated models, page in --work")
    parser.add_argument("--now", action="store_true", help="measure nothing more; the page of what there is")
    parser.add_argument(
        "--jobs", metavar="N", type=_jobs, default=2,
        help="processes that measure (2); each goes on with its own journal, so that a study keeps to one number",
    )  # fmt: skip
    parser.add_argument("--part", type=int, help=argparse.SUPPRESS)
    args = parser.parse_args(argv)
    args.work = args.work or ROOT / "out" / ("evidence-smoke" if args.smoke else "evidence")
    try:
        return _run(args, out)
    except FMQMError as error:
        print_stderr(f"evidence.py: {error}\n")
        return FAILED


def _run(args: argparse.Namespace, out: TextIO) -> int:
    study = SMOKE if args.smoke else FULL
    versions = provenance(blender_version())
    if args.part is not None:
        end_with_parent()
        prepare_bpy()
        measure(study, _distorted(args.work, (*REAL, *GENERATED)), _journal(args, args.part, versions), args.part,
                args.jobs, versions)  # fmt: skip
        return OK
    models = find_models(None if args.smoke else args.models)
    models += make_models(args.work / "models", study.cells)[: 1 if args.smoke else None]
    if not args.now:
        _distort(args.work, models, study.kinds, out)
        options = ["--work", args.work, "--jobs", args.jobs, *(["--smoke"] if args.smoke else [])]
        processes = [_begin([__file__, *options, "--part", part]) for part in range(args.jobs)]
        if max([process.wait() for process in processes]):
            raise FMQMError("a process has failed; what is measured stays, and the same command goes on with it")
    folders = _distorted(args.work, [model.name for model in models if model.path])
    found = read_study(study, folders, [_journal(args, part, versions) for part in range(args.jobs)], versions)
    page = args.page or (args.work / "evidence.md" if args.smoke else ROOT / "docs" / "evidence.md")
    write_page(page, study, models, found, planned(study, folders, versions), versions)
    out.write(f"{page}: of {len(found)} measured pairs\n")
    return OK


def _distort(work: Path, models: Sequence[Model], kinds: Sequence[str], out: TextIO) -> None:
    """By degrade.py, what is not there yet; its manifest is written last."""
    only = ["--only", ",".join(kinds)] if kinds else []
    for model in models:
        if model.path and not _distorted(work, [model.name]):
            out.write(f"distorting {model.name}\n")
            out.flush()
            if _begin([ROOT / "scripts" / "degrade.py", model.path, "-o", work / model.name, *only]).wait():
                raise FMQMError(f"{model.path}: its distorted versions could not be made")


def _distorted(work: Path, names: Sequence[str]) -> list[Path]:
    return [work / name for name in names if (work / name / MANIFEST).is_file()]


def _journal(args: argparse.Namespace, part: int, versions: dict[str, str]) -> Journal:
    return Journal(str(args.work / f"journal{part}.jsonl"), True, versions)


def _begin(command: Sequence[object]) -> subprocess.Popen[bytes]:
    """A process of its own, which ends with this one."""
    return subprocess.Popen([sys.executable, *map(str, command)], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)


def _jobs(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is no whole number of at least 1")
    return int(text)


if __name__ == "__main__":
    run_script(main, __file__)
