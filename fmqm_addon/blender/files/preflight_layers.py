# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a USD file's layers compose to, counted prim by prim before the stage is opened.

Opening a stage composes all of its prims at once, and nothing stops it: nine layers of ten references are a billion.
"""

from __future__ import annotations

import contextlib
import os
import re
from typing import Any

import numpy as np

from ...metric.errors import FileError
from ..limits import MAX_DEPTH, MAX_INSTANCES, MAX_PRIMS

# What may hold brackets that are none: texts, names of assets, comments.
_QUOTED = re.compile(
    rb'"""(?:[^\\]|\\.)*?"""|'
    rb"'''(?:[^\\]|\\.)*?'''|"
    rb'"(?:[^"\\\n]|\\.)*"|'
    rb"'(?:[^'\\\n]|\\.)*'|"
    rb"@@@.*?@@@|@[^@\n]*@|#[^\n]*|//[^\n]*|/\*.*?\*/",
    re.DOTALL,
)
_STEPS = np.zeros(256, np.int8)
_STEPS[list(b"{[(")] = 1
_STEPS[list(b"}])")] = -1


def check_text(path: str) -> None:
    """A text layer's brackets must not lie too deep in one another: USD's reader calls itself at each.

    Of an archive (.usdz) each text layer in it. Binary layers have no such text; what crashes their reader cannot be
    told beforehand.

    Raises:
        FileError: they do.
    """
    if not os.path.isfile(path):
        return  # at a pipe this would wait
    try:
        with open(path, "rb") as file:
            is_text = file.read(4) in (b"#usd", b"#sdf")
        if is_text:
            with open(path, "rb") as file:
                _check_brackets(path, file.read())
        else:
            _check_archive(path)
    except (OSError, NotImplementedError, RuntimeError):
        return  # the importer says what is wrong


def _check_archive(path: str) -> None:
    import zipfile  # only here: it takes a while to import

    if not zipfile.is_zipfile(path):
        return
    with contextlib.suppress(zipfile.BadZipFile), zipfile.ZipFile(path) as archive:
        for info in archive.infolist():
            # USD reads only what is stored as it is.
            if info.filename.lower().endswith((".usd", ".usda")) and info.compress_type == zipfile.ZIP_STORED:
                data = archive.read(info)
                if data.startswith((b"#usd", b"#sdf")):
                    _check_brackets(path, data)


def _check_brackets(path: str, text: bytes) -> None:
    steps = _STEPS[np.frombuffer(_QUOTED.sub(b"", text), np.uint8)]
    depth = int(np.cumsum(steps[steps != 0], dtype=np.int64).max(initial=0))
    if depth > MAX_DEPTH:
        raise FileError(_too_deep(path, depth))


def _too_deep(path: str, depth: int) -> str:
    return f"{path}: its prims are nested {depth:,} deep; at most {MAX_DEPTH:,} are measured; flatten them"


def check_layers(path: str) -> None:
    """The layers that a file names must not be nested too deep, and compose to a stage that Blender can import.

    Raises:
        FileError: they are, or do not. Tf.ErrorException: the file cannot be read.
    """
    from pxr import Sdf, Usd

    check_text(path)
    _check_texts_below(Sdf.Layer.FindOrOpen(path))
    stage = Usd.Stage.OpenMasked(path, Usd.StagePopulationMask())  # the pseudo-root alone
    cache = stage._GetPcpCache()
    prims = [Sdf.Path.absoluteRootPath]  # of one depth
    prototypes: set[Any] = set()
    count = depth = 0
    while prims:
        count += len(prims)
        if count > MAX_PRIMS:
            raise FileError(
                f"{path}: its references, payloads and variants compose more than {MAX_PRIMS:,} prims; "
                "measure a part of it, or export it without them"
            )
        if depth > MAX_DEPTH:
            raise FileError(_too_deep(path, depth))
        indices = [cache.ComputePrimIndex(prim)[0] for prim in prims]
        payloads = [prim for prim, index in zip(prims, indices, strict=True) if index.hasAnyPayloads]
        if payloads:
            cache.RequestPayloads(payloads, [])
            indices = [cache.ComputePrimIndex(prim)[0] for prim in prims]
        below = []
        for prim, index in zip(prims, indices, strict=True):
            if index.IsInstanceable():  # composed once for all that are alike
                alike = tuple(_arcs(index.rootNode))
                if alike in prototypes:
                    continue
                prototypes.add(alike)
            below += [prim.AppendChild(name) for name in index.ComputePrimChildNames()[0]]
        prims, depth = below, depth + 1


def _check_texts_below(root: Any) -> None:
    """The layers that layers name, each once."""
    from pxr import Ar, Sdf, Tf

    seen: set[str] = set()
    waiting = [root] if root else []
    while waiting:
        layer = waiting.pop()
        for name in layer.GetCompositionAssetDependencies():
            asset = layer.ComputeAbsolutePath(name)
            if not name or asset in seen:
                continue
            seen.add(asset)
            found = os.fspath(Ar.GetResolver().Resolve(asset).GetPathString())
            if not found:
                continue  # told as missing later
            check_text(found)
            try:
                inner = Sdf.Layer.FindOrOpen(asset)
            except Tf.ErrorException:
                continue
            waiting += [inner] if inner else []


def _arcs(node: Any) -> list[Any]:
    """What an instance is made of but for its own opinions: USD shares a prototype among those that agree."""
    found = []
    for child in node.children:
        if not child.IsDueToAncestor():
            found.append((str(child.arcType), str(child.path), str(child.layerStack.identifier)))
        found += _arcs(child)
    return found


def check_point_instances(path: str, stage: Any) -> None:
    """Instances of point instancers, which may be instanced themselves, must not multiply to too much.

    Raises:
        FileError: they do.
    """
    from pxr import Usd, UsdGeom

    counted: dict[Any, int] = {}

    def count(root: Any) -> int:
        """What a prim and those below it show. Those at which this has begun count as one: rings show nothing."""
        if root.GetPath() in counted:
            return counted[root.GetPath()]
        counted[root.GetPath()] = 1
        total, below = 0, iter(Usd.PrimRange(root, Usd.TraverseInstanceProxies()))
        for prim in below:
            total += 1
            if prim.IsA(UsdGeom.PointInstancer):
                below.PruneChildren()
                total += count_instancer(UsdGeom.PointInstancer(prim))
            elif prim.IsInstance():
                below.PruneChildren()
                total += count(prim.GetPrototype())
        counted[root.GetPath()] = total
        return total

    def count_instancer(instancer: Any) -> int:
        indices = instancer.GetProtoIndicesAttr()
        times = indices.GetTimeSamples()
        points = max((len(indices.Get(time) or []) for time in times), default=0) or len(indices.Get() or [])
        prototypes = [stage.GetPrimAtPath(each) for each in instancer.GetPrototypesRel().GetForwardedTargets()]
        return points * max((count(each) for each in prototypes if each), default=0)

    shown = count(stage.GetPseudoRoot())
    if shown > MAX_INSTANCES:
        raise FileError(
            f"{path}: its instances and point instancers show {shown:,} prims; at most {MAX_INSTANCES:,} are measured; "
            "measure a part of it"
        )
