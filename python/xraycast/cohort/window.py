"""The futures of a run: a few for each thread of the workers, however many scans there are."""
import collections
import dataclasses
import logging
import queue
import time
import uuid

from distributed.scheduler import KilledWorker

from .._errors import Error, InputError
from .cluster import connect
from .task import attempt, error_of, new_record

FUTURES_A_THREAD = 3
COUNT_INTERVAL_S = 2.0
MOST_EVENTS = 500
MOST_UNBEGUN = 3
MOST_LOST = 3


@dataclasses.dataclass
class Job:
    """A scan that is to be done. tries: attempts that ended with a record of their own; began_on: the worker of the attempt that
    runs; unbegun: how often its workers died before it was seen to begin; lost: how often a scheduler was lost while it ran."""
    scan: object
    hash: str
    tries: int = 0
    began_on: str = ""
    unbegun: int = 0
    lost: int = 0
    future: object = None


class Window:
    """Gives jobs to a scheduler and hands on a record for each attempt that ends.

    An attempt ends with the task's own record, or by its worker's death, or by the scheduler's. Dask itself gives the
    scans of a dead worker to others; after `allowed-failures` deaths it calls the scan bad. When the scheduler dies, the
    window waits for one at the same address, and gives it the jobs anew.
    """

    def __init__(self, address, options, place, resources, retries, patience_s, on_record):
        self._address, self._options, self._place, self._resources = address, options, place, resources
        self._retries, self._patience_s, self._on_record = retries, patience_s, on_record
        self._topic = f"xraycast-cohort-{uuid.uuid4().hex}"
        self._events = queue.SimpleQueue()
        self._jobs = {}
        self._again = collections.deque()
        self._threads, self._counted = 1, 0.0
        self.client = None
        self._connect()

    def run(self, jobs, on_wait=lambda: None):
        """Returns when all jobs have ended for good."""
        jobs = iter(jobs)
        has_more = True
        while has_more or self._jobs or self._again:
            self._look_after_client()
            while len(self._jobs) < FUTURES_A_THREAD * self._threads and (self._again or has_more):
                job = self._again.popleft() if self._again else next(jobs, None)
                has_more = has_more and job is not None
                if job:
                    self._submit(job)
            self._take_events()
            on_wait()

    def close(self):
        """Tells the scheduler to forget the jobs that have not begun."""
        if self.client is None:
            return
        try:
            if self.client.status == "running":
                self.client.cancel([job.future for job in self._jobs.values()], force=True)
            self.client.close(timeout=5)
        except Exception:  # the scheduler is gone; nothing is lost
            logging.getLogger(__name__).debug("closing", exc_info=True)

    # ---- the scheduler ----------------------------------------------------------------------------

    def _connect(self):
        self.client = connect(self._address)
        self.client.subscribe_topic(self._topic, lambda event: self._events.put(("began", event[1])))

    def _look_after_client(self):
        if self.client.status == "closed":
            self._connect_again()
        elif self.client.status == "running" and time.monotonic() - self._counted > COUNT_INTERVAL_S:
            self._count_threads()

    def _count_threads(self):
        self._counted = time.monotonic()
        try:
            self._threads = max(1, sum(self.client.nthreads().values()))
        except (OSError, TimeoutError):
            pass  # the connection broke; the client tries again

    def _connect_again(self):
        deadline = time.monotonic() + self._patience_s
        while True:
            try:
                self._connect()
                return
            except InputError:
                if time.monotonic() > deadline:
                    raise Error(f"--scheduler {self._address}: gone for {self._patience_s:.0f} s; start it and run again, "
                                "which processes the remaining scans") from None

    # ---- jobs -------------------------------------------------------------------------------------

    def _submit(self, job):
        key = f"scan-{uuid.uuid4().hex}"  # dask keeps what stands before the hexadecimal digits for ever
        place = {**self._place, "topic": self._topic, "key": key}
        job.began_on = ""
        self._jobs[key] = job
        job.future = self.client.submit(attempt, job.scan, self._options, job.hash, place, key=key, pure=False,
                                        resources=self._resources or None)
        job.future.add_done_callback(lambda future: self._events.put(("ended", future)))

    def _take_events(self):
        """Waits for the first event and returns all that are there by then, so that results are fetched together."""
        events = []
        try:
            events.append(self._events.get(timeout=0.2))
            while len(events) < MOST_EVENTS:
                events.append(self._events.get_nowait())
        except queue.Empty:
            pass
        for kind, what in events:
            if kind == "began":
                self._note_begin(what)
        ended = [what for kind, what in events if kind == "ended" and self._is_awaited(what)]
        records = self._fetch([future for future in ended if future.status == "finished"])
        for future in ended:
            self._note_end(self._jobs.pop(future.key), future, records)

    def _is_awaited(self, future):
        job = self._jobs.get(future.key)
        return job is not None and job.future is future and future.status != "pending"

    def _fetch(self, futures):
        """The records by key, of the futures whose results still exist."""
        if not futures:
            return {}
        try:
            return self.client.gather({future.key: future for future in futures}, errors="skip")
        except Exception:  # the scheduler died with the results; what their workers published is not lost
            return {}

    def _note_begin(self, event):
        job = self._jobs.get(event["key"])
        if job is None:
            return
        if job.began_on:
            self._record_death(job, "WorkerDied", "its worker died, by a crash, for want of memory, or killed")
        job.began_on = event["worker"]

    def _note_end(self, job, future, records):
        if future.key in records:
            self._end(job, records[future.key])
        elif future.status == "error" and isinstance(error := future.exception(), KilledWorker):
            if not job.began_on and job.unbegun < MOST_UNBEGUN:  # dask blames all scans that wait on a worker for its death
                job.unbegun += 1
                self._again.append(job)
                return
            self._record_death(job, "KilledWorker", "its workers died, by crashes, for want of memory, or killed, "
                               f"{error.allowed_failures + 1} times; see the worker's log")
        elif future.status == "error":
            self._end(job, {**new_record(job.scan, job.hash, job.began_on), "error": error_of(future.exception(), job.scan)})
        else:
            self._give_again(job)

    def _end(self, job, record):
        job.tries += 1
        self._on_record(job, record)
        error = record["error"]
        if error and error["class"] != "InputError" and job.tries <= self._retries:
            self._again.append(job)

    def _give_again(self, job):
        if job.began_on:
            self._record_death(job, "SchedulerLost", "the connection to the scheduler broke")
            job.lost += 1
        if job.lost <= MOST_LOST:  # one that brings schedulers down is not given to ever more of them
            self._again.append(job)

    def _record_death(self, job, name, line):
        record = new_record(job.scan, job.hash, job.began_on)
        record["error"] = {"class": name, "line": f"{job.scan.path}: {line}"}
        self._on_record(job, record)
