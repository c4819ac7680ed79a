# SPDX-License-Identifier: GPL-3.0-or-later
"""Asks one Python what it has of what scoring needs: the text of this file goes to the workers of a cluster.

Only the standard library at the top, and nothing of this package, which need not be there.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from typing import Any


def found_here(cwd: str, files: list[str]) -> dict[str, Any]:
    """What is there.

    Args:
        cwd: what relative files are relative to.

    Returns:
        "sizes" of the files in bytes, None for one that is missing; "fmqm_version", "fmqm_code", "blender_version", or
        "no_fmqm", "no_bpy": why not.
    """
    found: dict[str, Any] = {"sizes": [_size(os.path.join(cwd, path)) for path in files]}
    try:
        found["fmqm_version"] = importlib.import_module("fmqm_addon").VERSION
        found["fmqm_code"] = importlib.import_module("fmqm_addon.provenance").code_digest()
    except Exception as error:  # a stranger's environment may hold anything
        if "fmqm_version" not in found:
            found["no_fmqm"] = f"{type(error).__name__}: {error}"
    try:
        found["blender_version"] = ".".join(map(str, importlib.import_module("bpy").app.version))
    except Exception as error:
        found["no_bpy"] = f"{type(error).__name__}: {error}"
    return found


def _size(path: str) -> int | None:
    try:
        return os.stat(path).st_size
    except (OSError, ValueError):
        return None


if __name__ == "__main__":
    print("\n" + json.dumps(found_here(**json.loads(sys.argv[1]))))
