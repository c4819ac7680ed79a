# SPDX-License-Identifier: GPL-3.0-or-later
"""A pair part by part: each object, material and connected part of the reference, its scores, and whether it is gone.

A part that is gone drowns in the mean over all patches, and may lie where no patch is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..metric.evaluation import Result
from ..metric.geometry import Floats, Ints
from ..metric.stepper import Progress, Work
from ..metric.surface import Surface
from .distances import points_at, squared_distances
from .places import place_name
from .surface_facts import NO_MATERIAL, box_of

LISTED = 50  # the largest parts of a kind; and as many others that are gone
POINTS = 100  # spread over a part; it is gone where more than half of them are far
_FIRST_POINTS = 6  # of a part; where none of these is far, hardly half of all are, and never all
FAR = 0.1  # of the diagonal of the part's box
MOST = 20_000  # parts of a kind that are looked for, the largest
_BATCH = 2048  # nearest points of a step


@dataclass(frozen=True)
class Part:
    """An object, a material or a connected part of the reference.

    Attributes:
        kind: "object", "material" or "connected". name: of it; connected parts have names by their objects and places.
        triangles: of it. area: share of the reference's, in [0, 1].
        FMQM, perceived: means of the patch scores, weighted by each patch's area in the part; None: no patch has any.
        missing: the distorted mesh has nothing where most of it is.
    """

    kind: str
    name: str
    triangles: int
    area: float
    FMQM: float | None
    perceived: float | None
    missing: bool

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self)


@dataclass(frozen=True)
class Grouping:
    """The triangles of a surface, divided.

    Attributes:
        kind: as in Part. names: G names; "" for one that its place names.
        label: (T,) its group, in [0, G). order: (T,) the triangles, group after group. start: (G + 1,) of each in
            order.
        areas: (T,) of the triangles in order, summed up. low, high: (G, 3) corners of each group's box.
    """

    kind: str
    names: tuple[str, ...]
    label: Ints
    order: Ints
    start: Ints
    areas: Floats
    low: Floats
    high: Floats

    def area(self) -> Floats:
        """(G,) of each group."""
        summed = np.concatenate([[0.0], self.areas])
        return np.asarray(summed[self.start[1:]] - summed[self.start[:-1]])

    def triangles(self, row: int) -> Ints:
        """Those of a group."""
        return self.order[self.start[row] : self.start[row + 1]]


@dataclass(frozen=True)
class PartsReport:
    """The parts of a pair.

    Attributes:
        parts: the LISTED largest of each kind, and those that are gone, largest first.
        missing: names of what is gone, each place once: objects before their parts.
        missing_count: how many that are; names are no more than LISTED.
    """

    parts: tuple[Part, ...]
    missing: tuple[str, ...]
    missing_count: int


def groupings(surface: Surface) -> Work[tuple[Grouping, ...]]:
    """A surface by objects, connected parts and materials; yields the share done."""
    areas = surface.areas
    boxes = yield from _boxes(surface)
    yield Progress("", 0.2)
    connected = connected_parts(surface.triangles)
    yield Progress("", 0.6)
    names = [material.name or NO_MATERIAL for material in surface.materials]
    materials = list(dict.fromkeys(names))  # baked for several objects it is one all the same
    by_name = np.array([materials.index(name) for name in names])[surface.material]
    return (
        _grouping(boxes, areas, "object", surface.object, _numbered(surface.objects)),
        _grouping(boxes, areas, "connected", connected, ("",) * (int(connected.max()) + 1)),
        _grouping(boxes, areas, "material", by_name, materials),
    )


def connected_parts(triangles: Ints) -> Ints:
    """(T,) the connected part of each triangle, numbered from 0 on in the order of their lowest vertices."""
    parent = np.arange(int(triangles.max()) + 1)
    a, b, c = triangles.T
    one, other = np.concatenate([a, b]), np.concatenate([b, c])
    while len(one):
        # The higher of two roots hangs on the lower one; then every vertex climbs to its root.
        np.minimum.at(parent, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(grand := parent.take(parent), parent):
            parent = grand
        one, other = parent.take(one), parent.take(other)
        apart = np.flatnonzero(one != other)
        one, other = one.take(apart), other.take(apart)
    root = parent.take(a)
    found = np.zeros(len(parent), bool)
    found[root] = True
    return np.asarray((np.cumsum(found) - 1)[root])


def parts_report(
    groups: Sequence[Grouping], reference: Surface, distorted: Surface, result: Result
) -> Work[PartsReport]:
    """Scores of parts, and which are gone; yields the share done.

    Args:
        groups: groupings of the reference.
    """
    parts: list[Part] = []
    gone: list[str] = []
    faces = np.concatenate([patch.faces for patch in result.patches])
    patch = np.repeat(np.arange(len(result.patches)), [len(patch.faces) for patch in result.patches])
    seen = _Seen(
        result.patch_mesh.parent.take(faces),
        result.patch_mesh.areas.take(faces),
        result.of_patches("FMQM").take(patch),
        result.of_patches("perceived").take(patch),
    )
    covered = np.zeros(len(reference.triangles), bool)
    box = box_of(reference.vertices)
    known: list[tuple[Ints, NDArray[np.bool_]]] = []
    for number, group in enumerate(groups):
        area = group.area()
        largest = np.argsort(-area, kind="stable")
        missing = next((found for label, found in known if np.array_equal(label, group.label)), None)
        if missing is None:  # often each object is one connected part
            missing = yield from _missing(group, largest[:MOST], reference, distorted, result.settings.seed)
            known.append((group.label, missing))
        yield Progress("", (number + 1) / len(groups))
        lost = largest[missing[largest]].tolist()
        listed = list(dict.fromkeys([*largest[:LISTED].tolist(), *lost[:LISTED]]))
        names = {row: group.names[row] or _place_in_object(reference, box, group, row) for row in {*listed, *lost}}
        scores = dict(zip(listed, _scores(group, listed, seen), strict=True))
        parts += [
            Part(
                kind=group.kind,
                name=names[row],
                triangles=int(group.start[row + 1] - group.start[row]),
                area=float(area[row] / group.areas[-1]),
                FMQM=scores[row][0],
                perceived=scores[row][1],
                missing=bool(missing[row]),
            )
            for row in listed
        ]
        for row in lost:
            its = group.triangles(row)
            if not covered[its].all():
                covered[its] = True
                gone.append(names[row])
    return PartsReport(tuple(parts), tuple(gone[:LISTED]), len(gone))


def _numbered(names: Sequence[str]) -> tuple[str, ...]:
    """Each name once: those that come again get a number."""
    seen: Counter[str] = Counter()
    numbered = []
    for name in names:
        seen[name] += 1
        numbered.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return tuple(numbered)


def _boxes(surface: Surface) -> Work[tuple[Floats, Floats]]:
    """(3, T) lowest and highest corner of the box of each triangle; yields 0."""
    low, high = np.empty((2, 3, len(surface.triangles)))
    corners = [np.ascontiguousarray(corner) for corner in surface.triangles.T]
    for axis, values in enumerate(surface.vertices.T.copy()):
        a, b, c = (values.take(corner) for corner in corners)
        np.minimum(np.minimum(a, b), c, out=low[axis])
        np.maximum(np.maximum(a, b), c, out=high[axis])
        yield Progress("", 0.0)
    return low, high


def _grouping(boxes: tuple[Floats, Floats], areas: Floats, kind: str, given: Ints, names: Sequence[str]) -> Grouping:
    """The groups that have triangles.

    Args:
        boxes: of the triangles.
    """
    count = np.bincount(given)
    used = np.flatnonzero(count)
    label = (np.cumsum(count > 0) - 1)[given]
    start = np.concatenate([[0], np.cumsum(count[used])])
    small = label.astype(np.uint16) if len(used) < 1 << 16 else label  # sorts several times faster
    order = np.argsort(small, kind="stable") if len(used) > 1 else np.arange(len(label))
    if len(used) > 1:
        areas, boxes = areas.take(order), (boxes[0].take(order, axis=1), boxes[1].take(order, axis=1))
    low = np.minimum.reduceat(boxes[0], start[:-1], axis=1).T
    high = np.maximum.reduceat(boxes[1], start[:-1], axis=1).T
    return Grouping(
        kind=kind,
        names=tuple(names[row] for row in used.tolist()),
        label=label,
        order=order,
        start=start,
        areas=np.cumsum(areas),
        low=low,
        high=high,
    )


def _missing(group: Grouping, rows: Ints, reference: Surface, distorted: Surface, seed: int) -> Work[NDArray[np.bool_]]:
    """(G,) which groups are gone, of the given rows; yields 0."""
    missing = np.zeros(len(group.names), bool)
    rng = np.random.default_rng(seed)
    first = yield from _far_share(group, rows, _FIRST_POINTS, reference, distorted, rng)
    suspects = rows[first > 0]
    missing[suspects] = (yield from _far_share(group, suspects, POINTS, reference, distorted, rng)) > 0.5
    return missing


def _far_share(
    group: Grouping, rows: Ints, count: int, reference: Surface, distorted: Surface, rng: np.random.Generator
) -> Work[Floats]:
    """(rows,) share of so many points on each group that lie farther from the distorted mesh than FAR of its box."""
    share = np.empty(len(rows))
    summed = np.concatenate([[0.0], group.areas])
    reach = (FAR * np.linalg.norm(group.high - group.low, axis=1)) ** 2
    at_once = max(1, _BATCH // count)
    for begin in range(0, len(rows), at_once):
        here = rows[begin : begin + at_once]
        first, last = summed[group.start[here]], summed[group.start[here + 1]]
        steps = (np.arange(count) + rng.random((len(here), count))) / count
        place = np.searchsorted(group.areas, first[:, None] + steps * (last - first)[:, None], side="right")
        place = np.clip(place, group.start[here, None], group.start[here + 1, None] - 1)
        points = points_at(reference, group.order[place.ravel()], rng)
        away = squared_distances(distorted, points).reshape(len(here), count)
        share[begin : begin + at_once] = (away > reach[here, None]).mean(axis=1)
        yield Progress("", 0.0)
    return share


@dataclass(frozen=True)
class _Seen:
    """The (n,) faces of all patches: their triangles, areas, and the scores of their patches."""

    triangle: Ints
    area: Floats
    fmqm: Floats
    perceived: Floats


def _scores(group: Grouping, rows: list[int], seen: _Seen) -> list[tuple[float | None, float | None]]:
    """FMQM and perceived of some groups."""
    label, n_groups = group.label.take(seen.triangle), len(group.names)
    whole = np.bincount(label, weights=seen.area, minlength=n_groups)[rows].tolist()
    fmqm, perceived = (
        np.bincount(label, weights=seen.area * scores, minlength=n_groups)[rows].tolist()
        for scores in (seen.fmqm, seen.perceived)
    )
    return [
        (None, None) if total <= 0 else (min(a / total, 1.0), min(b / total, 1.0))
        for a, b, total in zip(fmqm, perceived, whole, strict=True)
    ]


def _place_in_object(reference: Surface, box: Floats, group: Grouping, row: int) -> str:
    """The name of a connected part: its object's, its number, and where it is in the reference's (2, 3) box."""
    its = group.triangles(row)
    name = reference.objects[int(reference.object[its[0]])]
    center = (group.low[row] + group.high[row]) / 2
    place = place_name(center, *box)
    return f"{name}, piece {row + 1} of {len(group.names)} ({place})"
