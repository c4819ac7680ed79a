# SPDX-License-Identifier: GPL-3.0-or-later
"""What a screen size is defined by: every constant, in one place (docs/screen-size.md)."""

from __future__ import annotations

from dataclasses import dataclass

SIZES = (16, 32, 64, 128, 256, 512)  # h: pixels that the reference's box diagonal spans
FIRST_RENDER = 256  # h of the first rendering: what fails at a quarter of it or below is not rendered larger
RENDER = 1024  # h of the rendering that all other sizes are made of
MARGIN = 1 / 16  # around the sphere of the box diagonal, in diagonals: a pixel at the smallest size
VIEWS = 6
VIEW_CHOICES = (6, 12)

CONDITIONS = ("unlit", "headlight")  # base color alone; base color under a light at the camera
AMBIENT, HEADLIGHT = 0.2, 0.8  # shade = AMBIENT + HEADLIGHT max(0, n.v)
BACKGROUND = 0.18  # linear light
OPAQUE = 0.5  # what has a lower alpha is not there; the rest is opaque
SMOOTH_ANGLE = 60.0  # degrees; normals of a mesh that has none are smoothed over edges that are less sharp

PIXELS_PER_DEGREE = 67.0  # for FLIP: a monitor of 0.7 m and 3840 pixels, from 0.7 m


@dataclass(frozen=True)
class Limits:
    """How much images may differ where D is 1: mean FLIP, and 1 - mean SSIM."""

    flip: float
    ssim: float


STRICT = Limits(flip=0.06, ssim=0.024)  # a hard pop
FADE = Limits(flip=0.085, ssim=0.045)  # dithered
