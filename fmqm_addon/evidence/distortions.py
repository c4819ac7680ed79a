# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done to a model: eight kinds of distortion in levels, five mixed ones, and which is harsher than which.

The kinds are those of SJTU-TMQA, the paper's second data set; its levels are not all published, ours are below. The
names of the mixed ones are YANA's, the third's. It has ten levels of simplification, 7 to 11 bits for positions, 6 to
10 for texture coordinates, five sizes and five qualities; which five we mix, and what a level of simplification keeps,
is our choice.
"""

from __future__ import annotations

from dataclasses import dataclass

GN, QP, SOT, SWT, DS, TMC, MQ, GTC, YANA = KINDS = ("GN", "QP", "SOT", "SWT", "DS", "TMC", "MQ", "GTC", "YANA")
MEANING = {
    GN: "vertices shaken by Gaussian noise, % of the box diagonal",
    QP: "positions rounded to bits",
    SOT: "fewer triangles, texture seams free to move, % kept",
    SWT: "fewer triangles, texture seams kept, % kept",
    DS: "texture side divided",
    TMC: "texture compressed, quality",
    MQ: "positions and texture coordinates rounded to bits",
    GTC: "SWT and TMC together",
    YANA: "all at once",
}

NOISE = (0.05, 0.1, 0.2, 0.4, 0.8)  # standard deviation, % of the box diagonal
POSITION_BITS = (10, 9, 8, 7, 6)
KEPT_FREE = (50, 25, 12, 6)  # % of the triangles
KEPT_SEAMS = (50, 25, 12, 6, 3)
DIVISORS = (2, 4, 8, 16, 32)
JPEG, WEBP = "JPEG", "WEBP"
CODECS = (*((JPEG, quality) for quality in (75, 50, 20, 10, 4)), (WEBP, 10))
MIXED_BITS = (11, 10, 9, 8, 7, 6)
GTC_KEPT, GTC_QUALITIES = (50, 12, 3), (75, 20, 4)  # every second level of SWT and of TMC
# simpL, qp, qt, side, Q: each is in all five at least as harsh as the one before it.
YANA_MIXES = ((1, 11, 10, 2048, 90), (3, 10, 9, 1440, 50), (5, 9, 8, 1024, 10), (8, 8, 7, 712, 10), (10, 7, 6, 512, 10))
YANA_OCTAVE = 2  # levels of simplification that halve the triangles


@dataclass(frozen=True)
class Distortion:
    """One level of one kind; what it does is done in the order of its fields.

    Attributes:
        kind: one of KINDS. level: from 1, the mildest, as far as a kind has an order. name: unique among them.
        label: its level as people read it.
        kept: share of the triangles; 1 leaves them. seams: texture seams are kept meanwhile.
        noise: standard deviation of the vertices, in box diagonals.
        position_bits, uv_bits: of the grid that they are rounded to; 0 leaves them.
        divisor: of the textures' sides. side: of a texture at most; 0 leaves it.
        codec, quality: what its texture is encoded with and decoded from; "" leaves it.
    """

    kind: str
    level: int
    name: str
    label: str
    kept: float = 1.0
    seams: bool = False
    noise: float = 0.0
    position_bits: int = 0
    uv_bits: int = 0
    divisor: int = 1
    side: int = 0
    codec: str = ""
    quality: int = 0

    @property
    def on_texture(self) -> bool:
        """Whether it changes a texture, which there must be."""
        return self.divisor > 1 or self.side > 0 or bool(self.codec)

    @property
    def on_coordinates(self) -> bool:
        """Whether it changes texture coordinates, which there must be."""
        return self.uv_bits > 0


def _all() -> tuple[Distortion, ...]:
    """Kind after kind, from mild to harsh."""
    found: list[Distortion] = []

    def add(kind: str, level: int, label: str, name: str = "", **does: object) -> None:
        found.append(Distortion(kind, level, name or f"{kind}_{level}", label, **does))  # type: ignore[arg-type]

    for level, percent in enumerate(NOISE, 1):
        add(GN, level, f"{percent} %", noise=percent / 100)
    for level, bits in enumerate(POSITION_BITS, 1):
        add(QP, level, f"{bits} bits", position_bits=bits)
    for level, percent in enumerate(KEPT_FREE, 1):
        add(SOT, level, f"{percent} %", kept=percent / 100)
    for level, percent in enumerate(KEPT_SEAMS, 1):
        add(SWT, level, f"{percent} %", kept=percent / 100, seams=True)
    for level, divisor in enumerate(DIVISORS, 1):
        add(DS, level, f"1/{divisor}", divisor=divisor)
    for level, (codec, quality) in enumerate(CODECS, 1):
        add(TMC, level, f"{codec} {quality}", codec=codec, quality=quality)
    for level, bits in enumerate(MIXED_BITS, 1):
        add(MQ, level, f"{bits} bits", position_bits=bits, uv_bits=bits)
    for row, percent in enumerate(GTC_KEPT):
        for column, quality in enumerate(GTC_QUALITIES, 1):
            level, label = row * len(GTC_QUALITIES) + column, f"{percent} %, {JPEG} {quality}"
            add(GTC, level, label, kept=percent / 100, seams=True, codec=JPEG, quality=quality)
    for level, (simplified, qp, qt, side, quality) in enumerate(YANA_MIXES, 1):
        name = f"simpL{simplified}_qp{qp}_qt{qt}_decompJPEG_{side}x{side}_Q{quality}"
        kept = 2 ** (-simplified / YANA_OCTAVE)
        mixed = {"position_bits": qp, "uv_bits": qt, "side": side, "codec": JPEG, "quality": quality}
        add(YANA, level, name, name, kept=kept, **mixed)
    return tuple(found)


DISTORTIONS = _all()


def steps() -> tuple[tuple[Distortion, Distortion], ...]:
    """All (milder, harsher) neighbors.

    WebP is in no order with the JPEGs. Of GTC one of the two parts is harsher, and the other the same.
    """
    found = []
    for kind in KINDS:
        chain = [each for each in DISTORTIONS if each.kind == kind and each.codec != WEBP]
        if kind == GTC:
            width = len(GTC_QUALITIES)
            rows = [chain[first : first + width] for first in range(0, len(chain), width)]
            chains = [*rows, *map(list, zip(*rows, strict=True))]
        else:
            chains = [chain]
        found += [pair for each in chains for pair in zip(each[:-1], each[1:], strict=True)]
    return tuple(found)
