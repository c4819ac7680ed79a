# SPDX-License-Identifier: GPL-3.0-or-later
"""The lidded porcelain urn of the demo: its mesh and its texture, from formulas and a fixed seed. Needs only numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

COLUMNS = 160  # around the urn
ROWS = 113  # from the bottom to the top
GADROONS = 20  # raised lobes around the lower belly
BEADS = 40
TEXTURE_SIZE = 1024
OVERSAMPLING = 2  # the ornament is painted larger, then averaged

# The outline: radius and height, bottom center to the tip of the knob; Catmull-Rom through these.
PROFILE = np.array(
    [(0.0, 0.03), (0.24, 0.03), (0.29, 0.0), (0.31, 0.03), (0.285, 0.075), (0.23, 0.1), (0.24, 0.14), (0.34, 0.28)]
    + [(0.46, 0.52), (0.53, 0.78), (0.515, 0.97), (0.42, 1.1), (0.31, 1.155), (0.295, 1.19), (0.3, 1.23)]
    + [(0.365, 1.245), (0.375, 1.27), (0.345, 1.295), (0.32, 1.35), (0.22, 1.43), (0.1, 1.468), (0.055, 1.49)]
    + [(0.06, 1.52), (0.1, 1.56), (0.095, 1.61), (0.045, 1.645), (0.0, 1.66)]
)
RIDGES = (0.475, 0.955, 1.19)  # heights of the rings around the body
BEAD_HEIGHT = 1.035
GADROON_SPAN = (0.14, 0.45)

COBALT, NAVY, CREAM = (0.10, 0.20, 0.47), (0.06, 0.10, 0.26), (0.95, 0.91, 0.82)
GOLD, TEAL, CORAL = (0.83, 0.64, 0.25), (0.16, 0.55, 0.57), (0.78, 0.29, 0.22)

MEANDER = ("########", "#.......", "#.#####.", "#.#...#.", "#.#.#.#.", "#.###.#.", "#.....#.", "#######.")


@dataclass(frozen=True)
class Outline:
    """The profile, finely: radius, height and length along it of each of N places."""

    radius: Array
    height: Array
    length: Array

    def length_at(self, height: float) -> float:
        """Where the outside reaches a height; the foot's inside is left out."""
        outside = int(self.height.argmin())
        return float(np.interp(height, self.height[outside:], self.length[outside:]))


def outline() -> Outline:
    """Catmull-Rom through PROFILE."""
    before = np.concatenate([PROFILE[:1], PROFILE[:-1]])[:-1]
    after = np.concatenate([PROFILE[1:], PROFILE[-1:]])[1:]
    start, end = PROFILE[:-1], PROFILE[1:]
    t = np.linspace(0, 1, 40, endpoint=False)[:, None, None]
    tangent_start, tangent_end = (end - before) / 2, (after - start) / 2
    curve = (2 * t**3 - 3 * t**2 + 1) * start + (t**3 - 2 * t**2 + t) * tangent_start
    curve += (3 * t**2 - 2 * t**3) * end + (t**3 - t**2) * tangent_end
    points = np.concatenate([curve.transpose(1, 0, 2).reshape(-1, 2), PROFILE[-1:]])
    points[:, 0] = np.maximum(points[:, 0], 0)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return Outline(points[:, 0], points[:, 1], np.concatenate([[0], np.cumsum(steps)]))


def bump(x: Array, center: float, width: float) -> Array:
    return np.exp(-(((x - center) / width) ** 2))


def build_urn(line: Outline) -> tuple[Array, list[tuple[int, ...]], Array]:
    """(V, 3) vertices, faces, and (loops, 2) texture coordinates: u around, v along the outline."""
    places = row_places(line)
    radius, height = np.interp(places, line.length, line.radius), np.interp(places, line.length, line.height)
    angle = np.arange(COLUMNS) * (2 * np.pi / COLUMNS)
    rings = radius[1:-1, None] + relief(height[1:-1, None], angle)
    x, y = rings * np.cos(angle), rings * np.sin(angle)
    z = np.broadcast_to(height[1:-1, None], x.shape)
    vertices = np.concatenate([np.stack([x, y, z], axis=2).reshape(-1, 3), [[0, 0, height[0]], [0, 0, height[-1]]]])

    bottom, top = len(vertices) - 2, len(vertices) - 1
    v = places / line.length[-1]
    faces: list[tuple[int, ...]] = []
    uv: list[tuple[float, float]] = []
    for column in range(COLUMNS):
        right = (column + 1) % COLUMNS
        u0, u1 = column / COLUMNS, (column + 1) / COLUMNS  # 1, not 0, at the seam
        for row in range(ROWS - 3):
            low, high = row * COLUMNS, (row + 1) * COLUMNS
            faces.append((low + column, low + right, high + right, high + column))
            uv += [(u0, v[row + 1]), (u1, v[row + 1]), (u1, v[row + 2]), (u0, v[row + 2])]
        last = (ROWS - 3) * COLUMNS
        faces += [(bottom, right, column), (top, last + column, last + right)]
        uv += [((u0 + u1) / 2, v[0]), (u1, v[1]), (u0, v[1])]
        uv += [((u0 + u1) / 2, v[-1]), (u0, v[-2]), (u1, v[-2])]
    return vertices, faces, np.array(uv)


def row_places(line: Outline) -> Array:
    """(ROWS,) lengths along the outline, closer together where the relief is fine."""
    outside = line.length >= line.length_at(0.0)
    fine = sum(bump(line.height, height, 0.03) for height in (*RIDGES, BEAD_HEIGHT, 1.26))
    density = np.where(outside, 1 + 1.6 * fine, 0.35)
    total = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(line.length))])
    return np.interp(np.linspace(0, total[-1], ROWS), total, line.length)


def relief(height: Array, angle: Array) -> Array:
    """What is added to the radius: gadroons below, rings, a string of beads, a twisted knob."""
    low, high = GADROON_SPAN
    inside = np.clip((height - low) / (high - low), 0, 1)
    added = 0.034 * np.sin(np.pi * inside) ** 0.7 * (np.abs(np.cos(angle * GADROONS / 2)) ** 0.8 - 0.45)
    for ridge in RIDGES:
        added = added + 0.017 * bump(height, ridge, 0.011)
    bead = np.maximum(np.cos(angle * BEADS), -0.15) + 0.15
    added = added + 0.02 * bead * bump(height, BEAD_HEIGHT, 0.014)
    dome = np.clip((height - 1.31) / 0.14, 0, 1)
    added = added + 0.012 * np.sin(np.pi * dome) * np.cos(angle * 12)
    knob = np.clip((height - 1.515) / 0.13, 0, 1)
    return added + 0.007 * np.sin(np.pi * knob) * np.cos(angle * 8 + 6 * knob)


class Canvas:
    """The texture while it is painted; row 0 is the bottom.

    Attributes:
        u: (1, W) around, in [0, 1). height, radius, along: (H, 1) of the urn there; along is a length.
    """

    def __init__(self, line: Outline, size: int) -> None:
        place = (np.arange(size) + 0.5) / size
        self.line = line
        self.u = place[None]
        self.along = place[:, None] * line.length[-1]
        self.height = np.interp(self.along, line.length, line.height)
        self.radius = np.interp(self.along, line.length, line.radius)
        self.rgb = np.empty((size, size, 3), np.float32)
        self.rgb[:] = CREAM

    def paint(self, mask: Mask, color: tuple[float, float, float]) -> None:
        """Lay a color where the (H, 1) or (H, W) mask says."""
        self.rgb[mask[:, 0] if mask.shape[1] == 1 else mask] = color

    def band(self, low: float, high: float) -> Mask:
        """Between two heights on the outside."""
        return (self.along >= self.line.length_at(low)) & (self.along < self.line.length_at(high))

    def edge(self, height: float, width: float) -> Mask:
        """A thin line around at a height."""
        return np.abs(self.along - self.line.length_at(height)) < width / 2

    def cells(self, count: int, height: float, shift: float = 0.0) -> tuple[Array, Array]:
        """x and y, as lengths, from the centers of so many cells around the urn at a height."""
        x = ((self.u * count + shift) % 1 - 0.5) * (2 * np.pi * self.radius / count)
        return x, self.along - self.line.length_at(height)


def paint_texture(line: Outline) -> NDArray[np.float32]:
    """(H, W, 3) encoded colors in [0, 1], row 0 at the bottom."""
    canvas = Canvas(line, TEXTURE_SIZE * OVERSAMPLING)
    for paint in (_foot, _belly, _key_band, _body, _shoulder, _neck, _lid, _gilding):
        paint(canvas)
    n = OVERSAMPLING
    picture = canvas.rgb.reshape(TEXTURE_SIZE, n, TEXTURE_SIZE, n, 3).mean(axis=(1, 3))
    return np.clip(picture * _glaze(Canvas(line, TEXTURE_SIZE)), 0, 1).astype(np.float32)


def _foot(canvas: Canvas) -> None:
    canvas.paint(canvas.band(0.0, 0.14), NAVY)
    x, y = canvas.cells(36, 0.05)
    canvas.paint((np.hypot(x, y) < 0.016) & canvas.band(0.0, 0.14), CREAM)
    canvas.paint((np.hypot(x, y) < 0.008) & canvas.band(0.0, 0.14), CORAL)


def _belly(canvas: Canvas) -> None:
    """Lotus petals, one on each gadroon, with veins."""
    here = canvas.band(0.13, 0.46)
    canvas.paint(here, TEAL)
    x, _ = canvas.cells(GADROONS, 0.3, 0.5)
    low, high = (canvas.line.length_at(height) for height in (0.13, 0.455))
    t = np.clip((canvas.along - low) / (high - low), 0, 1)
    half = np.pi * canvas.radius / GADROONS * np.sqrt(np.clip(1 - t**3, 0, 1))
    inside = half - np.abs(x)
    canvas.paint(here & (inside > 0), GOLD)
    canvas.paint(here & (inside > 0.006), CREAM)
    canvas.paint(here & (inside > 0.015), COBALT)
    canvas.paint(here & (inside > 0.02) & (t < 0.9), (0.22, 0.36, 0.64))
    veins = np.cos((canvas.along - 1.1 * np.abs(x)) * 260) > 0.55
    canvas.paint(here & veins & (inside > 0.024) & (t < 0.86), CREAM)
    canvas.paint(here & (np.abs(x) < 0.0035) & (t < 0.9), GOLD)


def _key_band(canvas: Canvas) -> None:
    """The Greek key, between two lines."""
    low, high = 0.5, 0.575
    here = canvas.band(low, high)
    canvas.paint(here, CREAM)
    start, end = canvas.line.length_at(low + 0.012), canvas.line.length_at(high - 0.012)
    key = np.array([[mark == "#" for mark in row] for row in MEANDER])[::-1]
    row = np.floor((canvas.along - start) / (end - start) * len(key)).astype(int)
    column = np.floor(canvas.u * 40 * key.shape[1]).astype(int) % key.shape[1]
    marks = key[row.clip(0, len(key) - 1), column] & (row >= 0) & (row < len(key))
    canvas.paint(marks, COBALT)
    for height in (low, high):
        canvas.paint(canvas.edge(height, 0.012), GOLD)


def _body(canvas: Canvas) -> None:
    """Rosettes on a trellis."""
    low, high = 0.58, 0.935
    here = canvas.band(low, high)
    canvas.paint(here, COBALT)
    center = 0.757
    x, y = canvas.cells(96, center)
    up, down = (canvas.u * 96 + y * 28) % 1, (canvas.u * 96 - y * 28) % 1
    canvas.paint(here & ((up < 0.12) | (down < 0.12)), (0.20, 0.33, 0.62))
    canvas.paint(here & (np.hypot(up - 0.56, down - 0.56) < 0.14), (0.45, 0.62, 0.80))

    x, y = canvas.cells(8, center)
    _rosette(canvas, here, x, y, 0.155)
    for sign in (-1, 1):  # small flowers and leaves between the large ones
        x, y = canvas.cells(8, center, 0.5)
        y = y + sign * 0.112
        leaf = (np.abs(np.abs(x) - 0.075) / 0.045) ** 2 + ((y - sign * 0.6 * (np.abs(x) - 0.05)) / 0.017) ** 2
        canvas.paint(here & (leaf < 1), GOLD)
        canvas.paint(here & (leaf < 0.6), TEAL)
        _flower(canvas, here, x, y, 0.048, 6)
    x, y = canvas.cells(8, center, 0.5)
    diamond = np.abs(x) / 0.03 + np.abs(y) / 0.05
    canvas.paint(here & (diamond < 1), GOLD)
    canvas.paint(here & (diamond < 0.68), CORAL)
    canvas.paint(here & (diamond < 0.3), CREAM)


def _rosette(canvas: Canvas, here: Mask, x: Array, y: Array, size: float) -> None:
    """A medallion of petals within petals."""
    r, angle = np.hypot(x, y) / size, np.arctan2(y, x)
    scallop = 0.94 + 0.06 * np.abs(np.cos(8 * angle))
    canvas.paint(here & (r < scallop), GOLD)
    canvas.paint(here & (r < scallop - 0.045), NAVY)
    canvas.paint(here & (r < 0.84), CREAM)
    dots = (np.cos(24 * angle) > 0.1) & (np.abs(r - 0.775) < 0.032)
    canvas.paint(here & dots, CORAL)
    outer = 0.70 * np.abs(np.cos(4 * angle)) ** 0.45
    canvas.paint(here & (r < outer), COBALT)
    canvas.paint(here & (r < outer - 0.06), (0.33, 0.52, 0.76))
    rays = (np.cos(48 * angle) > 0.45) & (r > 0.3) & (r < outer - 0.1)
    canvas.paint(here & rays, CREAM)
    inner = 0.46 * np.abs(np.sin(4 * angle)) ** 0.5
    canvas.paint(here & (r < inner), NAVY)
    canvas.paint(here & (r < inner - 0.04), CORAL)
    canvas.paint(here & (r < 0.19), GOLD)
    canvas.paint(here & (r < 0.14), CREAM)
    canvas.paint(here & (r < 0.075), NAVY)


def _flower(canvas: Canvas, here: Mask, x: Array, y: Array, size: float, petals: int) -> None:
    r, angle = np.hypot(x, y) / size, np.arctan2(y, x)
    edge = 0.55 + 0.45 * np.abs(np.cos(angle * petals / 2))
    canvas.paint(here & (r < edge), CREAM)
    canvas.paint(here & (r < edge - 0.22) & (r > 0.3), CORAL)
    canvas.paint(here & (r < 0.25), GOLD)


def _shoulder(canvas: Canvas) -> None:
    """Fish scales, and a dark ground for the beads."""
    here = canvas.band(0.975, 1.15)
    canvas.paint(here, TEAL)
    pitch = 0.03
    for layer in range(9, -1, -1):  # upper scales first, lower ones lie over them
        start = canvas.line.length_at(0.985) + layer * pitch
        count = 56
        x = ((canvas.u * count + 0.5 * (layer % 2)) % 1 - 0.5) * 2
        r = np.hypot(x, (canvas.along - start) / (1.7 * pitch))
        scale = here & (r < 1) & (canvas.along >= start)
        canvas.paint(scale, NAVY)
        canvas.paint(scale & (r < 0.86), TEAL if layer % 2 else COBALT)
        canvas.paint(scale & (r < 0.62) & (r > 0.5), CREAM)
    beads = np.abs(canvas.along - canvas.line.length_at(BEAD_HEIGHT)) < 0.026
    canvas.paint(beads, NAVY)
    x, y = canvas.cells(BEADS, BEAD_HEIGHT, 0.5)
    canvas.paint((np.abs(x) / 0.031) ** 2 + (y / 0.021) ** 2 < 1, CREAM)
    canvas.paint((np.abs(x) / 0.014) ** 2 + (y / 0.01) ** 2 < 1, CORAL)


def _neck(canvas: Canvas) -> None:
    here = canvas.band(1.15, 1.245)
    canvas.paint(here, CREAM)
    wave = np.sin(2 * np.pi * canvas.u * 30) * 0.012
    for height in (1.168, 1.215):
        distance = np.abs(canvas.along - canvas.line.length_at(height) - wave)
        canvas.paint(here & (distance < 0.008), COBALT)
        canvas.paint(here & (distance < 0.003), GOLD)


def _lid(canvas: Canvas) -> None:
    """Checks on the rim, petals on the dome."""
    rim = canvas.band(1.245, 1.3)
    canvas.paint(rim, NAVY)
    checks = (np.floor(canvas.u * 72) + np.floor(canvas.along / 0.028)) % 2 == 0
    canvas.paint(rim & checks, CREAM)
    dome = canvas.band(1.3, 1.475)
    canvas.paint(dome, COBALT)
    low, high = canvas.line.length_at(1.3), canvas.line.length_at(1.475)
    t = np.clip((canvas.along - low) / (high - low), 0, 1)
    for shift, fill in ((0.5, TEAL), (0.0, CREAM)):
        x = np.abs((canvas.u * 12 + 0.5 + shift) % 1 - 0.5) * 2
        petal = np.sqrt(np.clip(np.sin(np.pi * np.clip(t, 0, 1) ** 0.8), 0, 1)) * 0.92 - x
        canvas.paint(dome & (petal > 0), GOLD)
        canvas.paint(dome & (petal > 0.09), fill)
        canvas.paint(dome & (petal > 0.2) & (np.cos(t * 90) > 0.2), CORAL if shift else COBALT)


def _gilding(canvas: Canvas) -> None:
    """Gold on the knob and on every ring."""
    knob = canvas.along >= canvas.line.length_at(1.472)
    canvas.paint(knob, GOLD)
    knob_stripes = np.cos(2 * np.pi * canvas.u * 8 + 30 * (canvas.along - canvas.line.length_at(1.515))) > 0.4
    canvas.paint(knob_stripes & (canvas.along >= canvas.line.length_at(1.52)), NAVY)
    for height in RIDGES:
        canvas.paint(canvas.edge(height, 0.036), GOLD)
        rope = np.cos(2 * np.pi * (canvas.u * 90 + (canvas.along - canvas.line.length_at(height)) * 22)) > 0.5
        canvas.paint(rope & canvas.edge(height, 0.026), (0.52, 0.34, 0.10))
    for height in (0.0, 0.1, 0.128, 0.58, 0.932, 0.978, 1.07, 1.148, 1.243, 1.3):
        canvas.paint(canvas.edge(height, 0.011), GOLD)


def _glaze(canvas: Canvas) -> Array:
    """(H, W, 1) factors: uneven glaze, fine speckles, and shadow in the hollows of the relief."""
    rng = np.random.default_rng(7)
    size = canvas.u.size
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None]) * size
    factor = np.ones((size, size))
    for low, high, strength in ((3, 14, 0.035), (90, 320, 0.03)):
        spectrum = np.fft.rfft2(rng.standard_normal((size, size))) * ((frequency > low) & (frequency < high))
        noise = np.fft.irfft2(spectrum, (size, size))  # periodic: no seam
        factor *= 1 + strength * noise / noise.std()
    depth = relief(canvas.height, 2 * np.pi * canvas.u)
    outside = canvas.along >= canvas.line.length_at(0.05)
    return (factor * (1 - 9 * np.clip(-depth * outside, 0, 0.03)))[..., None]
