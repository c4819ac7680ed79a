# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF extensions that Blender does not decode, each with what turns it into something that Blender does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .named import gltf_document

_CONVERT = "gltf-transform {} in.glb out.glb"
_KTX, _AVIF = "ktxdecompress", "png --formats avif"
_TEXTURES = {"KHR_texture_basisu": _KTX, "EXT_texture_avif": _AVIF}
_MESHES = dict.fromkeys(("EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_draco_mesh_compression"), "copy")
_LACKS = ("not found", "not available", "not loaded")  # others have a decoder, and something else is wrong
_TOLD = {"meshopt": tuple(_MESHES)[:2], "draco": tuple(_MESHES)[2:]}  # words by which importers tell a decoder's lack


def why_not_imported(path: str, said: str) -> str:
    """What to do about a file that an importer refuses for an extension; "" where it is no extension's fault.

    Args:
        said: what the importer says.
    """
    used, lacks = _extensions(path), any(words in said for words in _LACKS)
    wanted = [name for word, names in _TOLD.items() if lacks and word in said.lower() for name in names if name in used]
    for name in (*(each for each in used if each in said), *wanted):
        convert = (_TEXTURES | _MESHES).get(name)
        if convert is not None:
            return f"it uses {name}, which this Blender does not decode; convert it: {_CONVERT.format(convert)}"
        return f"it uses {name}, which is not available in Blender; export it without"
    return ""


def why_no_image(path: str) -> str:
    """What to do about a file whose textures come as no image; "" where it is no extension's fault."""
    for name in _extensions(path):
        if name in _TEXTURES:
            command = _CONVERT.format(_TEXTURES[name])
            return f"its textures are in {name}, which Blender does not decode; convert them: {command}"
    return ""


def _extensions(path: str) -> list[str]:
    if Path(path).suffix.lower() not in (".glb", ".gltf"):
        return []
    document: Any = gltf_document(path)
    names = document.get("extensionsUsed") if isinstance(document, dict) else None
    return [name for name in names if isinstance(name, str)] if isinstance(names, list) else []
