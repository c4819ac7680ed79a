# SPDX-License-Identifier: GPL-3.0-or-later
"""Which code makes the numbers here: the version, and a digest of the files that decide scores."""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

from .version import VERSION

PARTS = ("metric", "comparison", "blender")  # folders of the package whose code decides scores


@functools.cache
def code_digest(package: Path = Path(__file__).parent) -> str:
    """A digest of all code that decides scores: 16 hexadecimal digits, the same on every system.

    Args:
        package: its folder.
    """
    digest = hashlib.blake2b(digest_size=8)
    paths = {path.relative_to(package).as_posix(): path for part in PARTS for path in (package / part).rglob("*.py")}
    for name in sorted(paths):
        text = paths[name].read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{name} {len(text)}\n".encode() + text)
    return digest.hexdigest()


def provenance(blender_version: str) -> dict[str, str]:
    """What made a number, under the names that JSON outputs have for it."""
    return {"fmqm_version": VERSION, "fmqm_code": code_digest(), "blender_version": blender_version}
