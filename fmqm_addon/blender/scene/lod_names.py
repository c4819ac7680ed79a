# SPDX-License-Identifier: GPL-3.0-or-later
"""What names tell: levels of detail, and hulls for collisions. Needs no bpy."""

from __future__ import annotations

import re
from typing import NamedTuple

# Rock_LOD0, rock_lod1, LOD1_Rock, Rock.LOD1, Rock LOD 2, Rock_LOD1_low; not "Melody3" and not "Exploded1".
_LOD = re.compile(r"(?:(?:^|[_\-. ])(?i:lod)|(?<=[a-z0-9])LOD)[_\-. ]?(\d{1,2})(?!\d)")
# Names that mean other things too: x00_Rock, Rock_L0 (a left arm's first part), rock_high and rock_low (two rocks).
_PREFIX = re.compile(r"x(\d\d)[_\-. ]", re.IGNORECASE)
_SUFFIX = re.compile(r"[_\-. ]L(\d{1,2})$", re.IGNORECASE)
_WORD = re.compile(r"[_\-. ](high|mid|medium|low)(?:[_\-. ]?poly)?$", re.IGNORECASE)
_WORDS = {"high": 0, "mid": 1, "medium": 1, "low": 2}

_COPY_NUMBER = re.compile(r"\.\d{3,}$")  # Rock_LOD1.001
_SEPARATORS = "_-. "

# As game engines know them: Unreal's boxes, spheres, capsules and convex hulls, Godot's and Unity's endings.
_COLLIDER = re.compile(
    r"(?:UCX|UBX|USP|UCP)_.*|.*(?:-(?:conv)?col(?:only)?|_collider|_collision)(?:[_\-. ]?\d+)?",
    re.IGNORECASE | re.DOTALL,
)


class LODName(NamedTuple):
    """A level of detail as a name tells it.

    Attributes:
        stem: the asset's name, in lower case. level: 0 is the finest.
        sure: the name means nothing else; where it may, the levels must stand in one place as well.
    """

    stem: str
    level: int
    sure: bool


def lod_of_name(name: str) -> LODName | None:
    """The asset and the level that a name tells; None if it tells none."""
    base = _COPY_NUMBER.sub("", name)
    match = _LOD.search(base)
    if match is not None:
        parts = (base[: match.start()].strip(_SEPARATORS), base[match.end() :].strip(_SEPARATORS))
        return LODName("_".join(filter(None, parts)).lower(), int(match[1]), True)
    for match in (_PREFIX.match(base), _SUFFIX.search(base), _WORD.search(base)):
        stem = "" if match is None else (base[: match.start()] + base[match.end() :]).strip(_SEPARATORS).lower()
        if match is not None and stem:
            word = match[1].lower()
            return LODName(stem, _WORDS[word] if word in _WORDS else int(word), False)
    return None


def stem_of_name(name: str) -> str:
    """The asset's name without its level, in lower case."""
    found = lod_of_name(name)
    return _COPY_NUMBER.sub("", name).lower() if found is None else found.stem


def without_level_0(name: str) -> str:
    """A name to which another level can be added: Rock_LOD0 and LOD0_Rock without that, others as they are."""
    match = _LOD.search(name)
    if match is None or int(match[1]) != 0:
        return name
    return (name[: match.start()].rstrip(_SEPARATORS) + name[match.end() :]).strip(_SEPARATORS) or name


def is_collider(name: str) -> bool:
    """Whether a name tells a hull that stands for an asset where things collide, and is never seen."""
    return _COLLIDER.fullmatch(_COPY_NUMBER.sub("", name)) is not None
