# SPDX-License-Identifier: GPL-3.0-or-later
"""The house as docs and rooms promise it: who may know whom, no circles, no file too long, no bpy where none is due."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "fmqm_addon"
LONGEST = 400  # lines of a file

# Each room with what it may import besides itself. version and __init__ are for all.
_MIDDLE = {"metric", "comparison"}
_MATERIALS = {*_MIDDLE, "blender"}
_BAKING = {*_MATERIALS, "blender/materials"}
_SCENE = {*_BAKING, "blender/baking"}
_FILES = {*_SCENE, "blender/scene"}
_BELOW = {*_FILES, "blender/files", "blender/display", "report", "screen_size"}
MAY_KNOW = {
    "metric": set(),
    "comparison": {"metric"},
    "screen_size": _MIDDLE,
    "report": _MIDDLE,
    "blender": _MIDDLE,  # what lies beside its rooms and serves them all
    "blender/materials": _MATERIALS,
    "blender/baking": _BAKING,
    "blender/scene": _SCENE,
    "blender/files": _FILES,
    "blender/display": _MATERIALS,
    "batch": _BELOW,
    "api": _BELOW,
    "ui": {*_BELOW, "api"},
    "cli": {*_BELOW, "api", "batch"},
    "evidence": {*_BELOW, "batch"},
}

FILES = sorted(PACKAGE.rglob("*.py"))
MODULES = {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in FILES}


def room_of(module: str) -> str:
    """The room of a module by its dotted name; "" is the package's own front."""
    parts = module.split(".")[1:]
    if parts and parts[0] == "blender" and f"blender/{parts[1] if len(parts) > 1 else ''}" in MAY_KNOW:
        return "/".join(parts[:2])
    return parts[0] if parts and parts[0] in MAY_KNOW else ""


def imports(module: str, tree: ast.AST | None = None, typing: bool = True, lazy: bool = True) -> Iterator[str]:
    """The modules of ours that a module imports.

    Args:
        typing: those for type checkers alone too. lazy: those that functions import too.
    """
    path = MODULES[module]
    package = module.split(".") if path.name == "__init__.py" else module.split(".")[:-1]
    waiting = list(ast.iter_child_nodes(tree or ast.parse(path.read_text(encoding="utf-8"))))
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test) and not typing:
            waiting += node.orelse
            continue
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) and not lazy:
            continue
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*start, *([node.module] if node.module else [])])
            # What is imported from a package may be a module of it.
            inner = [f"{base}.{alias.name}" for alias in node.names]
            names = [name if name in MODULES else base for name in inner]
        else:
            continue
        yield from (name for name in names if name in MODULES and name != module)


def test_the_imports_are_found() -> None:
    """On lines of our own: relative and absolute ones, of modules and of their contents."""
    module = "fmqm_addon.comparison.pair"
    lines = "from ..metric import errors\nfrom ..metric.stepper import Stepper\nimport fmqm_addon.api\nimport numpy\n"
    lines += "if TYPE_CHECKING:\n    from . import trust\ndef f():\n    from .memory import peak_bytes\n"
    sure = {"fmqm_addon.metric.errors", "fmqm_addon.metric.stepper", "fmqm_addon.api"}
    typing, lazy = {"fmqm_addon.comparison.trust"}, {"fmqm_addon.comparison.memory"}
    assert set(imports(module, ast.parse(lines))) == sure | typing | lazy
    assert set(imports(module, ast.parse(lines), typing=False)) == sure | lazy
    assert set(imports(module, ast.parse(lines), typing=False, lazy=False)) == sure


def test_every_room_is_known() -> None:
    rooms = {path.name for path in PACKAGE.iterdir() if path.is_dir() and any(path.glob("*.py"))}
    assert rooms <= set(MAY_KNOW), "a new room: say what it may know"


@pytest.mark.parametrize("room", MAY_KNOW)
def test_rooms_know_only_what_lies_below_them(room: str) -> None:
    allowed = {room, "", *MAY_KNOW[room]}
    upward = [
        f"{module} imports {other}"
        for module in MODULES
        if room_of(module) == room
        for other in imports(module)
        if room_of(other) not in allowed
    ]
    assert not upward


def test_no_modules_import_each_other_in_a_circle() -> None:
    """Neither at once nor when functions run; what only type checkers see is left out."""
    known = {module: set(imports(module, typing=False)) for module in MODULES}
    done: set[str] = set()

    def visit(module: str, way: tuple[str, ...]) -> None:
        assert module not in way, " imports ".join([*way[way.index(module) :], module])
        if module in done:
            return
        for other in sorted(known[module]):
            visit(other, (*way, module))
        done.add(module)

    for module in known:
        visit(module, ())


def test_no_file_is_too_long() -> None:
    files = [*FILES, *(ROOT / "scripts").rglob("*.py")]
    lines = {path.relative_to(ROOT).as_posix(): len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert not {name: count for name, count in lines.items() if count > LONGEST}


REFUSING_BLENDER = """
import builtins, importlib, sys
real = builtins.__import__
def refuse(name, *args, **kwargs):
    if name.split(".")[0] in {"bpy", "bmesh", "mathutils", "gpu", "idprop", "addon_utils"}:
        raise ImportError(f"{sys.argv[-1]} asked for {name}")
    return real(name, *args, **kwargs)
builtins.__import__ = refuse
sys.path.insert(0, sys.argv[1])
for module in sys.argv[2:]:
    importlib.import_module(module)
assert not {"bpy", "mathutils"} & set(sys.modules), "Blender was imported"
"""


@pytest.mark.parametrize("room", ["metric", "comparison", "screen_size", "report", "batch", "cli", "evidence"])
def test_rooms_import_without_blender(room: str) -> None:
    modules = [module for module in MODULES if room_of(module) == room]
    assert modules
    command = [sys.executable, "-c", REFUSING_BLENDER, str(ROOT), *modules]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("room", ["metric", "comparison", "screen_size", "report", "batch", "cli", "evidence"])
def test_rooms_name_blender_in_functions_only(room: str) -> None:
    """Not even for types: whoever reads a file's top sees what it stands on. Evidence leaves it to blender/."""
    for path in (ROOT / "fmqm_addon" / room).rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        inside = {node for each in ast.walk(tree) if isinstance(each, ast.FunctionDef) for node in ast.walk(each)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Import) and (node not in inside or room == "evidence"):
                assert not {"bpy", "bmesh", "mathutils"} & {name.name.split(".")[0] for name in node.names}, path
