# SPDX-License-Identifier: GPL-3.0-or-later
"""The direction of the arrows: the metric knows numpy and itself, never Blender."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import fmqm_addon.metric

PACKAGE = Path(fmqm_addon.metric.__file__).parent
MODULES = [f"fmqm_addon.metric.{path.stem}" for path in sorted(PACKAGE.glob("*.py")) if path.stem != "__init__"]

REFUSING_BLENDER = """
import builtins, importlib, sys
real = builtins.__import__
def refuse(name, *args, **kwargs):
    if name.split(".")[0] in {"bpy", "mathutils", "bmesh", "gpu", "idprop", "addon_utils"}:
        raise ImportError(f"the metric asked for {name}")
    return real(name, *args, **kwargs)
builtins.__import__ = refuse
sys.path.insert(0, sys.argv[1])
for module in sys.argv[2:]:
    importlib.import_module(module)
ours = {name.split(".")[1] for name in sys.modules if name.startswith("fmqm_addon.")}
assert not {"bpy", "mathutils"} & set(sys.modules), "Blender was imported"
assert ours <= {"metric", "version"}, f"the metric imported {ours}"
"""


def test_every_module_is_looked_at() -> None:
    assert {"evaluation", "features", "fields", "surface"} <= {name.rsplit(".")[-1] for name in MODULES}


@pytest.mark.parametrize("modules", [["fmqm_addon.metric"], MODULES], ids=["package", "every module"])
def test_metric_imports_without_blender(modules: list[str]) -> None:
    command = [sys.executable, "-c", REFUSING_BLENDER, str(PACKAGE.parents[1]), *modules]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
