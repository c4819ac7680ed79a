# SPDX-License-Identifier: GPL-3.0-or-later
"""What has been scored, on disk as it comes: one line of JSON for each event, each forced to the disk.

{"start": key} before a pair, {"done": key, "made_by": provenance, "pair": record} after it, each with a "digest" of
what stands before it in the line; a line that does not fit it does not count. Of two records of a pair the last counts.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import IO, Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

from ..metric.errors import FileError, SettingsError
from ..report.criteria import Criteria
from ..report.record_check import checked_json, record_fault
from ..report.records import PairScore, pair_record
from .rows import BatchOptions, Row

_BEGINNINGS = (b'{"start": "', b'{"done": "')  # of a line
_TAIL = b', "digest": "'


def row_key(row: Row, options: BatchOptions, versions: Mapping[str, str]) -> str:
    """What a score depends on: the row, all options, the program, and size and time of the files that it names.

    Its id, threshold, kind and level are not part of it: they can change without a new score.
    """
    unread = dict.fromkeys(("id", "fail_under", "level", "kind"))
    plain = asdict(row) | unread | {"folder": os.path.abspath(row.folder)}
    stamps = [_stamp(path) for path in row.files()]
    text = json.dumps([plain, options.as_dict(), dict(versions), stamps], sort_keys=True)
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
        made_by: what makes the numbers, as BatchOptions.made_by has it; records of something else do not count.

    Attributes:
        damaged: lines that do not fit their digest, or are none of ours.

    Raises:
        FileError: it cannot be written. SettingsError: the file is something else, which is left as it is.
    """

    def __init__(self, path: str | None = None, resume: bool = False, made_by: Mapping[str, str] | None = None) -> None:
        self.path = path
        self.made_by = dict(made_by or {})
        self.damaged = 0
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
        self._note(key, self._append({"done": key, "made_by": self.made_by, "pair": record}), record)

    def record(self, key: str) -> dict[str, Any]:
        """Raises KeyError if there is none. FileError: the file is not what it was."""
        with self._reader(self._offsets[key]) as reader:
            event = _event(reader.readline())
        if event.get("done") != key:
            raise FileError(f"{self.path}: this journal was changed while it was in use; start again with --resume")
        pair: dict[str, Any] = event["pair"]
        return pair

    def damage(self) -> str:
        """The message about damaged lines."""
        lines = "1 line does" if self.damaged == 1 else f"{self.damaged} lines do"
        return (
            f"{self.path}: {lines} not fit the digest (a fault of the disk, an editor, or an older version); "
            "pairs that no other line tells of are scored again"
        )

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
                self.damaged += not event
                if "done" in event and event["made_by"] == self.made_by:
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
        rest = memoryview(line_of(event))
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


def line_of(event: Mapping[str, Any]) -> bytes:
    """The inverse of parse_line."""
    body = json.dumps(event, allow_nan=False).encode().removesuffix(b"}")
    return body + _TAIL + _digest(body) + b'"}\n'


def parse_line(line: bytes) -> dict[str, Any]:
    """An event; {} where a fault of the disk, a power cut, an editor or an older version left something else."""
    event = _event(line)
    match event:
        case {"start": str(), **rest} if not rest:
            return event
        case {"done": str(), "made_by": dict(), "pair": pair, **rest} if not rest and not record_fault(pair):
            return event
    return {}


def _event(line: bytes) -> dict[str, Any]:
    """What a line holds that fits its digest."""
    body, _, digest = line.rstrip(b"\r\n").rpartition(_TAIL)
    if digest != _digest(body) + b'"}':
        return {}
    try:
        event = checked_json(body + b"}")
    except ValueError:
        return {}
    return event if isinstance(event, dict) else {}


def _digest(body: bytes) -> bytes:
    return hashlib.blake2b(body, digest_size=8).hexdigest().encode()


def own_record(event: Mapping[str, Any], made_by: Mapping[str, str]) -> dict[str, Any]:
    """The record of an event that comes from elsewhere; an error in its place where something else has made it."""
    record: dict[str, Any] = event["pair"]
    if event["made_by"] == made_by:
        return record
    why = f"{record['distorted']}: scored by {differences(event['made_by'], made_by)}; give its host the same"
    return pair_record(PairScore(record["reference"], record["distorted"], error=why)) | {"id": record["id"]}


def differences(found: Mapping[str, Any], wanted: Mapping[str, Any], names: Iterable[str] = ()) -> str:
    """Where one provenance is not another, in words; "" where they are equal.

    Args:
        names: of what is looked at; none are all.
    """
    return ", ".join(
        f"{name} {found.get(name)} instead of {wanted.get(name)}"
        for name in names or {**wanted, **found}
        if found.get(name) != wanted.get(name)
    )


class Records:
    """The records of rows in their order, as the outputs want them; read anew each time, so that none is kept."""

    def __init__(self, rows: Sequence[Row], keys: Sequence[str], journal: Journal, criteria: Criteria) -> None:
        self._rows = rows
        self._keys = keys
        self._journal = journal
        self._criteria = criteria

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for row, key in zip(self._rows, self._keys, strict=True):
            yield self._journal.record(key) | row.record_fields() | self._criteria.record_fields(row.fail_under)
