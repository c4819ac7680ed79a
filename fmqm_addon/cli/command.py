# SPDX-License-Identifier: GPL-3.0-or-later
"""The command `fmqm`, which runs one of the others by its name: `fmqm score`, `fmqm decimate`, `fmqm screen-size`."""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from typing import NoReturn, TextIO

from .arguments import OneLineParser
from .process import run_script

PROGRAM = "fmqm"
COMMANDS = {  # modules of this folder, - as _, each with a main
    "score": "score textured meshes against a reference",
    "decimate": "find the fewest triangles, or the smallest textures, that still look like the original",
    "screen-size": "find at which size on screen LODs may replace their reference",
}


def main() -> NoReturn:
    """Ends the process with the exit code of the command that its first argument names."""
    run_script(run, PROGRAM, sys.argv[1:])


def run(argv: Sequence[str], out: TextIO) -> int:
    """Runs the command that the first argument names with the others; returns its exit code."""
    parser = OneLineParser(
        prog=PROGRAM,
        description="FMQM: how much textured meshes look like their reference; 1 is the same.",
        usage="%(prog)s COMMAND ...",
        epilog="commands:\n"
        + "".join(f"  {name:13}{text}\n" for name, text in COMMANDS.items())
        + f"\n{PROGRAM} COMMAND --help lists the arguments of a command.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.out = out
    parser.add_argument("command", metavar="COMMAND", choices=COMMANDS, help="one of those below")
    command = parser.parse_args(argv[:1]).command
    return int(
        importlib.import_module(f".{command.replace('-', '_')}", __package__).main(
            argv[1:], out, f"{PROGRAM} {command}"
        )
    )
