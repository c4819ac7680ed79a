# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of what was compared, drawn by casting camera rays through the surfaces' own spatial queries.

A pixel's color comes from the same lookup as the color field (NCF), times a headlight's shade by smooth normals, as
games show meshes. No renderer and no graphics card take part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..comparison.normals import corner_normals
from ..metric.errors import FMQMError
from ..metric.geometry import Floats, Ints, cross, dot
from ..metric.stepper import Progress, Work, as_part, finish
from ..metric.surface import Surface
from .visual.axes import plane_axes

Pixels = NDArray[np.uint8]
# (N,) triangles, (N, 3) points on them and where these are on each, barycentric, to (N, 3) encoded colors in [0, 1].
Paint = Callable[[Ints, Floats, Floats], Floats]

BACKGROUND = (236, 237, 239)  # light grey: stands on white pages and on dark ones

# The camera looks from the front right, a little from above; Blender's front is -Y, and Z is up.
AZIMUTH, ELEVATION = 32.0, 16.0  # degrees
FIELD_OF_VIEW = 20.0  # degrees, of the longer side
MARGIN = 1.06  # the frame is this much larger than what it holds
ASPECTS = (0.7, 1.4)  # panels are as high as this many widths at least and at most

AMBIENT, SCORE_AMBIENT = 0.5, 0.65  # shade of a face edge-on; colors that mean numbers are shaded less
LIGHT = (-0.45, 0.55, 1.0)  # direction to the headlight: right, up, towards the camera
CONTRAST = 0.16  # pixels that differ this much from a neighbor get more rays
MORE_RAYS = np.array([(-1, -3), (3, -1), (1, 3), (-3, 1)]) / 8  # a turned square: no two in a row or column
BATCH = 1 << 13  # rays of a step: few enough for a processor's cache
TILE = 8  # pixels; width and height of what is left out where nothing can be seen
HIDDEN_BEHIND = 0.01  # of the frame: what lies this much deeper than what is seen is hidden


@dataclass(frozen=True)
class Camera:
    """A perspective camera in the metric's frame.

    Attributes:
        eye: (3,) where it stands. axes: (3, 3) unit rows right, up, and forward.
        half: half the width and height of the image at distance 1.
        near: what is nearer to the eye is not seen.
    """

    eye: Floats
    axes: Floats
    half: tuple[float, float]
    near: float = 0.0

    @classmethod
    def framing(
        cls, *surfaces: Surface, aspect: float = 1.0, azimuth: float = AZIMUTH, elevation: float = ELEVATION
    ) -> Camera:
        """The camera that just holds the surfaces, Z up.

        Args:
            aspect: height of the image by its width. azimuth: degrees from the front (-Y) towards the
                right (+X). elevation: degrees above the horizon, less than 90 either way.
        """
        axes = _view_axes(azimuth, elevation)
        half_long = float(np.tan(np.radians(FIELD_OF_VIEW / 2)))
        half = (half_long / max(aspect, 1.0), half_long * min(aspect, 1.0))
        points = np.concatenate([surface.vertices for surface in surfaces]) @ axes.T
        # Each side of the frame is a plane through the eye that has all points inside.
        eye = np.empty(3)
        depths = []
        for k in (0, 1):
            slope = half[k] / MARGIN
            above = float((points[:, k] - slope * points[:, 2]).max())
            below = float((-points[:, k] - slope * points[:, 2]).max())
            eye[k] = (above - below) / 2
            depths.append(-(above + below) / (2 * slope))
        eye[2] = min(depths)
        return cls(eye @ axes, axes, half)

    @classmethod
    def facing(cls, center: Floats, normal: Floats, width: float) -> Camera:
        """The camera that looks straight at a place, in a square image that is so wide there.

        What stands before the place, farther than its width, does not hide it.

        Args:
            center: (3,) the place. normal: (3,) unit, towards the camera; zero takes the usual view.
        """
        axes = _view_axes(AZIMUTH, ELEVATION)
        if normal.any():
            axes = np.stack([*plane_axes(normal), -normal])
        return cls.close_up(center, axes, width)

    @classmethod
    def close_up(cls, center: Floats, axes: Floats, width: float) -> Camera:
        """The camera that looks along its axes at a place, as facing() does."""
        half = float(np.tan(np.radians(FIELD_OF_VIEW / 2)))
        distance = width / 2 / half
        return cls(center - distance * axes[2], axes, (half, half), max(distance - width, 0.0))

    def place_of(self, point: Floats) -> tuple[float, float]:
        """Where in the image a (3,) point before the eye is: shares of the width from the left, of the height from
        the top."""
        x, y, depth = ((point - self.eye) @ self.axes.T).tolist()
        return (1 + x / depth / self.half[0]) / 2, (1 - y / depth / self.half[1]) / 2

    def directions(self, x: Floats, y: Floats) -> Floats:
        """(N, 3) unit directions from the eye; x from -1 (left) to 1, y from -1 (bottom) to 1."""
        local = np.stack([x * self.half[0], y * self.half[1], np.ones(len(x))], axis=1)
        directions: Floats = local @ self.axes
        directions /= np.sqrt(dot(directions, directions))[:, None]
        return directions


def direction_towards(azimuth: float, elevation: float) -> Floats:
    """(3,) unit, from what Camera.framing sees to where it stands."""
    return -_view_axes(azimuth, elevation)[2]


def _view_axes(azimuth: float, elevation: float) -> Floats:
    a, e = np.radians(azimuth), np.radians(elevation)
    right = [np.cos(a), np.sin(a), 0.0]
    forward = [-np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)]
    return np.array([right, np.cross(right, forward), forward])


def natural_aspect(*surfaces: Surface, azimuth: float = AZIMUTH, elevation: float = ELEVATION) -> float:
    """Height by width of the surfaces as a camera sees them that is framing() them, within ASPECTS."""
    points = np.concatenate([surface.vertices for surface in surfaces]) @ _view_axes(azimuth, elevation)[:2].T
    width, height = np.maximum(points.max(axis=0) - points.min(axis=0), 1e-9)
    return float(np.clip(height / width, *ASPECTS))


def render(
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    paint: Paint | None = None,
    normals: Floats | None = None,
) -> Pixels:
    """A surface as the camera sees it, from either side of its faces, on BACKGROUND.

    Args:
        size: width and height in pixels.
        paint: colors that mean numbers, to show in place of the surface's own.
        normals: what corner_normals() says of the surface, to save smoothing them again; None: smoothed where seen.

    Returns:
        (height, width, 3) uint8. One ray a pixel, and more where neighbors differ.
    """
    return render_all(surface, camera, size, (paint,), normals)[0]


def render_all(
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    paints: Sequence[Paint | None],
    normals: Floats | None = None,
) -> list[Pixels]:
    """As render(), once for each of the paints; the rays are cast once for all."""
    return finish(rendering(surface, camera, size, paints, normals))


def rendering(
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    paints: Sequence[Paint | None],
    normals: Floats | None = None,
) -> Work[list[Pixels]]:
    """render_all() in steps of some milliseconds."""
    columns, rows = _pixel_centers(size)
    images = [np.full((size[0] * size[1], 3), np.array(BACKGROUND) / 255) for _ in paints]
    near = _near_silhouette(surface, camera, size)
    casting = _casting(surface, camera, size, columns[near], rows[near], paints, normals)
    for image, colors in zip(images, (yield from as_part(casting, 0.0, 0.6)), strict=True):
        image[near] = colors
    rough = [_differs(image.reshape(size[1], size[0], 3)).ravel() for image in images]
    again = np.flatnonzero(np.any(rough, axis=0))
    across, down = MORE_RAYS.T
    columns, rows = (columns[again, None] + across).ravel(), (rows[again, None] + down).ravel()
    casting = _casting(surface, camera, size, columns, rows, paints, normals)
    for image, here, colors in zip(images, rough, (yield from as_part(casting, 0.6, 0.4)), strict=True):
        image[here] = colors.reshape(len(again), len(MORE_RAYS), 3).mean(axis=1)[here[again]]
    return [(image.reshape(size[1], size[0], 3) * 255 + 0.5).astype(np.uint8) for image in images]


def _near_silhouette(surface: Surface, camera: Camera, size: tuple[int, int]) -> Ints:
    """The pixels, row after row, in tiles that triangles touch with their boxes; no other can show any of them."""
    local = (surface.vertices - camera.eye) @ camera.axes.T
    if local[:, 2].min() <= 0:  # what is beside the eye may be seen anywhere
        return np.arange(size[0] * size[1])
    tiles = [-(-side // TILE) for side in size]
    shares = [(1 + sign * local[:, k] / local[:, 2] / camera.half[k]) / 2 for k, sign in ((0, 1), (1, -1))]
    places = [
        np.clip(share * side / TILE, -1, count).astype(np.int64)
        for share, side, count in zip(shares, size, tiles, strict=True)
    ]
    corners = [place[surface.triangles] for place in places]
    (left, top), (right, bottom) = ([of(place, axis=1).clip(0) for place in corners] for of in (np.min, np.max))
    # Each box is counted at its corners; sums along both axes count it everywhere within.
    width = tiles[0] + 2
    counts = np.zeros((tiles[1] + 2) * width, np.int64)
    for row, column, sign in ((top, left, 1), (top, right + 1, -1), (bottom + 1, left, -1), (bottom + 1, right + 1, 1)):
        counts += sign * np.bincount(row * width + column, minlength=len(counts))
    touched = counts.reshape(-1, width).cumsum(axis=0).cumsum(axis=1)[: tiles[1], : tiles[0]] > 0
    return np.flatnonzero(touched.repeat(TILE, axis=0).repeat(TILE, axis=1)[: size[1], : size[0]])


def _pixel_centers(size: tuple[int, int]) -> tuple[Floats, Floats]:
    """(N,) columns and rows, in pixels from the left and the top."""
    columns, rows = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    return columns.ravel(), rows.ravel()


def is_seen(surface: Surface, camera: Camera, point: Floats) -> bool:
    """Whether nothing stands between the camera and a (3,) point of the surface."""
    towards = point - camera.eye
    distance = float(np.linalg.norm(towards))
    _, hit = surface.query.first_hit(camera.eye[None], (towards / distance)[None])
    return bool(hit[0] > distance - HIDDEN_BEHIND)


def _casting(
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    columns: Floats,
    rows: Floats,
    paints: Sequence[Paint | None],
    normals: Floats | None,
) -> Work[list[Floats]]:
    """(N, 3) encoded colors in [0, 1], for each of the paints, of rays through places of the image, in pixels."""
    images = [np.empty((len(columns), 3)) for _ in paints]
    for first in range(0, len(columns), BATCH):
        here = slice(first, first + BATCH)
        directions = camera.directions(2 * columns[here] / size[0] - 1, 1 - 2 * rows[here] / size[1])
        for image, colors in zip(images, _ray_colors(surface, camera, directions, paints, normals), strict=True):
            image[here] = colors
        yield Progress("", min(here.stop / len(columns), 1.0))
    return images


def _ray_colors(
    surface: Surface, camera: Camera, directions: Floats, paints: Sequence[Paint | None], normals: Floats | None
) -> Iterator[Floats]:
    """(N, 3) encoded colors in [0, 1] of (N, 3) rays from the camera, once for each of the paints."""
    triangle, _ = surface.query.first_hit(camera.eye + camera.near * directions, directions)
    count, hit = len(triangle), np.flatnonzero(triangle >= 0)
    directions, triangle = directions[hit], triangle[hit]
    # What is the same for all of a triangle's pixels is computed once.
    seen = np.zeros(len(surface.triangles), bool)
    seen[triangle] = True
    shown = np.flatnonzero(seen)
    row = (np.cumsum(seen) - 1)[triangle]
    a, b, c = (surface.vertices[surface.triangles[shown, k]] - camera.eye for k in range(3))
    ahead = dot(cross(a, b), c)  # above 0 where the order of the corners has the camera behind the face
    side = np.where(ahead > 0, 1.0, -1.0)[:, None, None]
    # A direction is in the cone of a triangle by its products with the three planes through the eye and an edge.
    planes = side * np.stack([cross(b, c), cross(c, a), cross(a, b)], axis=1)
    barycentric = np.maximum(np.einsum("nkc,nc->nk", planes[row], directions), 0)
    total = barycentric.sum(axis=1, keepdims=True)
    barycentric = np.where(total > 0, barycentric / np.where(total > 0, total, 1), 1 / 3)
    # Towards the camera, whichever side of the face that is; normals that stand on the other side than the order of
    # the corners say which side is meant.
    own = corner_normals(surface, faces=shown) if normals is None else normals[shown]
    meant = np.where(dot(own.sum(axis=1), cross(b - a, c - a)) < 0, 1.0, -1.0)[:, None, None]
    smooth = np.einsum("nk,nkc->nc", barycentric, (side * meant * own)[row])
    light = np.array(LIGHT) * (1, 1, -1) @ camera.axes
    length = np.linalg.norm(light) * np.sqrt(np.maximum(dot(smooth, smooth), np.finfo(np.float64).tiny))
    lit = np.maximum(smooth @ light / length, 0)[:, None]
    for paint in paints:
        colors = np.full((count, 3), np.array(BACKGROUND) / 255)
        if not len(hit):
            pass
        elif paint is None:
            colors[hit] = np.clip(surface.color_at(triangle, barycentric), 0, 1) * (AMBIENT + (1 - AMBIENT) * lit)
        else:
            points = camera.eye + np.einsum("nk,nkc->nc", barycentric, np.stack([a, b, c], axis=1)[row])
            colors[hit] = paint(triangle, points, barycentric) * (SCORE_AMBIENT + (1 - SCORE_AMBIENT) * lit)
        yield colors


def _differs(image: Floats) -> NDArray[np.bool_]:
    """(H, W) whether a pixel has more than CONTRAST to one of its four neighbors in any channel."""
    differs = np.zeros(image.shape[:2], bool)
    across = (np.abs(np.diff(image, axis=1)) > CONTRAST).any(axis=2)
    down = (np.abs(np.diff(image, axis=0)) > CONTRAST).any(axis=2)
    differs[:, 1:] |= across
    differs[:, :-1] |= across
    differs[1:] |= down
    differs[:-1] |= down
    return differs


def require_pillow() -> None:
    """Checks that pictures can be written.

    Raises:
        FMQMError: Pillow is missing.
    """
    try:
        import PIL.Image  # noqa: F401
    except ImportError as error:
        raise FMQMError(
            "pictures need Pillow, which this Python lacks: "
            "install it (python -m pip install Pillow) or leave the picture out"
        ) from error
