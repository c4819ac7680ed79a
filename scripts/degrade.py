# SPDX-License-Identifier: GPL-3.0-or-later
"""Distorted versions of a model: eight kinds in levels and five mixed ones, with a manifest that score.py reads.

python scripts/degrade.py MODEL -o DIR [--seed N] [--only GN,TMC]
blender -b -q --python scripts/degrade.py -- MODEL -o DIR
python scripts/score.py --manifest DIR/manifest.csv --csv scores.csv
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fmqm_addon.batch.progress_log import print_stderr
from fmqm_addon.cli.arguments import OneLineParser
from fmqm_addon.cli.process import FAILED, OK, prepare_bpy, run_script
from fmqm_addon.evidence.degrade import MANIFEST, degrade
from fmqm_addon.evidence.distortions import DISTORTIONS, KINDS, MEANING
from fmqm_addon.metric.errors import FMQMError


def main(argv: Sequence[str], out: TextIO) -> int:
    kinds = "; ".join(f"{kind}: {meaning}" for kind, meaning in MEANING.items())
    text = f"Distorted versions of a model, as .glb files with a manifest. {kinds}."
    parser = OneLineParser(prog="degrade.py", description=text, allow_abbrev=False)
    parser.out = out
    parser.add_argument("model", metavar="MODEL", help="any file that score.py reads, or file.blend:Name")
    parser.add_argument("-o", "--output", metavar="DIR", type=Path, required=True, help="where the files go")
    parser.add_argument("--seed", metavar="N", type=_seed, default=0, help="of the noise (default: 0)")
    parser.add_argument("--only", metavar="KIND,...", type=_kinds, default=KINDS, help="only these kinds")
    args = parser.parse_args(argv)
    wanted = [each for each in DISTORTIONS if each.kind in args.only]
    try:
        prepare_bpy()
        rows = degrade(args.model, args.output, args.seed, wanted, lambda text: print_stderr(f"degrade.py: {text}\n"))
    except FMQMError as error:
        print_stderr(f"degrade.py: {error}\n")
        return FAILED
    out.write(f"{args.output / MANIFEST}: {len(rows)} distorted models\n")
    return OK


def _seed(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text} is no whole number of at least 0")
    return int(text)


def _kinds(text: str) -> list[str]:
    kinds = text.split(",")
    for kind in kinds:
        if kind not in KINDS:
            raise argparse.ArgumentTypeError(f"{kind} is none of {', '.join(KINDS)}")
    return kinds


if __name__ == "__main__":
    run_script(main, __file__)
