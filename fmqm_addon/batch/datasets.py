# SPDX-License-Identifier: GPL-3.0-or-later
"""The data sets of the paper (section VI-A): which files are a pair, and where people's scores stand.

A layout is data, so that another copy of a set, or another set, needs a file and no code.
"""

from __future__ import annotations

import glob
import json
import os
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace

from ..metric.errors import FileError, SettingsError
from .rows import Row
from .table_files import read_rows


@dataclass(frozen=True)
class Layout:
    """How a data set is laid out below its folder.

    Attributes:
        opinions: the table of mean opinion scores; * stands for any name, and the first that exists is taken.
        id_column, opinion_column: its columns: what people saw, and their score.
        id: a regular expression that a whole name matches; its named groups are what the files' names hold. A group
            kind is the kind of distortion; a group model is the reference.
        reference, distorted: files below the folder, {group} replaced; * as above. texture: of the distorted, or "".
        kinds: by the names of the set, those of the paper.
        paper: what the paper reports there for FMQM: PLCC, SROCC, RMSE (table I). paper_kinds: SROCC by kind.
    """

    opinions: tuple[str, ...]
    id_column: str
    opinion_column: str
    id: str
    reference: str
    distorted: str
    texture: str = ""
    kinds: Mapping[str, str] = field(default_factory=dict)
    paper: Mapping[str, float] = field(default_factory=dict)
    paper_kinds: Mapping[str, float] = field(default_factory=dict)


_FIELD = re.compile(r"\{(\w+)\}")


def _paper(plcc: float, srocc: float, rmse: float) -> dict[str, float]:
    return {"PLCC": plcc, "SROCC": srocc, "RMSE": rmse}


LAYOUTS = {
    "tsmd": Layout(
        ("TSMD_MOS.csv", "*MOS*.csv", "*/*MOS*.csv"), "PVS", "MOS",
        r"(?P<model>.+)_dec(?P<dec>[\d.]+)_qp(?P<qp>\d+)_qt(?P<qt>\d+)_cqlevel_?(?P<cq>\d+)",
        "Reference/{model}/{model}*.obj",
        "Distortion/{model}/{model}_dec{dec}_qp{qp}_qt{qt}_cqlevel_{cq}.obj",
        paper=_paper(0.810, 0.811, 0.683),
    ),
    "sjtu-tmqa": Layout(
        ("distortion_dataset/SJTU-TMQA_MOS.csv", "SJTU-TMQA_MOS.csv", "*MOS*.csv", "*/*MOS*.csv"), "name", "MOS",
        r"(?P<model>.+)_(?P<kind>[A-Za-z]+)_(?P<level>L\d+)",
        "reference_dataset/{model}/{model}.obj",
        "distortion_dataset/{kind}/{model}/{level}/{model}.obj",
        kinds={
            "gn": "GN", "qp": "QP", "simpNoTex": "SOT", "simp": "SWT", "ds": "DS", "JPEG": "TMC", "qpqt": "MQ",
            "qpqtJPEG": "GTC",
        },
        paper=_paper(0.728, 0.760, 1.639),
        paper_kinds={
            "GN": 0.693, "QP": 0.802, "SOT": 0.737, "SWT": 0.758, "DS": 0.848, "TMC": 0.807, "MQ": 0.803, "GTC": 0.688,
        },
    ),
    "yana": Layout(
        ("MOS+CI_3000stimuli.csv", "*MOS*.csv", "*/*MOS*.csv"), "stimulus", "MOS",
        r"(?P<model>.+)_(?P<simp>simpL\d+)_(?P<qp>qp\d+)_(?P<qt>qt\d+)_decompJPEG_(?P<size>\d+x\d+)_Q(?P<quality>\d+)",
        "{model}/source/{model}.obj",
        "{model}/distortions/JPEG_resize{size}_quality{quality}/{model}_{simp}_{qp}_{qt}.obj",
        paper=_paper(0.674, 0.666, 0.721),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Dataset:
    """A data set on disk: its layout, the table of opinions, the pairs, and names of the table without a file."""

    layout: Layout
    opinions: str
    rows: tuple[Row, ...]
    missing: tuple[str, ...]


def layout_of(name: str, path: str | None = None) -> Layout:
    """The layout of a data set by its name, with what a JSON object in a file changes of it.

    Raises:
        FileError: the file cannot be read. SettingsError: the name is not known; or the file names what a layout has
            not, or in another form.
    """
    if name not in LAYOUTS:
        raise SettingsError(f"--dataset {name} is not known; known are {', '.join(LAYOUTS)}")
    return _changed(LAYOUTS[name], path) if path else LAYOUTS[name]


def _changed(layout: Layout, path: str) -> Layout:
    try:
        with open(path, encoding="utf-8") as file:
            changes = json.load(file)
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path}: not a JSON file ({error})") from error
    known = [each.name for each in fields(Layout)]
    if not isinstance(changes, dict) or not set(changes) <= set(known):
        raise SettingsError(f"{path}: an object is wanted, with some of {', '.join(known)}")
    plain = asdict(layout)
    for name, value in changes.items():
        wanted = list if name == "opinions" else dict if isinstance(plain[name], dict) else str
        members = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
        member = (int, float) if name.startswith("paper") else str
        if not isinstance(value, wanted) or not all(isinstance(each, member) for each in members):
            form = {list: "a list of texts", dict: "an object", str: "a text"}[wanted]
            raise SettingsError(f"{path}: {name} is {json.dumps(value)[:80]}; {form} is wanted")
    if isinstance(changes.get("opinions"), list):
        changes["opinions"] = tuple(changes["opinions"])
    return replace(layout, **changes)


def read_dataset(folder: str, layout: Layout) -> Dataset:
    """The pairs that people have scored, in the order of the table.

    Raises:
        FileError: the folder has no such table, or no file that it names. SettingsError: the layout is wrong.
    """
    pattern = _pattern(layout)
    table = opinion_file(folder, layout)
    rows: list[Row] = []
    missing: list[str] = []
    for plain in read_rows(table):
        if layout.id_column not in plain:
            raise SettingsError(f"{table}: no column {layout.id_column}; say another with --layout FILE")
        name = str(plain[layout.id_column])
        row = _row(folder, layout, pattern, name)
        if row is None:
            missing.append(name)
        else:
            rows.append(row)
    if not rows:
        wanted = _example(layout, pattern, missing[0])
        raise FileError(f"{folder}: none of the {len(missing)} names in {table} has its files ({wanted})")
    return Dataset(layout, table, tuple(rows), tuple(missing))


def opinion_file(folder: str, layout: Layout) -> str:
    """The table of people's scores.

    Raises:
        FileError: the folder has none.
    """
    for name in layout.opinions:
        for found in _found(folder, name):
            return found
    names = ", ".join(layout.opinions)
    raise FileError(f"{folder}: no table of people's scores there ({names}; a spreadsheet saved as CSV); or --layout")


def kind_of(layout: Layout, name: str) -> str:
    """The kind of distortion of what people saw, as the paper calls it; "" where its name tells none."""
    found = _pattern(layout).fullmatch(name)
    kind = (found.groupdict().get("kind") or "") if found else ""
    return layout.kinds.get(kind, kind)


def model_of(layout: Layout, name: str) -> str:
    """The reference of what people saw; "" where its name tells none."""
    found = _pattern(layout).fullmatch(name)
    return (found.groupdict().get("model") or "") if found else ""


def _pattern(layout: Layout) -> re.Pattern[str]:
    try:
        return re.compile(layout.id)
    except re.error as error:
        raise SettingsError(f"the layout's id is no regular expression ({error})") from error


def _row(folder: str, layout: Layout, pattern: re.Pattern[str], name: str) -> Row | None:
    found = pattern.fullmatch(name)
    if found is None or {"/", "\\", ".."} & {part for value in found.groups("") for part in (*value, value)}:
        return None  # a name that leaves its folder names nothing of the set
    texture = _first(folder, _filled(layout.texture, found)) if layout.texture else ""
    reference, distorted = (_first(folder, _filled(each, found)) for each in (layout.reference, layout.distorted))
    if reference is None or distorted is None or texture is None:
        return None
    return Row(name, reference, distorted, texture=texture)


def _filled(template: str, found: re.Match[str]) -> str:
    """A file's name with {group} replaced."""
    groups = found.groupdict("")
    try:
        return _FIELD.sub(lambda field: groups[field[1]], template)
    except KeyError as error:
        raise SettingsError(f"the layout's {template} holds {error}, which its id has no group for") from error


def _first(folder: str, name: str) -> str | None:
    return next(iter(_found(folder, name)), None)


def _found(folder: str, name: str) -> list[str]:
    """Files below the folder, sorted. Names of models may hold brackets, which stand for themselves."""
    bare = name.replace("[", "[[]").replace("?", "[?]")
    return sorted(glob.glob(os.path.join(glob.escape(folder), bare)))


def _example(layout: Layout, pattern: re.Pattern[str], name: str) -> str:
    found = pattern.fullmatch(name)
    if found is None:
        return f"{name} is not such as {layout.id}; say another --layout FILE"
    names = (_filled(each, found) for each in (layout.reference, layout.distorted))
    return f"{' and '.join(names)} are wanted; say others with --layout FILE"
