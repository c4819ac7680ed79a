# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a record is one: what comes from a file, a stranger's perhaps, is looked at before it is shown."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

from ..comparison.impairment import IMPAIRMENTS
from ..comparison.judge import Judge
from ..metric.perceived import Perceived
from .explain import explain
from .html.kept import FRONT_VIEW, KINDS, LOSS, MESHES, is_viewer
from .records import RECORD_KEYS, SHOWN, STAGES
from .trust_table import GROUPS, trust_lines

_PICTURE = re.compile(r"pictures/[A-Za-z0-9-]+\.jpg")  # as pictures.picture_stem names them: no path leads elsewhere
_LARGEST = 2**63  # of a number; larger ones cannot be shown
# What code that shows something meets where that is of another shape.
_CANNOT_BE_SHOWN = (
    AttributeError, IndexError, KeyError, OverflowError, RecursionError, StopIteration, TypeError, ValueError,
)  # fmt: skip
_BOUNDS = ("", "at least", "below")  # of a size on screen
_ROUNDING = 1e-9  # by which a score may leave [0, 1]


def checked_json(text: str | bytes) -> Any:
    """What a JSON text holds.

    Raises:
        ValueError: it is none, holds NaN or an infinite number, or is nested too deeply.
    """
    try:
        value = json.loads(text, parse_constant=_refuse)
        _check_numbers(value)
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    return value


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no number")


def _check_numbers(value: Any) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("a number is too large")
    if isinstance(value, (dict, list)):
        for part in value.values() if isinstance(value, dict) else value:
            _check_numbers(part)


def record_fault(record: object) -> str:
    """What is wrong with what should be a record, as checked_json read it; "" for nothing."""
    if not isinstance(record, dict):
        return "it is no record"
    missing = sorted(RECORD_KEYS - record.keys())
    if missing:
        return f"{missing[0]} is missing"
    for name, is_right in _KINDS.items():
        if name in record and not is_right(record[name]):
            return f"{name} is not what it should be"
    if (record["error"] is None) != _is_scores(record):
        return "it has neither five scores nor an error"
    if (record["error"] is None) != (_is_perceived(record["perceived"]) and _is_share(record["fmqm_p10"])):
        return "perceived or fmqm_p10 is not what it should be"
    try:
        explain(record)
    except _CANNOT_BE_SHOWN:
        return "where, trust or attribution is not what it should be"
    return ""


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_optional_text(value: object) -> bool:
    return value is None or isinstance(value, str)


def _is_number(value: object) -> bool:
    """Whether it is finite and not too large to be shown; True and False are no numbers."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < _LARGEST


def _is_count(value: object) -> bool:
    return isinstance(value, int) and _is_number(value) and value >= 0


def _is_share(value: object) -> bool:
    return isinstance(value, (int, float)) and _is_number(value) and -_ROUNDING <= value <= 1 + _ROUNDING


def _is_scores(value: object) -> bool:
    return isinstance(value, Mapping) and all(_is_share(value.get(name)) for name in SHOWN)


def _is_perceived(value: object) -> bool:
    return (
        isinstance(value, Mapping)
        and all(_is_share(value.get(name)) for name in Perceived._fields)
        and "stderr" in value
        and _is_errors(value["stderr"], Perceived._fields)
    )


def _is_reverse(value: object) -> bool:
    return isinstance(value, Mapping) and _is_scores(value) and _is_perceived(value.get("perceived"))


def _is_no_perceived(value: object) -> bool:
    """Whether it is that of a pair without scores."""
    return value == dict.fromkeys((*Perceived._fields, "stderr"))


def _is_list(value: object, is_right: Any, length: int | None = None) -> bool:
    return (
        isinstance(value, Sequence)
        and not isinstance(value, str)
        and length in (None, len(value))
        and all(map(is_right, value))
    )


def _is_errors(value: object, names: Sequence[str] = SHOWN) -> bool:
    return value is None or (isinstance(value, Mapping) and all(_is_amount(value.get(name)) for name in names))


def _is_amount(value: object) -> bool:
    return isinstance(value, (int, float)) and _is_number(value) and value >= 0


def is_settings(value: object) -> bool:
    """Whether it is a table of names and plain values."""
    return isinstance(value, dict) and all(
        part is None or isinstance(part, (bool, str)) or _is_number(part) for part in value.values()
    )


def _is_picture(value: object) -> bool:
    return isinstance(value, str) and bool(_PICTURE.fullmatch(value))


def _are_pictures(value: object, kinds: Sequence[str]) -> bool:
    return isinstance(value, Mapping) and all(_is_picture(value.get(kind)) for kind in kinds)


def _is_view(value: object) -> bool:
    return (
        isinstance(value, Mapping)
        and _are_pictures(value, KINDS)
        and value.get("name") in (LOSS, FRONT_VIEW)
        and _is_list(value.get("size"), _is_count, 2)
    )


def _is_worst(value: object) -> bool:
    return (
        isinstance(value, Mapping)
        and _are_pictures(value, MESHES)
        and all(_is_share(value.get(name)) for name in ("FMQM", "perceived", "value"))
        and all(_is_text(value.get(name)) for name in ("blame", "place"))
        and _is_optional_text(value.get("object"))
        and _is_list(value.get("at"), lambda at: at is None or _is_list(at, _is_number, 2))
    )


def _is_pictures(value: object) -> bool:
    return value is None or (
        isinstance(value, Mapping)
        and _is_list(value.get("views"), _is_view)
        and len(value["views"]) > 0
        and _are_pictures(value.get("thumbnails"), KINDS)
        and _is_list(value.get("range"), _is_share, 2)
        and value["range"][0] < value["range"][1]
        and _is_list(value.get("histogram"), _is_count)
        and len(value["histogram"]) > 0
        and all(_is_list(value.get(name), _is_count, 2) for name in ("triangles", "texture_bytes"))
        and value.get("judge") in tuple(Judge)
        and isinstance(value.get("has_gaps"), bool)
        and _is_list(value.get("worst"), _is_worst)
        and all(len(worst["at"]) == len(value["views"]) for worst in value["worst"])
    )


def is_screen_size(value: object) -> bool:
    """Whether it can be shown as what screen_size.records.size_record gives."""
    return (
        isinstance(value, Mapping)
        and all(
            isinstance(size, Mapping) and _is_amount(size.get("pixels")) and size.get("bound") in _BOUNDS
            for size in (value.get("strict"), value.get("fade"))
        )
        and _is_list(value.get("curve"), _is_at_size)
        and len(value["curve"]) > 0
        and _is_list(value.get("notes", []), _is_text)
    )


def _is_at_size(value: object) -> bool:
    return (
        isinstance(value, Mapping)
        and _is_amount(value.get("D_strict"))
        and _is_amount(value.get("size"))
        and value["size"] > 0
    )


def is_attribution(value: object) -> bool:
    """Whether it is what comparison.attribution.Attribution.as_dict gives."""
    return (
        isinstance(value, Mapping)
        and all(_is_number(value.get(name)) for name in ("geometry_loss", "texture_loss"))
        and all(_is_text(value.get(name)) for name in ("phrase", "mostly", "how"))
    )


def is_part(value: object) -> bool:
    """Whether it is what comparison.parts.Part.as_dict gives."""
    return (
        isinstance(value, Mapping)
        and all(_is_text(value.get(name)) for name in ("kind", "name"))
        and _is_count(value.get("triangles"))
        and _is_share(value.get("area"))
        and all(value.get(name) is None or _is_share(value[name]) for name in ("FMQM", "perceived"))
        and isinstance(value.get("missing"), bool)
    )


def is_trust(value: object) -> bool:
    """Whether it can be shown as what report.trust_table.trust_dict gives. It is nested, and only read to be shown."""
    report: Any = value
    try:
        trust_lines(report)
        groups = [report[group] for group in GROUPS]
        images = [image for group in groups[:2] for image in group["images"]["value"] or ()]
        return all(_is_text(fact["unit"]) for group in groups for fact in group.values()) and all(
            _is_text(image["path"]) for image in images
        )
    except _CANNOT_BE_SHOWN:
        return False


_KINDS: dict[str, Any] = {
    **dict.fromkeys(("id", "reference", "distorted", "kind"), _is_text),
    **dict.fromkeys(("error", "space", "texture", "ref_texture", "explanation"), _is_optional_text),
    **dict.fromkeys(SHOWN, lambda value: value is None or _is_share(value)),
    **dict.fromkeys(("patches", "samples"), lambda value: value is None or _is_count(value)),
    "stderr": _is_errors,
    "perceived": lambda value: _is_perceived(value) or _is_no_perceived(value),
    "reverse": lambda value: value is None or _is_reverse(value),
    "judge": lambda value: value in tuple(Judge),
    "seconds": lambda value: isinstance(value, dict) and all(_is_amount(value.get(stage)) for stage in STAGES),
    **dict.fromkeys(("warnings", "notes"), lambda value: _is_list(value, _is_text)),
    "level": lambda value: value is None or (_is_number(value) and isinstance(value, int)),
    "triangles": lambda value: value is None or _is_count(value),
    "triangle_share": lambda value: value is None or _is_amount(value),
    "texture_bytes": lambda value: value is None or _is_count(value),
    "settings": is_settings,
    **dict.fromkeys(("fmqm_p10", "fail_under", "fail_under_p10"), lambda value: value is None or _is_share(value)),
    "pictures": _is_pictures,
    "viewer": lambda value: value is None or is_viewer(value),
    "attribution": lambda value: value is None or is_attribution(value),
    "trust": lambda value: value is None or is_trust(value),
    "impairment": lambda value: value is None or value in {words for _, words in IMPAIRMENTS},
    "parts": lambda value: _is_list(value, is_part),
    "screen_size": lambda value: value is None or is_screen_size(value),
}
