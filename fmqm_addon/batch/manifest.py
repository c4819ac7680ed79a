# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways of naming pairs; all of them end in rows."""

from __future__ import annotations

import csv
import glob
import json
import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..blender.access import ANYWHERE, Access
from ..blender.files.asset_path import split_spec
from ..metric.errors import FileError, FMQMError, SettingsError
from ..metric.settings import SETTING_NAMES, Settings, info_of
from .rows import Row
from .table_files import readable

REQUIRED = ("reference", "distorted")
OPTIONAL = ("id", "ref_texture", "texture", "fail_under", "kind", "level")
MAX_LEVEL = 1000
KNOWN = (*REQUIRED, *OPTIONAL, *SETTING_NAMES)

_KIND_OF = {name: info_of(Settings, name).kind for name in SETTING_NAMES} | {"fail_under": float, "level": int}


def plain_rows(reference: str, distorted: Sequence[str], ref_texture: str, textures: Sequence[str]) -> list[Row]:
    """One reference, any number of distorted; textures are none, one for all or one for each.

    Raises:
        SettingsError: another number of textures, or a pattern that the shell has not replaced by files.
    """
    for name in distorted:
        if any(letter in split_spec(name)[0] for letter in "*?[") and not os.path.exists(split_spec(name)[0]):
            raise SettingsError(f"{name}: no such file; for the files that match, say --glob '{name}'")
    if len(textures) not in (0, 1, len(distorted)):
        raise SettingsError(
            f"--texture is given {len(textures)} times for {len(distorted)} files; give it once, or once per DISTORTED"
        )
    images = list(textures) or [""]
    images = images * len(distorted) if len(images) == 1 else images
    return _with_ids(
        Row("", reference, name, ref_texture, image) for name, image in zip(distorted, images, strict=True)
    )


def glob_files(reference: str, pattern: str) -> list[str]:
    """The files that match, sorted, without the reference itself.

    Raises:
        FileError: none does.
    """
    here = os.path.abspath(reference)
    found = [
        path
        for path in sorted(glob.glob(pattern, recursive=True))
        if os.path.isfile(path) and os.path.abspath(path) != here
    ]
    if not found:
        raise FileError(f"--glob {pattern}: no file matches; quote the pattern so that the shell leaves it alone")
    return found


def lod_rows(path: str, access: Access = ANYWHERE, thresholds: Sequence[float] = ()) -> list[Row]:
    """Every level of every chain in a file against level 0 and against the level before. Imports bpy.

    Args:
        thresholds: of the levels below the finest, in their order; the last of all that follow.

    Raises:
        FileError: it cannot be opened, or no names in it tell levels.
    """
    from ..blender.files.load import chains_of_file
    from ..blender.materials.types import Reading

    rows = []
    for name, levels in chains_of_file(path, Reading(access=access)):
        for index, (level, asset) in enumerate(levels[1:]):
            for other, reference in dict.fromkeys((levels[0], levels[index])):
                against = f"LOD{other}" if other >= 0 else "original"
                limit = thresholds[min(index, len(thresholds) - 1)] if thresholds else None
                names = f"{name} LOD{level} / {against}".strip(), f"{path}:{reference}", f"{path}:{asset}"
                rows.append(Row(*names, fail_under=limit, level=level))
    if not rows:
        raise FileError(f"{path}: no names in it tell levels of detail; wanted are such as Rock_LOD0 and Rock_LOD1")
    return _with_ids(rows)


def read_manifest(path: str, settings: Settings) -> list[Row]:
    """The rows of a CSV with a header, or of a JSON list of objects; paths are relative to the file's folder.

    Args:
        settings: what a row's own settings are changes of.

    Raises:
        FileError: it cannot be read. SettingsError: what it holds is wrong; the text names the row.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".csv", ".json"):
        raise SettingsError(f"{path}: a manifest must end in .csv or .json")
    with readable(path):
        plain = _csv_rows(path) if suffix == ".csv" else _json_rows(path)
    rows, taken = [], dict[str, int]()
    for number, values in plain:
        try:
            row = _row(values, os.path.dirname(path), settings)
        except FMQMError as error:
            raise SettingsError(f"{path}, row {number}: {error}") from error
        if row.id in taken and row.id:
            raise SettingsError(f"{path}, row {number}: id {row.id} is that of row {taken[row.id]}; ids must differ")
        taken[row.id] = number
        rows.append(row)
    if not rows:
        raise SettingsError(f"{path}: no rows in it; one for each pair is wanted")
    return _with_ids(rows)


def _csv_rows(path: str) -> list[tuple[int, dict[str, Any]]]:
    with open(path, encoding="utf-8-sig", newline="") as file:
        header = file.readline()
        # Spreadsheets write what the country uses where a comma is the decimal point.
        delimiter = next((each for each in ",;\t" if each in header), ",")
        names = next(csv.reader([header], delimiter=delimiter, skipinitialspace=True), [])
        reader = csv.DictReader(
            file, [_column(name) for name in names], "", "", delimiter=delimiter, skipinitialspace=True, strict=True
        )
        rows = [(1 + reader.line_num, row) for row in reader if any("".join(value) for value in row.values())]
        _check_columns(path, reader.fieldnames or ())
    for number, row in rows:
        if "" in row:
            raise SettingsError(f"{path}, row {number}: more values than columns; quote values that hold a comma")
    return rows


def _json_rows(path: str) -> list[tuple[int, dict[str, Any]]]:
    with open(path, encoding="utf-8-sig") as file:
        rows = json.load(file)
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise SettingsError(f"{path}: a list of objects is wanted, one for each pair")
    for number, row in enumerate(rows, 1):
        if len({_column(name) for name in row}) < len(row):
            raise SettingsError(f"{path}, row {number}: a name is there twice")
    rows = [{_column(name): value for name, value in row.items()} for row in rows]
    _check_columns(path, dict.fromkeys(name for row in rows for name in row))
    return list(enumerate(rows, 1))


def _column(name: str) -> str:
    """A column's name as it is known: people write Reference, and "Fail under"."""
    return name.strip().lower().replace(" ", "_").replace("-", "_")


def _check_columns(path: str, names: Iterable[str]) -> None:
    names = list(names)
    unknown = [name for name in names if name not in KNOWN]
    if unknown:
        raise SettingsError(f"{path}: unknown column {unknown[0] or '(no name)'}; known are {', '.join(KNOWN)}")
    repeated = [name for name in names if names.count(name) > 1]
    if repeated:
        raise SettingsError(f"{path}: column {repeated[0]} is there twice")
    missing = [name for name in REQUIRED if name not in names]
    if missing and names:
        raise SettingsError(f"{path}: no column {missing[0]}; {' and '.join(REQUIRED)} are wanted")


def _row(plain: dict[str, Any], folder: str, settings: Settings) -> Row:
    values = {name: _value(name, raw) for name, raw in plain.items() if raw is not None and raw != ""}
    for name in REQUIRED:
        if name not in values:
            raise SettingsError(f"no {name}; a file is wanted")
    own = tuple((name, values.pop(name)) for name in SETTING_NAMES if name in values)
    row = Row(**{"id": ""} | values, settings=own, folder=folder)
    if row.fail_under is not None and not 0 <= row.fail_under <= 1:
        raise SettingsError(f"fail_under is {row.fail_under}; it must be between 0 and 1")
    if row.level is not None and not 0 <= row.level <= MAX_LEVEL:
        raise SettingsError(f"level is {row.level}; it must be between 0 and {MAX_LEVEL}")
    replace(settings, **dict(own))  # raises what is wrong with them
    return row


def _value(name: str, raw: Any) -> Any:
    kind = _KIND_OF.get(name, str)
    wanted = {int: "a whole number", float: "a number", str: "a text"}[kind]
    if not isinstance(raw, str) and (kind is str or isinstance(raw, bool) or not isinstance(raw, (int, float))):
        raise SettingsError(f"{name} is {json.dumps(raw)}; {wanted} is wanted")
    try:
        return kind(str(raw))
    except ValueError as error:
        raise SettingsError(f"{name} is {raw}; {wanted} is wanted") from error


def _with_ids(rows: Iterable[Row]) -> list[Row]:
    """Rows without an id get the name of what is scored, numbered where it is taken."""
    rows = list(rows)
    taken = {row.id for row in rows if row.id}
    named = []
    for row in rows:
        name, number = row.id, 1
        while not name:
            candidate = row.distorted if number == 1 else f"{row.distorted} ({number})"
            name = "" if candidate in taken else candidate
            number += 1
        taken.add(name)
        named.append(replace(row, id=name))
    return named
