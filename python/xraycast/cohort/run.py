"""xraycast-cohort run: every scan of a cohort that has no outputs yet."""
import dataclasses
import pathlib
import zlib

from .._errors import Error
from .cluster import address_of, check_workers, local_threads
from .ledger import Ledger, read_ledger
from .lock import RunLock
from .manifest import identity_of, read_cohort
from .outputs import folder_of, remove_unfinished
from .progress import ProgressLine
from .task import error_of, new_record
from .window import Job, Window


@dataclasses.dataclass(frozen=True)
class Run:
    """What the command line says. part: (number from 0, count), or None for all scans."""
    source: str
    out: pathlib.Path
    options: object
    workers: object
    part: tuple = None
    retries: int = 1
    patience_s: float = 600
    cache: str = ""
    cache_gb: float = 20
    tries_bad_again: bool = False
    is_quiet: bool = False


@dataclasses.dataclass
class Counts:
    """Scans, by how they ended: done now, done before, bad now, bad before."""
    done: int = 0
    done_before: int = 0
    bad: int = 0
    bad_before: int = 0

    @property
    def ended(self):
        return self.done + self.done_before + self.bad + self.bad_before


def run_cohort(run):
    """Returns the counts. Raises InputError, Error, OSError."""
    scans = read_cohort(run.source)
    if run.part:
        scans = [scan for scan in scans if _part_of(scan, run.part[1]) == run.part[0]]
    try:
        run.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise Error(f"-o {run.out}: {error.strerror}; give a folder that can be written") from None
    lock = RunLock(run.out, run.part)
    try:
        return _Session(run, scans).counts()
    finally:
        lock.close()


class _Session:
    def __init__(self, run, scans):
        self._run, self._scans = run, scans
        self._counts = Counts()
        self._known = _latest(read_ledger(run.out / "ledger.jsonl"))
        self._ledger = Ledger(run.out / "ledger.jsonl")
        self._progress = ProgressLine(len(scans), run.is_quiet)
        self._good, self._bad = set(), set()

    def counts(self):
        if not self._run.part:
            remove_unfinished(self._run.out)
        try:
            jobs = self._missing()
            first = next(jobs, None)
            if first:
                self._do(first, jobs)
        finally:
            self._progress.clear()
            self._ledger.close()
            if not self._run.part:
                remove_unfinished(self._run.out)
        return self._counts

    def _missing(self):
        """A job for each scan that is neither done nor known to be bad."""
        for scan in self._scans:
            try:
                hash_ = self._run.options.hash_with(identity_of(scan.path))
            except (OSError, ImportError, ValueError) as error:
                self._record(Job(scan, ""), {**new_record(scan, "", ""), "error": error_of(error, scan)})
                continue
            known = self._known.get(scan.name)
            if known and known["hash"] == hash_ and self._is_final(scan, known):
                continue
            yield Job(scan, hash_)

    def _is_final(self, scan, known):
        if known["error"] is None and folder_of(self._run.out, scan).is_dir():
            self._counts.done_before += 1
            return True
        is_bad = known["error"] is not None and known["error"]["class"] == "InputError"
        if is_bad and not self._run.tries_bad_again:
            self._counts.bad_before += 1
            return True
        return False

    def _do(self, first, rest):
        run = self._run
        threads = run.workers.threads if run.workers.scheduler else local_threads(run.workers)
        place = {"out": str(run.out), "cache": run.cache, "cache_gb": run.cache_gb, "threads": threads}
        with address_of(run.workers) as address:
            window = Window(address, run.options, place, run.workers.resources, run.retries, run.patience_s, self._record)
            try:
                check_workers(window.client, run.out, run.workers.resources)
                window.run(_chain(first, rest), self._show)
            finally:
                window.close()

    def _record(self, job, record):
        self._ledger.append(record)
        ended, other = (self._bad, self._good) if record["error"] else (self._good, self._bad)
        ended.add(job.scan.name)
        other.discard(job.scan.name)
        self._counts.done, self._counts.bad = len(self._good), len(self._bad)

    def _show(self):
        self._progress.show(self._counts.ended, self._counts.bad + self._counts.bad_before)


def _part_of(scan, count):
    """By the name, so that a scan's part does not change when others are added."""
    return zlib.crc32(scan.name.encode()) % count


def _chain(first, rest):
    yield first
    yield from rest


def _latest(records):
    """The record that counts of each scan: its last."""
    return {record["scan"]: record for record in records}
