# SPDX-License-Identifier: GPL-3.0-or-later
"""Scores as JUnit XML, which build servers show: a pair is a test case."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any
from xml.etree import ElementTree

from .criteria import below, judge_of, shortfall
from .numbers import score_text
from .records import BESIDE, PERCEIVED, SEPARATOR, SHOWN, value_of

_NOT_IN_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit_parts(records: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """The text of a document; goes through the records twice.

    A pair below a threshold is a failure with the judge's four features in its message; one without scores is an
    error. All numbers are properties.
    """
    pairs = failures = errors = 0
    seconds = 0.0
    for record in records:
        pairs += 1
        failures += below(record)
        errors += record["error"] is not None
        seconds += record["seconds"]["total"]
    counts = f'tests="{pairs}" failures="{failures}" errors="{errors}" time="{seconds:.3f}"'
    yield f'<?xml version="1.0" encoding="UTF-8"?>\n<testsuites {counts}>\n<testsuite name="FMQM" {counts}>\n'
    for record in records:
        yield ElementTree.tostring(_case(record), encoding="unicode") + "\n"
    yield "</testsuite>\n</testsuites>\n"


def _case(record: Mapping[str, Any]) -> ElementTree.Element:
    names = {"classname": _text(record["reference"]), "name": _text(record["id"])}
    case = ElementTree.Element("testcase", names, time=f"{record['seconds']['total']:.3f}")
    if record["error"] is None:
        properties = ElementTree.SubElement(case, "properties")
        for name in (*SHOWN, *PERCEIVED, "fmqm_p10"):
            ElementTree.SubElement(properties, "property", name=name, value=repr(value_of(record, name)))
        for name in BESIDE:
            if record[name] not in (None, []):
                text = SEPARATOR.join(record[name]) if isinstance(record[name], list) else repr(record[name])
                ElementTree.SubElement(properties, "property", name=name, value=_text(text))
    if record["error"] is not None:
        ElementTree.SubElement(case, "error", message=_text(record["error"]))
    elif below(record):
        features = ", ".join(f"{name} {score_text(value_of(record, name))}" for name in judge_of(record).features)
        ElementTree.SubElement(case, "failure", message=f"{shortfall(record)}: {features}")
    if record["warnings"]:
        ElementTree.SubElement(case, "system-out").text = _text("\n".join(record["warnings"]))
    return case


def _text(value: str) -> str:
    """Without what XML cannot hold."""
    return _NOT_IN_XML.sub("\N{REPLACEMENT CHARACTER}", value)
