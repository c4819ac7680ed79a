# SPDX-License-Identifier: GPL-3.0-or-later
"""Temporary copies of materials that shine in their base color: what a baker can draw without light."""

from __future__ import annotations

from contextlib import ExitStack
from enum import Enum

import bpy

from .nodes import active_output, only_shines

# Mixing never hides one of its shaders wholly: what a transparent one covers still has a color.
_LEAST_SHARE = 1e-4
_KEPT = {"MIX_SHADER", "ADD_SHADER", "GROUP", "GROUP_INPUT", "REROUTE"}
_TRANSPARENT = {"BSDF_TRANSPARENT", "HOLDOUT"}


class Shine(Enum):
    """What a copy shines in: its base color, black where a transparent shader is; or red as far as its shader is
    not a transparent one, green as far as it is opaque in all."""

    COLOR = 1
    WEIGHT = 2


def is_opaque(tree: bpy.types.NodeTree) -> bool:
    """Whether none of its nodes, its groups' among them, can make a material transparent."""
    return not any(_lets_through(node) for each in _with_groups(tree) for node in each.nodes)


def _lets_through(node: bpy.types.Node) -> bool:
    alpha = node.inputs.get("Alpha") if any(socket.type == "SHADER" for socket in node.outputs) else None
    return node.type in _TRANSPARENT or (alpha is not None and (alpha.is_linked or alpha.default_value < 1))


def _with_groups(tree: bpy.types.NodeTree) -> list[bpy.types.NodeTree]:
    """The tree and those of its groups, each once."""
    trees = [tree]
    for each in trees:
        inner = [node.node_tree for node in each.nodes if node.type == "GROUP" and node.node_tree is not None]
        trees += [found for found in dict.fromkeys(inner) if found not in trees]
    return trees


def shining(material: bpy.types.Material, shine: Shine, temporary: ExitStack) -> bpy.types.Material:
    """A copy of a material whose shaders, in its node groups too, are emissions; mixes of them stay.

    Base color over weight is the color of a mix with transparent shaders, however they are nested.

    Args:
        temporary: removes the copy, and those of the groups.
    """
    copy = material.copy()
    temporary.callback(bpy.data.materials.remove, copy)
    tree = copy.node_tree
    output = active_output(tree)
    if output is not None:
        output.target = "ALL"
        for name in ("Volume", "Displacement"):
            for link in list(output.inputs[name].links):
                tree.links.remove(link)
    _convert(tree, shine, {}, temporary)
    return copy


def _convert(
    tree: bpy.types.NodeTree, shine: Shine, groups: dict[str, bpy.types.NodeTree], temporary: ExitStack
) -> None:
    """Replaces the shaders of a tree. groups: the copies made so far, by the full name of what they copy."""
    for link in list(tree.links):
        # A color at a shader's place shines by itself.
        if link.to_socket.type == "SHADER" and link.from_socket.type != "SHADER":
            _emission(tree, link.from_socket, [link.to_socket])
    for node in list(tree.nodes):
        if node.type == "SHADERTORGB":
            _pass_color(tree, node)
    for node in list(tree.nodes):
        outputs = [socket for socket in node.outputs if socket.type == "SHADER"]
        if not outputs or node.mute:
            continue
        if node.type == "GROUP" and node.node_tree is not None:
            node.node_tree = _group(node.node_tree, shine, groups, temporary)
        elif node.type == "MIX_SHADER":
            _never_wholly(tree, node.inputs[0])
        elif node.type not in _KEPT and not (node.type == "EMISSION" and shine is Shine.COLOR):
            _replace(tree, node, outputs[0], shine)


def _group(
    tree: bpy.types.NodeTree, shine: Shine, groups: dict[str, bpy.types.NodeTree], temporary: ExitStack
) -> bpy.types.NodeTree:
    key = tree.name_full
    if key not in groups:
        groups[key] = tree.copy()
        temporary.callback(bpy.data.node_groups.remove, groups[key])
        _convert(groups[key], shine, groups, temporary)
    return groups[key]


def _pass_color(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Shader to RGB, which Cycles lacks: the color of the shader before it, as if in full light."""
    link = next(iter(node.inputs[0].links), None)
    wanted = None if link is None else _color_of(link.from_node)
    if wanted is None:
        return
    passed = tree.nodes.new("ShaderNodeGamma")  # of 1: hands a color on
    _take_over(tree, wanted, passed.inputs["Color"])
    for each in list(node.outputs["Color"].links):
        tree.links.new(passed.outputs[0], each.to_socket)


def _color_of(shader: bpy.types.Node) -> bpy.types.NodeSocket | None:
    if only_shines(shader):
        return shader.inputs["Emission Color"]
    return shader.inputs.get("Base Color") or shader.inputs.get("Color")


def _never_wholly(tree: bpy.types.NodeTree, factor: bpy.types.NodeSocket) -> None:
    if not factor.is_linked:
        factor.default_value = min(max(factor.default_value, _LEAST_SHARE), 1 - _LEAST_SHARE)
        return
    clamp = tree.nodes.new("ShaderNodeClamp")
    clamp.inputs["Min"].default_value, clamp.inputs["Max"].default_value = _LEAST_SHARE, 1 - _LEAST_SHARE
    tree.links.new(factor.links[0].from_socket, clamp.inputs["Value"])
    tree.links.new(clamp.outputs[0], factor)


def _replace(tree: bpy.types.NodeTree, node: bpy.types.Node, output: bpy.types.NodeSocket, shine: Shine) -> None:
    targets = [link.to_socket for link in output.links]
    color = _emission(tree, None, targets)
    if shine is Shine.COLOR:
        wanted = _color_of(node)
        if node.type not in _TRANSPARENT and wanted is not None:
            _take_over(tree, wanted, color)
        if only_shines(node):
            _take_over(tree, node.inputs["Emission Strength"], color.node.inputs["Strength"])
        if "Alpha" in node.inputs and node.inputs["Alpha"].is_linked:
            _keep_in_use(tree, node.inputs["Alpha"].links[0].from_socket, color.node.inputs["Strength"])
    elif node.type not in _TRANSPARENT:
        weights = tree.nodes.new("ShaderNodeCombineColor")
        tree.links.new(weights.outputs[0], color)
        weights.inputs["Red"].default_value = weights.inputs["Green"].default_value = 1
        if "Alpha" in node.inputs:
            _take_over(tree, node.inputs["Alpha"], weights.inputs["Green"])
    tree.nodes.remove(node)


def _keep_in_use(tree: bpy.types.NodeTree, alpha: bpy.types.NodeSocket, strength: bpy.types.NodeSocket) -> None:
    """Cycles divides an image's color by its alpha only where the alpha is used too."""
    one = tree.nodes.new("ShaderNodeMath")
    one.operation = "MULTIPLY_ADD"
    one.inputs[1].default_value = 1e-7
    _take_over(tree, strength, one.inputs[2])
    tree.links.new(alpha, one.inputs[0])
    tree.links.new(one.outputs[0], strength)


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
    """What the old socket has: its link, else its value."""
    if old.is_linked:
        tree.links.new(old.links[0].from_socket, new)
    else:
        new.default_value = old.default_value
