# SPDX-License-Identifier: GPL-3.0-or-later
"""What has been scored, on disk as it comes: one line of JSON for each event, each forced to the disk.

{"start": key} before a pair, {"done": key, "pair": record} after it. Of two records of one pair the last counts.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import IO, Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

from ..metric.errors import FileError, SettingsError
from ..report.records import RECORD_KEYS
from .rows import Options, Row

_BEGINNINGS = (b'{"start": "', b'{"done": "')  # of a line


def row_key(row: Row, options: Options, versions: Mapping[str, str]) -> str:
    """What a score depends on: the row, all options, the program, and size and time of the files that it names.

    Its id and threshold are not part of it: they can change without a new score.
    """
    told = asdict(row) | {"folder": os.path.abspath(row.folder), "id": None, "fail_under": None}
    stamps = [_stamp(path) for path in row.files()]
    text = json.dumps([told, options.as_dict(), dict(versions), stamps], sort_keys=True)
    return hashlib.blake2b(text.encode("utf-8", "surrogatepass"), digest_size=16).hexdigest()


def _stamp(path: str) -> tuple[int, int] | None:
    try:
        found = os.stat(path)
    except (OSError, ValueError):
        return None
    return found.st_size, found.st_mtime_ns


class Journal:
    """Records by key, in a file; in memory only where each of them begins.

    Args:
        path: the file; None is a temporary one without a name.
        resume: go on with what the file holds, less a last line that was torn; else it is replaced.

    Raises:
        FileError: it cannot be written. SettingsError: the file is something else, which is left as it is.
    """

    def __init__(self, path: str | None = None, resume: bool = False) -> None:
        self.path = path
        self._offsets: dict[str, int] = {}
        self._failed: set[str] = set()
        self._begun: set[str] = set()
        try:
            self._file: IO[bytes] = open(path, "ab+", 0) if path else tempfile.TemporaryFile(buffering=0)  # noqa: SIM115
            _lock(self._file, path)
            if self._is_foreign():
                raise SettingsError(f"{path}: this file is not a journal; name another with --journal")
            if not resume:
                self._file.truncate(0)
            self._read()
        except OSError as error:
            raise self._cannot_be_written(error) from error

    def __contains__(self, key: object) -> bool:
        """Whether there is a record, of scores or of an error."""
        return key in self._offsets

    def has_scores(self, key: str) -> bool:
        """Whether there is a record to stand by: the cause of an error may have been repaired."""
        return key in self._offsets and key not in self._failed

    def was_begun(self, key: str) -> bool:
        """Whether the pair was begun and never recorded: an earlier run was stopped there, or the pair ended it."""
        return key in self._begun

    def start(self, key: str) -> None:
        self._append({"start": key})
        self._begun.add(key)

    def done(self, key: str, record: Mapping[str, Any]) -> None:
        self._note(key, self._append({"done": key, "pair": record}), record)

    def record(self, key: str) -> dict[str, Any]:
        """Raises KeyError if there is none."""
        with self._reader(self._offsets[key]) as reader:
            pair: dict[str, Any] = json.loads(reader.readline())["pair"]
        return pair

    def close(self) -> None:
        self._file.close()

    def remove(self) -> None:
        self.close()
        if self.path:
            os.remove(self.path)

    def _is_foreign(self) -> bool:
        """Whether it holds something, but no event."""
        with self._reader() as reader:
            first = reader.readline()
            return not any(begin.startswith(first[: len(begin)]) for begin in _BEGINNINGS) and not any(
                map(parse_line, reader)
            )

    def _read(self) -> None:
        offset = 0
        with self._reader() as reader:
            for line in reader:
                if not line.endswith(b"\n"):
                    self._file.truncate(offset)
                    break
                event = parse_line(line)
                if "done" in event:
                    self._note(event["done"], offset, event["pair"])
                elif "start" in event:
                    self._begun.add(event["start"])
                offset += len(line)

    def _reader(self, offset: int = 0) -> IO[bytes]:
        self._file.seek(offset)
        return os.fdopen(os.dup(self._file.fileno()), "rb")

    def _note(self, key: str, offset: int, record: Mapping[str, Any]) -> None:
        self._offsets[key] = offset
        self._begun.discard(key)
        if record["error"] is None:
            self._failed.discard(key)
        else:
            self._failed.add(key)

    def _append(self, event: Mapping[str, Any]) -> int:
        """Where the line begins. Written in one piece: a reader never sees the middle of two."""
        rest = memoryview(json.dumps(event, allow_nan=False).encode() + b"\n")
        begin = self._file.seek(0, os.SEEK_END)
        try:
            while rest:  # a disk that fills up takes a part first, and only then says so
                rest = rest[self._file.write(rest) :]
            if self.path:
                os.fsync(self._file.fileno())
        except OSError as error:
            with contextlib.suppress(OSError):
                self._file.truncate(begin)
            raise self._cannot_be_written(error) from error
        return begin

    def _cannot_be_written(self, error: OSError) -> FileError:
        if not self.path:
            return FileError(f"there is no place for temporary files ({error.strerror or error}); set TMPDIR")
        return FileError(f"{self.path}: the journal cannot be written ({error.strerror or error})")


def _lock(file: IO[bytes], path: str | None) -> None:
    """Keeps a second run out, where the system can; the lock goes with the process."""
    if fcntl is None:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise FileError(f"{path}: another run is writing this journal; wait for it or name another") from error
    except OSError:
        pass  # a file system without locks


def parse_line(line: bytes) -> dict[str, Any]:
    """An event; {} where a power cut or an editor left something else."""
    try:
        event = json.loads(line)
    except (ValueError, RecursionError):
        return {}
    match event:
        case {"start": str(), **rest} if not rest:
            return {"start": event["start"]}
        case {"done": str(), "pair": dict() as pair} if pair.keys() >= RECORD_KEYS:
            return {"done": event["done"], "pair": pair}
    return {}


class Records:
    """The records of rows in their order, as the outputs want them; read anew each time, so that none is kept."""

    def __init__(self, rows: Sequence[Row], keys: Sequence[str], journal: Journal, fail_under: float | None) -> None:
        self._rows = rows
        self._keys = keys
        self._journal = journal
        self._fail_under = fail_under

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for row, key in zip(self._rows, self._keys, strict=True):
            limit = self._fail_under if row.fail_under is None else row.fail_under
            yield self._journal.record(key) | row.told() | {"fail_under": limit}
