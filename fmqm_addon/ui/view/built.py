# SPDX-License-Identifier: GPL-3.0-or-later
"""What is drawn over the view is built for a scene's present choices, and built again where these have changed, by
whatever way: a click, undo, another scene. Drawing itself builds nothing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, Protocol, TypeVar

import bpy

from ...blender.display import viewport
from ...metric.errors import FMQMError

Key = tuple[Any, ...]


class Shown(Protocol):
    """What can be built. key: the choices that it was built for. uid: its row."""

    @property
    def key(self) -> Key: ...

    @property
    def uid(self) -> str: ...


T = TypeVar("T", bound="Shown")  # by name: typing remembers it longer than bpy, which keeps Blender 4.5 from ending


class Built(Generic[T]):
    """What is built of one kind, for each scene."""

    def __init__(
        self, wanted: Callable[[bpy.types.Scene], Key | None], build: Callable[[bpy.types.Scene, Key, T | None], T]
    ) -> None:
        """Nothing is built yet.

        Args:
            wanted: the choices that decide what is drawn, or None: nothing is to be. It is asked at each drawing.
            build: is given what there was before, or None. FMQMError: there is nothing to show.
        """
        self._wanted, self._build = wanted, build
        self._by_scene: dict[str, T] = {}  # by name

    def is_current(self, scene: bpy.types.Scene) -> bool:
        """Whether what was built is what is wanted."""
        shown = self._by_scene.get(scene.name)
        return self._wanted(scene) == (None if shown is None else shown.key)

    def shown_in(self, scene: bpy.types.Scene) -> T | None:
        """What is drawn in a scene now."""
        return self._by_scene.get(scene.name) if self.is_current(scene) else None

    def latest_in(self, scene: bpy.types.Scene) -> T | None:
        """What is drawn, or, until that is built, what was of the same row. Keys begin with its uid."""
        key, shown = self._wanted(scene), self._by_scene.get(scene.name)
        return shown if key is not None and shown is not None and key[0] == shown.uid else None

    def refresh(self, scene: bpy.types.Scene) -> None:
        """Builds what is wanted, from what is there already where that fits."""
        key = self._wanted(scene)
        if key is None:
            self._by_scene.pop(scene.name, None)
        elif not self.is_current(scene):
            self._by_scene[scene.name] = self._build(scene, key, self._by_scene.get(scene.name))
        viewport.redraw()

    def refresh_all(self) -> None:
        """Brings what is drawn up to date in all scenes."""
        for scene in bpy.data.scenes:
            try:
                self.refresh(scene)
            except FMQMError:
                self._by_scene.pop(scene.name, None)

    def keep(self, uids: set[str]) -> None:
        """Lets go of what belongs to other rows."""
        self._by_scene = {name: shown for name, shown in self._by_scene.items() if shown.uid in uids}
