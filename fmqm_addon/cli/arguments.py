# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands' parsers share: errors of one line, the flags of settings and of what files may name."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from typing import Any, NoReturn, TextIO

from ..comparison.judge import Judge
from ..metric.errors import SettingsError
from ..metric.settings import PRESETS, SETTING_NAMES, Settings, info_of
from .process import WRONG_ARGUMENTS


class OneLineParser(argparse.ArgumentParser):
    """Says what is wrong in one line, without the whole usage before it; prints its help to the script's own stdout."""

    out: TextIO | None = None

    def print_help(self, file: Any = None) -> None:
        super().print_help(file or self.out)

    def error(self, message: str) -> NoReturn:
        self.exit(WRONG_ARGUMENTS, f"{self.prog}: error: {message} (--help lists all arguments)\n")


def add_option(parser: argparse._ActionsContainer, owner: type, name: str) -> None:
    """The flag of one option, with the text, the limits and the default that its dataclass has for it."""
    info, default = info_of(owner, name), getattr(owner, name)
    flag = flag_of(name)
    if info.kind is bool:
        parser.add_argument(flag, action="store_true", help=info.text)
        return
    notes = [] if info.choices else [info.wanted]
    notes.append(f"default: {'all' if default is None else default}")
    text = f"{info.text} ({'; '.join(notes)})"
    if info.choices:
        parser.add_argument(flag, choices=info.choices, help=text)
    else:
        parser.add_argument(flag, type=info.kind, metavar="N" if info.kind is int else "X", help=text)


def settings_of(args: argparse.Namespace) -> Settings:
    """The settings of the flags that are given, over those of the preset.

    Raises:
        SettingsError: a value is out of its range.
    """
    given = {name: value for name in SETTING_NAMES if (value := getattr(args, name, None)) is not None}
    return Settings(**(PRESETS[args.preset] | given))


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


def add_judge(parser: argparse._ActionsContainer, decides: str) -> None:
    """The flag of which reading decides.

    Args:
        decides: about what.
    """
    parser.add_argument(
        "--judge", type=Judge, choices=list(Judge), metavar="{" + ",".join(Judge) + "}",
        help=f"which reading decides: {decides} (default: {Judge.FMQM})",
    )  # fmt: skip


def flag_of(name: str | Sequence[str]) -> str:
    name = name if isinstance(name, str) else "".join(name[:1])
    return f"--{name.replace('_', '-')}" if name else ""
