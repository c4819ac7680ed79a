# SPDX-License-Identifier: GPL-3.0-or-later
"""How materials are read, and what a read one is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from ...comparison.surface_facts import Fact
from ...metric.errors import SettingsError
from ...metric.texture import ImageFacts, Material, Texture
from ..access import ANYWHERE, Access
from .image_headers import DEFAULT_LIMITS, ImageLimits

MAX_BAKE = 16384  # pixels a side
MAX_FRAME = 1_048_574  # in either direction


@dataclass(frozen=True)
class Reading:
    """How an asset is read: its looks, and which of its parts in which pose.

    Attributes:
        texture: replaces everything that the materials say.
        bake: side of baked images in pixels; 0 forbids baking.
        stand_in: a missing base-color image is shown in magenta, as Blender shows it, instead of being an error.
        limits: of the images.
        access: which files the asset may name.
        include, exclude: patterns of names, as of files (`*_hull?`), whatever their case: of the objects that are
            measured, of what they hang from or of their collections. No include takes all.
        frame: at which a file's first clip, or a .blend, is measured; None: as it stands without a clip, or was saved.
        normals: the normals at the corners are read, too, for who renders the mesh.

    Raises:
        SettingsError: bake is not between 0 and MAX_BAKE, or frame not one that Blender has.
    """

    texture: Texture | None = None
    bake: int = 1024
    stand_in: bool = False
    limits: ImageLimits = DEFAULT_LIMITS
    access: Access = ANYWHERE
    include: tuple[str, ...] = ()
    exclude: tuple[str, ...] = ()
    frame: int | None = None
    normals: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.bake <= MAX_BAKE:
            raise SettingsError(f"bake is {self.bake}; it must be between 0 and {MAX_BAKE}")
        if self.frame is not None and abs(self.frame) > MAX_FRAME:
            raise SettingsError(f"frame is {self.frame}; it must be between {-MAX_FRAME} and {MAX_FRAME}")

    @property
    def facts(self) -> tuple[Fact, ...]:
        """What a trust report says of it: facts that are known before a pair is compared."""
        return (Fact("baked_at", self.bake, "pixels a side of what is baked; 0 forbids it"),)


@dataclass(frozen=True)
class MeshLayer:
    """What a material wants of a mesh: a UV map (2 channels of MeshArrays.corners) or a color attribute (4, linear
    RGBA). The name "" is the mesh's one that is active for rendering."""

    kind: Literal["uv", "color"]
    name: str

    @property
    def width(self) -> int:
        """How many channels it has."""
        return {"uv": 2, "color": 4}[self.kind]


@dataclass(frozen=True)
class Look:
    """A material that was read.

    Attributes:
        material: its samplers read the channels of MeshArrays.corners, layer after layer in the order of layers.
        layers: what the mesh must offer.
        warnings: what was assumed, so that a score may mislead. notes: what was done that misleads nobody. Both name
            the material.
    """

    material: Material
    layers: tuple[MeshLayer, ...]
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Unread:
    """A material that must be baked: the node that is not read, what about it (a verb phrase), the images that are
    used, and what is to be said of them, as of a Look."""

    node: str
    why: str
    images: tuple[ImageFacts, ...] = ()
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
