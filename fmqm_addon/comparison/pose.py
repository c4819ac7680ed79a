# SPDX-License-Identifier: GPL-3.0-or-later
"""The pose in which an asset was measured."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Pose:
    """When an asset that moves was measured.

    Attributes:
        frame: None where nothing moves it: the pose that its file gives without a clip.
        clips: names of the actions that move it, as far as they have some.
    """

    frame: int | None = None
    clips: tuple[str, ...] = ()

    def __str__(self) -> str:
        if self.frame is None:
            return "rest"
        return f"frame {self.frame}" + (f" of {', '.join(self.clips)}" if self.clips else "")

    def differs(self, other: Pose) -> bool:
        """Whether two assets may stand differently. Kinds of files put the object before the clip: "Rig|Walk"."""
        mine, its = ({name.rpartition("|")[2].lower() for name in pose.clips} for pose in (self, other))
        return self.frame != other.frame or bool(mine and its and not mine & its)


def pose_warnings(reference: str, reference_pose: Pose, distorted: str, distorted_pose: Pose) -> tuple[str, ...]:
    """What is to be said where two poses differ."""
    if not reference_pose.differs(distorted_pose):
        return ()
    return (
        f"{distorted} was measured in another pose ({distorted_pose}) than {reference} ({reference_pose}); what moves "
        "between the two lowers the score",
    )
