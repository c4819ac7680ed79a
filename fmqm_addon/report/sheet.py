# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a comparison: reference, distorted surface and heat map side by side, with their scores, as a PNG.

Only writing a PNG needs Pillow.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..comparison.judge import Judge
from ..metric.evaluation import Result
from ..metric.geometry import Floats
from ..metric.surface import Surface
from .atomic_files import replaced
from .heat import Heat, heat_of
from .labels import shorten
from .numbers import score_text
from .render import BACKGROUND, Camera, natural_aspect, render, render_all, require_pillow
from .visual.colormap import score_colors
from .visual.heat_map import round_ticks
from .visual.layers import number_text
from .words import LABELS, LOD, ORIGINAL

if TYPE_CHECKING:
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

INK, FAINT_INK, RULE = (32, 34, 38), (84, 88, 96), (150, 153, 158)
WIDTH = 1500  # pixels; the lengths and type sizes below are for a picture this wide
GAP, BAR_WIDTH, BAR_SPACE, HEAD, FOOT = 24, 22, 86, 64, 60


def write_picture(
    path: str,
    reference: Surface,
    distorted: Surface,
    result: Result,
    width: int = WIDTH,
    judge: Judge = Judge.FMQM,
) -> None:
    """A PNG of the reference, the distorted surface, and the reference colored by the judge's scores.

    The file is replaced when the new one is complete, or not at all.

    Args:
        reference, distorted: what the result compares. width: of the picture, in pixels.

    Raises:
        FMQMError: Pillow is missing. FileError: the path cannot be written.
    """
    require_pillow()
    with replaced(path) as temporary:
        compose(reference, distorted, result, width, judge).save(temporary, "PNG")


def compose(
    reference: Surface, distorted: Surface, result: Result, width: int = WIDTH, judge: Judge = Judge.FMQM
) -> Image:
    """The picture of write_picture, as a Pillow image of so many pixels in width.

    Raises:
        FMQMError: Pillow is missing.
    """
    require_pillow()
    from PIL import Image, ImageDraw

    sheet = _Sheet(width, natural_aspect(reference, distorted))
    heat = heat_of(reference, result, judge)
    camera = Camera.framing(reference, distorted, aspect=sheet.panel[1] / sheet.panel[0])
    own, painted = render_all(reference, camera, sheet.panel, (None, heat.paint))
    views = (own, render(distorted, camera, sheet.panel), painted)
    canvas = Image.new("RGB", (width, sheet.height), BACKGROUND)
    for index, view in enumerate(views):
        canvas.paste(Image.fromarray(view), (sheet.left(index), sheet.top))
    draw = ImageDraw.Draw(canvas)
    score = float(heat.values.mean())
    features = [f"{LABELS[name]} {score_text(result.of_patches(name).mean(), places=3)}" for name in judge.features]
    sheet.label(draw, 0, ORIGINAL, reference.name, f"{len(reference.triangles):,} triangles")
    sheet.label(draw, 1, LOD, distorted.name, f"{len(distorted.triangles):,} triangles")
    heading = f"{LABELS[judge.column]} {score_text(score)}"
    sheet.label(draw, 2, heading, "   ".join(features[:2]), "   ".join(features[2:]))
    sheet.color_bar(draw, LABELS[judge.column], score, heat)
    return canvas


class _Sheet:
    """Where things stand in the picture, in pixels.

    Attributes:
        panel: width and height of a panel. top: of the panels. height: of the whole.
    """

    def __init__(self, width: int, aspect: float) -> None:
        self._unit = width / WIDTH  # type and spaces grow with the whole
        panel_width = (width - self._px(4 * GAP + BAR_SPACE)) // 3
        self.panel = (panel_width, round(panel_width * aspect))
        self.top = self._px(HEAD)
        self.height = self.top + self.panel[1] + self._px(FOOT)

    def left(self, index: int) -> int:
        """Of a panel; index 3 is the color bar."""
        return self._px(GAP) + index * (self.panel[0] + self._px(GAP))

    def label(self, draw: ImageDraw, index: int, title: str, *lines: str) -> None:
        """A title above a panel and lines below it, centered."""
        center = self.left(index) + self.panel[0] / 2
        self._text(draw, (center, self._px(HEAD / 2)), title, 26, INK, "mm")
        for number, line in enumerate(lines):
            y = self.top + self.panel[1] + self._px(14 + 24 * number)
            self._text(draw, (center, y), line, 17, FAINT_INK, "mm")

    def color_bar(self, draw: ImageDraw, column: str, score: float, heat: Heat) -> None:
        """Scores and their colors, 1 at the top, with a mark at the whole score."""
        px = self._px
        left, right = self.left(3), self.left(3) + px(BAR_WIDTH)
        top, bottom = self.top + px(40), self.top + self.panel[1] - px(40)
        rows = np.arange(bottom - top + 1)
        for row, color in zip(rows.tolist(), score_colors(1 - rows / rows[-1]), strict=True):
            draw.line([(left, top + row), (right, top + row)], fill=_to_bytes(color))

        def height(value: float) -> int:
            return round(bottom - (bottom - top) * min(max((value - heat.low) / (heat.high - heat.low), 0), 1))

        ticks = round_ticks(heat.low, heat.high)
        text = number_text(ticks[1] - ticks[0])
        for tick in ticks:
            y = height(tick)
            draw.line([(right + px(3), y), (right + px(8), y)], fill=RULE, width=max(px(1), 1))
            self._text(draw, (right + px(13), y), text(tick), 16, INK, "lm")
        y = height(score)
        draw.polygon([(left - px(2), y), (left - px(11), y - px(6)), (left - px(11), y + px(6))], fill=INK)
        self._text(draw, (left, top - px(24)), column, 16, INK, "lm")
        if heat.has_gaps:
            self._text(draw, (left, bottom + px(24)), "pale: no patch", 14, FAINT_INK, "lm")

    def _px(self, length: float) -> int:
        """A length in a picture of the usual WIDTH, here."""
        return round(length * self._unit)

    def _text(
        self, draw: ImageDraw, at: tuple[float, float], text: str, size: int, color: tuple[int, int, int], anchor: str
    ) -> None:
        """Text in one line; what is wider than a panel loses its middle."""
        from PIL import ImageFont

        font = ImageFont.load_default(max(self._px(size), 1))
        shown = shorten(text, lambda part: draw.textlength(part, font=font) <= self.panel[0])
        draw.text(at, shown, fill=color, font=font, anchor=anchor)


def _to_bytes(color: Floats) -> tuple[int, int, int]:
    red, green, blue = np.rint(color * 255).astype(int).tolist()
    return red, green, blue
