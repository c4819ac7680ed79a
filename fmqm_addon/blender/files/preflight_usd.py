# SPDX-License-Identifier: GPL-3.0-or-later
"""USD files at which Blender's importer would end the whole process, and what it leaves out of others."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...metric.errors import FileError
from .preflight_layers import check_layers, check_point_instances

_ASSET = re.compile("@([^@]+)@")  # in what USD says of a missing one, its name first, then that of who asks
_UNREAD = ("NurbsPatch", "HermiteCurves", "TetMesh", "Volume")  # kinds of prims that no mesh comes of
_FOLLOWED = {"UsdUVTexture": "st", "UsdTransform2d": "in"}  # by the importer, from shader to shader, round any ring
_FARTHEST = 200  # shaders in a row: more take minutes


def check_usd(path: str) -> tuple[str, ...]:
    """A USD file must not compose to too much; its meshes and curves must hold what they count.

    Nor may its shaders be connected in rings.

    Returns:
        The references, payloads, layers and images that are missing, and kinds of prims that Blender does not read.

    Raises:
        FileError: they do not, or are.
    """
    try:
        bpy.utils.expose_bundled_modules()
        from pxr import Tf, Usd, UsdGeom, UsdShade
    except ImportError:
        return ()  # Debian's Blender 5 has no pxr, and survives such files
    try:
        check_layers(path)
        stage = Usd.Stage.Open(path, Usd.Stage.LoadAll)
    except Tf.ErrorException:
        return ()  # the importer says what is wrong
    check_point_instances(path, stage)
    sources: dict[Any, Any] = {}
    missing: dict[str, None] = {}  # in their order
    unread: dict[str, int] = {}
    inner = (prim for prototype in stage.GetPrototypes() for prim in Usd.PrimRange.AllPrims(prototype))
    for prim in (*stage.TraverseAll(), *inner):  # each prototype once, not each of its instances
        if prim.IsA(UsdGeom.Mesh):
            _check_mesh(path, UsdGeom.Mesh(prim))
        elif prim.IsA(UsdGeom.Curves):
            curves = UsdGeom.Curves(prim)
            _check_counts(path, "curves", "points", curves.GetCurveVertexCountsAttr(), curves.GetPointsAttr())
        elif prim.IsA(UsdShade.Shader):
            sources |= _followed(UsdShade.Shader(prim))
            missing |= dict.fromkeys(_missing_image(UsdShade.Shader(prim)))
        if prim.GetTypeName() in _UNREAD and prim.IsActive() and prim.IsDefined() and not prim.IsAbstract():
            unread[prim.GetTypeName()] = unread.get(prim.GetTypeName(), 0) + 1
    _check_chains(path, sources)
    missing |= dict.fromkeys(name for error in stage.GetCompositionErrors() for name in _ASSET.findall(str(error))[:1])
    return (
        *(f"refers to {name}, which is missing or cannot be read" for name in missing),
        *(f"holds {count} of type {kind}, which Blender does not read as surfaces" for kind, count in unread.items()),
    )


def _check_mesh(path: str, mesh: Any) -> None:
    _check_counts(path, "a mesh's faces", "corners", mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr())
    for corners, points in _values(mesh.GetCornerIndicesAttr(), mesh.GetPointsAttr()):
        if corners.max(initial=-1) >= points:
            raise FileError(f"{path}: a mesh of {points} points has a sharp corner at {corners.max()}; export it again")


def _check_counts(path: str, whose: str, what: str, counted: Any, listed: Any) -> None:
    """What one attribute counts the other must list: Blender 4.5 reads beyond the end."""
    for counts, length in _values(counted, listed):
        if counts.min(initial=0) < 0 or counts.sum() > length:
            raise FileError(f"{path}: {whose} have {counts.sum()} {what}, {length} are listed; export it again")


def _values(one: Any, other: Any) -> Iterator[tuple[NDArray[np.int64], int]]:
    """At each time the numbers of one attribute, and how many another has."""
    from pxr import Usd

    if not one.HasAuthoredValue():
        return
    times = {*one.GetTimeSamples(), *other.GetTimeSamples()}
    for time in map(Usd.TimeCode, times) if times else (Usd.TimeCode.Default(),):
        yield np.array(one.Get(time) or [], np.int64), len(other.Get(time) or [])


def _followed(shader: Any) -> dict[Any, Any]:
    """A shader's path to that of the one that the importer goes on to, where there is one."""
    asks = shader.GetInput(_FOLLOWED.get(shader.GetIdAttr().Get(), ""))
    found = asks.GetConnectedSources()[0] if asks else ()
    return {shader.GetPath(): found[0].source.GetPath()} if found else {}


def _missing_image(shader: Any) -> list[str]:
    """The image that a shader names, if it is not there."""
    asks = shader.GetInput("file")
    asset: Any = asks.Get() if asks else None
    path = getattr(asset, "path", "")
    return [] if not path or asset.resolvedPath or "<UDIM>" in path else [path]


def _check_chains(path: str, sources: dict[Any, Any]) -> None:
    for shader in sources:
        for _ in range(_FARTHEST):
            shader = sources.get(shader)
            if shader is None:
                break
        else:
            raise FileError(f"{path}: more than {_FARTHEST} of its shaders are connected in a row or a ring")
