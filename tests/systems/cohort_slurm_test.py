"""A cohort as an array job of a real Slurm of one node, which is started and stopped here.

usage: cohort_slurm_test.py PACKAGE_FOLDER. As root, who alone may run another slurmd; otherwise it is skipped.
"""
import collections
import json
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
ENVIRONMENT = {**os.environ, "PYTHONPATH": os.path.abspath(sys.argv[1])}
SCANS = 12
CONFIGURATION = """
ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={control_port}
SlurmdPort={node_port}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SlurmdParameters=config_overrides
MpiDefault=none
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES State=UP
"""


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


class Slurm:
    def __init__(self, folder):
        self.folder = folder
        self.processes = []
        self.environment = {**ENVIRONMENT, "SLURM_CONF": str(folder / "slurm.conf")}
        for name in ("state", "spool"):
            (folder / name).mkdir()
        (folder / "munge.key").write_bytes(os.urandom(128))
        (folder / "munge.key").chmod(0o400)
        (folder / "slurm.conf").write_text(CONFIGURATION.format(
            folder=folder, host=socket.gethostname().split(".")[0], control_port=free_port(), node_port=free_port()))

    def start(self):
        munge = [f"--{name}={self.folder}/munge.{end}" for name, end in
                 [("key-file", "key"), ("socket", "socket"), ("pid-file", "pid"), ("log-file", "log"), ("seed-file", "seed")]]
        self._start("munged", "--foreground", "--force", *munge)
        self._wait(lambda: (self.folder / "munge.socket").exists(), "munged")
        self._start("slurmctld", "-D")
        self._start("slurmd", "-D")
        self._wait(lambda: "idle" in self.ask("sinfo", "-h", "-o", "%t"), "slurmd")

    def _start(self, *command):
        log = open(self.folder / f"{command[0]}.out", "w")
        self.processes.append(subprocess.Popen(["/usr/sbin/" + command[0], *command[1:]], env=self.environment, stdout=log, stderr=log))

    def _wait(self, is_there, name):
        deadline = time.monotonic() + 60
        while not is_there():
            assert time.monotonic() < deadline, f"{name} did not start: " + "".join(
                path.read_text()[-1500:] for path in self.folder.glob("*.out"))
            time.sleep(0.2)

    def ask(self, *command, **more):
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=60, **more).stdout

    def close(self):
        for process in reversed(self.processes):
            process.terminate()
            try:
                process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                process.kill()


def make_scans(folder):
    folder.mkdir()
    code = ("import sys, xraycast as xc\n"
            f"for i in range({SCANS}): xc.phantom('thorax', size=(32, 32, 32), seed=i).write(f'{{sys.argv[1]}}/p{{i:02}}.nrrd')")
    subprocess.run([sys.executable, "-c", code, folder], env=ENVIRONMENT, check=True)
    (folder / "broken.nrrd").write_text("no")


def run_job(slurm, source, out):
    """Submits the array job and waits for its end."""
    script = subprocess.run([sys.executable, "-m", "xraycast.cohort", "slurm", source, "-o", out, "--array", "3", "--",
                             "--steps", "cast"], env=slurm.environment, capture_output=True, text=True, check=True).stdout
    job = slurm.ask("sbatch", "--parsable", "--cpus-per-task=1", "--mem=0", input=script).strip()
    assert job, "sbatch gave no number"
    deadline = time.monotonic() + 300
    while slurm.ask("squeue", "-h", "-j", job).strip():
        assert time.monotonic() < deadline, slurm.ask("squeue")
        time.sleep(0.5)


def records(out):
    return [json.loads(line) for line in open(out / "ledger.jsonl")]


def main():
    if os.geteuid() != 0 or not shutil.which("slurmctld", path="/usr/sbin") or \
            subprocess.run([sys.executable, "-c", "import distributed"], capture_output=True).returncode != 0:
        print("skipped: needs root, slurm-wlm, munge and dask")
        return SKIPPED
    folder = pathlib.Path(tempfile.mkdtemp(prefix="slurm-"))
    folder.chmod(0o755)
    source, out = folder / "in", folder / "out"
    make_scans(source)
    slurm = Slurm(folder)
    try:
        slurm.start()
        run_job(slurm, source, out)
        lines = records(out)
        logs = "".join(path.read_text() for path in out.glob("slurm-*.log"))
        good = collections.Counter(line["scan"] for line in lines if line["error"] is None)
        assert sorted(good.values()) == [1] * SCANS, (good, logs)
        assert [line["scan"] for line in lines if line["error"]] == ["broken.nrrd"]
        assert len(list(out.glob("scans/*/map.exr"))) == SCANS
        (source / "late.nrrd").write_bytes((source / "p00.nrrd").read_bytes())
        run_job(slurm, source, out)
        assert [line["scan"] for line in records(out)[len(lines):]] == ["late.nrrd"], "only what is missing is done"
    finally:
        slurm.close()
        shutil.rmtree(folder, ignore_errors=True)
    print(f"{SCANS} scans by an array job of 3 tasks, one bad; a later one by the same job again")
    return 0


if __name__ == "__main__":
    sys.exit(main())
