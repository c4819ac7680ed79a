# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether an image's alpha is used: Cycles divides the color of such an image by it, and of no other.

It makes one node of equal ones first, and cuts off what a constant cancels. None of this is followed here: what is
not plain is baked.
"""

from __future__ import annotations

import bpy

from .expressions import OPERATIONS
from .node_graph import NestedSocket, NotReadError, outputs, upstream_outputs


def linked_alphas(material: bpy.types.Material, names: tuple[str, ...]) -> list[NestedSocket]:
    """The alpha outputs of image nodes that these inputs of the material's output depend on, whatever comes of it."""
    places = dict.fromkeys(place for start in outputs(material, names) for place, _ in upstream_outputs(start))
    return [place for place in places if is_image_alpha(place)]


def is_image_alpha(place: NestedSocket) -> bool:
    """Whether a socket is the alpha output of an image node."""
    return place.socket.is_output and place.node.type == "TEX_IMAGE" and place.socket.name == "Alpha"


def opacity_alphas(place: NestedSocket) -> set[NestedSocket]:
    """The alpha outputs of image nodes that make a shader transparent, in ways that Cycles never cuts off."""
    node = place.node
    if not place.socket.is_output:
        return set()
    if is_image_alpha(place):
        return {place}
    asks: list[str | int] = []
    if node.type == "BSDF_PRINCIPLED":
        asks = ["Alpha"]
    elif node.type == "MIX_SHADER":
        asks = [0, 1, 2]
    elif node.type == "MATH" and node.operation in {*OPERATIONS, "MULTIPLY_ADD"}:
        asks = list(range(3 if node.operation == "MULTIPLY_ADD" else 2))
    try:
        fed = [place.input(name) for name in asks]
    except NotReadError:
        return set()
    constants = [_constant(each) for each in fed]
    hides = node.type == "MIX_SHADER" and constants[0] is not None and not 0 < constants[0] < 1
    if hides or (node.type == "MATH" and 0 in constants[:2] and node.operation in {"MULTIPLY", "MULTIPLY_ADD"}):
        return set()
    return {found for each in fed for found in opacity_alphas(each)}


def _constant(place: NestedSocket) -> float | None:
    """The number of a socket where nothing varies it."""
    fixed = not place.socket.is_output or place.node.type == "VALUE"
    return float(place.socket.default_value) if fixed and place.socket.type == "VALUE" else None
