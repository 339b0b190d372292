#!/usr/bin/env python3
"""What a cohort costs beside its scans: tasks that only sleep, through the window and the ledger, by a real scheduler.

usage: cohort_tasks.py PACKAGE_FOLDER [TASKS]
"""
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import time

SLEEP_S = 0.02
WORKERS, THREADS = 2, 16


def sleeping_attempt(scan, options, hash_, place):
    """As task.attempt, with outputs of a usual length."""
    import time

    from xraycast.cohort import task
    record = task.new_record(scan, hash_, task._announce(place))
    time.sleep(SLEEP_S)
    record["seconds"] = {"fetch": 0.0001, "read": 1.2345, "info": 0.0123, "cast": 2.3456}
    record["outputs"] = [f"scans/{scan.folder}/{name}" for name in ("info.json", "map.exr", "map.png")]
    return record


def start(*arguments):
    return subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]],
                            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def memory_mb(process, name="VmHWM"):
    text = pathlib.Path(f"/proc/{process}/status").read_text()
    return int(text.split(name + ":")[1].split()[0]) / 1024


def network_mb():
    import psutil
    return psutil.net_io_counters(pernic=True)["lo"].bytes_sent / 1e6


def main():
    os.environ["PYTHONPATH"] = os.path.abspath(sys.argv[1])
    sys.path.insert(0, sys.argv[1])
    tasks = int(sys.argv[2]) if len(sys.argv) > 2 else 100_000
    from xraycast.cohort import window
    from xraycast.cohort.cluster import _silence_dask
    from xraycast.cohort.ledger import Ledger, read_ledger
    from xraycast.cohort.manifest import CohortScan
    from xraycast.cohort.options import Options
    _silence_dask()
    window.attempt = sleeping_attempt
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    scheduler = start("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
    workers = []
    with tempfile.TemporaryDirectory() as folder:
        try:
            time.sleep(3)
            workers = [start("worker", address, "--host", "127.0.0.1", "--nthreads", str(THREADS), "--no-dashboard", "--no-nanny",
                             "--memory-limit", "0", "--local-directory", folder) for _ in range(WORKERS)]
            path = pathlib.Path(folder, "ledger.jsonl")
            ledger = Ledger(path)
            place = {"out": folder, "cache": "", "cache_gb": 1, "threads": 1}
            futures = window.Window(address, Options(), place, {}, 1, 60, lambda job, record: ledger.append(record))
            futures.client.wait_for_workers(WORKERS, timeout=60)
            before_mb, sent_mb, begin = memory_mb(scheduler.pid), network_mb(), time.monotonic()
            futures.run(window.Job(CohortScan(f"patient{i:06}/ct.nrrd", f"/data/patient{i:06}/ct.nrrd"), f"{i:032x}")
                        for i in range(tasks))
            seconds = time.monotonic() - begin
            print(f"{tasks} tasks of {1000 * SLEEP_S:.0f} ms on {WORKERS} x {THREADS} threads: {seconds:.0f} s, "
                  f"{1000 * seconds / tasks:.2f} ms a task; scheduler {before_mb:.0f} MB, at most {memory_mb(scheduler.pid):.0f} MB; "
                  f"client at most {memory_mb(os.getpid()):.0f} MB; loopback {1000 * (network_mb() - sent_mb) / tasks:.1f} kB a task")
            ledger.close()
            begin = time.monotonic()
            lines = len({record["scan"] for record in read_ledger(path)})
            print(f"ledger: {lines} scans, {path.stat().st_size / 1e6:.1f} MB, read in {time.monotonic() - begin:.2f} s")
            futures.close()
        finally:
            for process in [*workers, scheduler]:
                process.terminate()
                process.wait(timeout=20)


if __name__ == "__main__":
    main()
