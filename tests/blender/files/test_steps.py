# SPDX-License-Identifier: GPL-3.0-or-later
"""How long a step of the stepper takes: the window is drawn, and Esc is heard, between two of them."""

from __future__ import annotations

import time
from pathlib import Path

import bpy
import pytest

from fmqm_addon.blender.files.load import load_mesh
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.comparison.measurement import Measurement
from fmqm_addon.metric.geometry import Floats, Ints
from fmqm_addon.metric.settings import Settings

LONGEST = 0.02  # of the whole: twice what it is on a quiet machine, and far below what a loop left uncut takes
RUNS = 2  # the same steps; what else the machine does does not strike the same one twice


def test_steps_are_short_on_a_large_asset(
    shared_data: Path, monkeypatch: pytest.MonkeyPatch, record_property: pytest.RecordProperty
) -> None:
    """180,000 faces, the paper's settings; building a tree apart, which cannot be cut."""
    if bpy.app.version >= (5, 0):
        pytest.skip("the wheel of this Blender has no Draco decoder")
    mesh = load_mesh(str(shared_data / "chess_board" / "chess_board_draco.glb"))
    assert len(mesh.triangles) > 170_000
    in_trees = [0.0]
    build = BVHQuery.__init__

    def timed(self: BVHQuery, vertices: Floats, triangles: Ints) -> None:
        began = time.thread_time()
        build(self, vertices, triangles)
        in_trees[0] += time.thread_time() - began

    monkeypatch.setattr(BVHQuery, "__init__", timed)
    runs: list[list[tuple[float, str]]] = []
    for _ in range(RUNS):
        measurement = Measurement(mesh, BVHQuery, Settings())
        steps = []
        for stepper in (measurement.prepare(), measurement.compare(mesh)):
            more = True
            while more:
                began, trees = time.thread_time(), in_trees[0]
                more = stepper.step()
                spent = time.thread_time() - began - (in_trees[0] - trees)
                steps.append((spent, f"{stepper.progress.stage} {stepper.progress.done:.3f}"))
        runs.append(steps)
    best = sorted(min(same) for same in zip(*runs, strict=True))
    record_property("longest", best[-1][0])
    print(f"longest of {len(best)}:", [(round(seconds, 3), where) for seconds, where in best[-5:]])
    assert best[-1][0] < LONGEST * sum(seconds for seconds, _ in best), best[-1]
