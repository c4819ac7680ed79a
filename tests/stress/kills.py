# SPDX-License-Identifier: GPL-3.0-or-later
"""Kills runs at random, damages their journals, resumes them, and compares the outputs with an undisturbed run's.

    python -m tests.stress.kills [ROUNDS [SEED]]

A round: one to three runs with --jobs 2 --resume that are killed (the run or one of its workers, by a signal of
several), after each of which the journal may be damaged; then one that is let go to its end. Its JSON and CSV must be
those of the undisturbed run, byte by byte, `seconds` aside.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fmqm_addon.batch.journal import parse_line
from tests.blender.script import SCORE, noise, read_json, without_seconds, write_png, write_torus

PAIRS = 8
FLAGS = ("--samples", "320", "--patches", "5", "--color-units", "10", "--quiet")
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
SECONDS = 600.0  # for a run to end: machines are busy
DAMAGES = ("none", "flip", "flip a digit", "flip a digit", "cut the end", "cut a piece", "insert")


def write_assets(folder: Path) -> list[str]:
    """A reference, and tori that are shaken more and more; the arguments that score them."""
    write_png(folder / "a.png", noise(seed=1))
    paths = [str(write_torus(folder, f"t{number}", "a.png", shake=0.004 * number)) for number in range(PAIRS + 1)]
    return [*paths, *FLAGS]


def outputs(folder: Path) -> list[str]:
    return ["--json", str(folder / "out.json"), "--csv", str(folder / "out.csv"), "--journal", str(folder / "journal")]


def written(folder: Path) -> tuple[object, bytes]:
    return without_seconds(read_json(folder / "out.json")), (folder / "out.csv").read_bytes()


def run_through(arguments: list[str], folder: Path) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, str(SCORE), *arguments, *outputs(folder), "--jobs", "2", "--resume"]
    return subprocess.run(command, capture_output=True, timeout=SECONDS, check=False, stdin=subprocess.DEVNULL)


def kill_one(arguments: list[str], folder: Path, chance: random.Random) -> str:
    """Starts a run and kills it, or one of its workers, once the journal has grown by so many lines, or after a while.

    The run that loses a worker goes on, and is killed a little later. Says what was done.
    """
    command = [sys.executable, str(SCORE), *arguments, *outputs(folder), "--jobs", "2", "--resume"]
    began, lines, patience = _lines(folder), chance.randrange(2 * PAIRS), chance.uniform(0, 20)
    parent = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL)
    end = time.monotonic() + patience
    while parent.poll() is None and time.monotonic() < end and _lines(folder) - began < lines:
        time.sleep(0.02)
    told = f"at {_lines(folder) - began} lines"
    workers = _children(parent.pid)
    if workers and chance.random() < 0.4:
        with contextlib.suppress(ProcessLookupError):  # it may just have ended
            os.kill(chance.choice(workers), signal.SIGKILL)
        told += ", a worker"
        time.sleep(chance.uniform(0, 2))
    how = chance.choice(SIGNALS)
    parent.send_signal(how)
    try:
        parent.wait(SECONDS)
    except subprocess.TimeoutExpired:
        parent.kill()
        parent.wait()
        raise AssertionError(f"a run does not end within {SECONDS:g} s of {how.name}") from None
    return f"{told}, {how.name}"


def _lines(folder: Path) -> int:
    journal = folder / "journal"
    return journal.read_bytes().count(b"\n") if journal.exists() else 0


def _children(pid: int) -> list[int]:
    """Processes that a process of ours has started."""
    try:
        return [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="ascii").split()]
    except OSError:
        return []


def damage(journal: Path, how: str, chance: random.Random) -> None:
    """Changes a journal as a bad disk, an editor or a power cut would."""
    data = bytearray(journal.read_bytes()) if journal.exists() else bytearray()
    if not data:
        return
    at = chance.randrange(len(data))
    match how:
        case "flip":
            data[at] ^= 1 << chance.randrange(8)
        case "flip a digit":  # which leaves the line JSON: a score changes
            digits = [k for k, byte in enumerate(data) if byte in b"0123456789"]
            at = chance.choice(digits) if digits else at
            data[at] = chance.choice(b"0123456789")
        case "cut the end":
            del data[at:]
        case "cut a piece":
            del data[at : at + chance.randrange(1, 400)]
        case "insert":
            data[at:at] = chance.randbytes(chance.randrange(1, 40))
    journal.write_bytes(data)


def disturbed_round(arguments: list[str], calm: tuple[object, bytes], folder: Path, chance: random.Random) -> str:
    """What was done in a round.

    Raises:
        AssertionError: a run hangs, ends in a traceback, or writes something else.
    """
    told = []
    for _ in range(chance.randrange(1, 4)):
        told.append(kill_one(arguments, folder, chance))
        how = chance.choice(DAMAGES)
        damage(folder / "journal", how, chance)
        told.append(how)
        _leave_what_is_no_journal(folder / "journal")
    done = run_through(arguments, folder)
    words = done.stderr.decode(errors="replace")
    assert "Traceback" not in words, f"{told}: {words}"
    assert done.returncode == 0, f"{told}: exit code {done.returncode}: {words}"
    assert written(folder) == calm, f"{told}: the outputs differ"
    return "; ".join(told)


def _leave_what_is_no_journal(journal: Path) -> None:
    """A file without one whole line is another program's for all the run knows, and refused: the user removes it."""
    if journal.exists() and not any(map(parse_line, journal.read_bytes().splitlines())):
        journal.unlink()


def run(rounds: int, seed: int) -> tuple[int, list[str]]:
    """Rounds done, and a line for each that failed."""
    failed = []
    with tempfile.TemporaryDirectory() as name:
        base = Path(name)
        arguments = write_assets(base)
        (base / "calm").mkdir()
        done = run_through(arguments, base / "calm")
        assert done.returncode == 0, done.stderr
        calm = written(base / "calm")
        for number in range(rounds):
            folder = base / f"round-{number}"
            folder.mkdir()
            try:
                told = disturbed_round(arguments, calm, folder, random.Random(f"{seed} {number}"))
                print(f"round {number}: {told}", flush=True)
            except (AssertionError, subprocess.TimeoutExpired) as error:
                failed.append(f"round {number} of seed {seed}: {error}")
                print(f"FAILED: {failed[-1]}", file=sys.stderr, flush=True)
    return rounds, failed


def main(arguments: list[str]) -> int:
    rounds = int(arguments[0]) if arguments else 50
    seed = int(arguments[1]) if len(arguments) > 1 else random.randrange(10**6)
    done, failed = run(rounds, seed)
    print(f"{done} rounds of seed {seed}: {len(failed)} failed")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
