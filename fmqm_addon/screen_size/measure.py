# SPDX-License-Identifier: GPL-3.0-or-later
"""Screen sizes of LODs: a reference, rendered once, and each LOD against it, in steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..comparison.normals import corner_normals
from ..metric.colorspace import encode_srgb
from ..metric.errors import MeshError, SettingsError
from ..metric.geometry import Floats, Ints
from ..metric.stepper import Progress, Stepper, Work, as_part
from ..metric.surface import Frame, MeshArrays, QueryBuilder, Surface, preparing_surface
from .definition import (
    CONDITIONS,
    FADE,
    FIRST_RENDER,
    OPAQUE,
    PIXELS_PER_DEGREE,
    RENDER,
    SIZES,
    SMOOTH_ANGLE,
    STRICT,
    VIEW_CHOICES,
    VIEWS,
    Limits,
)
from .flip import Appearance, appearance, flip_map
from .mipmaps import Mipmaps
from .render import View, render
from .ssim import Structure, ssim_map, structure
from .views import camera_axes, fibonacci_directions

_FROM_FIRST = tuple(size for size in SIZES if 4 * size <= FIRST_RENDER)  # at least 4 by 4 samples a pixel
_SEE_THROUGH = (
    "some material of the two is see-through: only what is at least half opaque is rendered, and as if it were solid"
)
_REACH = 16  # pixels around an object that its image's comparison sees
_GRID = 16  # images are cut to multiples of so many pixels, so that those of the reference are used again


@dataclass(frozen=True)
class AtSize:
    """How much the images of two meshes differ at one size.

    Attributes:
        size: h, the pixels that the reference's box diagonal spans.
        flip, dissimilarity: (conditions, views) float64, means over the object's pixels of FLIP and of 1 - SSIM.
    """

    size: int
    flip: Floats
    dissimilarity: Floats

    def difference(self, limits: Limits) -> float:
        """D: 1 where the images differ as much as is allowed. Means over the views, the worse condition."""
        return max(
            float(self.flip.mean(axis=1).max()) / limits.flip,
            float(self.dissimilarity.mean(axis=1).max()) / limits.ssim,
        )

    def worst_view(self, limits: Limits) -> tuple[int, float]:
        """The view with the largest difference, and that difference."""
        each = np.maximum(self.flip.max(axis=0) / limits.flip, self.dissimilarity.max(axis=0) / limits.ssim)
        return int(each.argmax()), float(each.max())


@dataclass(frozen=True)
class Switch:
    """The largest size at which an LOD may stand for its reference.

    Attributes:
        pixels: of the reference's box diagonal. The largest of SIZES where "at least", the smallest where "below".
        bound: "at least" where it never fails, "below" where it always does, "" between.
        worst: the view that is worst at the first size that fails, or at the largest.
    """

    pixels: float
    bound: str
    worst: int

    @property
    def label(self) -> str:
        return f"{self.bound} {self.pixels:.0f}".strip()


@dataclass(frozen=True)
class ScreenSize:
    """What came of one LOD.

    Attributes:
        curve: from the smallest size to the first at which it fails by any limits, or the largest.
        strict: for a hard pop. fade: for a dithered one; never below strict.
        notes: what should be known of the renders.
    """

    curve: tuple[AtSize, ...]
    strict: Switch
    fade: Switch
    notes: tuple[str, ...] = ()


class ScreenSizes:
    """A reference, rendered once for any number of LODs.

    Args:
        views: how many, of definition.VIEW_CHOICES.
        build_query: makes the spatial query of the reference, for who aligns LODs with it; rendering needs none.

    Raises:
        SettingsError: views is another number.
    """

    def __init__(self, reference: MeshArrays, views: int = VIEWS, build_query: QueryBuilder | None = None) -> None:
        if views not in VIEW_CHOICES:
            raise SettingsError(f"views is {views}; it must be {' or '.join(map(str, VIEW_CHOICES))}")
        self._mesh = reference
        self._build_query = build_query or _NoQuery
        self._axes = [camera_axes(direction) for direction in fibonacci_directions(views)]
        self._reference: _Model
        self._seen: dict[tuple[int, int, _Window], tuple[_Seen, ...]] = {}  # of the reference, by view and size

    def prepare(self) -> Stepper[None]:
        """A stepper over preparing the reference, which comes before any LOD."""
        return Stepper(self._prepare())

    def measure(self, mesh: MeshArrays) -> Stepper[ScreenSize]:
        """A stepper over finding the sizes of an LOD, in the reference's world; its normals are used if it has any.

        Raises:
            MeshError, while stepping: it cannot be rendered, or all of the reference is see-through.
        """
        return Stepper(self._measure(mesh))

    @property
    def reference(self) -> Surface:
        """The prepared reference; only after prepare()."""
        return self._reference.surface

    def _prepare(self) -> Work[None]:
        yield Progress("prepare", 0.0)
        self._reference = _Model((yield from _prepared(self._mesh, self._build_query)))

    def _measure(self, mesh: MeshArrays) -> Work[ScreenSize]:
        yield Progress("prepare", 0.0)
        model = _Model((yield from _prepared(mesh, _NoQuery, self._reference.surface.frame)))
        curve = yield from self._curve(model)
        notes = (_SEE_THROUGH,) if self._reference.see_through or model.see_through else ()
        return ScreenSize(curve, switch(curve, STRICT), switch(curve, FADE), notes)

    def _curve(self, model: _Model) -> Work[tuple[AtSize, ...]]:
        """From the smallest size to the first that fails."""
        curve: list[AtSize] = []
        for resolution, sizes in ((FIRST_RENDER, _FROM_FIRST), (RENDER, SIZES[len(_FROM_FIRST) :])):
            for index, axes in enumerate(self._axes):
                yield Progress("render", 0.1)
                self._reference.render(index, axes, resolution, sizes)
                yield Progress("render", 0.1)
                model.render(index, axes, resolution, sizes)
            if not any(self._reference.view(index, sizes[0]).covered.any() for index in range(len(self._axes))):
                name = self._reference.surface.name
                raise MeshError(f"{name}: nothing of it shows, its alpha is below {OPAQUE} all over; unlink its alpha")
            for size in sizes:
                flip, dissimilarity = np.empty((2, len(CONDITIONS), len(self._axes)))
                for index in range(len(self._axes)):
                    yield Progress("compare", 0.1 + 0.9 * len(curve) / len(SIZES))
                    flip[:, index], dissimilarity[:, index] = self._compared(model, index, size)
                curve.append(AtSize(size, flip, dissimilarity))
                if curve[-1].difference(FADE) > 1:
                    return tuple(curve)
        return tuple(curve)

    def _compared(self, model: _Model, index: int, size: int) -> tuple[list[float], list[float]]:
        """FLIP and 1 - SSIM under each condition, in a view."""
        one, other = (each.view(index, size) for each in (self._reference, model))
        mask = _grown((one.covered > 0) | (other.covered > 0))
        if not mask.any():  # seen from there, all of both is see-through
            return [0.0] * len(CONDITIONS), [0.0] * len(CONDITIONS)
        window = _window(mask)
        key = (index, size, window)
        if key not in self._seen:
            self._seen[key] = tuple(_Seen.of(image[window.slices]) for image in one.images)
        inside = mask[window.slices]
        flips, dissimilarities = [], []
        for reference, image in zip(self._seen[key], other.images, strict=True):
            seen = _Seen.of(image[window.slices])
            flips.append(float(flip_map(reference.appearance, seen.appearance)[inside].mean(dtype=np.float64)))
            similar = ssim_map(reference.structure, seen.structure)[inside].mean(dtype=np.float64)
            dissimilarities.append(1 - float(similar))
        return flips, dissimilarities


def switch(curve: Sequence[AtSize], limits: Limits) -> Switch:
    """The largest size with D at most 1 at it and at every smaller one, between sizes by the logarithm.

    Args:
        curve: from the smallest of SIZES on; at its end D is above 1, or all sizes are in it.
    """
    differences = [each.difference(limits) for each in curve]
    failed = next((index for index, difference in enumerate(differences) if difference > 1), None)
    last = curve[-1 if failed is None else failed]
    worst = last.worst_view(limits)[0]
    if failed is None:
        return Switch(float(last.size), "at least", worst)
    if failed == 0:
        return Switch(float(last.size), "below", worst)
    below, above = differences[failed - 1], differences[failed]
    share = (1 - below) / (above - below)
    pixels = curve[failed - 1].size * (last.size / curve[failed - 1].size) ** share
    return Switch(float(pixels), "", worst)


class _Model:
    """A surface and its views, each rendered once."""

    def __init__(self, surface: Surface) -> None:
        self.surface = surface
        self.see_through = False  # as in View: in one that was rendered
        self._normals = corner_normals(surface, SMOOTH_ANGLE)
        self._mipmaps = Mipmaps()
        self._scaled: dict[int, Surface] = {}
        self._views: dict[tuple[int, int], View] = {}

    def render(self, index: int, axes: Floats, resolution: int, sizes: Sequence[int]) -> None:
        """Renders a view at a resolution, for these sizes, unless that is done."""
        if (index, sizes[0]) in self._views:
            return
        if resolution not in self._scaled:
            self._scaled[resolution] = self._mipmaps.for_scale(self.surface, float(resolution))
        size = max(sizes)
        view = render(self._scaled[resolution], self._normals, axes, resolution, resolution // size)
        self.see_through |= view.see_through
        while size >= min(sizes):
            self._views[index, size] = view
            size, view = size // 2, view.halved()

    def view(self, index: int, size: int) -> View:
        """One that was rendered."""
        return self._views[index, size]


@dataclass(frozen=True)
class _Seen:
    """An image as it is compared."""

    appearance: Appearance
    structure: Structure

    @classmethod
    def of(cls, linear: NDArray[np.float32]) -> _Seen:
        return cls(appearance(linear, PIXELS_PER_DEGREE), structure(encode_srgb(linear)))


@dataclass(frozen=True)
class _Window:
    """A part of an image: first and last row, first and last column."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def slices(self) -> tuple[slice, slice]:
        return slice(self.top, self.bottom), slice(self.left, self.right)


def _window(mask: NDArray[np.bool_]) -> _Window:
    """The part of an image that the comparison of a mask's pixels sees."""
    bounds = []
    for axis in (1, 0):
        where = np.flatnonzero(mask.any(axis=axis))
        length = mask.shape[1 - axis]
        first = max(int(where[0]) - _REACH, 0) // _GRID * _GRID
        last = min(-(-(int(where[-1]) + 1 + _REACH) // _GRID) * _GRID, length)
        bounds += [first, last]
    return _Window(*bounds)


def _grown(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """With all pixels around those that are set."""
    grown = mask.copy()
    for _ in range(2):  # along one axis, then along the other
        wider = grown.copy()
        wider[1:] |= grown[:-1]
        wider[:-1] |= grown[1:]
        grown = wider.T
    return grown


def _prepared(mesh: MeshArrays, build_query: QueryBuilder, frame: Frame | None = None) -> Work[Surface]:
    return (yield from as_part(preparing_surface(mesh, build_query, frame), 0.0, 0.1, "prepare"))


class _NoQuery:
    """In place of a spatial tree, which rendering does not need."""

    def __init__(self, vertices: Floats, triangles: Ints) -> None: ...

    def nearest(self, points: Floats, bounds: Floats | None) -> Ints:
        raise NotImplementedError

    def first_hit(self, origins: Floats, directions: Floats) -> tuple[Ints, Floats]:
        raise NotImplementedError
