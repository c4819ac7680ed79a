# SPDX-License-Identifier: GPL-3.0-or-later
"""A trust report as JSON, and what JSON keeps of it as text for people."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..comparison.surface_facts import Fact
from ..comparison.trust import Trust
from ..metric.errors import one_line
from .numbers import value_text
from .words import plain

Report = dict[str, dict[str, dict[str, Any]]]  # group, fact, "value" and "unit"

GROUPS = ("reference", "distorted", "pair")
SHARE = "share"  # what the unit of a share in [0, 1] begins with
_UNKNOWN = "?"
_SAID_BY_VALUE = {"yes or no", "number", "by material"}  # units that a reader of the value needs not be told
_APART = {"settings", "images"}  # not in the table: said elsewhere, and in lines of their own


def trust_dict(trust: Trust) -> Report:
    """Facts by group and name, each {"value": ..., "unit": ...}; one that is not known is null and says "why"."""
    return {group: {fact.name: _fact_dict(fact) for fact in getattr(trust, group)} for group in GROUPS}


@dataclass(frozen=True)
class Line:
    """A fact as people read it.

    Attributes:
        label: what. values: of the pair, or of original and LOD. unit: of them.
    """

    label: str
    values: tuple[str, ...]
    unit: str


def trust_lines(report: Report) -> list[Line]:
    """What trust_dict gave, line by line: the meshes' facts, the pair's, the images."""
    reference, distorted, pair = (report[group] for group in GROUPS)
    lines = [
        Line(_label(name), (_text(item), _text(distorted[name])), _unit(item, distorted[name]))
        for name, item in reference.items()
        if name not in _APART and not _is_long(item)
    ]
    apart = _APART if _was_baked(reference) or _was_baked(distorted) else {*_APART, "baked_at"}
    lines += [Line(_label(name), (_text(item),), _unit(item)) for name, item in pair.items() if name not in apart]
    for group in GROUPS[:2]:
        side = plain(group)
        lines += [
            Line(f"{_label(name)}, {side}", (_text(item),), _unit(item))
            for name, item in report[group].items()
            if name not in _APART and _is_long(item)
        ]
        lines += [Line(f"{image['role']}, {side}", (_image_text(image),), "") for image in _images(report[group])]
    return lines


def trust_text(report: Report) -> str:
    """An aligned table."""
    lines = trust_lines(report)
    labels = max(len(line.label) for line in lines)
    heads = tuple(map(plain, GROUPS[:2]))
    both = [heads, *(line.values for line in lines if len(line.values) == 2)]
    widths = [max(len(values[k]) for values in both) for k in range(2)]
    rows = [f"{'':{labels}}  {heads[0]:>{widths[0]}}  {heads[1]:>{widths[1]}}"]
    for line in lines:
        if len(line.values) == 2:
            cells = "  ".join(value.rjust(width) for value, width in zip(line.values, widths, strict=True))
        else:
            cells = line.values[0].rjust(sum(widths) + 2)
        rows.append(one_line(f"{line.label.ljust(labels)}  {cells}  {line.unit}".rstrip()))
    return "\n".join(rows) + "\n"


def _fact_dict(fact: Fact) -> dict[str, Any]:
    known = {"value": fact.value, "unit": fact.unit}
    return known if fact.value is not None else {**known, "why": fact.why}


def _label(name: str) -> str:
    return plain(name).replace("uv ", "UV ").replace("non manifold", "non-manifold")


def _unit(*items: dict[str, Any]) -> str:
    """The unit of a line's values, and why one of them is not known."""
    units = dict.fromkeys(item["why"] if item["value"] is None else item["unit"] for item in items)
    return "; ".join(unit.removeprefix(SHARE).strip() for unit in units if unit not in _SAID_BY_VALUE)


def _was_baked(group: dict[str, dict[str, Any]]) -> bool:
    return "colors_from" in group and "baked" in group["colors_from"]["value"].values()


def _is_long(item: dict[str, Any]) -> bool:
    """A list or a table: it has a line of its own for each mesh."""
    return isinstance(item["value"], (list, dict))


def _images(group: dict[str, dict[str, Any]]) -> list[dict[str, Any]]:
    images: list[dict[str, Any]] = group["images"]["value"]
    return images


def _text(item: dict[str, Any]) -> str:
    value = item["value"]
    if value is None:
        return _UNKNOWN
    return value_text(value, str(item["unit"]).startswith(SHARE))


def _image_text(image: dict[str, Any]) -> str:
    if image["missing"]:
        return f"{image['name']}, missing ({image['path'] or 'no path'})"
    return f"{image['name']}, {image['width']} x {image['height']}, {image['color_space']}"
