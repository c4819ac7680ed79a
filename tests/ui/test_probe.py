# SPDX-License-Identifier: GPL-3.0-or-later
"""The value under the mouse, held against rays and distances taken one by one; and the handles of the legend."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector
from mathutils.bvhtree import BVHTree

from fmqm_addon.report.visual.heat_map import UNCOVERED, patches_at
from fmqm_addon.ui import session
from fmqm_addon.ui.view import heat
from fmqm_addon.ui.view.legends import BELOW, HIGH, LOW, moved
from fmqm_addon.ui.view.probe import Probed, lines_of, probe
from fmqm_addon.ui.view.result import world_matrix
from tests.ui.test_look import measured, scene  # noqa: F401 fixtures

REGION = SimpleNamespace(width=400, height=300)
LOD_AT = Vector((11.0, 2.0, 3.0))  # its middle, about


def view_from(turn: tuple[float, float, float], perspective: bool, at: Vector) -> SimpleNamespace:
    """A view that looks at a place from 6 units away; matrices as Blender has them."""
    view = Matrix.Translation((0, 0, -6)) @ Euler(turn).to_matrix().to_4x4().inverted() @ Matrix.Translation(-at)
    near, far, half = 0.1, 100.0, REGION.height / REGION.width
    if perspective:
        window = Matrix(
            ((2, 0, 0, 0), (0, 2 / half, 0, 0), (0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)),
             (0, 0, -1, 0))
        )  # fmt: skip
    else:
        window = Matrix(
            ((1 / 3, 0, 0, 0), (0, 1 / (3 * half), 0, 0), (0, 0, -2 / (far - near), -(far + near) / (far - near)),
             (0, 0, 0, 1))
        )  # fmt: skip
    kind = "PERSP" if perspective else "ORTHO"
    return SimpleNamespace(
        view_matrix=view, window_matrix=window, perspective_matrix=window @ view, is_perspective=perspective,
        view_perspective=kind,
    )  # fmt: skip


def naive(measured: session.Measured, view: SimpleNamespace, at: tuple[float, float]) -> Probed | None:  # noqa: F811
    """From near to far through the pixel, against both surfaces as they stand in the world."""
    place = Vector((2 * at[0] / REGION.width - 1, 2 * at[1] / REGION.height - 1, 0, 1))
    ends = []
    for depth in (-1.0, 1.0):
        place.z = depth
        point = view.perspective_matrix.inverted() @ place
        ends.append(point.xyz / point.w)
    found = []
    for where in (heat.ORIGINAL, heat.LOD):
        surface, result, fields = heat.surface_at(measured, where)
        into = world_matrix(measured, where)
        stood = surface.vertices @ into[:3, :3].T + into[:3, 3]
        hit = BVHTree.FromPolygons(stood.tolist(), surface.triangles.tolist()).ray_cast(ends[0], ends[1] - ends[0])
        if hit[0] is not None:
            in_frame = np.linalg.inv(into) @ (*hit[0], 1)
            patch = int(patches_at(in_frame[None, :3], result, fields)[0])
            found.append((hit[3], Probed(where == heat.ORIGINAL, patch)))
    return min(found, key=lambda each: each[0])[1] if found else None


@pytest.mark.parametrize("perspective", [False, True], ids=["orthographic", "perspective"])
@pytest.mark.parametrize("turn", [(1.2, 0.1, 0.5), (np.pi / 2, 0, -np.pi / 2)], ids=["aslant", "one behind the other"])
def test_the_probe_says_what_is_foremost(
    scene: bpy.types.Scene,  # noqa: F811
    measured: session.Measured,  # noqa: F811
    turn: tuple[float, float, float],
    perspective: bool,
) -> None:
    scene.fmqm.look.show = "SURFACE"
    view = view_from(turn, perspective, LOD_AT)
    pixels = [(x, y) for x in range(120, 300, 25) for y in range(80, 230, 25)]
    found = [probe(scene, REGION, view, at) for at in pixels]
    assert found == [naive(measured, view, at) for at in pixels]
    assert sum(each is not None for each in found) > 8 and None in found


def test_the_probe_tells_the_judges_score_and_features(
    scene: bpy.types.Scene,  # noqa: F811
    measured: session.Measured,  # noqa: F811
) -> None:
    scene.fmqm.look.show = "SURFACE"
    result = measured.comparison.result
    for judge, names in (("FMQM", ("FMQM", "geoSSIM")), ("PERCEIVED", ("perceived", "shape"))):
        scene.fmqm.judge = judge
        lines = lines_of(scene, Probed(False, 3))
        assert len(lines) == 6 and lines[0] == "LOD, patch 3"
        for name, line in zip(names, lines[1:], strict=False):
            assert line.lower() == f"{name.lower()} {result.of_patches(name)[3]:.3f}"
    assert lines_of(scene, Probed(True, UNCOVERED)) == ["Original: not measured here"]
    scene.fmqm.look.show = "OFF"
    assert lines_of(scene, Probed(False, 3)) == []
    assert probe(scene, REGION, view_from((1.2, 0.1, 0.5), False, LOD_AT), (200, 150)) is None


def test_a_handle_follows_the_mouse_and_stays_in_order() -> None:
    """Moving by half of the bar moves the score by half of the range that it had when the drag began."""
    before = (0.6, 1.0, 0.8)
    assert moved(LOW, before, 0.5) == pytest.approx((0.8, 1.0, 0.8))
    assert moved(LOW, before, -0.5) == pytest.approx((0.4, 1.0, 0.8)), "beyond the bar, too"
    assert moved(HIGH, before, -0.25) == pytest.approx((0.6, 0.9, 0.8))
    assert moved(BELOW, before, 0.25) == pytest.approx((0.6, 1.0, 0.9))
    for share in (-9, 9):
        for end in (LOW, HIGH, BELOW):
            low, high, below = moved(end, before, share)
            assert 0 <= low < high <= 1 and 0 <= below <= 1
