"""Workers that die of a scan, and workers with resources."""
import json
import os
import signal
import socket
import subprocess
import sys
import time

import cloudpickle
import pytest
from xraycast.cohort import task
from xraycast.cohort.cli import main

cloudpickle.register_pickle_by_value(sys.modules[__name__])


def fatal_attempt(scan, options, hash_, place):
    """As task.attempt, but b.nrrd ends the process, as a crash in a library does."""
    if scan.name == "b.nrrd":
        task.new_record(scan, hash_, task._announce(place))
        time.sleep(0.3)  # in which the announcement is sent
        os.kill(os.getpid(), signal.SIGKILL)
    return task.attempt(scan, options, hash_, place)


@pytest.fixture(autouse=True)
def restored_signals():
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    [signal.signal(number, handler) for number, handler in handlers.items()]


def records(out):
    return [json.loads(line) for line in open(out / "ledger.jsonl")]


def test_a_scan_that_ends_its_workers_is_bad(phantoms, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("xraycast.cohort.window.attempt", fatal_attempt)
    assert main(["run", str(phantoms / "more"), "-o", str(tmp_path / "only-good"), "--steps", "info", "--workers", "1"]) == 0
    arguments = ["run", str(phantoms), "-o", str(tmp_path / "out"), "--steps", "info", "--workers", "1", "--allowed-failures", "1",
                 "--retries", "0"]
    assert main(arguments) == 1
    lines = records(tmp_path / "out")
    of_it = [line["error"] for line in lines if line["scan"] == "b.nrrd"]
    # Two deaths are one more than allowed: the first is told when dask gives the scan to the next worker.
    assert [error["class"] for error in of_it] == ["WorkerDied", "KilledWorker"]
    assert "died" in of_it[1]["line"] and "2 times" in of_it[1]["line"] and str(phantoms / "b.nrrd") in of_it[1]["line"]
    good = [line["scan"] for line in lines if line["error"] is None]
    assert sorted(good) == ["a.nrrd", "c.nrrd", "more/d.nrrd"], "the others are done, once each"


@pytest.fixture
def cluster(tmp_path):
    """A scheduler and two workers, one of them with a GPU, as its administrator says. Yields its address."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    common = ["--no-dashboard", "--host", "127.0.0.1"]
    worker = ["worker", address, *common, "--nthreads", "1", "--no-nanny", "--local-directory", str(tmp_path), "--memory-limit", "0"]
    commands = [["scheduler", *common, "--port", str(port)], [*worker, "--name", "plain"], [*worker, "--name", "gpu", "--resources", "GPU=1"]]
    processes = [subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_" + command[0], *command[1:]],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) for command in commands]
    from distributed import Client
    with Client(address, timeout=30, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=30)
        gpu = next(at for at, worker in client.scheduler_info()["workers"].items() if worker["name"] == "gpu")
    yield address, gpu
    for process in reversed(processes):
        process.terminate()
        process.wait(timeout=20)


def test_scans_go_to_workers_with_the_resources(cluster, phantoms, tmp_path, monkeypatch, capsys):
    address, gpu = cluster
    run = ["run", str(phantoms), "-o", str(tmp_path / "out"), "--steps", "info", "--scheduler", address]
    assert main([*run, "--resources", "GPU=1"]) == 1  # two scans are bad
    assert {line["worker"] for line in records(tmp_path / "out")} == {gpu}
    monkeypatch.setattr("xraycast.cohort.cluster.WORKER_S", 1)
    capsys.readouterr()
    assert main([*run, "--again", "--resources", "TAPE=2"]) == 1
    told = capsys.readouterr().err
    assert "no worker with --resources TAPE=2 joined the scheduler in 1 s; start some by `dask worker ADDRESS --resources TAPE=2`" in told
    assert told.count("\n") == 1
