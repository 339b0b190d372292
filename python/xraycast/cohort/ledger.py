"""OUT/ledger.jsonl: a line an attempt, appended whole."""
import fcntl
import json
import os
import time

from .._errors import InputError

SYNC_INTERVAL_S = 1.0


class Ledger:
    """Appends lines, also from several processes: each line is one write at the file's end, under a lock of the file."""

    def __init__(self, path):
        self._file = os.open(path, os.O_RDWR | os.O_APPEND | os.O_CREAT, 0o666)
        self._synced = time.monotonic()
        with self._locked():
            self._remove_torn_line()

    def append(self, record):
        line = (json.dumps(record, ensure_ascii=False) + "\n").encode()
        with self._locked():
            self._remove_torn_line()
            written = os.write(self._file, line)
            if written != len(line):
                self._remove_torn_line()
                raise OSError(28, "No space left on device")
        if time.monotonic() - self._synced > SYNC_INTERVAL_S:
            self.sync()

    def sync(self):
        os.fsync(self._file)
        self._synced = time.monotonic()

    def close(self):
        self.sync()
        os.close(self._file)

    def _locked(self):
        return _FileLock(self._file)

    def _remove_torn_line(self):
        """Removes the incomplete last line of a process that died, or had no space left, while it wrote."""
        size = os.fstat(self._file).st_size
        end = size
        while end > 0:
            start = max(0, end - 4096)
            newline = os.pread(self._file, end - start, start).rfind(b"\n")
            if newline >= 0:
                end = start + newline + 1
                break
            end = start
        if end != size:
            os.ftruncate(self._file, end)


class _FileLock:
    def __init__(self, file):
        self._file = file

    def __enter__(self):
        fcntl.flock(self._file, fcntl.LOCK_EX)

    def __exit__(self, *_):
        fcntl.flock(self._file, fcntl.LOCK_UN)


def read_ledger(path):
    """The records, oldest first; none if there is no ledger. An incomplete last line is left out. Raises InputError."""
    try:
        with open(path, "rb") as file:
            for number, line in enumerate(file, 1):
                if line.endswith(b"\n"):
                    yield _record_of(line, f"{path} line {number}")
    except FileNotFoundError:
        return


def _record_of(line, place):
    try:
        record = json.loads(line)
    except ValueError:
        record = None
    if not isinstance(record, dict) or not _is_whole(record):
        raise InputError(f"{place}: not a record of an attempt; remove the line")
    return record


def _is_whole(record):
    error, seconds = record.get("error", ""), record.get("seconds", {})
    is_told = error is None or isinstance(error, dict) and all(isinstance(error.get(name), str) for name in ("class", "line"))
    is_timed = isinstance(seconds, dict) and all(isinstance(time, (int, float)) for time in seconds.values())
    outputs = record.get("outputs", [])
    has_outputs = isinstance(outputs, list) and all(isinstance(path, str) for path in outputs)
    return is_told and is_timed and has_outputs and isinstance(record.get("scan"), str) and isinstance(record.get("hash"), str)
