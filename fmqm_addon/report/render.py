# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of what was compared, drawn by a depth buffer.

A pixel's color comes from the same lookup as the color field (NCF), times a headlight's shade by smooth normals, as
games show meshes. No renderer and no graphics card take part.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..comparison.depth_buffer import DEEPEST, NOTHING, Screen, on_screen
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
CONTRAST = 40  # of 255; pixels that differ this much from a neighbor are looked at in more places
MORE_PLACES = ((3 / 8, 1 / 8), (7 / 8, 3 / 8), (5 / 8, 7 / 8), (1 / 8, 5 / 8))  # no two in a row or column of a pixel
BATCH = 1 << 13  # places of a step: few enough for a processor's cache
NEAREST = 1e-3  # diagonals of the reference; what is nearer to the eye is seen by no camera
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
        (height, width, 3) uint8. One look a pixel, and more where neighbors differ.
    """
    return render_all(surface, camera, size, (paint,), normals)[0]


def render_all(
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    paints: Sequence[Paint | None],
    normals: Floats | None = None,
) -> list[Pixels]:
    """As render(), once for each of the paints; what is seen where is found once for all."""
    return finish(rendering(surface, camera, size, paints, normals))


def rendering(
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    paints: Sequence[Paint | None],
    normals: Floats | None = None,
) -> Work[list[Pixels]]:
    """render_all() in steps of some milliseconds."""
    screen = yield from as_part(_projecting(surface, camera, size), 0.0, 0.1)
    shown = yield from as_part(screen.showing(), 0.1, 0.1)
    covered = np.flatnonzero(shown != NOTHING)
    rows, columns = np.divmod(covered, size[0])
    images = [np.full((size[0] * size[1], 3), BACKGROUND, np.uint8) for _ in paints]
    shading = _shading(surface, camera, size, columns + 0.5, rows + 0.5, shown[covered], paints, normals)
    for image, colors in zip(images, (yield from as_part(shading, 0.2, 0.4)), strict=True):
        image[covered] = colors + 0.5
    rough = [_differs(image.reshape(size[1], size[0], 3)).ravel() for image in images]
    again = np.flatnonzero(np.any(rough, axis=0))
    screen = screen.about(again)
    shown = np.empty((len(again), len(MORE_PLACES)), np.int64)
    for number, place in enumerate(MORE_PLACES):
        shown[:, number] = yield from as_part(screen.showing(again, place), 0.6 + 0.02 * number, 0.02)
    which, corner = np.nonzero(shown != NOTHING)
    rows, columns = np.divmod(again[which], size[0])
    across, down = np.array(MORE_PLACES)[corner].T
    shading = _shading(surface, camera, size, columns + across, rows + down, shown[which, corner], paints, normals)
    for image, here, colors in zip(images, rough, (yield from as_part(shading, 0.7, 0.3)), strict=True):
        fine = np.full((*shown.shape, 3), BACKGROUND, np.float32)
        fine[which, corner] = colors
        image[here] = fine.mean(axis=1)[here[again]] + 0.5
    return [image.reshape(size[1], size[0], 3) for image in images]


def _projecting(surface: Surface, camera: Camera, size: tuple[int, int]) -> Work[Screen]:
    """The triangles as they lie on the camera's image."""
    nearest = max(camera.near, NEAREST)
    local, triangles, source = _clipped((surface.vertices - camera.eye) @ camera.axes.T, surface.triangles, nearest)
    yield Progress("", 0.2)
    depth = np.maximum(local[:, 2], nearest)
    x = (1 + local[:, 0] / depth / camera.half[0]) / 2 * size[0]
    y = (1 - local[:, 1] / depth / camera.half[1]) / 2 * size[1]
    near = 1 / depth  # is linear on the image, which depth is not
    low, high = float(near.min()), float(near.max())
    near = (near - (low + high) / 2) * (2 * DEEPEST / max(high - low, float(np.finfo(np.float64).tiny)))
    screen = yield from as_part(on_screen(x, y, near, triangles, size), 0.2, 0.8)
    return screen if source is None else replace(screen, names=source[screen.names])


def _clipped(local: Floats, triangles: Ints, nearest: float) -> tuple[Floats, Ints, Ints | None]:
    """What of the triangles lies before a camera, at a depth or deeper.

    Args:
        local: (V, 3) right, up and forward of the camera.

    Returns:
        Vertices, the first of them as they were; triangles; and which each is a part of, None where all are whole.
    """
    behind = local[:, 2] < nearest
    if not behind.any():
        return local, triangles, None
    hidden = behind[triangles]
    count = np.count_nonzero(hidden, axis=1)
    whole, cut = np.flatnonzero(count == 0), np.flatnonzero((count == 1) | (count == 2))
    # Turned so that the first corner is alone on its side.
    alone = hidden[cut] == (count[cut] == 1)[:, None]
    turned = (alone.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles[cut], turned, axis=1).T
    ends = []
    for other in (b, c):
        # From the end that is hidden, whichever triangle asks: both of an edge must get the same.
        start, end = (local[np.where(behind[a] == first, a, other)] for first in (True, False))
        share = (nearest - start[:, 2]) / (end[:, 2] - start[:, 2])
        ends.append(start + share[:, None] * (end - start))
    p = len(local) + np.arange(len(cut))
    q = p + len(cut)
    one, two = np.flatnonzero(~behind[a]), np.flatnonzero(behind[a])
    parts = [
        np.stack([a[one], p[one], q[one]], axis=1),
        np.stack([p[two], b[two], c[two]], axis=1),
        np.stack([p[two], c[two], q[two]], axis=1),
    ]
    source = np.concatenate([whole, cut[one], cut[two], cut[two]])
    return np.concatenate([local, *ends]), np.concatenate([triangles[whole], *parts]), source


def is_seen(surface: Surface, camera: Camera, point: Floats) -> bool:
    """Whether nothing stands between the camera and a (3,) point of the surface."""
    towards = point - camera.eye
    distance = float(np.linalg.norm(towards))
    _, hit = surface.query.first_hit(camera.eye[None], (towards / distance)[None])
    return bool(hit[0] > distance - HIDDEN_BEHIND)


def _shading(
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    columns: Floats,
    rows: Floats,
    triangle: Ints,
    paints: Sequence[Paint | None],
    normals: Floats | None,
) -> Work[list[NDArray[np.float32]]]:
    """(N, 3) encoded colors from 0 to 255, for each paint, of the triangles at places of the image, in pixels."""
    images = [np.empty((len(columns), 3), np.float32) for _ in paints]
    for first in range(0, len(columns), BATCH):
        here = slice(first, first + BATCH)
        x = (2 * columns[here] / size[0] - 1) * camera.half[0]
        y = (1 - 2 * rows[here] / size[1]) * camera.half[1]
        for image, colors in zip(images, _shaded(surface, camera, x, y, triangle[here], paints, normals), strict=True):
            image[here] = 255 * colors
        yield Progress("", min(here.stop / len(columns), 1.0))
    return images


def _shaded(
    surface: Surface,
    camera: Camera,
    x: Floats,
    y: Floats,
    triangle: Ints,
    paints: Sequence[Paint | None],
    normals: Floats | None,
) -> Iterator[Floats]:
    """(N, 3) encoded colors in [0, 1], for each of the paints.

    Args:
        x, y: (N,) how far to the right and up, at distance 1 from the camera. triangle: (N,) that is seen there.
    """
    # What is the same for all of a triangle's pixels is computed once.
    seen = np.zeros(len(surface.triangles), bool)
    seen[triangle] = True
    shown = np.flatnonzero(seen)
    row = (np.cumsum(seen) - 1)[triangle]
    a, b, c = ((surface.vertices[surface.triangles[shown, k]] - camera.eye) @ camera.axes.T for k in range(3))
    ahead = dot(cross(a, b), c)  # above 0 where the order of the corners has the camera behind the face
    side = np.where(ahead > 0, 1.0, -1.0)
    # A direction is in the cone of a triangle by its products with the three planes through the eye and an edge.
    planes = [(side * cross(*edge).T).take(row, axis=1) for edge in ((b, c), (c, a), (a, b))]
    weights = np.stack([np.maximum(right * x + up * y + forward, 0) for right, up, forward in planes])
    total = weights.sum(axis=0)
    weights = np.where(total > 0, weights / np.where(total > 0, total, 1), 1 / 3)
    # Towards the camera, whichever side of the face that is; normals that stand on the other side than the order of
    # the corners say which side is meant.
    own = corner_normals(surface, faces=shown) if normals is None else normals[shown]
    own = own @ camera.axes.T
    meant = np.where(dot(own.sum(axis=1), cross(b - a, c - a)) < 0, side, -side)
    smooth = _mixed(weights, [(meant * own[:, k].T).take(row, axis=1) for k in range(3)])
    light = np.array(LIGHT) * (1, 1, -1)
    length = np.linalg.norm(light) * np.sqrt(np.maximum((smooth * smooth).sum(axis=0), np.finfo(np.float64).tiny))
    lit = np.maximum(light @ smooth / length, 0)[:, None]
    for paint in paints:
        if paint is None:
            yield np.clip(surface.color_at(triangle, weights.T), 0, 1) * (AMBIENT + (1 - AMBIENT) * lit)
        else:
            points = _mixed(weights, [corner.T.take(row, axis=1) for corner in (a, b, c)]).T @ camera.axes + camera.eye
            yield paint(triangle, points, weights.T) * (SCORE_AMBIENT + (1 - SCORE_AMBIENT) * lit)


def _mixed(weights: Floats, corners: Sequence[Floats]) -> Floats:
    """(K, N) sums of the (K, N) corners with (3, N) weights."""
    mixed: Floats = weights[0] * corners[0]
    mixed += weights[1] * corners[1]
    mixed += weights[2] * corners[2]
    return mixed


def _differs(image: Pixels) -> NDArray[np.bool_]:
    """(H, W) whether a pixel has more than CONTRAST to one of its four neighbors in any channel."""
    differs = np.zeros(image.shape[:2], bool)
    for axis in (0, 1):
        one, other = (np.moveaxis(image, axis, 0)[part] for part in (slice(1, None), slice(None, -1)))
        red, green, blue = np.moveaxis(np.maximum(one, other) - np.minimum(one, other) > CONTRAST, 2, 0)
        rough = red | green | blue
        marked = np.moveaxis(differs, axis, 0)
        marked[1:] |= rough
        marked[:-1] |= rough
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
