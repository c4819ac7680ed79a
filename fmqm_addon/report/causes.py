# SPDX-License-Identifier: GPL-3.0-or-later
"""What the facts of a pair say about why it looks different, and what to do about it, as sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from ..comparison.color_shift import JUST_NOTICEABLE
from ..comparison.doubts import COLOR_SHIFT
from ..comparison.impairment import MISSING

_LOW = 0.97  # a feature below it asks for a cause
_FEWER = 0.75  # of the reference's triangles: few enough to be the cause
_SMALLER = 0.75  # of the side of the reference's largest texture


class Facts:
    """The values of a record's trust report by name.

    Attributes:
        pair, reference, distorted: of each group; empty where there is no report. Facts that are not known are None.
    """

    def __init__(self, record: Mapping[str, Any]) -> None:
        trust = record.get("trust") or {}
        self.pair, self.reference, self.distorted = (
            {name: item["value"] for name, item in trust.get(group, {}).items()}
            for group in ("pair", "reference", "distorted")
        )


def causes(features: Mapping[str, float], facts: Facts) -> Iterator[str]:
    """What is not said by a warning already.

    Args:
        features: shape, facing, color and detail, as a record's "perceived" has them.
    """
    of = facts.pair
    ratio = of.get("triangle_ratio")
    is_whole = not of.get("missing_parts_count") and (of.get("missing") or 0) <= MISSING
    if is_whole and features["facing"] < _LOW and ratio is not None and ratio < _FEWER:
        yield (
            f"With {100 * ratio:.3g} % of the triangles its silhouette and shading are faceted; allow more, shade it "
            "smooth or bake a normal map."
        )
    opened = [side.get("open_edges") for side in (facts.reference, facts.distorted)]
    if opened[0] == 0 and opened[1]:
        yield f"Its shell is open, with {opened[1]:,} open edges where the original has none; fill the holes."
    if JUST_NOTICEABLE <= (of.get("color_shift") or 0) <= COLOR_SHIFT:
        yield (
            f"Its colors have shifted by {of['color_shift']:.1f} on average (CIE 1976); compare base colors and the "
            "color spaces of the images."
        )
    if min(features["color"], features["detail"]) < _LOW:
        yield from _of_texture(features, facts)


def _of_texture(features: Mapping[str, float], facts: Facts) -> Iterator[str]:
    sides = [largest_side(side) for side in (facts.reference, facts.distorted)]
    if sides[0] and sides[1] and sides[1] < _SMALLER * sides[0]:
        yield f"Its texture is smaller, {sides[1]} pixels a side instead of {sides[0]}; keep a larger one."
    elif facts.pair.get("same_images") and min(features["shape"], features["facing"]) >= _LOW:
        yield "It has the original's own images, which lie on it differently; its UVs have moved or a seam is broken."
    elif facts.pair.get("same_images") is False and features["detail"] < min(_LOW, features["color"]):
        yield "Its texture is another one: blurred, compressed more, or baked anew; compare the images."


def largest_side(side: Mapping[str, Any]) -> int:
    """Of the largest image of a mesh's facts that base colors come from, in pixels; 0 for none."""
    images = side.get("images") or ()
    return max((max(image["width"], image["height"]) for image in images if image["role"] == "base color"), default=0)
