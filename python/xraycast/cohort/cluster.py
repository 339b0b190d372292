"""The workers: those of a scheduler that runs, or processes of this machine."""
import contextlib
import dataclasses
import gc
import logging
import os
import signal
import time
import uuid
from multiprocessing import resource_tracker

import dask
from distributed import Client, LocalCluster

from .. import _core
from .._errors import Error, InputError
from .task import probe

ANSWER_S = 5
CLOSE_S = 2
WORKER_S = 60


@dataclasses.dataclass(frozen=True)
class Workers:
    """The command line's options for workers. scheduler: an address, or empty for `count` processes on this machine."""
    scheduler: str = ""
    count: int = 0
    threads: int = 0
    resources: dict = dataclasses.field(default_factory=dict)
    allowed_failures: int = 3
    worker_ttl: str = "5 minutes"


@contextlib.contextmanager
def address_of(workers):
    """Context manager: the scheduler's address, that of `workers` or of a cluster on this machine, which ends with the `with`."""
    _silence_dask()
    if workers.scheduler:
        yield workers.scheduler
        return
    dask.config.set({"distributed.scheduler.allowed-failures": workers.allowed_failures,
                     "distributed.scheduler.worker-ttl": workers.worker_ttl,
                     "distributed.nanny.pre-spawn-environ": _environment()})
    _close_lost_clients()
    with _ctrl_c_kept_from_children():
        cluster = LocalCluster(n_workers=workers.count, threads_per_worker=1, processes=True, host="127.0.0.1",
                               dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL, resources=workers.resources or None)
    try:
        yield cluster.scheduler_address
    except BaseException:
        _kill_workers(cluster)
        raise
    finally:
        with contextlib.suppress(Exception):
            cluster.close(timeout=CLOSE_S)


def _close_lost_clients():
    """Those that did not connect. Dask closes them as they are collected, under the lock that it holds while a cluster or client starts its thread:
    collected in that thread, both would wait for each other."""
    gc.collect()


def _environment():
    """Dask's environment without the threshold by which glibc returns large memory at once, which costs a third of a cast's time."""
    return {name: value for name, value in dask.config.get("distributed.nanny.pre-spawn-environ").items()
            if name != "MALLOC_TRIM_THRESHOLD_"}


def _kill_workers(cluster):
    """Does not wait for their tasks, which may take minutes. Outputs appear whole, so that only unfinished ones are lost."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid:
            with contextlib.suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)


def _silence_dask():
    """Drops dask's warnings, for example of workers that died: the ledger has these."""
    for name in [name for name in logging.root.manager.loggerDict if name.split(".")[0] == "distributed"]:
        logging.getLogger(name).setLevel(logging.CRITICAL)


@contextlib.contextmanager
def _ctrl_c_kept_from_children():
    """Blocks SIGINT in threads and processes that start meanwhile: a terminal sends it to all of them, but only this process
    is to end the workers."""
    resource_tracker.ensure_running()  # which would lift the mask when it starts
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def local_threads(workers):
    """Threads for each worker on this machine: its share of the cores."""
    return workers.threads or max(1, len(os.sched_getaffinity(0)) // workers.count)


def connect(address):
    """Raises InputError."""
    _close_lost_clients()
    try:
        return Client(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = "not an address" if isinstance(error, (ValueError, TypeError)) else "no scheduler answers"
        raise InputError(f"--scheduler {address}: {reason}; start one by `dask scheduler`, or give --workers N") from None


def check_workers(client, out, resources):
    """Raises Error unless a worker with the resources has joined, has this version and sees OUT. Also works if all are busy."""
    worker = _joined_worker(client, resources)
    token = out / f".seen-{uuid.uuid4().hex}"
    token.touch()
    try:
        version, is_seen = client.run(probe, str(token), workers=[worker])[worker]
    except ImportError as error:
        raise Error(f"the workers cannot import xraycast: {error}; install it with them") from None
    except OSError:
        raise Error(f"the worker at {worker} does not answer; see its log, and run again") from None
    finally:
        token.unlink(missing_ok=True)
    if version != _core.__version__:
        raise Error(f"the workers have xraycast {version}, this is {_core.__version__}; install the same")
    if not is_seen:
        raise Error(f"-o {out}: the workers do not see this folder; give one that all machines share")


def _joined_worker(client, resources):
    """Waits for a worker with the resources and returns its address. Raises Error."""
    deadline = time.monotonic() + WORKER_S
    while True:
        for address, worker in client.scheduler_info(n_workers=-1)["workers"].items():
            if all(worker["resources"].get(name, 0) >= amount for name, amount in resources.items()):
                return address
        if time.monotonic() > deadline:
            wanted = ",".join(f"{name}={amount:g}" for name, amount in resources.items())
            raise Error(f"no worker {f'with --resources {wanted} ' * bool(wanted)}joined the scheduler in {WORKER_S} s; start some by "
                        f"`dask worker ADDRESS{f' --resources {wanted}' * bool(wanted)}`")
        time.sleep(0.1)
