# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of what was compared, drawn by casting camera rays through the surfaces' own spatial queries.

A pixel's color comes from the same lookup as the color field (NCF), times a headlight's shade by smooth normals, as
games show meshes. No renderer and no graphics card take part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..comparison.normals import corner_normals
from ..metric.errors import FMQMError
from ..metric.evaluation import Result
from ..metric.geometry import Floats, Ints, closest_on_triangles, dot
from ..metric.stepper import Progress, Work, as_part, finish
from ..metric.surface import Surface, triangle_normals
from .visual.axes import plane_axes
from .visual.colormap import score_colors

Pixels = NDArray[np.uint8]

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
BATCH = 1 << 13  # rays of a step
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
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        return directions


def _view_axes(azimuth: float, elevation: float) -> Floats:
    a, e = np.radians(azimuth), np.radians(elevation)
    right = [np.cos(a), np.sin(a), 0.0]
    forward = [-np.sin(a) * np.cos(e), np.cos(a) * np.cos(e), -np.sin(e)]
    return np.array([right, np.cross(right, forward), forward])


def natural_aspect(*surfaces: Surface) -> float:
    """Height by width of the surfaces as the usual camera sees them, within ASPECTS."""
    points = np.concatenate([surface.vertices for surface in surfaces]) @ _view_axes(AZIMUTH, ELEVATION)[:2].T
    width, height = np.maximum(points.max(axis=0) - points.min(axis=0), 1e-9)
    return float(np.clip(height / width, *ASPECTS))


def render(
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    face_color: Floats | None = None,
    hits: Ints | None = None,
    normals: Floats | None = None,
) -> Pixels:
    """A surface as the camera sees it, from either side of its faces, on BACKGROUND.

    Args:
        size: width and height in pixels.
        face_color: (T, 3) encoded colors in [0, 1] to show in place of the surface's own.
        hits: what pixel_hits() says of the same surface, camera and size, to save casting them again.
        normals: what corner_normals() says of the surface, to save smoothing them again.

    Returns:
        (height, width, 3) uint8. One ray a pixel, and more where neighbors differ.
    """
    return finish(rendering(surface, camera, size, face_color, hits, normals))


def rendering(
    surface: Surface,
    camera: Camera,
    size: tuple[int, int],
    face_color: Floats | None = None,
    hits: Ints | None = None,
    normals: Floats | None = None,
) -> Work[Pixels]:
    """render() in steps of some milliseconds; normals that are not given are smoothed where they are seen."""
    columns, rows = _pixel_centers(size)
    casting = _casting(surface, camera, size, columns, rows, normals, face_color, hits)
    image = yield from as_part(casting, 0.0, 0.6)
    rough = np.flatnonzero(_differs(image.reshape(size[1], size[0], 3)))
    across, down = MORE_RAYS.T
    columns, rows = (columns[rough, None] + across).ravel(), (rows[rough, None] + down).ravel()
    fine = yield from as_part(_casting(surface, camera, size, columns, rows, normals, face_color), 0.6, 0.4)
    image[rough] = fine.reshape(len(rough), len(MORE_RAYS), 3).mean(axis=1)
    pixels: Pixels = (image.reshape(size[1], size[0], 3) * 255 + 0.5).astype(np.uint8)
    return pixels


def pixel_hits(surface: Surface, camera: Camera, size: tuple[int, int]) -> Ints:
    """(height * width,) the triangle behind the center of each pixel, row after row; -1 for none."""
    return finish(hitting_pixels(surface, camera, size))


def hitting_pixels(surface: Surface, camera: Camera, size: tuple[int, int]) -> Work[Ints]:
    """pixel_hits() in steps of some milliseconds."""
    columns, rows = _pixel_centers(size)
    hits = np.empty(len(columns), np.int64)
    for here in _batches(len(hits)):
        hits[here] = _first_hits(surface, camera, _directions(camera, size, columns[here], rows[here]))
        yield Progress("", here.stop / len(hits))
    return hits


def _pixel_centers(size: tuple[int, int]) -> tuple[Floats, Floats]:
    """(N,) columns and rows, in pixels from the left and the top."""
    columns, rows = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    return columns.ravel(), rows.ravel()


def _directions(camera: Camera, size: tuple[int, int], columns: Floats, rows: Floats) -> Floats:
    """(N, 3) unit directions through places of the image, in pixels."""
    return camera.directions(2 * columns / size[0] - 1, 1 - 2 * rows / size[1])


def _batches(count: int) -> Iterator[slice]:
    """So many rays, as many as are asked for at once: a query makes Python objects of them."""
    for first in range(0, count, BATCH):
        yield slice(first, min(first + BATCH, count))


def _first_hits(surface: Surface, camera: Camera, directions: Floats) -> Ints:
    """(N,) the first triangle on each ray from the camera, -1 for none."""
    return surface.query.first_hit(camera.eye + camera.near * directions, directions)[0]


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
    normals: Floats | None,
    face_color: Floats | None,
    hits: Ints | None = None,
) -> Work[Floats]:
    """(N, 3) encoded colors in [0, 1] of rays through places of the image, in pixels. hits: as in render()."""
    colors = np.empty((len(columns), 3))
    for here in _batches(len(colors)):
        directions = _directions(camera, size, columns[here], rows[here])
        triangle = _first_hits(surface, camera, directions) if hits is None else hits[here]
        colors[here] = _ray_colors(surface, camera, directions, triangle, normals, face_color)
        yield Progress("", here.stop / len(colors))
    return colors


def _ray_colors(
    surface: Surface,
    camera: Camera,
    directions: Floats,
    triangle: Ints,
    normals: Floats | None,
    face_color: Floats | None,
) -> Floats:
    """(N, 3) encoded colors in [0, 1] of rays from the camera that end on the (N,) triangles; -1: BACKGROUND."""
    colors = np.empty((len(directions), 3))
    colors[:] = np.array(BACKGROUND) / 255
    hit = np.flatnonzero(triangle >= 0)
    directions, triangle = directions[hit], triangle[hit]
    a, b, c = (surface.vertices[surface.triangles[triangle, k]] for k in range(3))
    flat = triangle_normals(surface.vertices, surface.triangles[triangle])
    slope = dot(flat, directions)
    distance = dot(a - camera.eye, flat) / np.where(np.abs(slope) < 1e-12, 1e-12, slope)
    barycentric = closest_on_triangles(camera.eye + distance[:, None] * directions, a, b, c)[1]
    smooth = np.einsum("nk,nkc->nc", barycentric, _normals_of(surface, triangle, normals))
    # Towards the camera, whichever side of the face that is; normals that stand on the other side than the order of
    # the corners say which side is meant.
    smooth *= (-np.sign(slope) * np.where(dot(flat, smooth) < 0, -1, 1))[:, None]
    light = np.array(LIGHT) * (1, 1, -1) @ camera.axes
    length = np.linalg.norm(light) * np.maximum(np.linalg.norm(smooth, axis=1), np.finfo(np.float64).tiny)
    lit = np.maximum(smooth @ light / length, 0)
    if face_color is not None:
        seen, ambient = face_color[triangle], SCORE_AMBIENT
    else:
        seen, ambient = surface.color_at(triangle, barycentric), AMBIENT
    colors[hit] = np.clip(seen, 0, 1) * (ambient + (1 - ambient) * lit)[:, None]
    return colors


def _normals_of(surface: Surface, triangle: Ints, normals: Floats | None) -> Floats:
    """(N, 3, 3) unit normals at the corners of (N,) triangles, out of those of all where these are there."""
    if normals is not None:
        return normals[triangle]
    faces, which = np.unique(triangle, return_inverse=True)
    return corner_normals(surface, faces=faces)[which]


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


def score_by_face(result: Result, surface: Surface, column: str = "FMQM") -> Floats:
    """(T,) mean score of the patches that cover each triangle of the reference; nan where none does.

    A triangle that was cut for the patches has the area-weighted mean of its covered pieces.

    Args:
        surface: the reference of the result. column: as in Result.of_patches.
    """
    mesh = result.patch_mesh
    total, patches = np.zeros(len(mesh.triangles)), np.zeros(len(mesh.triangles))
    for patch, score in zip(result.patches, result.of_patches(column).tolist(), strict=True):
        total[patch.faces] += score
        patches[patch.faces] += 1
    covered = patches > 0
    area, parent = mesh.areas[covered], mesh.parent[covered]
    count = len(surface.triangles)
    weighted = np.bincount(parent, area * total[covered] / patches[covered], minlength=count)
    covered_area = np.bincount(parent, area, minlength=count)
    scores: Floats = np.full(count, np.nan)
    np.divide(weighted, covered_area, out=scores, where=covered_area > 0)
    return scores


def three_views(
    reference: Surface, distorted: Surface, face_scores: Floats, camera: Camera, size: tuple[int, int]
) -> tuple[Pixels, Pixels, Pixels]:
    """The reference, the distorted surface, and the reference colored by its (T,) face_scores; as render()."""
    hits, normals = pixel_hits(reference, camera, size), corner_normals(reference)
    return (
        render(reference, camera, size, hits=hits, normals=normals),
        render(distorted, camera, size),
        render(reference, camera, size, score_colors(face_scores), hits, normals),
    )


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
