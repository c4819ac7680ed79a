# SPDX-License-Identifier: GPL-3.0-or-later
"""What Cycles makes of a node tree before it renders, as far as an image's color depends on it: a node that something
asks for alpha divides its color by it. Of equal nodes Cycles makes one, and it cuts off what a constant cancels."""

from __future__ import annotations

import bpy

from .image_files import same_content
from .node_graph import NestedSocket, NotReadError, family, outputs, source, upstream_outputs

# Of the kinds of nodes that images' vectors are read from: the settings that make two of them unlike.
_SETTINGS = {
    "TEX_IMAGE": ("extension", "interpolation", "projection", "projection_blend"),
    "TEX_COORD": ("from_instancer", "object"),
    "UVMAP": ("uv_map", "from_instancer"),
    "ATTRIBUTE": ("attribute_name", "attribute_type"),
    "MAPPING": ("vector_type",),
    "MATH": ("operation", "use_clamp"),
    "COMBXYZ": (),
    "SEPXYZ": (),
}
_NOTHING = 1e-5  # what Cycles takes for no weight at all
# Of a Principled BSDF since Blender 5.2: what is left out without a weight.
_LOBES = {
    "Subsurface Weight": ("Subsurface Radius", "Subsurface Scale", "Subsurface IOR", "Subsurface Anisotropy"),
    "Coat Weight": ("Coat IOR", "Coat Roughness", "Coat Tint"),
    "Sheen Weight": ("Sheen Roughness", "Sheen Tint"),
    "Anisotropic": ("Anisotropic Rotation", "Tangent"),
    "Thin Film Thickness": ("Thin Film IOR",),
}


def used_alphas(material: bpy.types.Material) -> list[NestedSocket]:
    """The alpha outputs of image nodes that Cycles uses for anything."""
    starts = outputs(material, ("Surface", "Volume", "Displacement"))
    used = dict.fromkeys(place for start in starts for place, _ in upstream_outputs(start, _dropped))
    return [place for place in used if place.node.type == "TEX_IMAGE" and place.socket.name == "Alpha"]


def divided(material: bpy.types.Material) -> list[NestedSocket]:
    """The color outputs of image nodes, of those that feed the surface, that Cycles divides by their alpha."""
    alphas = used_alphas(material)
    beside = {(place.node, place.groups) for place in alphas}
    once = {place.node: place for place in alphas}.values()  # groups within groups can be used any number of times
    colors = dict.fromkeys(place for start in outputs(material, ("Surface",)) for place, _ in upstream_outputs(start))
    return [
        place
        for place in colors
        if place.node.type == "TEX_IMAGE"
        and place.socket.name == "Color"
        and (
            (place.node, place.groups) in beside
            or any(same_content(place.node.image, other.node.image) and merged(place, other) for other in once)
        )
    ]


def merged(one: NestedSocket, other: NestedSocket) -> bool:
    """Whether Cycles makes one node of those of two outputs, having equal settings and inputs, whatever image they
    show. Their place in the trees does not matter."""
    first, second = one.node, other.node
    names = _SETTINGS.get(first.type)
    if names is None or first.type != second.type:
        return False
    if any(getattr(first, name) != getattr(second, name) for name in names) or _mapping(first) != _mapping(second):
        return False
    pairs = zip(first.inputs, second.inputs, strict=True)
    return all(_same(NestedSocket(mine, one.groups), NestedSocket(its, other.groups)) for mine, its in pairs)


def _mapping(node: bpy.types.Node) -> list[object]:
    """The settings of an image node's own, hidden mapping."""
    if node.type != "TEX_IMAGE":
        return []
    mapping = node.texture_mapping
    values = (getattr(mapping, each.identifier) for each in mapping.bl_rna.properties)
    return [tuple(value) if hasattr(value, "__len__") else value for value in values]


def _same(one: NestedSocket, other: NestedSocket) -> bool:
    """Whether two inputs are fed by the same, in Cycles' eyes."""
    try:
        one, other = _folded(source(one)), _folded(source(other))
    except NotReadError:
        return False
    if _is_own_uv(one) and _is_own_uv(other):
        return True
    mine, its = _constant(one), _constant(other)
    if mine is not None or its is not None:
        return mine == its
    return one.socket.identifier == other.socket.identifier and (one == other or merged(one, other))


def _folded(place: NestedSocket) -> NestedSocket:
    """What is left of a Mapping node that does nothing: what it maps."""
    while place.socket.is_output and place.node.type == "MAPPING":
        still = {"Rotation": (0, 0, 0), "Scale": (1, 1, 1)}
        if place.node.vector_type != "VECTOR":
            still["Location"] = (0, 0, 0)
        if any(_constant(place.input(name)) != value for name, value in still.items()):
            break
        place = place.input("Vector")
    return place


def _is_own_uv(place: NestedSocket) -> bool:
    """Whether a place is the UV map that images have without a vector."""
    node = place.node
    if not place.socket.is_output:
        return bool(node.type == "TEX_IMAGE")
    return node.type == "TEX_COORD" and place.socket.name == "UV" and not (node.from_instancer or node.object)


def _constant(place: NestedSocket) -> tuple[float, ...] | None:
    """The value of a socket where nothing varies it."""
    if place.socket.is_output and place.node.type not in {"RGB", "VALUE"}:
        return None
    value = place.socket.default_value
    return tuple(value) if family(place.socket) == "VECTOR" else (value,)


def _dropped(place: NestedSocket) -> list[bpy.types.NodeSocket]:
    """The inputs of an output's node that Cycles cuts off, since a constant leaves nothing of them."""
    node = place.node
    inputs = node.inputs

    def is_(socket: bpy.types.NodeSocket, number: float) -> bool:
        try:
            return _constant(source(NestedSocket(socket, place.groups))) == (number,)
        except NotReadError:
            return False

    if node.type == "EMISSION" and is_(inputs["Strength"], 0):
        return [inputs["Color"]]
    if node.type == "BSDF_PRINCIPLED":
        return _idle_lobes(place)
    if node.type in {"MIX", "MIX_RGB", "MIX_SHADER"}:
        factor, first, second = (socket for socket in inputs if socket.enabled)  # of the node's kind of data
        hides = getattr(node, "blend_type", "MIX") == "MIX"
        return [second] if is_(factor, 0) else [first] if is_(factor, 1) and hides else []
    if node.type == "MATH" and node.operation == "MULTIPLY" and (is_(inputs[0], 0) or is_(inputs[1], 0)):
        return [inputs[0], inputs[1]]
    return []


def _idle_lobes(place: NestedSocket) -> list[bpy.types.NodeSocket]:
    """The inputs of a Principled BSDF that its own weights leave out."""

    def is_nothing(name: str) -> bool:
        try:
            value = _constant(place.input(name))
        except NotReadError:
            return False
        return value is not None and max(value[:3]) <= _NOTHING

    emission = ("Emission Color", "Emission Strength")
    idle = list(emission) if any(is_nothing(name) for name in emission) else []
    if bpy.app.version >= (5, 2):
        idle += [name for weight, names in _LOBES.items() if is_nothing(weight) for name in names]
    return [socket for socket in place.node.inputs if socket.identifier in idle]  # by name, Blender finds not all
