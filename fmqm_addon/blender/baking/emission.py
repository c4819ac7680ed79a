# SPDX-License-Identifier: GPL-3.0-or-later
"""Temporary copies of materials that emit their base color: what a baker can draw without light."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from contextlib import ExitStack
from enum import Enum

import bpy

from ..materials.node_graph import TRANSPARENT, active_output, color_of, only_emits
from ..materials.used_alpha import linked_alphas

# Mixing never hides one of its shaders wholly: what a transparent one covers still has a color.
_LEAST_SHARE = 1e-4
_USERS = ("Surface", "Volume", "Displacement")  # inputs of the output


class BakePass(Enum):
    """What a copy emits: its base color, black where a transparent shader is, and what its own shaders emit if these
    are kept; these alone; or red as far as its shader is not a transparent one, green as far as it is opaque in all.
    """

    COLOR = 1
    OWN = 2
    WEIGHT = 3


def is_opaque(tree: bpy.types.NodeTree) -> bool:
    """Whether none of its nodes, its groups' among them, can make a material transparent."""
    return not any(_lets_through(node) for each in _with_groups(tree) for node in each.nodes)


def _lets_through(node: bpy.types.Node) -> bool:
    alpha = node.inputs.get("Alpha") if any(socket.type == "SHADER" for socket in node.outputs) else None
    return node.type in TRANSPARENT or (alpha is not None and (alpha.is_linked or alpha.default_value < 1))


def _with_groups(tree: bpy.types.NodeTree) -> list[bpy.types.NodeTree]:
    """The tree and those of its groups, each once."""
    trees = [tree]
    for each in trees:
        inner = [node.node_tree for node in each.nodes if node.type == "GROUP" and node.node_tree is not None]
        trees += [found for found in dict.fromkeys(inner) if found not in trees]
    return trees


def keeps_shaders(material: bpy.types.Material) -> bool:
    """Whether its shaders must be there while it is baked: Cycles sees by them which images' alpha is used."""
    return bool(linked_alphas(material, _USERS))


def shines(tree: bpy.types.NodeTree) -> bool:
    """Whether any of its shaders may emit something by itself."""
    return any(_may_emit(node) for each in _with_groups(tree) for node in each.nodes)


def _may_emit(node: bpy.types.Node) -> bool:
    strength = node.inputs.get("Emission Strength")
    return node.type == "EMISSION" or (strength is not None and (strength.is_linked or strength.default_value > 0))


def emission_copy(
    material: bpy.types.Material, bake_pass: BakePass, numbers: Collection[str], temporary: ExitStack
) -> bpy.types.Material:
    """A copy of a material whose shaders, in its node groups too, have emissions for twins; mixes of them as well.

    Base color over weight is the color of a mix with transparent shaders, however they are nested.

    Args:
        numbers: names of the mesh's attributes that have fewer values than a color.
        temporary: removes the copy, and those of the groups.
    """
    copy = material.copy()
    temporary.callback(bpy.data.materials.remove, copy)
    kept = bake_pass is not BakePass.WEIGHT and keeps_shaders(material)
    tree = copy.node_tree
    twins = Twins(tree, bake_pass, numbers, {}, temporary)
    output = active_output(tree)
    if output is None:
        return copy
    for other in [each for each in tree.nodes if each.type == "OUTPUT_MATERIAL" and each != output]:
        tree.nodes.remove(other)
    output.target = "ALL"
    copy.displacement_method = "BUMP"  # it may use an alpha, and must not move what is baked
    for name in ("Volume", "Displacement"):
        if not (kept and linked_alphas(material, (name,))):
            for link in list(output.inputs[name].links):
                tree.links.remove(link)
    surface = output.inputs["Surface"]
    if surface.is_linked and bake_pass is not BakePass.OWN:
        both = tree.nodes.new("ShaderNodeAddShader")
        if kept:
            tree.links.new(surface.links[0].from_socket, both.inputs[1])
        tree.links.new(twins.of_input(surface), both.inputs[0])
        tree.links.new(both.outputs[0], surface)
    return copy


class Twins:
    """A tree's shaders, each with a twin that emits; the shaders stay. Groups become copies with both."""

    def __init__(
        self,
        tree: bpy.types.NodeTree,
        bake_pass: BakePass,
        numbers: Collection[str],
        groups: dict[str, Twins],
        temporary: ExitStack,
    ) -> None:
        self.tree = tree
        self._pass = bake_pass
        self._known: dict[tuple[str, str], bpy.types.NodeSocket] = {}
        self.sockets: dict[str, str] = {}  # of a group: each shader socket's identifier to that of its twin
        for link in list(tree.links):
            if link.is_muted or not link.is_valid:
                tree.links.remove(link)
        for link in list(tree.links):
            # A color at a shader's place emits by itself.
            if link.to_socket.type == "SHADER" and link.from_socket.type != "SHADER":
                _emission(tree, link.from_socket, [link.to_socket])
        for node in list(tree.nodes):
            if node.type == "SHADERTORGB":
                _pass_color(tree, node)
        self._groups: dict[str, Twins] = {}  # by the names of their nodes
        for node in list(tree.nodes):
            if node.type == "GROUP" and node.node_tree is not None:
                self._groups[node.name] = _group(node.node_tree, bake_pass, numbers, groups, temporary)
                node.node_tree = self._groups[node.name].tree
            elif node.type == "VERTEX_COLOR" and node.layer_name in numbers and not node.mute:
                _read_number(tree, node)

    def of_input(self, socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """The twin of the shader that feeds an input; black where none does."""
        if socket.is_linked:
            found = self._of_output(socket.links[0].from_socket)
            if found is not None:
                return found
        return _emission(self.tree, None, []).node.outputs[0]

    def _of_output(self, socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
        key = (socket.node.name, socket.identifier)
        if key not in self._known:
            found = self._made(socket.node, socket)
            if found is None:
                return None
            self._known[key] = found
        return self._known[key]

    def _made(self, node: bpy.types.Node, socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
        if node.mute:
            through = next((link.from_socket for link in node.internal_links if link.to_socket == socket), None)
            return None if through is None else self.of_input(through)
        if node.type == "REROUTE":
            return self.of_input(node.inputs[0])
        if node.type in {"MIX_SHADER", "ADD_SHADER"}:
            made = self.tree.nodes.new(node.bl_idname)
            for old, new in zip(node.inputs, made.inputs, strict=True):
                if old.type == "SHADER":
                    self.tree.links.new(self.of_input(old), new)
                else:
                    _clamp(self.tree, old, new, _LEAST_SHARE, 1 - _LEAST_SHARE)
            return made.outputs[0]
        if node.type == "GROUP_INPUT":
            return _with_identifier(node.outputs, self.sockets.get(socket.identifier))
        if node.type == "GROUP":
            return self._of_group(node, socket)
        if node.type == "EMISSION" and self._pass is BakePass.COLOR:
            return socket
        return _replacement(self.tree, node, self._pass)

    def _of_group(self, node: bpy.types.Node, socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
        if node.name not in self._groups:
            return None
        twins = self._groups[node.name].sockets
        for inner in node.inputs:
            twin = _with_identifier(node.inputs, twins.get(inner.identifier))
            if twin is not None and not twin.is_linked:
                self.tree.links.new(self.of_input(inner), twin)
        return _with_identifier(node.outputs, twins.get(socket.identifier))

    def add_sockets(self) -> None:
        """Gives a group a socket more for each of its shader sockets."""
        items = [each for each in self.tree.interface.items_tree if each.item_type == "SOCKET"]
        for item in items:
            if item.socket_type == "NodeSocketShader":
                new = self.tree.interface.new_socket("FMQM twin", in_out=item.in_out, socket_type=item.socket_type)
                self.sockets[item.identifier] = new.identifier
        for node in list(self.tree.nodes):
            if node.type == "GROUP_OUTPUT":
                for inner in list(node.inputs):
                    twin = _with_identifier(node.inputs, self.sockets.get(inner.identifier))
                    if twin is not None:
                        self.tree.links.new(self.of_input(inner), twin)


def _with_identifier(sockets: Iterable[bpy.types.NodeSocket], identifier: str | None) -> bpy.types.NodeSocket | None:
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def _group(
    tree: bpy.types.NodeTree,
    bake_pass: BakePass,
    numbers: Collection[str],
    groups: dict[str, Twins],
    temporary: ExitStack,
) -> Twins:
    key = tree.name_full
    if key not in groups:
        copy = tree.copy()
        temporary.callback(bpy.data.node_groups.remove, copy)
        groups[key] = Twins(copy, bake_pass, numbers, groups, temporary)
        groups[key].add_sockets()
    return groups[key]


def _read_number(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Cycles takes what a Color Attribute node names for a color unseen, and crashes where it is shorter; an Attribute
    node looks first."""
    looking = tree.nodes.new("ShaderNodeAttribute")
    looking.attribute_name = node.layer_name
    for name in ("Color", "Alpha"):
        for link in list(node.outputs[name].links):
            tree.links.new(looking.outputs[name], link.to_socket)


def _pass_color(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Shader to RGB, which Cycles lacks: the color of the shader before it, as if in full light."""
    link = next(iter(node.inputs[0].links), None)
    wanted = None if link is None else color_of(link.from_node)
    if wanted is None:
        return
    passed = tree.nodes.new("ShaderNodeGamma")  # of 1: hands a color on
    _take_over(tree, wanted, passed.inputs["Color"])
    for each in list(node.outputs["Color"].links):
        tree.links.new(passed.outputs[0], each.to_socket)


def _clamp(
    tree: bpy.types.NodeTree, old: bpy.types.NodeSocket, new: bpy.types.NodeSocket, least: float, most: float
) -> None:
    """As _take_over, between two limits; both sockets may be one."""
    clamp = tree.nodes.new("ShaderNodeClamp")
    clamp.inputs["Min"].default_value, clamp.inputs["Max"].default_value = least, most
    _take_over(tree, old, clamp.inputs["Value"])
    tree.links.new(clamp.outputs[0], new)


def _replacement(tree: bpy.types.NodeTree, node: bpy.types.Node, bake_pass: BakePass) -> bpy.types.NodeSocket:
    """A new emission of what a shader shows."""
    color = _emission(tree, None, [])
    if bake_pass is BakePass.COLOR:
        wanted = color_of(node)
        if wanted is not None:
            _take_over(tree, wanted, color)
        if only_emits(node):
            _take_over(tree, node.inputs["Emission Strength"], color.node.inputs["Strength"])
    elif node.type not in TRANSPARENT:
        weights = tree.nodes.new("ShaderNodeCombineColor")
        tree.links.new(weights.outputs[0], color)
        weights.inputs["Red"].default_value = weights.inputs["Green"].default_value = 1
        if "Alpha" in node.inputs:
            _clamp(tree, node.inputs["Alpha"], weights.inputs["Green"], 0, 1)
    return color.node.outputs[0]


def _emission(
    tree: bpy.types.NodeTree, source: bpy.types.NodeSocket | None, targets: list[bpy.types.NodeSocket]
) -> bpy.types.NodeSocket:
    """A new emission before the targets, black unless it has a source; its color socket."""
    made = tree.nodes.new("ShaderNodeEmission")
    made.inputs["Color"].default_value = (0, 0, 0, 1)
    if source is not None:
        tree.links.new(source, made.inputs["Color"])
    for target in targets:
        tree.links.new(made.outputs[0], target)
    return made.inputs["Color"]


def _take_over(tree: bpy.types.NodeTree, old: bpy.types.NodeSocket, new: bpy.types.NodeSocket) -> None:
    """What the old socket has: its value, and its link, which may end in nothing."""
    new.default_value = old.default_value
    if old.is_linked:
        tree.links.new(old.links[0].from_socket, new)
