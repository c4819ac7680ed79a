# SPDX-License-Identifier: GPL-3.0-or-later
"""The way through a node tree: what feeds a socket, past reroutes, muted nodes and groups."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import inf
from typing import Any

import bpy

from ...metric.errors import FMQMError

_IS_OLD = bpy.app.version < (5, 2)
DEEPEST = 100  # groups within groups
TRANSPARENT = {"BSDF_TRANSPARENT", "HOLDOUT"}  # shaders without a color of their own
_ROLES = {"Base Color": "base color", "Color": "base color", "Alpha": "alpha", "Fac": "alpha", "Factor": "alpha"}


class NotReadError(FMQMError):
    """A node that is not read; read_look answers it with Unread, so that callers never see it."""

    def __init__(self, node: bpy.types.Node, why: str) -> None:
        super().__init__(f"{node.name}: {why}")
        self.node, self.why = node.name, why


@dataclass(frozen=True)
class NestedSocket:
    """A socket in nested node groups, with the group nodes that lead to its tree."""

    socket: bpy.types.NodeSocket
    groups: tuple[bpy.types.Node, ...] = ()

    @property
    def node(self) -> bpy.types.Node:
        """The node of the socket."""
        return self.socket.node

    def input(self, name: str | int) -> NestedSocket:
        """What feeds an input of this place's node, by its name or number."""
        return source(NestedSocket(self.node.inputs[name], self.groups))


def outputs(material: bpy.types.Material, names: Iterable[str] = ("Surface", "Displacement")) -> list[NestedSocket]:
    """What feeds the active output: of these inputs, those that something feeds."""
    output = active_output(material.node_tree) if uses_nodes(material) else None
    if output is None:
        return []
    return [NestedSocket(output.inputs[name]) for name in names if _link(output.inputs[name])]


def active_output(tree: bpy.types.NodeTree) -> bpy.types.Node | None:
    """The output node that counts: Cycles' own first, as it bakes; asked for "ALL", Blender finds no renderer's own."""
    return tree.get_output_node("CYCLES") or tree.get_output_node("EEVEE")


def uses_nodes(material: bpy.types.Material) -> bool:
    """Whether a material's nodes count: before Blender 5 it may have some and not use them; later use_nodes warns."""
    return material.node_tree is not None and (bpy.app.version >= (5, 0) or material.use_nodes)


def node_count(tree: bpy.types.NodeTree, known: dict[bpy.types.NodeTree, float] | None = None, depth: int = 0) -> float:
    """How many nodes a renderer makes of a tree, those of a group as often as it is used; infinite if they are nested
    deeper than DEEPEST. Groups within groups, each used twice, soon have any number."""
    known = {} if known is None else known
    if depth > DEEPEST:
        return inf
    if tree not in known:
        inner = (node.node_tree for node in tree.nodes if node.type == "GROUP" and node.node_tree is not None)
        known[tree] = len(tree.nodes) + sum(node_count(each, known, depth + 1) for each in inner)
    return known[tree]


def surface_of(material: bpy.types.Material) -> NestedSocket | None:
    """The output's surface socket, where something feeds it."""
    return next((place for place in outputs(material) if place.socket.name == "Surface"), None)


def _link(socket: bpy.types.NodeSocket) -> bpy.types.NodeLink | None:
    """The link into an input that counts."""
    return next((link for link in socket.links if link.is_valid and not link.is_muted), None)


def source(place: NestedSocket, converting: bool = False) -> NestedSocket:
    """The output that feeds an input, through reroutes, muted nodes and groups; where none does, the input whose own
    value counts: since Blender 5.2 never one of a reroute or a muted node.

    Args:
        converting: follow it also where a color becomes a number, or a number a color, on its way.

    Raises:
        NotReadError: the way there cannot be followed.
    """
    wanted, own = family(place.socket), place
    while (link := _link(place.socket)) is not None:
        output, node = link.from_socket, link.from_node
        if node.type == "REROUTE":
            place = NestedSocket(node.inputs[0], place.groups)
        elif node.mute:
            through = next((inner.from_socket for inner in node.internal_links if inner.to_socket == output), None)
            if _IS_OLD and (through is None or _link(through) is None):
                raise NotReadError(node, "is muted and lets nothing through")
            if through is None:
                return own
            place = NestedSocket(through, place.groups)
        elif node.type == "GROUP":
            own = place = NestedSocket(_group_result(node, output.identifier), (*place.groups, node))
        elif node.type == "GROUP_INPUT":
            own = place = NestedSocket(
                by_identifier(place.groups[-1].inputs, output.identifier, node), place.groups[:-1]
            )
        else:
            return NestedSocket(output, place.groups)
        if family(place.socket) != wanted and not converting:
            raise NotReadError(node, "turns a color into a number or a number into a color")
    return place if _IS_OLD else own


def family(socket: bpy.types.NodeSocket) -> str:
    """The kind of what a socket carries: VECTOR for colors too, SHADER, VALUE for numbers; for whole ones too since
    Blender 5.2, which no longer rounds what passes such a socket."""
    if socket.type in {"INT", "BOOLEAN"} and not _IS_OLD:
        return "VALUE"
    return "VECTOR" if socket.type == "RGBA" else socket.type


def _group_result(node: bpy.types.Node, identifier: str) -> bpy.types.NodeSocket:
    inner = () if node.node_tree is None else node.node_tree.nodes
    output = next((each for each in inner if each.type == "GROUP_OUTPUT" and each.is_active_output), None)
    if output is None:
        raise NotReadError(node, "is a group without an output")
    return by_identifier(output.inputs, identifier, node)


def by_identifier(sockets: Any, identifier: str, node: bpy.types.Node) -> bpy.types.NodeSocket:
    """The socket of that identifier among a node's.

    Raises:
        NotReadError: there is none.
    """
    found = next((socket for socket in sockets if socket.identifier == identifier), None)
    if found is None:
        raise NotReadError(node, "has lost a socket")
    return found


def only_emits(node: bpy.types.Node) -> bool:
    """Whether all that is seen of a Principled BSDF is its emission: the base color is plain black, as in glTF files
    of what has no light on it."""
    if node.type != "BSDF_PRINCIPLED" or _link(node.inputs["Base Color"]) is not None:
        return False
    base, color, strength = (node.inputs[name] for name in ("Base Color", "Emission Color", "Emission Strength"))
    lit = _link(strength) is not None or strength.default_value > 0
    shines = _link(color) is not None or max(color.default_value[:3]) > 0
    return lit and shines and max(base.default_value[:3]) <= 0


def color_of(shader: bpy.types.Node) -> bpy.types.NodeSocket | None:
    """The input that is a shader's base color; None if it has none or lets all light through."""
    if shader.type in TRANSPARENT:
        return None
    if only_emits(shader):
        return shader.inputs["Emission Color"]
    return shader.inputs.get("Base Color") or shader.inputs.get("Color")


def upstream(start: NestedSocket) -> Iterator[tuple[bpy.types.Node, str]]:
    """Every node that an input depends on, with its role: the name of the shader's input that it feeds."""
    for place, role in upstream_outputs(start):
        yield place.node, role


def upstream_outputs(start: NestedSocket) -> Iterator[tuple[NestedSocket, str]]:
    """Every output that an input depends on, with its role."""
    queue, seen = [(start, start.socket.name)], set()
    while queue:
        asking, role = queue.pop(0)
        try:
            place = source(asking, converting=True)
        except NotReadError:
            continue
        key = (place.socket.as_pointer(), tuple(group.as_pointer() for group in place.groups), role)
        if not place.socket.is_output or key in seen:
            continue
        seen.add(key)
        yield place, role
        for socket in place.node.inputs:
            own = place.socket.type == "SHADER" and socket.type != "SHADER"
            queue.append((NestedSocket(socket, place.groups), _role(socket) if own else role))


def _role(socket: bpy.types.NodeSocket) -> str:
    """Of what feeds a shader's input."""
    if socket.name == "Emission Color" and only_emits(socket.node):
        return "base color"
    return _ROLES.get(socket.name, socket.name)
