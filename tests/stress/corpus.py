# SPDX-License-Identifier: GPL-3.0-or-later
"""Scores hostile files against themselves, each in a process of its own under limits, and counts what went wrong.

    python -m tests.stress.corpus [FILE or FOLDER ...]

Without arguments: what tests/blender/files/hostile_files.py makes, and the real files beside the checkout, where there
are any. A file is well if its score is 1 in every column, or if it is refused in one line that names it.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from fmqm_addon.blender.files.asset_path import SUFFIXES
from tests.blender.files.hostile_files import all_files
from tests.blender.script import COLUMNS, SCORE

ROOT = Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared" / "data"
MEMORY = 8 * 2**30  # bytes of address space of a process
SECONDS = 90  # of processors, many more than a file takes
WAIT = 1800.0  # seconds: machines are busy
FLAGS = ("--samples", "320", "--patches", "5", "--color-units", "10", "--quiet", "--json", "-")


def write_made(folder: Path) -> list[Path]:
    """The files that the tests make."""
    paths = []
    for name, (content, _) in all_files().items():
        (folder / name).write_bytes(content)
        paths.append(folder / name)
    return sorted(paths)


def real_files(folders: Iterable[Path] = (SHARED / "hostile", SHARED / "cases" / "security")) -> list[Path]:
    """The assets in folders; none where they are missing."""
    return sorted(p for each in folders for p in each.rglob("*") if p.suffix.lower() in SUFFIXES and p.is_file())


def judge(path: Path) -> tuple[str, str]:
    """What became of a file: "identity", "refused", or a kind of trouble; and the words for it."""
    command = [sys.executable, str(SCORE), str(path), str(path), *FLAGS]
    began = time.monotonic()
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=WAIT, check=False, preexec_fn=_limit, stdin=subprocess.DEVNULL
        )
    except subprocess.TimeoutExpired:
        return "hang", f"not done within {WAIT:g} s"
    if done.returncode == -signal.SIGXCPU:
        return "hang", f"not done within {SECONDS} s of processors"
    took = f"{time.monotonic() - began:.1f} s"
    said, out = (each.decode(errors="replace") for each in (done.stderr, done.stdout))
    if "Traceback (most recent call last)" in said + out:
        return "traceback", said.strip().splitlines()[-1]
    errors = [line for line in said.splitlines() if line.startswith("score.py: ") and " warning: " not in line]
    if done.returncode == 0:
        return _judge_scores(out, took)
    if done.returncode != 1:
        return "crash", f"exit code {done.returncode}: {said[-200:]!r}"
    # A name in which lines break is written on one.
    if len(errors) != 1 or path.name.split("\n")[0] not in errors[0]:
        return "unclear", f"not one line that names the file: {errors}"
    return "refused", f"{took}: {errors[0]}"


def _judge_scores(out: str, took: str) -> tuple[str, str]:
    try:
        (pair,) = json.loads(out, parse_constant=float)["pairs"]
    except (ValueError, KeyError) as error:
        return "unclear", f"no JSON of one pair on stdout ({error})"
    numbers = {name: pair[name] for name in COLUMNS}
    wrong = {name: number for name, number in numbers.items() if number != 1.0}
    return ("number", f"not 1: {wrong}") if wrong else ("identity", took)


def _limit() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def run(paths: Iterable[Path], jobs: int = 2) -> tuple[Counter[str], list[str]]:
    """How many files became what, and a line for each that went wrong."""
    paths = list(paths)
    counts: Counter[str] = Counter()
    wrong = []
    with ThreadPoolExecutor(jobs) as pool:
        for path, (kind, words) in zip(paths, pool.map(judge, paths), strict=True):
            counts[kind] += 1
            if kind not in ("identity", "refused"):
                wrong.append(f"{kind}: {path}: {words}")
                print(wrong[-1], file=sys.stderr, flush=True)
    return counts, wrong


def main(arguments: list[str]) -> int:
    with tempfile.TemporaryDirectory() as folder:
        named = [Path(each) for each in arguments]
        paths = [each for each in named if each.is_file()] + real_files(each for each in named if each.is_dir())
        counts, wrong = run(paths if arguments else [*write_made(Path(folder)), *real_files()], os.cpu_count() or 1)
    print(f"{counts.total()} files: {', '.join(f'{count} {kind}' for kind, count in sorted(counts.items()))}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
