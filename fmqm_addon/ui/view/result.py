# SPDX-License-Identifier: GPL-3.0-or-later
"""The chosen row's result, and where it stands in the world."""

from __future__ import annotations

import bpy
import numpy as np

from ...metric.errors import FMQMError
from ...metric.geometry import Floats
from .. import session
from ..properties.rows import FMQMRow, active_row
from ..properties.view import FMQMLook

POINT = 1.1  # usual radius of a point, in mean distances between neighbors
AGAIN = "the samples are not in memory any longer; press Measure Quality again"


def look_of(scene: bpy.types.Scene) -> FMQMLook:
    look: FMQMLook = scene.fmqm.look
    return look


def measured_row(scene: bpy.types.Scene) -> tuple[str, str, session.Measured]:
    """Identifier and name of the chosen row, and what it was computed from.

    Raises:
        FMQMError: no row, or its samples are gone.
    """
    row = active_row(scene)
    if row is None:
        raise FMQMError("there is no result yet; press Measure Quality first")
    measured = session.get(row.uid)
    if measured is None:
        raise FMQMError(f"{row.name}: {'it could not be measured' if row.error else AGAIN}")
    return row.uid, row.name, measured


def showable(scene: bpy.types.Scene) -> FMQMRow | None:
    """The chosen row, if it can be shown: its samples are in memory, and what it measured has not changed since."""
    row = active_row(scene)
    return None if row is None or row.uid in session.stale or session.get(row.uid) is None else row


def why_not(scene: bpy.types.Scene) -> str:
    """Why there is nothing to look at, and what to do; "" where there is."""
    row = active_row(scene)
    if row is None:
        return "There is no result yet; press Measure Quality first"
    if row.error:
        return f"{row.name} could not be measured"
    if session.get(row.uid) is None:
        return f"{row.name}: {AGAIN}"
    return session.stale.get(row.uid, "")


def world_matrix(measured: session.Measured, place: str) -> Floats:
    """(4, 4) from the metric's frame to where a row's compared object (COMPARED) or its reference stands."""
    frame = measured.reference.frame
    into = np.eye(4)
    into[:3, :3] *= frame.scale
    into[:3, 3] = frame.center
    to_world = measured.distorted_to_world if place == "COMPARED" else measured.reference_to_world
    matrix: Floats = np.asarray(to_world, np.float64) @ into
    return matrix


def world_length(measured: session.Measured) -> float:
    """Scene units of the metric's unit, the reference's diagonal."""
    matrix = world_matrix(measured, "REFERENCE")
    return float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))
