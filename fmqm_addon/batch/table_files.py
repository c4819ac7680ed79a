# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables as people and programs write them: CSV, JSON."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import PurePath
from typing import Any

from ..metric.errors import FileError

LARGEST = 512 << 20  # bytes of a table that is read


def read_rows(path: str) -> list[dict[str, Any]]:
    """The rows of a CSV with a header (comma, semicolon or tab), of a JSON list, or of score.py's JSON.

    Raises:
        FileError: it cannot be read, or has no rows.
    """
    suffix = PurePath(path).suffix.lower()
    readers: Mapping[str, Callable[[str], list[dict[str, Any]]]] = {".csv": _csv, ".tsv": _csv, ".json": _json}
    if suffix not in readers:
        raise FileError(f"{path}: a table must end in .csv or .json; save a spreadsheet as CSV (UTF-8)")
    with readable(path):
        if os.path.getsize(path) > LARGEST:
            raise FileError(f"{path}: larger than {LARGEST >> 20} MB; a table of scores is wanted")
        rows = readers[suffix](path)
    if not rows:
        raise FileError(f"{path}: no rows in it")
    return rows


@contextmanager
def readable(path: str) -> Iterator[None]:
    """Reads a CSV or JSON file inside of it.

    Raises:
        FileError: for what goes wrong there; its text names the file.
    """
    try:
        yield
    except OSError as error:
        raise FileError(f"{path}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise FileError(f'{path}: not in UTF-8; save it so (a spreadsheet\'s "CSV UTF-8")') from error
    except csv.Error as error:
        raise FileError(f"{path}: not a CSV file ({error}; are all quotes closed?)") from error
    except (ValueError, RecursionError) as error:  # json raises ValueError for numbers too long for int
        raise FileError(f"{path}: not a JSON file ({error})") from error


def _csv(path: str) -> list[dict[str, Any]]:
    with open(path, encoding="utf-8-sig", newline="") as file:
        header = file.readline()
        delimiter = next((each for each in "\t;," if each in header), ",")
        file.seek(0)
        reader = csv.DictReader(file, restkey="", restval="", delimiter=delimiter, skipinitialspace=True, strict=True)
        rows: list[dict[str, Any]] = []
        for row in reader:
            if "" in row:
                raise FileError(f"{path}, row {reader.line_num}: more values than columns; quote values with a comma")
            rows.append({name.strip(): value for name, value in row.items()})
    return rows


def _json(path: str) -> list[dict[str, Any]]:
    with open(path, encoding="utf-8-sig") as file:
        found = json.load(file)
    rows = found.get("pairs") if isinstance(found, dict) else found
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise FileError(f"{path}: neither what score.py writes nor a list of objects")
    return rows
