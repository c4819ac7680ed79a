# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose in which files are measured."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from fmqm_addon.blender.files.load import load_asset
from fmqm_addon.blender.materials.types import Reading
from fmqm_addon.blender.scene.bvh import BVHQuery
from fmqm_addon.blender.scene.target import take, target_of
from fmqm_addon.comparison.alignment import AssetMesh
from fmqm_addon.comparison.pair import PairOptions, comparing_pair, measurement_of
from fmqm_addon.comparison.pose import Pose
from fmqm_addon.metric.settings import Settings
from tests.blender import scenes

FEW = PairOptions(settings=Settings(samples=600, patches=10))
STANDS, TOP = 7, 2.0  # the frame at which a file is written; the height of a straight arm
EXPORTERS: dict[str, Callable[[str], object]] = {
    "glb": lambda path: bpy.ops.export_scene.gltf(filepath=path),
    "fbx": lambda path: bpy.ops.export_scene.fbx(filepath=path, add_leaf_bones=False),
    "usdc": lambda path: bpy.ops.wm.usd_export(filepath=path, export_animation=True),
    "abc": lambda path: bpy.ops.wm.alembic_export(filepath=path, start=1, end=11),
}


def arm(bends: bool) -> bpy.types.Object:
    """A post, 2 high, whose upper half bends from frame 1 to 11 and stands straight at STANDS, and without a clip."""
    bones = bpy.data.armatures.new("Bones")
    rig = bpy.data.objects.new("Rig", bones)
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    lower, upper = bones.edit_bones.new("Lower"), bones.edit_bones.new("Upper")
    lower.head, lower.tail, upper.head, upper.tail = (0, 0, 0), (0, 0, 1), (0, 0, 1), (0, 0, 2)
    upper.parent = lower
    bpy.ops.object.mode_set(mode="OBJECT")
    post = scenes.cube("Post")
    corners = np.empty(24, np.float32)
    post.data.vertices.foreach_get("co", corners)
    corners = corners.reshape(-1, 3)
    corners -= corners.min(axis=0)
    corners *= np.array([0.2, 0.2, 2.0]) / corners.max(axis=0)
    post.data.vertices.foreach_set("co", corners.ravel())
    for name, is_high in (("Lower", False), ("Upper", True)):
        rows = np.flatnonzero((corners[:, 2] > 1) == is_high).tolist()
        post.vertex_groups.new(name=name).add(rows, 1.0, "REPLACE")
    post.parent = rig
    post.modifiers.new("Bones", "ARMATURE").object = rig
    if bends:
        bone = rig.pose.bones["Upper"]
        bone.rotation_mode = "XYZ"
        for frame, angle in ((1, 0.8), (STANDS, 0.0), (11, 1.6)):
            bone.rotation_euler.x = angle
            bone.keyframe_insert("rotation_euler", frame=frame)
        rig.animation_data.action.name = "Bend"
        scene = bpy.context.scene
        scene.frame_start, scene.frame_end = 1, 11
        scene.frame_set(STANDS)
    return post


def written(path: Path, bends: bool) -> str:
    scenes.clear()
    arm(bends)
    EXPORTERS[path.suffix[1:]](str(path))
    return str(path)


def height(asset: AssetMesh) -> float:
    return float(asset.world().positions[:, 2].max())


@pytest.mark.parametrize("kind", ["glb", "fbx"])
def test_without_a_clip_as_the_nodes_stand(tmp_path: Path, kind: str) -> None:
    """Frame 1 of the clip bends it; a file without the clip is the same asset."""
    moving, still = written(tmp_path / f"moving.{kind}", True), written(tmp_path / f"still.{kind}", False)
    one, other = load_asset(moving), load_asset(still)
    assert one.pose == other.pose == Pose() and str(one.pose) == "rest"
    assert abs(height(one) - TOP) < 1e-3
    np.testing.assert_allclose(one.world().positions, other.world().positions, atol=1e-4)
    assert one.mesh.notes == other.mesh.notes == ("Post: there is no material; Blender's default grey is taken",)


@pytest.mark.parametrize("kind", ["glb", "fbx"])
def test_a_frame_of_the_first_clip(tmp_path: Path, kind: str) -> None:
    moving = written(tmp_path / f"moving.{kind}", True)
    frames = [load_asset(moving, Reading(frame=frame)) for frame in (0, 1, 6, 10, 11)]
    heights = [height(asset) for asset in frames]
    assert max(heights) - min(heights) > 0.3
    assert [asset.pose.frame for asset in frames] == [0, 1, 6, 10, 11]
    assert all("Bend" in str(asset.pose) for asset in frames)


@pytest.mark.parametrize("kind", ["usdc", "abc"])
def test_values_over_time_at_their_first_frame(tmp_path: Path, kind: str) -> None:
    moving = written(tmp_path / f"moving.{kind}", True)
    first, straight = load_asset(moving), load_asset(moving, Reading(frame=STANDS))
    assert first.pose.frame == 1 and height(first) < TOP - 0.1
    assert "first frame, 1" in " ".join(first.mesh.notes)
    assert straight.pose.frame == STANDS and abs(height(straight) - TOP) < 1e-3


def test_a_blend_as_it_was_saved_and_the_scene_as_it_is_shown(tmp_path: Path) -> None:
    post = arm(True)
    assert take(target_of(post)).pose == Pose(STANDS, ("Bend",))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "asset.blend"))
    saved = load_asset(str(tmp_path / "asset.blend"))
    assert saved.pose == Pose(STANDS, ("Bend",)) and abs(height(saved) - TOP) < 1e-3
    bent = load_asset(str(tmp_path / "asset.blend"), Reading(frame=1))
    assert bent.pose.frame == 1 and height(bent) < TOP - 0.1


def test_a_frame_of_what_does_not_move_is_noted(tmp_path: Path) -> None:
    still = load_asset(written(tmp_path / "still.glb", False), Reading(frame=5))
    assert still.pose == Pose() and "nothing in it moves" in still.mesh.notes[0]


@pytest.mark.parametrize(
    ("one", "other", "differs"),
    [
        (Pose(), Pose(), False),
        (Pose(), Pose(1, ("Walk",)), True),
        (Pose(1, ("Walk",)), Pose(2, ("Walk",)), True),
        (Pose(1, ("Walk",)), Pose(1, ("Rig|walk",)), False),
        (Pose(1, ("Walk",)), Pose(1, ("Run",)), True),
        (Pose(1, ("Walk",)), Pose(1), False),
    ],
)
def test_poses_that_differ(one: Pose, other: Pose, differs: bool) -> None:
    assert one.differs(other) == other.differs(one) == differs


def test_poses_are_facts_and_a_difference_is_warned_of(tmp_path: Path) -> None:
    moving = written(tmp_path / "moving.glb", True)
    rest, bent = load_asset(moving), load_asset(moving, Reading(frame=1))
    measurement = measurement_of(rest, BVHQuery, FEW)
    measurement.prepare().run()
    same = comparing_pair(measurement, rest, rest, FEW).run()
    assert same.comparison.scores.FMQM == 1 and not any("pose" in warning for warning in same.warnings)
    other = comparing_pair(measurement, rest, bent, FEW).run()
    assert any("frame 1 of Bend" in warning and "rest" in warning for warning in other.warnings)
    facts = {fact.name: fact.value for fact in other.comparison.trust.pair}
    assert (facts["pose_of_reference"], facts["pose_of_distorted"]) == ("rest", "frame 1 of Bend")


def test_the_importer_is_left_as_it_was(tmp_path: Path) -> None:
    load_asset(written(tmp_path / "moving.glb", True))
    bpy.ops.import_scene.gltf(filepath=str(tmp_path / "moving.glb"))
    assert bpy.data.actions.get("Bend") is not None


def test_the_animated_arm(shared_data: Path) -> None:
    """Of the shared cases: one mesh, with and without a clip."""
    moving, still = (
        load_asset(str(shared_data / "cases" / "pose" / f"arm_{name}.glb")) for name in ("animated", "static")
    )
    np.testing.assert_allclose(moving.world().positions, still.world().positions, atol=1e-6)
