# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip as a user gets it: built and validated by Blender's own tool, installed, used, disabled, uninstalled."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Sequence
from pathlib import Path

import bpy
import pytest

from fmqm_addon import VERSION

ROOT = Path(__file__).resolve().parents[2]
TOOL = Path(bpy.utils.system_resource("SCRIPTS"), "addons_core", "bl_pkg", "cli", "blender_ext.py")

# Runs in a Blender of its own. Its last line of output is JSON.
LIFE = """
import json, os, sys
import bpy

def found():
    handlers = [h for n in dir(bpy.app.handlers) if isinstance(getattr(bpy.app.handlers, n), list)
                for h in getattr(bpy.app.handlers, n)]
    menus = [d for name in ("VIEW3D_MT_object",) for d in getattr(bpy.types, name)._dyn_ui_initialize()]
    return {
        "classes": sorted(n for n in dir(bpy.types) if n.upper().startswith("FMQM")),
        "operators": sorted(dir(bpy.ops.fmqm)) if "fmqm" in dir(bpy.ops) else [],
        "property": hasattr(bpy.types.Scene, "fmqm"),
        "handlers": [repr(h) for h in handlers if "fmqm" in getattr(h, "__module__", "")],
        "menus": [repr(d) for d in menus if "fmqm" in getattr(d, "__module__", "")],
    }

report = {"before": found()}
bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
bpy.ops.extensions.package_install_files(filepath=sys.argv[-1], repo="user_default", enable_on_install=True)
module = "bl_ext.user_default.fmqm"
report["enabled"] = module in bpy.context.preferences.addons
report["installed"] = found()
for level in range(2):
    bpy.ops.mesh.primitive_monkey_add()
    bpy.context.object.name = f"Rock_LOD{level}"
bpy.context.object.modifiers.new("Decimate", "DECIMATE").ratio = 0.5
fmqm = bpy.context.scene.fmqm
fmqm.settings.samples, fmqm.settings.patches = 8000, 40
bpy.ops.fmqm.find_lods()
bpy.ops.fmqm.measure()
report["rows"] = [(row.name, json.loads(row.scores)["scores"], row.error) for row in fmqm.rows]
from bl_ext.user_default.fmqm.fmqm_addon import api
lods = [bpy.data.objects[f"Rock_LOD{level}"] for level in range(2)]
outcome = api.measure(*lods, api.Settings(samples=8000, patches=40))[0]
report["api"] = list(outcome.scores)
del fmqm, outcome
for again in range(2):
    bpy.ops.preferences.addon_disable(module=module)
    report[f"disabled {again}"] = found()
    bpy.ops.preferences.addon_enable(module=module)
    assert hasattr(bpy.types.Scene, "fmqm")
bpy.ops.preferences.addon_disable(module=module)
repositories = [repository.module for repository in bpy.context.preferences.extensions.repos]
bpy.ops.extensions.package_uninstall(repo_index=repositories.index("user_default"), pkg_id="fmqm")
report["uninstalled"] = found()
print(json.dumps(report), flush=True)
os._exit(0)  # bpy 4.5 hangs at its end over handlers of Blender's own extension manager
"""


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    tool("build", "--source-dir", str(ROOT), "--output-dir", str(folder))
    return folder / f"fmqm-{VERSION}.zip"


def tool(*arguments: str) -> str:
    done = subprocess.run([sys.executable, str(TOOL), *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_manifest() -> None:
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())
    assert manifest["version"] == VERSION
    assert manifest["blender_version_min"] == "4.5.0"
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later", "SPDX:MIT"]
    assert list(manifest["permissions"]) == ["files"]
    assert "wheels" not in manifest
    for text in (manifest["tagline"], *manifest["permissions"].values()):
        assert len(text) <= 64 and not text.endswith(".")


def test_validated(package: Path) -> None:
    assert "Success" in tool("validate", str(package))


def test_what_is_in_it(package: Path) -> None:
    names = zipfile.ZipFile(package).namelist()
    assert {"__init__.py", "blender_manifest.toml", "README.md", "LICENSE"} <= set(names)
    paths = (ROOT / "fmqm_addon").rglob("*.py")
    code = {path.relative_to(ROOT).as_posix() for path in paths if path.parent.name not in {"batch", "cli", "evidence"}}
    code.remove("fmqm_addon/__main__.py")  # these are of scripts
    assert {name for name in names if name.endswith(".py")} == {"__init__.py", *code}
    assert {"fmqm_addon/report/html/page.css", "fmqm_addon/report/html/page.js"} <= set(names)
    for name in names:
        assert not name.startswith((".", "tests", "scripts", "out", "dist", "docs")) and "__pycache__" not in name
    for name in code:  # what Blender's reviewers refuse
        source = (ROOT / name).read_text()
        assert "sys.path" not in source and "import threading" not in source, name
        assert "from fmqm_addon" not in source.replace("or: from fmqm_addon", ""), name


def test_life(package: Path, tmp_path: Path) -> None:
    live(package, tmp_path)


def test_the_zip_of_a_code_host(package: Path, tmp_path: Path) -> None:
    """All below one top folder, with the tests."""
    hosted = tmp_path / "fmqm-main.zip"
    with zipfile.ZipFile(package) as source, zipfile.ZipFile(hosted, "w") as target:
        for name in source.namelist():
            target.writestr(f"fmqm-main/{name}", source.read(name))
        target.writestr("fmqm-main/tests/test_nothing.py", "")
        target.writestr("fmqm-main/Makefile", "")
    live(hosted, tmp_path)


def live(package: Path, folder: Path, command: Sequence[str] = (sys.executable,), before: Sequence[str] = ()) -> None:
    """Runs LIFE by the command, with the package behind `before`, and checks what it reports."""
    script = folder / "life.py"
    script.write_text(LIFE)
    done = subprocess.run(
        [*command, str(script), *before, str(package)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(folder / "user")},
    )
    assert "Traceback" not in done.stderr, done.stderr
    line = next(line for line in reversed(done.stdout.splitlines()) if line.startswith("{"))
    report = json.loads(line)
    assert report["enabled"] and report["installed"]["property"]
    assert len(report["installed"]["classes"]) > 10 and len(report["installed"]["menus"]) == 1
    assert report["installed"]["handlers"] == []  # none without a window
    ((name, scores, error),) = report["rows"]
    assert (name, error) == ("Rock_LOD1", "")
    assert scores == report["api"] and 0 < scores[-1] < 1
    for state in ("disabled 0", "disabled 1", "uninstalled"):
        assert report[state] == report["before"], state
    left = list((folder / "user").rglob("fmqm_addon"))
    assert not left, left
