# SPDX-License-Identifier: GPL-3.0-or-later
"""What renders show of an object otherwise than viewports: modifiers, and how finely they divide."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import bpy

OWN_DATA = "FMQM render levels"  # what the data of duplicates is called that is not the original's
_LEVELS = {  # of modifiers by their types: where a viewport's level is and a render's
    "SUBSURF": ("levels", "render_levels"),
    "MULTIRES": ("levels", "render_levels"),
    "SCREW": ("steps", "render_steps"),
    "OCEAN": ("viewport_resolution", "resolution"),
}
_RESOLUTIONS = {  # of data by the types of objects
    "CURVE": (("resolution_u", "render_resolution_u"), ("resolution_v", "render_resolution_v")),
    "SURFACE": (("resolution_u", "render_resolution_u"), ("resolution_v", "render_resolution_v")),
    "FONT": (("resolution_u", "render_resolution_u"),),
    "META": (("resolution", "render_resolution"),),
}
_SUBDIVIDED = ("SUBSURF", "MULTIRES")  # which simplifying the scene limits


def differs_in_renders(object_: bpy.types.Object) -> bool:
    """Whether a viewport shows an object's own surface otherwise than renders do."""
    return bool(_modifiers(object_)) or bool(_data(object_))


def set_render_levels(duplicates: Sequence[bpy.types.Object]) -> None:
    """Makes viewports show duplicates as renders do; data that must change for that becomes their own.

    Metaballs must have names of their own: Blender gives the resolution of one to all that flow together by name.
    """
    changed = {each: found for each in duplicates if (found := _data(each))}
    for object_ in changed:
        object_.data = object_.data.copy()
        object_.data.name = OWN_DATA
    for object_, resolutions in changed.items():
        for viewport, render in resolutions:
            setattr(object_.data, viewport, getattr(object_.data, render))
    for modifier in (modifier for object_ in duplicates for modifier in object_.modifiers):
        modifier.show_viewport = modifier.show_render
        viewport, render = _LEVELS.get(modifier.type, ("", ""))
        if viewport:
            setattr(modifier, viewport, getattr(modifier, render))


def render_notes(objects: Iterable[bpy.types.Object]) -> tuple[str, ...]:
    """A sentence for each object that is measured otherwise than a viewport shows it."""
    return tuple(
        f"{object_.name}: measured as rendered, which differs from the viewport in {', '.join(what)}"
        for object_ in objects
        if (what := _what_differs(object_))
    )


def viewport_notes(instances: Iterable[bpy.types.Object]) -> tuple[str, ...]:
    """The same of objects of instanced collections, of which Blender gives Python only what viewports show."""
    return tuple(
        f"{object_.name}: its instances are measured as the viewport shows them, which differs from renders in "
        f"{', '.join(what)}; make them real to measure what is rendered"
        for object_ in instances
        if (what := _what_differs(object_))
    )


def _what_differs(object_: bpy.types.Object) -> list[str]:
    return [*_modifiers(object_), *(["its resolution"] if _data(object_) else [])]


def _modifiers(object_: bpy.types.Object) -> list[str]:
    """Names of the modifiers that are not the same in renders."""
    return [each.name for each in object_.modifiers if _differs(each)]


def _differs(modifier: bpy.types.Modifier) -> bool:
    if modifier.show_viewport != modifier.show_render:
        return True
    if not modifier.show_render or modifier.type not in _LEVELS:
        return False
    viewport, render = (int(getattr(modifier, name)) for name in _LEVELS[modifier.type])
    scene = bpy.context.scene.render
    if modifier.type in _SUBDIVIDED and scene.use_simplify:
        viewport = min(viewport, scene.simplify_subdivision)
        render = min(render, scene.simplify_subdivision_render)
    return viewport != render


def _data(object_: bpy.types.Object) -> list[tuple[str, str]]:
    """The resolutions of an object's data that are not the same in renders, where 0 is the viewport's."""
    return [
        (viewport, render)
        for viewport, render in _RESOLUTIONS.get(object_.type, ())
        if getattr(object_.data, render) not in (0, getattr(object_.data, viewport))
    ]
