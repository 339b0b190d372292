"""A cohort on a real scheduler and four workers that are killed at random moments, the scheduler once too.

usage: cohort_kills_test.py PACKAGE_FOLDER. XRAYCAST_TEST_COHORT="SCANS KILLS" chooses the size; by default 60 scans, 8 kills.
"""
import collections
import json
import os
import pathlib
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
WORKERS = 4
ENVIRONMENT = {**os.environ, "PYTHONPATH": sys.argv[1]}
SCANS, KILLS = map(int, os.environ.get("XRAYCAST_TEST_COHORT", "60 8").split())
LONGEST_S = 1500


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Cluster:
    """Starts again what ended, as a service manager does."""

    def __init__(self, log):
        self.log = log
        self.port = free_port()
        self.processes = {name: None for name in ["scheduler", *range(WORKERS)]}

    def address(self):
        return f"tcp://127.0.0.1:{self.port}"

    def look_after(self):
        for name, process in self.processes.items():
            if process is None or process.poll() is not None:
                self.processes[name] = self.start(name)

    def start(self, name):
        if name == "scheduler":
            arguments = ["scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"]
        else:
            # Enough deaths are allowed that no good scan meets so many.
            arguments = ["worker", self.address(), "--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard", "--memory-limit", "0",
                         "--local-directory", tempfile.gettempdir(), "--death-timeout", "30"]
        return subprocess.Popen([sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]],
                                env={**ENVIRONMENT, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "10"},
                                stdout=self.log, stderr=self.log, start_new_session=True)

    def kill_worker(self, generator):
        """The process that runs scans, a nanny's child."""
        nanny = self.processes[generator.randrange(WORKERS)]
        children = subprocess.run(["pgrep", "-P", str(nanny.pid), "-f", "spawn_main"], capture_output=True, text=True).stdout.split()
        if not children:
            return False
        os.kill(int(generator.choice(children)), signal.SIGKILL)
        return True

    def kill_scheduler(self):
        self.processes["scheduler"].kill()

    def close(self):
        for process in self.processes.values():
            if process is not None and process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)
        for process in self.processes.values():
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)


def make_scans(folder):
    """Phantoms of 64 voxels a side, and one file in twenty broken."""
    code = ("import sys, xraycast as xc\n"
            "for i in range(int(sys.argv[1])): xc.phantom('thorax', size=(64, 64, 64), seed=i).write(f'{sys.argv[2]}/p{i:03}.nrrd')")
    broken = max(1, SCANS // 20)
    subprocess.run([sys.executable, "-c", code, str(SCANS - broken), folder], env=ENVIRONMENT, check=True)
    whole = (folder / "p000.nrrd").read_bytes()
    for i in range(broken):
        (folder / f"broken{i:03}.nrrd").write_bytes(whole[:3000 + i] if i % 2 else b"no")
    return broken


def start_run(source, out, address):
    return subprocess.Popen([sys.executable, "-m", "xraycast.cohort", "run", source, "-o", out, "--steps", "info,cast", "--layers", "8",
                             "--scheduler", address], env=ENVIRONMENT, stderr=subprocess.PIPE, text=True)


def records(out):
    try:
        return [json.loads(line) for line in open(out / "ledger.jsonl") if line.endswith("\n")]
    except FileNotFoundError:
        return []


def disturb(cluster, run, out, generator):
    """Kills spread over the run by how many scans have ended, the scheduler about the middle. Returns what was killed."""
    kills_at = sorted(generator.uniform(0.02, 0.95) * SCANS for _ in range(KILLS))
    scheduler_at = 0.5 * SCANS
    killed = 0
    deadline = time.monotonic() + LONGEST_S
    while run.poll() is None and time.monotonic() < deadline:
        cluster.look_after()
        ended = len({record["scan"] for record in records(out)})
        if scheduler_at is not None and ended >= scheduler_at:
            cluster.kill_scheduler()
            scheduler_at = None
        elif kills_at and ended >= kills_at[0] and cluster.kill_worker(generator):
            kills_at.pop(0)
            killed += 1
        time.sleep(generator.uniform(0.02, 0.2))
    return killed, scheduler_at is None


def check(out, broken):
    lines = records(out)
    good = collections.Counter(record["scan"] for record in lines if record["error"] is None)
    bad = collections.Counter(record["scan"] for record in lines if record["error"] and record["error"]["class"] == "InputError")
    assert sorted(good.values()) == [1] * (SCANS - broken), f"good lines: {good.most_common(3)}, {len(good)} scans"
    assert sorted(bad.values()) == [1] * broken and all(name.startswith("broken") for name in bad), bad
    folders = sorted(path.name for path in (out / "scans").iterdir())
    assert folders == sorted(good), "an output for each good scan and no other"
    for name in folders:
        files = {path.name for path in (out / "scans" / name).iterdir()}
        assert files == {"info.json", "map.exr", "map.png", "record.json"}, (name, files)
    assert not (out / "unfinished").exists()
    return lines


def times(out):
    return {path.name: path.stat().st_mtime_ns for path in out.glob("scans/*/map.exr")}


def main():
    if subprocess.run([sys.executable, "-c", "import distributed"], capture_output=True).returncode != 0:
        print("skipped: dask is not installed")
        return SKIPPED
    generator = random.Random(1)
    with tempfile.TemporaryDirectory() as folder, open(os.path.join(folder, "log"), "w") as log:
        source, out = pathlib.Path(folder, "in"), pathlib.Path(folder, "out")
        source.mkdir()
        broken = make_scans(source)
        cluster = Cluster(log)
        try:
            cluster.look_after()
            time.sleep(3)
            start = time.monotonic()
            run = start_run(source, out, cluster.address())
            killed, is_scheduler_killed = disturb(cluster, run, out, generator)
            errors = run.communicate()[1]
            seconds = time.monotonic() - start
            print(errors.strip())
            assert run.returncode == 1, run.returncode  # some scans are bad
            assert killed == KILLS and is_scheduler_killed, (killed, is_scheduler_killed)
            lines = check(out, broken)
            before = times(out)
            again = start_run(source, out, cluster.address())
            again.communicate()
            assert again.returncode == 1 and records(out) == lines and times(out) == before, "nothing is done twice"
        finally:
            cluster.close()
    died = collections.Counter(record["error"]["class"] for record in lines if record["error"])
    print(f"{SCANS} scans, {killed} workers and the scheduler killed, in {seconds:.0f} s; lines with errors: {dict(died)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
