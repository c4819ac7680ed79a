# SPDX-License-Identifier: GPL-3.0-or-later
"""Which buttons can be pressed, and what the grey ones say."""

from __future__ import annotations

import bpy

from ...metric.errors import FMQMError
from ..view.result import measured_row, why_not


def allowed(cls: type, why: str) -> bool:
    """What poll answers: whether nothing speaks against it; the tooltip of a grey button says what does."""
    if why:
        cls.poll_message_set(why)  # type: ignore[attr-defined]
    return not why


def no_rows(context: bpy.types.Context) -> str:
    """Why no result can be used; "" where there are some."""
    return "" if context.scene.fmqm.rows else "Nothing has been measured yet"


def no_samples(context: bpy.types.Context) -> str:
    """Why the samples of the chosen row cannot be shown; "" where they can."""
    try:
        measured_row(context.scene)
    except FMQMError as reason:
        text = str(reason)
        return text[:1].upper() + text[1:]
    return ""


def no_viewport(context: bpy.types.Context) -> str:
    """Why the mouse cannot point at samples; "" where it can."""
    if context.area is None or context.area.type != "VIEW_3D":
        return "Needs a 3D viewport"
    return no_samples(context)


def cannot_compare(context: bpy.types.Context) -> str:
    """Why a view cannot show the two of the chosen row as they are now; "" where it can."""
    reason = no_viewport(context) or why_not(context.scene)
    return reason[:1].upper() + reason[1:]


class OfRows:
    """A part of operators that need results."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return allowed(cls, no_rows(context))
