# SPDX-License-Identifier: GPL-3.0-or-later
"""Temporary copies of materials that emit their base color: what a baker can draw without light."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import ExitStack
from dataclasses import dataclass
from enum import Enum

import bpy

from ..materials.cycles_alpha import divided
from ..materials.node_graph import TRANSPARENT, active_output, color_of, only_emits

# Mixing never hides one of its shaders wholly: what a transparent one covers still has a color.
_LEAST_SHARE = 1e-4
_NEXT_TO_NOTHING = 1e-7
_KEPT = {"MIX_SHADER", "ADD_SHADER", "GROUP", "GROUP_INPUT", "REROUTE"}


class BakePass(Enum):
    """What a copy emits: its base color, black where a transparent shader is; or red as far as its shader is not a
    transparent one, green as far as it is opaque in all."""

    COLOR = 1
    WEIGHT = 2


@dataclass(frozen=True)
class _Task:
    """What a copy becomes.

    Attributes:
        numbers: see emission_copy.
        divided: pointers of the original image nodes whose color Cycles divides by their alpha.
        groups: the copies made so far, by the full name of what they copy.
        temporary: removes them.
    """

    bake_pass: BakePass
    numbers: Collection[str]
    divided: Collection[int]
    groups: dict[str, bpy.types.NodeTree]
    temporary: ExitStack


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


def emission_copy(
    material: bpy.types.Material, bake_pass: BakePass, numbers: Collection[str], temporary: ExitStack
) -> bpy.types.Material:
    """A copy of a material whose shaders, in its node groups too, are emissions; mixes of them stay.

    Base color over weight is the color of a mix with transparent shaders, however they are nested.

    Args:
        numbers: names of the mesh's attributes that have fewer values than a color.
        temporary: removes the copy, and those of the groups.
    """
    copy = material.copy()
    temporary.callback(bpy.data.materials.remove, copy)
    tree = copy.node_tree
    output = active_output(tree)
    if output is not None:
        for other in [each for each in tree.nodes if each.type == "OUTPUT_MATERIAL" and each != output]:
            tree.nodes.remove(other)
        output.target = "ALL"
        for name in ("Volume", "Displacement"):
            for link in list(output.inputs[name].links):
                tree.links.remove(link)
    pointers = {place.node.as_pointer() for place in divided(material)}
    _convert(tree, material.node_tree, _Task(bake_pass, numbers, pointers, {}, temporary))
    return copy


def _convert(tree: bpy.types.NodeTree, original: bpy.types.NodeTree, task: _Task) -> None:
    """Replaces the shaders of a tree, the copy of another."""
    for link in list(tree.links):
        if link.is_muted or not link.is_valid:
            tree.links.remove(link)
    for node in original.nodes:
        if node.as_pointer() in task.divided:
            _use_alpha(tree, tree.nodes[node.name])
    for link in list(tree.links):
        # A color at a shader's place emits by itself.
        if link.to_socket.type == "SHADER" and link.from_socket.type != "SHADER":
            _emission(tree, link.from_socket, [link.to_socket])
    for node in list(tree.nodes):
        if node.type == "SHADERTORGB":
            _pass_color(tree, node)
    kept = _KEPT | {"EMISSION"} if task.bake_pass is BakePass.COLOR else _KEPT
    for node in list(tree.nodes):
        if node.mute:
            continue
        shader = next((socket for socket in node.outputs if socket.type == "SHADER"), None)
        if node.type == "GROUP" and node.node_tree is not None:
            node.node_tree = _group(node.node_tree, task)
        elif node.type == "VERTEX_COLOR" and node.layer_name in task.numbers:
            _read_number(tree, node)
        elif node.type == "MIX_SHADER":
            _clamp(tree, node.inputs[0], node.inputs[0], _LEAST_SHARE, 1 - _LEAST_SHARE)
        elif shader is not None and node.type not in kept:
            _replace(tree, node, shader, task.bake_pass)


def _group(tree: bpy.types.NodeTree, task: _Task) -> bpy.types.NodeTree:
    key = tree.name_full
    if key not in task.groups:
        task.groups[key] = tree.copy()
        task.temporary.callback(bpy.data.node_groups.remove, task.groups[key])
        _convert(task.groups[key], tree, task)
    return task.groups[key]


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


def _replace(tree: bpy.types.NodeTree, node: bpy.types.Node, output: bpy.types.NodeSocket, bake_pass: BakePass) -> None:
    targets = [link.to_socket for link in output.links]
    color = _emission(tree, None, targets)
    if bake_pass is BakePass.COLOR:
        wanted = color_of(node)
        if wanted is not None:
            _take_over(tree, wanted, color)
        if only_emits(node):
            _take_over(tree, node.inputs["Emission Strength"], color.node.inputs["Strength"])
        if "Alpha" in node.inputs and node.inputs["Alpha"].is_linked:
            _keep_in_use(tree, node.inputs["Alpha"].links[0].from_socket, color.node.inputs["Strength"])
    elif node.type not in TRANSPARENT:
        weights = tree.nodes.new("ShaderNodeCombineColor")
        tree.links.new(weights.outputs[0], color)
        weights.inputs["Red"].default_value = weights.inputs["Green"].default_value = 1
        if "Alpha" in node.inputs:
            _clamp(tree, node.inputs["Alpha"], weights.inputs["Green"], 0, 1)
    tree.nodes.remove(node)


def _keep_in_use(tree: bpy.types.NodeTree, alpha: bpy.types.NodeSocket, strength: bpy.types.NodeSocket) -> None:
    """As _use_alpha, whatever lies between the image and the shader's Alpha."""
    one = tree.nodes.new("ShaderNodeMath")
    one.operation = "MULTIPLY_ADD"
    one.inputs[1].default_value = _NEXT_TO_NOTHING
    _take_over(tree, strength, one.inputs[2])
    tree.links.new(alpha, one.inputs[0])
    tree.links.new(one.outputs[0], strength)


def _use_alpha(tree: bpy.types.NodeTree, image: bpy.types.Node) -> None:
    """Cycles divides an image's color by its alpha only where the alpha is used too: here it is added to the color."""
    color, alpha = image.outputs["Color"], image.outputs["Alpha"]
    links = list(color.links)
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "ADD"
    share, first, second = (socket for socket in mix.inputs if socket.enabled)
    share.default_value = _NEXT_TO_NOTHING
    tree.links.new(color, first)
    tree.links.new(alpha, second)
    for link in links:
        tree.links.new(next(socket for socket in mix.outputs if socket.enabled), link.to_socket)


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
