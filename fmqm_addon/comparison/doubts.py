# SPDX-License-Identifier: GPL-3.0-or-later
"""Which facts of a pair should stop someone from believing its score, and which are only good to know, as sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from ..metric.evaluation import Result
from .impairment import MISSING, TRANSPARENCY
from .surface_facts import Fact

# Shares.
SIGN_IN_DOUBT = 0.01  # of samples whose side is doubtful on one mesh and not the same on both: the SDF's sign is noise
MOST_IN_DOUBT = 0.25  # FMQM's shape is then of no use; perceived takes no such sign
LEAST_COVERED = 0.6  # of the reference's area; the gaps between round patches alone leave out up to 0.25 (measured)
FLIPPED = 0.02  # of samples; a renderer that culls back faces shows holes there. Thin things turn when decimated
ADDED = 0.005  # of the distorted mesh's area; floating junk that the score leaves out
MAGENTA = 0.01  # of samples; images or tiles of UDIM sets are missing there
UV_MISSING = 0.01  # of the textured area; it is painted with a single pixel
WIDE_PATCHES = 0.05  # of the patches; slivers as long as the box
MANY = 100  # patches asked for: fewer are wide on any mesh
COLLAPSED = 0.05  # of triangles
ROUNDING = 1e-4  # of the reference's box: a thousandth of a patch
# Others.
COLOR_SHIFT = 5.0  # CIE 1976 difference, mean
MORE_TRIANGLES = 1.1  # times the reference's
_NAMED = 3  # of what is listed


def doubts(
    names: tuple[str, str], result: Result, sides: Sequence[Sequence[Fact]], pair: Sequence[Fact]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Warnings and notes of what passes its limit.

    Args:
        names: of reference and distorted. sides: facts of each. pair: of both.
    """
    of = {fact.name: fact.value for fact in pair}
    both = [{fact.name: fact.value for fact in facts} for facts in sides]
    # Positions that are steps lie as far from the other mesh as what is gone.
    blurred = max(side["rounding"] for side in both) * result.frame.scale > of["added_beyond"]
    warnings = [*_of_pair(*names, of, both, blurred), *_of_result(names[0], result, of)]
    for name, facts in zip(names, both, strict=True):
        warnings += _of_side(name, facts)
    # A mesh may be compared with itself.
    return tuple(dict.fromkeys(warnings)), tuple(dict.fromkeys(_notes(*names, of)))


def _of_pair(
    reference: str, distorted: str, of: dict[str, Any], sides: Sequence[dict[str, Any]], blurred: bool
) -> Iterator[str]:
    if of["missing_parts_count"]:
        count, names = of["missing_parts_count"], of["missing_parts"]
        what = "a part" if count == 1 else f"{count} parts"
        yield f"{distorted}: {what} of the original {'is' if count == 1 else 'are'} gone: {listed(names, count)}"
    elif of["missing"] > MISSING and not blurred:
        edges = [side["open_edges"] for side in sides]
        hole = f", and it has {edges[1]:,} open edges instead of {edges[0]:,}" if edges[1] > edges[0] else ""
        yield (
            f"{distorted}: {percent(of['missing'])} of the original's area is gone{hole}; fill its holes, or restore "
            "what is missing"
        )
    if of["color_shift"] > COLOR_SHIFT:
        yield (
            f"{distorted}: its colors differ by {of['color_shift']:.1f} on average (CIE 1976; 2.3 is just noticeable), "
            "which the scores hardly weigh; compare materials and color spaces"
        )
    if of["transparency_lost"] > TRANSPARENCY:
        yield (
            f"{distorted}: {percent(of['transparency_lost'])} of the samples lie where the original is see-through "
            "and it is not; the scores cannot see that (is its alpha still linked?)"
        )
    if of["transparency_gained"] > TRANSPARENCY:
        yield (
            f"{distorted}: {percent(of['transparency_gained'])} of the samples lie where it is see-through and the "
            "original is not; the scores cannot see that (check its alpha)"
        )
    if of["maps_lost"]:
        yield (
            f"{distorted}: it has no map any more for {listed(of['maps_lost'])}; the scores look at the base color "
            "only (link it again)"
        )
    if of["maps_added"]:
        yield (
            f"{distorted}: it has a map for {listed(of['maps_added'])}, which the original has not; the scores look "
            "at the base color only"
        )
    if of["flipped"] > FLIPPED:
        yield (
            f"{distorted}: {percent(of['flipped'])} of its faces, by samples, look the other way than the "
            "original's; the score cannot see that (recalculate its normals)"
        )
    if of["added"] > ADDED and not blurred:
        yield (
            f"{distorted}: {percent(of['added'])} of its area lies far from the original; the score looks around "
            "the original only and cannot see that (Both Directions, --both, does)"
        )
    if of["triangle_ratio"] > MORE_TRIANGLES:
        yield (
            f"{distorted}: it has {of['triangle_ratio']:.3g} times the triangles of the original; are the two in the "
            "wrong order?"
        )
    if of["sign_in_doubt_and_different"] > MOST_IN_DOUBT:
        yield f"{_unsure(distorted, of)}; close the holes, or turn the normals of either mesh outwards"


def _of_result(reference: str, result: Result, of: dict[str, Any]) -> Iterator[str]:
    all_scored = len(result.patches) >= min(result.settings.patches, len(result.patch_mesh.vertices))
    if all_scored and of["covered"] < LEAST_COVERED:
        yield (
            f"{reference}: the patches cover {percent(of['covered'])} of its area; the rest has no say in the "
            "score (more patches cover more)"
        )
    if result.settings.patches >= MANY and of["wide_patches"] > WIDE_PATCHES:
        yield (
            f"{reference}: a patch of it spans {percent(of['widest_patch'])} of its box, since its triangles are that "
            "long; they decide the score there more than its shape does (remesh it evenly)"
        )


def _of_side(name: str, of: dict[str, Any]) -> Iterator[str]:
    if of["magenta"] > MAGENTA:
        yield (
            f"{name}: {percent(of['magenta'])} of the samples on it are magenta, as Blender shows images and UDIM "
            "tiles that are missing; repair its images"
        )
    if of["uv_missing"] is not None and of["uv_missing"] > UV_MISSING:
        yield (
            f"{name}: {percent(of['uv_missing'])} of its textured area has no texture coordinates (all are 0, 0) and "
            "the color of one pixel; unwrap it"
        )
    if of["alpha_zero"]:
        yield (
            f"{name}: the alpha of {listed(of['alpha_zero'])} is 0 everywhere, so that nothing of it shows; the scores "
            "look at its colors all the same (unlink its alpha, or save the image without)"
        )
    if of["rounding"] > ROUNDING:
        yield (
            f"{name}: it lies so far from the origin that its positions are steps of {percent(of['rounding'])} of its "
            "box; export it near the origin"
        )
    if of["collapsed"] > COLLAPSED:
        yield (
            f"{name}: {percent(of['collapsed'])} of its triangles have collapsed to lines or lie on others; was "
            "precision lost when it was saved?"
        )


def _notes(reference: str, distorted: str, of: dict[str, Any]) -> Iterator[str]:
    if SIGN_IN_DOUBT < of["sign_in_doubt_and_different"] <= MOST_IN_DOUBT:
        yield _unsure(distorted, of)
    differ = [name for name in of["maps_not_seen"] if name not in {*of["maps_lost"], *of["maps_added"]}]
    if differ:
        yield f"{distorted}: its maps for {listed(differ)} differ from the original's; the scores do not look at them"


def _unsure(distorted: str, of: dict[str, Any]) -> str:
    return (
        f"{distorted}: open shells: FMQM's shape is unsure at {percent(of['sign_in_doubt_and_different'])} of the "
        "samples; perceived hardly"
    )


def listed(names: Sequence[str], count: int | None = None) -> str:
    """The first of some names, and how many more there are."""
    more = (len(names) if count is None else count) - _NAMED
    named = list(names[:_NAMED])
    if more > 0:
        return f"{', '.join(named)} and {more} more"
    return " and ".join(named) if len(named) < 3 else f"{', '.join(named[:-1])} and {named[-1]}"


def percent(share: float) -> str:
    """Three digits."""
    return f"{100 * share:.3g} %"
