"""One attempt at one scan, on a worker. A failure becomes the record's error, unless the worker itself dies."""
import time

from .. import _core
from .._errors import InputError
from .manifest import identity_of
from .outputs import finished_record, publish, unfinished_folder
from .source import local_files
from .steps import ALL
from .threads import limit_threads


def attempt(scan, options, hash_, place):
    """Takes the steps and returns the record of the ledger. place: out, cache, cache_gb, threads, topic and key."""
    record = new_record(scan, hash_, _announce(place))
    try:
        return finished_record(place["out"], scan, hash_) or _made(scan, options, record, place)
    except Exception as error:
        record["outputs"] = []
        record["error"] = error_of(error, scan)
        return record


def new_record(scan, hash_, worker):
    return {"scan": scan.name, "hash": hash_, "version": _core.__version__, "worker": worker, "seconds": {},
            "outputs": [], "error": None}


def _announce(place):
    """Tells the client that this worker begins, so that it knows of attempts that never end. Returns the worker's address."""
    from distributed import get_worker
    worker = get_worker()
    limit_threads(place["threads"] or worker.state.nthreads)
    worker.log_event(place["topic"], {"key": place["key"], "worker": worker.address})
    return worker.address


def _made(scan, options, record, place):
    clock = _Clock(record["seconds"])
    if options.hash_with(identity_of(scan.path)) != record["hash"]:
        raise InputError(f"{scan.path}: changed since the run began; run again")
    with unfinished_folder(place["out"]) as folder:
        with local_files(scan.path, place["cache"], place["cache_gb"]) as path:
            clock.lap("fetch")
            opened = _core.open(path)
        clock.lap("read")
        made = {"name": scan.name}
        for step in options.steps:
            ALL[step](opened, folder, options, made)
            clock.lap(step)
        return publish(folder, place["out"], scan, record)


class _Clock:
    def __init__(self, seconds):
        self._seconds = seconds
        self._last = time.monotonic()

    def lap(self, name):
        now = time.monotonic()
        self._seconds[name] = round(now - self._last, 4)
        self._last = now


def error_of(error, scan):
    line = " ".join(str(error).split()) or type(error).__name__
    return {"class": type(error).__name__, "line": line if scan.path in line else f"{scan.path}: {line}"}


def probe(token):
    """A worker's answer before the run: xraycast's version, and whether it sees the client's OUT."""
    import os
    return _core.__version__, os.path.exists(token)
